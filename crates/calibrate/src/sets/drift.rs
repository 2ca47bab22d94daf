//! What the two halves of a recording say: whether single pixels change, and whether all of them do.

use super::observed::Level;
use spikelane_measure::{Estimate, median_and_spread};

/// A change between the halves is told from here on, in its own errors. Of steady lamps one in two million is,
const TOLD: f64 = 5.0;
/// and if it is more than this of the light: what is left of a lamp on the mains at the ends of the halves is less.
const LEAST: f64 = 1e-3;

/// Spikes a pixel by which the halves differ where no light changes: pixels that all began empty, or full, fire half a spike
/// less or more in the first half than pixels that were running.
const START: f64 = 0.5;

/// Pixels beyond so many deviations count as if they lay there: a pixel that blinks is no lamp.
const CUT: f64 = 4.0;

/// Share of the pixels whose counts of the two halves differ by more than six standard
/// deviations: two for the ends, `s = 1e-3` per spike (thirty times that of known cameras)
/// and 0.2 % for a lamp that settles.
pub(crate) fn drifting(level: &Level, early: &[u32]) -> f64 {
    let split = f64::from(level.readouts / 2);
    let late = f64::from(level.readouts) - split;
    let moves = |(n, e): (&u32, &u32)| {
        let (e, l) = (f64::from(*e), f64::from(n - e) * split / late);
        (e - l).abs() > 2.0 + 6.0 * (1e-3 * (e + l)).sqrt() + 0.002 * (e + l)
    };
    let moving = level.spikes.iter().zip(early).filter(|pair| moves(*pair)).count();
    moving as f64 / level.spikes.len() as f64
}

/// By how much the mean rate of all pixels changes from the first half of a recording to the second, of the whole mean, with its error
/// over the pixels; `early` are their spikes in the first half. `None` of a recording without spikes.
///
/// A pixel's counts of the halves differ by `u0 - 2 u1 + u2` with phases of 1/12 each, so by half a spike squared, and by its noise: many
/// pixels tell a thousandth where each of them tells a tenth.
pub(crate) fn change(level: &Level, early: &[u32]) -> Option<Estimate> {
    let split = f64::from(level.readouts / 2);
    let late = f64::from(level.readouts) - split;
    let each = |(n, e): (&u32, &u32)| f64::from(n - e) / late - f64::from(*e) / split;
    let mut all: Vec<f64> = level.spikes.iter().zip(early).map(each).collect();
    let (centre, spread) = median_and_spread(&mut all.clone());
    // Most pixels of a dark recording may have fired as often in either half.
    let half_a_spike = 0.5_f64.sqrt() / split;
    let reach = CUT * spread.max(half_a_spike);
    all.iter_mut().for_each(|d| *d = d.clamp(centre - reach, centre + reach));
    let found = Estimate::mean(all.iter().copied());
    let spikes = level.spikes.iter().map(|n| f64::from(*n)).sum::<f64>();
    let rate = spikes / (f64::from(level.readouts) * all.len() as f64);
    // Pixels that all do the same at the same time tell no error of their mean.
    let error = if found.error > 0.0 { found.error } else { half_a_spike };
    let known = rate > 0.0 && found.value.is_finite() && error.is_finite();
    known.then(|| Estimate { value: found.value / rate, error: error / rate, samples: all.len() })
}

impl Level {
    /// Takes in how many of its spikes each pixel had in the first half of the readouts, rounded down.
    #[must_use]
    pub fn with_first_half(mut self, early: &[u32]) -> Self {
        self.drifting = drifting(&self, early);
        self.change = change(&self, early);
        self
    }

    /// Whether the light, or the dark current of all pixels, changed while it was recorded. How charged the pixels were when
    /// it began is no change.
    #[must_use]
    pub fn drifts(&self) -> bool {
        let spikes = self.spikes.iter().map(|n| f64::from(*n)).sum::<f64>() / self.spikes.len() as f64;
        let least = LEAST.max(START / (spikes / 2.0));
        self.change.is_some_and(|c| c.value.abs() > least && c.value.abs() > TOLD * c.error)
    }
}
