//! What was observed of a recording set: its uniform levels, pixel by pixel.

use spikelane::spikes::{Geometry, span_rate};
use spikelane_measure::{Estimate, finite, median};

/// Phase variance per spike, over the pixels of a level.
#[derive(Clone, Debug, PartialEq)]
pub struct IntervalNoise {
    /// Per pixel, in its own thresholds squared; NaN where too few intervals.
    pub map: Vec<f64>,
    /// The spans whose variances gave it, in intervals.
    pub lags: Vec<u32>,
}

/// A uniform level: per-pixel maps, row-major.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Level {
    /// Its file.
    pub name: String,
    /// Light in fractions of what gives one spike per readout.
    pub light: f64,
    /// Relative uncertainty of the light, where the set states it.
    pub uncertainty: Option<f64>,
    /// Readouts; 0 for a rate map of unknown length.
    pub readouts: u32,
    /// Spikes per pixel.
    pub spikes: Vec<u32>,
    /// Time-based rate, spikes per readout; by count below two spikes.
    pub rate: Vec<f64>,
    /// Share of the pixels whose two halves differ more than a static scene allows.
    pub drifting: f64,
    /// Change of the mean rate of all pixels from the first half to the second, of the whole mean; `None` where that is not known.
    pub change: Option<Estimate>,
    /// Phase noise per spike, of dim levels.
    pub noise: Option<IntervalNoise>,
}

impl Level {
    /// A level from counts, first and last spikes (readouts from 0, `u32::MAX` without).
    #[must_use]
    pub fn from_counts(
        name: &str,
        light: f64,
        readouts: u32,
        count: Vec<u32>,
        first: &[u32],
        last: &[u32],
    ) -> Self {
        let counted = |p: usize| f64::from(count[p]) / f64::from(readouts);
        let rate = |p: usize| span_rate(count[p], first[p], last[p]).unwrap_or_else(|| counted(p));
        let rate = (0..count.len()).map(rate).collect();
        Self {
            name: name.to_owned(),
            light,
            uncertainty: None,
            readouts,
            spikes: count,
            rate,
            drifting: 0.0,
            change: None,
            noise: None,
        }
    }

    /// A level of rates that are known.
    pub(crate) fn of_rates(name: &str, light: f64, readouts: u32, spikes: Vec<u32>, rate: Vec<f64>) -> Self {
        let nowhere = vec![0; spikes.len()];
        Self { rate, ..Self::from_counts(name, light, readouts, spikes, &nowhere, &nowhere) }
    }

    /// Median rate of the pixels.
    #[must_use]
    pub fn median_rate(&self) -> f64 {
        median(&mut finite(&self.rate))
    }
}

/// The uniform levels of a set, and what was noticed on the way.
#[derive(Clone, Debug, PartialEq)]
pub struct Observed {
    /// Width and height.
    pub geometry: Geometry,
    /// Readouts per second.
    pub readout_hz: f64,
    /// The levels, by rising light.
    pub levels: Vec<Level>,
    /// Recordings of other scenes: their file names; the estimators do not use them.
    pub others: Vec<String>,
}
