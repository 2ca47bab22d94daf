//! A part of a planned sensor.

use std::sync::Arc;

use crate::draws::hash;
use crate::error::Result;
use crate::plan::moving::{Moving, Telegraph};
use crate::plan::tables::{NoiseTable, Shot, Tables};
use crate::plan::{LANES, Plan};
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
        let moving = self.moving().map(|moving| cut.moving(moving, geometry));
        let origin = self.origin.window(crop, geometry);
        Ok(Self {
            geometry,
            tables: Arc::new(tables),
            moving: moving.map(Arc::new),
            origin: Arc::new(origin),
            // What all pixels share.
            seeds: self.seeds,
            greatest_light: self.greatest_light,
            steps: self.steps,
            rules: self.rules,
            losses: self.losses,
            clocks: self.clocks,
            counts: self.counts,
            bounds: self.bounds,
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
            undecided: self.of(&whole.undecided, 0),
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

    fn moving(&self, whole: &Moving, geometry: Geometry) -> Moving {
        let last = geometry.height() - 1;
        let Moving {
            schedule,
            quadratic,
            peak,
            crosstalk,
            lag,
            telegraph,
            leak,
            coupling,
            comparator,
            row_noise,
            slow,
            adaptation,
            droop,
            threshold,
            sway,
            rows: _,
        } = whole;
        Moving {
            telegraph: telegraph
                .as_ref()
                .map(|t| Telegraph { amplitude: self.of(&t.amplitude, 0.0), rate: t.rate }),
            threshold: self.of(threshold, 0.0),
            sway: self.of(sway, 0),
            rows: (0..self.padded).map(|p| (p / geometry.width()).min(last) as u32).collect(),
            schedule: *schedule,
            quadratic: *quadratic,
            peak: *peak,
            crosstalk: *crosstalk,
            lag: *lag,
            leak: *leak,
            coupling: *coupling,
            comparator: *comparator,
            row_noise: *row_noise,
            slow: *slow,
            adaptation: *adaptation,
            droop: *droop,
        }
    }
}
