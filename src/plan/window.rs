//! A part of a planned sensor.

use std::sync::Arc;

use crate::draws::hash;
use crate::error::Result;
use crate::plan::further::{Further, Switch};
use crate::plan::tables::{NoiseTable, Shot, Tables};
use crate::plan::{LANES, Plan, state};
use crate::spikes::{Crop, Geometry};

impl Plan {
    /// The plan of [`crate::Camera::window`] without planning anew: the tables of these pixels, with clocks and
    /// seeds as they are and a start state of its own.
    ///
    /// # Errors
    /// When the rectangle is empty or leaves the sensor.
    pub fn window(&self, crop: Crop) -> Result<Self> {
        let geometry = crop.geometry(self.geometry)?;
        let cut = Cut { crop, of: self.geometry, padded: geometry.pixels().next_multiple_of(LANES) };
        let tables = cut.tables(&self.tables);
        let further = self.further().map(|further| cut.further(further, geometry));
        let origin = self.origin.window(crop, geometry);
        let start = state::start(&origin, self.seeds, &tables, &self.rules, further.as_ref(), self.losses);
        Ok(Self {
            geometry,
            tables: Arc::new(tables),
            further: further.map(Arc::new),
            origin: Arc::new(origin),
            start,
            ..self.clone()
        })
    }
}

struct Cut {
    crop: Crop,
    of: Geometry,
    padded: usize,
}

impl Cut {
    /// The window of a table, padded with what [`Tables`] are padded with; nothing of an empty one.
    fn of<T: Copy>(&self, table: &[T], filler: T) -> Vec<T> {
        if table.is_empty() {
            return Vec::new();
        }
        let mut part = self.crop.pick(self.of, table);
        part.resize(self.padded, filler);
        part
    }

    fn tables(&self, whole: &Tables) -> Tables {
        // The end of a padded table holds the fillers, but not every table is padded.
        Tables {
            threshold: self.of(&whole.threshold, 16_000),
            pair_keys: self.keys(self.padded / 2),
            gain: self.of(&whole.gain, 0.0),
            whole_gain: self.of(&whole.whole_gain, 0),
            dark: self.of(&whole.dark, 0.0),
            ceiling: self.of(&whole.ceiling, 0),
            shot: whole.shot.as_ref().map(|shot| Shot {
                keys: self.keys(self.padded),
                light: self.of(&shot.light, 0.0),
                dark: self.of(&shot.dark, 0.0),
                quantum: self.of(&shot.quantum, 0.0),
                whole_from: self.of(&shot.whole_from, f32::INFINITY),
                slope: self.of(&shot.slope, 0.0),
                offset: self.of(&shot.offset, 0.0),
            }),
            noise: whole.noise.as_ref().map(|noise| match noise {
                NoiseTable::Whole(table) => NoiseTable::Whole(self.of(table, 0)),
                NoiseTable::Fine(table) => NoiseTable::Fine(self.of(table, 0.0)),
            }),
        }
    }

    fn keys(&self, count: usize) -> Vec<u32> {
        (0..count as u32).map(hash::key).collect()
    }

    fn further(&self, whole: &Further, geometry: Geometry) -> Further {
        let last = geometry.height() - 1;
        Further {
            telegraph: whole
                .telegraph
                .as_ref()
                .map(|switch| Switch { amplitude: self.of(&switch.amplitude, 0.0), rate: switch.rate }),
            threshold: self.of(&whole.threshold, 0.0),
            sway: self.of(&whole.sway, 0),
            rows: (0..self.padded).map(|p| (p / geometry.width()).min(last) as u32).collect(),
            ..whole.clone()
        }
    }
}
