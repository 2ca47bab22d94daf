//! The plan of a window, derived from the plan of the whole sensor.

use std::sync::Arc;

use crate::draws::hash;
use crate::error::Result;
use crate::plan::dynamics::{Dynamics, TelegraphRule};
use crate::plan::tables::{NoiseTable, PixelTables, ShotTables};
use crate::plan::{PIXEL_ALIGNMENT, Plan};
use crate::spikes::{Crop, Geometry};

impl Plan {
    /// Returns the plan of [`crate::Camera::window`] without planning again.
    ///
    /// The new plan contains the tables and the start distribution of the window's pixels. Its seeds and generators
    /// equal the seeds and generators of this plan.
    ///
    /// # Examples
    /// ```
    /// use spikelane::spikes::Crop;
    /// use spikelane::{Camera, Plan, Seeds, Sensor, effects};
    /// let camera = Camera::ideal(Sensor::new(64, 48, 20_000.0)?).with_effect(effects::find("prnu")?.typical());
    /// let plan = Plan::new(&camera, Seeds::default())?;
    /// let crop = Crop { row: 8, col: 16, width: 32, height: 24 };
    /// assert_eq!(plan.window(crop)?, Plan::new(&camera.window(crop)?, Seeds::default())?);
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    ///
    /// # Errors
    /// Returns [`ErrorKind::Usage`](crate::ErrorKind::Usage) if the rectangle is empty or not within the sensor.
    pub fn window(&self, crop: Crop) -> Result<Self> {
        let geometry = crop.geometry(self.geometry)?;
        let cut = WindowCutter {
            crop,
            sensor: self.geometry,
            padded: geometry.pixels().next_multiple_of(PIXEL_ALIGNMENT),
        };
        let tables = cut.tables(&self.tables);
        let dynamics = self.dynamics().map(|dynamics| cut.dynamics(dynamics, geometry));
        let origin = self.start_distribution.window(crop, geometry);
        Ok(Self {
            geometry,
            tables: Arc::new(tables),
            dynamics: dynamics.map(Arc::new),
            start_distribution: Arc::new(origin),
            // All pixels have equal values of these fields.
            seeds: self.seeds,
            max_light: self.max_light,
            threshold_steps: self.threshold_steps,
            rules: self.rules,
            faults: self.faults,
            rngs: self.rngs,
            count_tables: self.count_tables,
            bounds: self.bounds,
        })
    }
}

struct WindowCutter {
    crop: Crop,
    sensor: Geometry,
    padded: usize,
}

impl WindowCutter {
    /// Returns the part of a table that belongs to the window, padded like [`PixelTables`]. For an empty table, the
    /// result is empty.
    fn cut<T: Copy>(&self, table: &[T], filler: T) -> Vec<T> {
        if table.is_empty() {
            return Vec::new();
        }
        let mut part = self.crop.pick(self.sensor, table);
        part.resize(self.padded, filler);
        part
    }

    fn tables(&self, full: &PixelTables) -> PixelTables {
        // A table of the sensor may end without padding, so this function cannot copy the filler values from the table.
        // It repeats the filler values instead.
        PixelTables {
            threshold: self.cut(&full.threshold, 16_000),
            pair_keys: self.keys(self.padded / 2),
            gain: self.cut(&full.gain, 0.0),
            whole_gain: self.cut(&full.whole_gain, 0),
            dark: self.cut(&full.dark, 0.0),
            ceiling: self.cut(&full.ceiling, 0),
            jitter_width: self.cut(&full.jitter_width, 0),
            shot: full.shot.as_ref().map(|shot| ShotTables {
                keys: self.keys(self.padded),
                light: self.cut(&shot.light, 0.0),
                dark: self.cut(&shot.dark, 0.0),
                quantum: self.cut(&shot.quantum, 0.0),
                whole_noise_min_light: self.cut(&shot.whole_noise_min_light, f32::INFINITY),
                slope: self.cut(&shot.slope, 0.0),
                offset: self.cut(&shot.offset, 0.0),
            }),
            noise: full.noise.as_ref().map(|noise| match noise {
                NoiseTable::Whole(table) => NoiseTable::Whole(self.cut(table, 0)),
                NoiseTable::Fine(table) => NoiseTable::Fine(self.cut(table, 0.0)),
            }),
        }
    }

    fn keys(&self, count: usize) -> Vec<u32> {
        (0..count as u32).map(hash::address_key).collect()
    }

    fn dynamics(&self, full: &Dynamics, geometry: Geometry) -> Dynamics {
        let last = geometry.height() - 1;
        let Dynamics {
            schedule,
            quadratic,
            peak,
            crosstalk,
            lag,
            telegraph,
            leak,
            coupling,
            comparator_noise: comparator,
            row_noise,
            slow_noise: slow,
            adaptation,
            droop,
            threshold,
            max_offset,
            pixel_rows: _,
        } = full;
        Dynamics {
            telegraph: telegraph
                .as_ref()
                .map(|t| TelegraphRule { amplitude: self.cut(&t.amplitude, 0.0), rate: t.rate }),
            threshold: self.cut(threshold, 0.0),
            max_offset: self.cut(max_offset, 0),
            pixel_rows: (0..self.padded).map(|p| (p / geometry.width()).min(last) as u32).collect(),
            schedule: *schedule,
            quadratic: *quadratic,
            peak: *peak,
            crosstalk: *crosstalk,
            lag: *lag,
            leak: *leak,
            coupling: *coupling,
            comparator_noise: *comparator,
            row_noise: *row_noise,
            slow_noise: *slow,
            adaptation: *adaptation,
            droop: *droop,
        }
    }
}
