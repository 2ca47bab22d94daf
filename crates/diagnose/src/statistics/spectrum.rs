//! Spectra of the spikes per readout, and lines in them.

use crate::thresholds::{BACKGROUND_BINS, MAX_LINE_FREQUENCY, MIN_PERIODS, STEPS_PER_BIN};
use std::collections::HashMap;
use std::sync::{Arc, LazyLock, Mutex, PoisonError};

use realfft::{RealFftPlanner, RealToComplex};
use spikelane::unstable::kernels::dispatch;
use spikelane_measure::squared_magnitudes;

/// Returns the power spectrum of the spikes per readout. The unit is the power of independent spikes.
pub(crate) fn power(totals: &[u32]) -> Vec<f64> {
    let n = totals.len();
    let mean = totals.iter().map(|c| f64::from(*c)).sum::<f64>() / n.max(1) as f64;
    if n < 2 {
        return Vec::new();
    }
    let [fft] = transforms([n]);
    let squares = squared_magnitudes(&*fft, totals, std::iter::repeat(1.0)).unwrap_or_default();
    squares.iter().map(|square| square / (n as f64 * mean.max(1e-9))).collect()
}

/// Returns the frequency, in cycles per readout, at which the summed power of all `totals` is highest. The search
/// is limited to one frequency step of the spectrum on each side of `frequency`.
///
/// For a clear line, the error is a few hundredths of this step.
pub(crate) fn refine_line(totals: &[&[u32]], frequency: f64) -> f64 {
    let longest = totals.iter().map(|t| t.len()).max().unwrap_or(1) as f64;
    let at = |i: i32| frequency + f64::from(i) / (STEPS_PER_BIN * longest);
    let power = |f: f64| totals.iter().map(|t| power_at(t, f)).sum::<f64>();
    let reach = STEPS_PER_BIN as i32;
    let all: Vec<f64> = (-reach - 1..=reach + 1).map(|i| power(at(i))).collect();
    let best = (1..all.len() - 1).max_by(|a, b| all[*a].total_cmp(&all[*b])).unwrap_or(1);
    let [a, b, c] = [all[best - 1], all[best], all[best + 1]];
    let top = if 2.0 * b > a + c { 0.5 * (a - c) / (a - 2.0 * b + c) } else { 0.0 };
    at(best as i32 - 1 - reach) + top.clamp(-0.5, 0.5) / (STEPS_PER_BIN * longest)
}

/// Returns the power of `totals` at any frequency, divided by their mean.
fn power_at(totals: &[u32], frequency: f64) -> f64 {
    let mean = totals.iter().map(|c| f64::from(*c)).sum::<f64>() / totals.len().max(1) as f64;
    let (mut re, mut im) = (0.0, 0.0);
    for (t, c) in totals.iter().enumerate() {
        let (sin, cos) = (std::f64::consts::TAU * frequency * t as f64).sin_cos();
        (re, im) = (re + (f64::from(*c) - mean) * cos, im + (f64::from(*c) - mean) * sin);
    }
    (re * re + im * im) / mean.max(1e-9)
}

/// Returns the frequency of the strongest line, in cycles per readout, and the ratio of its power to the mean power
/// around it.
pub(crate) fn line(power: &[f64], readouts: usize) -> (f64, f64) {
    let end = ((MAX_LINE_FREQUENCY * readouts as f64) as usize).min(power.len());
    let mut best = (0.0, 1.0);
    let sums = dispatch(
        #[inline(always)]
        || background_sums(power, end),
    );
    for i in MIN_PERIODS as usize..end {
        let count =
            i - i.saturating_sub(BACKGROUND_BINS).max(1) + (i + BACKGROUND_BINS).min(power.len()) - (i + 1);
        let ratio = power[i] * count as f64 / f64::max(sums[i], 1e-12);
        if ratio > best.1 {
            best = (i as f64 / readouts as f64, ratio);
        }
    }
    best
}

/// Returns, for each frequency below `end`, the sum of the powers at up to [`BACKGROUND_BINS`] frequencies on each
/// side. A power larger than that at the frequency itself counts as equal to it. The first two sums are zero.
#[inline(always)]
fn background_sums(power: &[f64], end: usize) -> Vec<f64> {
    let mut sums = vec![0.0; end];
    for step in (1..=BACKGROUND_BINS).rev() {
        add_neighbor(&mut sums, power, step + 1, power.get(1..).unwrap_or(&[]));
    }
    for step in 1..BACKGROUND_BINS {
        add_neighbor(&mut sums, power, 2, power.get(2 + step..).unwrap_or(&[]));
    }
    sums
}

/// Adds the powers of one neighbor to the sums of all frequencies from `first` on. The sums are independent, so the
/// compiler vectorizes the loop.
#[inline(always)]
fn add_neighbor(sums: &mut [f64], power: &[f64], first: usize, others: &[f64]) {
    let sums = sums.get_mut(first..).unwrap_or(&mut []);
    for ((sum, own), other) in sums.iter_mut().zip(power.get(first..).unwrap_or(&[])).zip(others) {
        *sum += other.min(*own);
    }
}

type Transform = Arc<dyn RealToComplex<f64>>;

/// Plans of transforms. The key is the list of lengths that were planned together: a planner that contains other
/// plans may choose other steps, whose rounding differs.
static PLANS: LazyLock<Mutex<HashMap<Vec<usize>, Vec<Transform>>>> = LazyLock::new(Mutex::default);

/// Returns transforms of the given lengths. They are cached, because thousands of simulations use the same few
/// lengths, and planning takes longer than a transform.
pub(crate) fn transforms<const N: usize>(lengths: [usize; N]) -> [Transform; N] {
    let mut plans = PLANS.lock().unwrap_or_else(PoisonError::into_inner);
    let plan = || {
        let mut planner = RealFftPlanner::new();
        lengths.iter().map(|n| planner.plan_fft_forward(*n)).collect()
    };
    let all = plans.entry(lengths.to_vec()).or_insert_with(plan);
    std::array::from_fn(|i| Arc::clone(&all[i]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_between_two_frequencies_of_the_spectrum_is_located() {
        // The line is at 103.5 Hz, with 20,000 readouts per second. The frequencies of the spectrum around it are
        // 100 Hz and 105 Hz.
        let total = |phase: f64| {
            move |t: u32| {
                let noise = f64::from(t.wrapping_mul(2_654_435_761) >> 28) - 7.5;
                (900.0 + 8.0 * (std::f64::consts::TAU * (103.5 * f64::from(t) / 2e4 + phase)).sin() + noise)
                    as u32
            }
        };
        let both: Vec<Vec<u32>> = [0.2, 0.7].map(|p| (0..4000).map(total(p)).collect()).into();
        let all: Vec<&[u32]> = both.iter().map(Vec::as_slice).collect();
        let found = 2e4 * refine_line(&all, 105.0 / 2e4);
        assert!((found - 103.5).abs() < 0.25, "{found}");
    }
}
