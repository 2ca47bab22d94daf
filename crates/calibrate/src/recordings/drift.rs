//! Measures changes between the two halves of a recording, for single pixels and for the mean rate of all pixels.

use super::observations::{ChangeRemoval, LightLevel};
use spikelane_measure::{Estimate, median_and_spread};

/// Smallest change of the mean rate that counts as drift, in standard errors of the change. With a steady lamp, one in
/// two million recordings exceeds it.
const DRIFT_Z_THRESHOLD: f64 = 5.0;
/// Smallest change of the mean rate that counts as drift, divided by the mean rate. Incomplete mains periods at the ends
/// of the halves change the mean by less.
const MIN_RELATIVE_DRIFT: f64 = 1e-3;

/// Smallest change of the mean rate, in standard errors, for which a lit recording without frame totals is not used for
/// noise. With a steady lamp, one recording in eighty exceeds it. The drift that remains is part of the error.
const NOISE_DRIFT_Z_THRESHOLD: f64 = 2.5;

/// Largest deviation of the change of a pixel from the median change, in robust standard deviations. Larger deviations are
/// clamped, because a single blinking pixel must not look like a drifting lamp.
const MAX_PIXEL_DEVIATION: f64 = 4.0;

/// Returns the share of the pixels whose spike counts differ between the two halves by more than the tolerance.
///
/// `early` contains the number of spikes of each pixel in the first half. For a pixel with `n` spikes in both halves
/// together, the tolerance is `2 + 6 sqrt(s n) + 0.002 n` spikes. The 2 spikes are for the ends of the halves. The second
/// term is six standard deviations of phase noise. The last term, 0.2 %, is for a lamp that settles. The variance per
/// spike, `s = 1e-3` thresholds squared, is thirty times the variance of known cameras.
///
/// `split` is the light of the first half in readouts of mean light. In constant light it is the number of readouts.
pub(crate) fn drifting_share(level: &LightLevel, early: &[u32], split: f64) -> f64 {
    let late = f64::from(level.readouts) - split;
    let moves = |(n, e): (&u32, &u32)| {
        let (e, l) = (f64::from(*e), f64::from(n - e) * split / late);
        (e - l).abs() > 2.0 + 6.0 * (1e-3 * (e + l)).sqrt() + 0.002 * (e + l)
    };
    let drifting = level.spikes.iter().zip(early).filter(|pair| moves(*pair)).count();
    drifting as f64 / level.spikes.len() as f64
}

/// Returns the change of the mean rate of all pixels between the first and the second half of a recording, divided by the
/// mean rate. The standard error is computed from the scatter of the pixels.
///
/// `early` contains the number of spikes of each pixel in the first half. Returns `None` for a recording without spikes.
///
/// The difference between the two counts of a pixel is `u0 - 2 u1 + u2` plus noise. `u0`, `u1` and `u2` are the phases at
/// the start, the middle and the end. Each has a variance of 1/12 spike squared, so the variance of `u0 - 2 u1 + u2` is
/// 1/2. A single pixel resolves a change of a tenth. The mean over many pixels resolves a change of a thousandth.
pub(crate) fn mean_rate_change(level: &LightLevel, early: &[u32]) -> Option<Estimate> {
    let split = f64::from(level.readouts / 2);
    let late = f64::from(level.readouts) - split;
    let each = |(n, e): (&u32, &u32)| f64::from(n - e) / late - f64::from(*e) / split;
    let mut all: Vec<f64> = level.spikes.iter().zip(early).map(each).collect();
    let (center, spread) = median_and_spread(&mut all.clone());
    // In the dark most pixels can fire equally often in both halves. The robust spread is then 0, so a minimum is needed.
    let half_a_spike = 0.5_f64.sqrt() / split;
    let reach = MAX_PIXEL_DEVIATION * spread.max(half_a_spike);
    all.iter_mut().for_each(|d| *d = d.clamp(center - reach, center + reach));
    let mean_change = Estimate::mean(all.iter().copied());
    let spikes = level.spikes.iter().map(|n| f64::from(*n)).sum::<f64>();
    let rate = spikes / (f64::from(level.readouts) * all.len() as f64);
    // If all pixels change equally, their scatter is 0. The error of one pixel is then used instead.
    let error = if mean_change.error > 0.0 { mean_change.error } else { half_a_spike };
    let known = rate > 0.0 && mean_change.value.is_finite() && error.is_finite();
    known.then(|| Estimate { value: mean_change.value / rate, error: error / rate, samples: all.len() })
}

impl LightLevel {
    /// Sets the drift statistics of the level. `early` contains the number of spikes of each pixel in the first half of
    /// the readouts. If the number of readouts is odd, the first half is the shorter half.
    #[must_use]
    pub fn with_first_half(mut self, early: &[u32]) -> Self {
        self.drifting_share = drifting_share(&self, early, f64::from(self.readouts / 2));
        self.rate_change = mean_rate_change(&self, early);
        self
    }

    /// Returns whether the light, or the dark current of all pixels, changed during the recording. An effect of the
    /// pixels' charge at the start does not count as a change.
    #[must_use]
    pub fn drifts(&self) -> bool {
        self.drifts_by(MIN_RELATIVE_DRIFT, DRIFT_Z_THRESHOLD)
    }

    /// Returns whether the intervals of the recording contain too large a change of the light for an estimate of the noise.
    ///
    /// Flicker in the dark is light on the sensor. Its shot noise would be mistaken for threshold noise.
    pub(crate) fn has_unsteady_intervals(&self) -> bool {
        match self.change_removal {
            _ if self.light == 0.0 => self.drifts() || self.flicker.is_some(),
            ChangeRemoval::Unknown => self.drifts_by(0.0, NOISE_DRIFT_Z_THRESHOLD),
            ChangeRemoval::Negligible | ChangeRemoval::Removed => false,
            ChangeRemoval::Impossible => true,
        }
    }

    /// Returns the likely variance that an undetected linear drift of the lamp adds to the relative rate, as its rise over
    /// the whole recording. It is 0 in the dark.
    pub(crate) fn undetected_rise_variance(&self) -> f64 {
        // A linear rise changes the mean of a half by a quarter of the rise in each direction, so the halves differ by half
        // of it.
        let error = self.rate_change.map_or(0.0, |c| 2.0 * c.error);
        if self.light == 0.0 { 0.0 } else { error * error }
    }

    fn drifts_by(&self, min_relative: f64, min_z: f64) -> bool {
        let spikes = self.spikes.iter().map(|n| f64::from(*n)).sum::<f64>() / self.spikes.len() as f64;
        // Pixels that all start with the same charge fire up to half a spike more or less in the first half.
        let of_start = self.start_offset / (spikes / 2.0);
        let exceeds = |c: Estimate| {
            let excess = c.value.abs() - of_start;
            excess > min_relative && excess > min_z * c.error
        };
        self.rate_change.is_some_and(exceeds)
    }
}
