//! Statistics over time: spikes per readout, their spectrum, and the response to steps of the light.

use std::collections::HashMap;
use std::sync::{Arc, LazyLock, Mutex, PoisonError};

use super::maps::{Lines, MAX_LINE_RATE, Map};
use super::quantiles::Spread;
use super::vector::{StatisticsVector, ln};
use crate::protocol::recorded_scene::RecordedScene;
use crate::recording::scan::{Scan, dark_windows};
use crate::recording::stretches::{STEADY_READOUTS, Stretch};
use realfft::{RealFftPlanner, RealToComplex};
use spikelane::unstable::kernels::dispatch;
use spikelane_calibrate::{Stimulus, StimulusPattern};
use spikelane_measure::squared_magnitudes;

/// Highest frequency of a line, in cycles per readout. The firing rates of bright pixels are higher.
const MAX_LINE_FREQUENCY: f64 = 0.13;

/// Smallest light at which the firing rates of the pixels exceed [`MAX_LINE_FREQUENCY`].
const MIN_LINE_LIGHT: f64 = 0.2;

/// Number of examined frequencies per frequency step of the spectrum.
const STEPS_PER_BIN: f64 = 10.0;

/// Number of frequencies on either side of a line whose mean power is its background.
const BACKGROUND_BINS: usize = 40;

/// Windows after a step, in readouts.
const STEP_WINDOWS: [(usize, usize); 4] = [(2, 20), (20, 60), (60, 120), (120, 300)];

/// Adds the statistics of the spikes per readout and of the coincidences of neighbors.
pub(crate) fn push_totals(v: &mut StatisticsVector, k: usize, scan: &Scan, scene: &RecordedScene) {
    let n = scan.pixels.len() as f64;
    let t = scan.totals.len();
    let mean = |range: std::ops::Range<usize>| {
        let part = &scan.totals[range];
        part.iter().map(|c| f64::from(*c)).sum::<f64>() / part.len().max(1) as f64
    };
    if scene.is_constant() {
        let rest = mean(t / 16..t);
        v.push(k, "first readouts over the rest", ln(mean(0..t / 64)) - ln(rest), 1e-4);
        v.push(k, "start over the rest", ln(mean(t / 64..t / 16)) - ln(rest), 1e-4);
        push_spectrum(v, k, &scan.totals, scene.brightness());
    }
    let even: f64 = scan.totals.iter().step_by(2).map(|c| f64::from(*c)).sum();
    let odd: f64 = scan.totals.iter().skip(1).step_by(2).map(|c| f64::from(*c)).sum();
    v.push(k, "even readouts over odd", ln(even) - ln(odd), 1e-4);
    if scene.has_row_halves() {
        v.push(k, "halves of a row together", scan.row_halves, 5e-5);
    }
    const NAMES: [&str; 4] = [
        "neighbors beside, same readout",
        "neighbors below, same readout",
        "neighbors beside, next readout",
        "neighbors below, next readout",
    ];
    // In a square wave, the common light makes neighbors fire together. The amount depends on the share of bright
    // readouts.
    for (name, value) in NAMES.into_iter().zip(scan.neighbors).filter(|_| scene.is_constant()) {
        v.push(k, name, value, 5e-5);
    }
    let mean_changes =
        scan.changes.iter().map(|c| f64::from(*c)).sum::<f64>() / scan.changes.len().max(1) as f64;
    let equal = scan.changes.iter().filter(|c| f64::from(**c) < 0.4 * mean_changes).count() as f64;
    // With few spikes, two successive readouts are equal by chance.
    let equal = if mean_changes > 0.002 * n { equal } else { 0.0 };
    v.push_count(k, "readouts equal to the one before", equal);
    if scene.is_dim() && scene.brightness() > 0.0 {
        push_jumps(v, k, scan);
    }
}

/// Adds the number of moments at which all intervals are short or long. Intervals across a lost readout are short by
/// one.
fn push_jumps(v: &mut StatisticsVector, k: usize, scan: &Scan) {
    let spikes: f64 = scan.deviations.iter().map(|d| d[1]).sum();
    let window = (scan.pixels.len() as f64 * scan.deviations.len() as f64 / spikes.max(1.0)).round() as usize;
    let window = window.clamp(1, scan.deviations.len() / 4 + 1);
    let mut sum = [0.0; 2];
    let (mut below, mut above) = (0.0, 0.0);
    let skip = 2 * window;
    for t in 0..scan.deviations.len() {
        sum = [sum[0] + scan.deviations[t][0], sum[1] + scan.deviations[t][1]];
        if t >= window {
            sum = [sum[0] - scan.deviations[t - window][0], sum[1] - scan.deviations[t - window][1]];
        }
        if t < skip || sum[1] < 1.0 {
            continue;
        }
        let mean = sum[0] / sum[1];
        below += f64::from(u8::from(mean < -0.5)) / window as f64;
        above += f64::from(u8::from(mean > 0.5)) / window as f64;
    }
    v.push_count(k, "moments with short intervals", below);
    v.push_count(k, "moments with long intervals", above);
}

/// Returns the power spectrum of the spikes per readout, relative to independent pixels.
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

/// Returns the frequency near a given `frequency` at which all of `totals` together have the highest power, in cycles per readout.
///
/// For a clear line, the error is a few hundredths of the frequency step of the spectrum.
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

/// Returns the power of the totals at any frequency, divided by their mean.
fn power_at(totals: &[u32], frequency: f64) -> f64 {
    let mean = totals.iter().map(|c| f64::from(*c)).sum::<f64>() / totals.len().max(1) as f64;
    let (mut re, mut im) = (0.0, 0.0);
    for (t, c) in totals.iter().enumerate() {
        let (sin, cos) = (std::f64::consts::TAU * frequency * t as f64).sin_cos();
        (re, im) = (re + (f64::from(*c) - mean) * cos, im + (f64::from(*c) - mean) * sin);
    }
    (re * re + im * im) / mean.max(1e-9)
}

/// Adds the power of the spikes per readout in frequency bands.
fn push_spectrum(v: &mut StatisticsVector, k: usize, totals: &[u32], light: f64) {
    let power = power(totals);
    let t = totals.len();
    let mean = |from: usize, to: usize| {
        // Below 600 readouts the low band is empty, because its frequencies belong to the slow band.
        let part = &power[from.min(power.len())..to.max(from).min(power.len())];
        part.iter().sum::<f64>() / part.len().max(1) as f64
    };
    v.push(k, "slow power of the total", ln(mean(1, 6)), 1e-3);
    v.push(k, "low power of the total", ln(mean(6, t / 100)), 1e-3);
    v.push(k, "middle power of the total", ln(mean(t / 100, t / 10)), 1e-3);
    v.push(k, "high power of the total", ln(mean(t / 10, t / 2)), 1e-3);
    if light >= MIN_LINE_LIGHT {
        v.push(k, "line in the total", ln(line(&power, t).1), 1e-2);
    }
}

/// Fewest periods of a line in a recording. A mean and a drift have fewer.
pub(crate) const MIN_PERIODS: f64 = 2.0;

/// Returns the frequency of the highest line in cycles per readout, and its power divided by the mean power around it.
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

/// Returns the sum of the powers around each frequency below `end`, in order of frequency. No summand exceeds the
/// power at the frequency itself. The first two frequencies are excluded.
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

/// Adds one neighbor of all frequencies from `first` on. The sums of different frequencies are independent, so the
/// compiler vectorizes the loop.
#[inline(always)]
fn add_neighbor(sums: &mut [f64], power: &[f64], first: usize, others: &[f64]) {
    let sums = sums.get_mut(first..).unwrap_or(&mut []);
    for ((sum, own), other) in sums.iter_mut().zip(power.get(first..).unwrap_or(&[])).zip(others) {
        *sum += other.min(*own);
    }
}

/// Adds the rates in the windows after a step, relative to the steady rate.
pub(crate) fn push_steps(v: &mut StatisticsVector, k: usize, scan: &Scan, scene: &RecordedScene) {
    if scene.half_period().is_none() {
        return;
    }
    const UP: [&str; 4] = [
        "2 to 20 readouts after a rise",
        "20 to 60 after a rise",
        "60 to 120 after a rise",
        "120 to 300 after a rise",
    ];
    const DOWN: [&str; 4] = [
        "2 to 20 readouts after a fall",
        "20 to 60 after a fall",
        "60 to 120 after a fall",
        "120 to 300 after a fall",
    ];
    for (names, is_bright) in [(UP, true), (DOWN, false)] {
        let mean = |window: &dyn Fn(&Stretch) -> (usize, usize)| {
            let (mut sum, mut count) = (0.0, 0.0);
            for (from, to) in scan.stretches.iter().filter(|s| s.is_bright == is_bright).map(window) {
                sum += scan.totals[from..to].iter().map(|c| f64::from(*c)).sum::<f64>();
                count += (to - from) as f64;
            }
            sum / f64::max(count, 1.0)
        };
        let steady = mean(&|s| (s.from + STEADY_READOUTS, s.to));
        for (name, (from, to)) in names.into_iter().zip(STEP_WINDOWS) {
            let rate = mean(&|s| (s.from + from, s.from + to));
            v.push(k, name, 10.0 * (ln(rate) - ln(steady)), 1e-3);
        }
    }
}

/// Adds the slopes of the excess rate after a fall over gain and over dark current. Late light is proportional to the
/// gain.
pub(crate) fn push_after_falls(
    v: &mut StatisticsVector,
    k: usize,
    scan: &Scan,
    scene: &RecordedScene,
    lines: &Lines,
    [gain, dark]: [&Map<'_>; 2],
) {
    let Stimulus::Scene(StimulusPattern::Square { low, .. }) = scene.found_light() else { return };
    if scene.half_period().is_none() {
        return;
    }
    let readouts: usize = dark_windows(&scan.stretches).map(|(from, to)| to - from).sum();
    let excess = |p: usize| {
        let expected = lines.expected(p, low) * readouts as f64;
        if expected > 0.0 { f64::from(scan.pixels[p].after_falls) / expected - 1.0 } else { f64::NAN }
    };
    let excess: Vec<f64> = (0..scan.pixels.len()).map(excess).collect();
    let spread = Spread::of(&excess);
    v.push(k, "after a fall, by gain", 1e3 * gain.slope(&excess, &spread), 0.05);
    v.push(k, "after a fall, by dark current", 1e3 * dark.slope(&excess, &spread), 0.05);
}

/// Adds the deviations of the rates inside and at the edges of the squares from the lines of the pixels.
pub(crate) fn push_checkerboard(
    v: &mut StatisticsVector,
    k: usize,
    scan: &Scan,
    scene: &RecordedScene,
    lines: &Lines,
) {
    let Stimulus::Scene(StimulusPattern::Checkerboard { high, low, cell }) = scene.found_light() else {
        return;
    };
    let (width, height) = (scan.geometry.width(), scan.geometry.height());
    let cell = cell.max(1) as usize;
    let bright = |row: usize, col: usize| (row / cell + col / cell).is_multiple_of(2);
    let mut groups: [Vec<f64>; 4] = Default::default();
    for p in 0..width * height {
        let (row, col) = (p / width, p % width);
        let is_bright = bright(row, col);
        let neighbors =
            [(row.wrapping_sub(1), col), (row + 1, col), (row, col.wrapping_sub(1)), (row, col + 1)];
        let is_edge = neighbors.iter().any(|(r, c)| *r < height && *c < width && bright(*r, *c) != is_bright);
        let rate = scan.pixels[p].rate;
        let expected = lines.expected(p, if is_bright { high } else { low });
        if expected > 0.0 && rate < MAX_LINE_RATE {
            groups[2 * usize::from(!is_bright) + usize::from(is_edge)].push(rate / expected - 1.0);
        }
    }
    const NAMES: [&str; 4] = [
        "bright squares, inside",
        "bright squares, at the edge",
        "dark squares, inside",
        "dark squares, at the edge",
    ];
    for (name, group) in NAMES.into_iter().zip(&groups) {
        v.push(k, name, 1e3 * Spread::of(group).trimmed, 0.02);
    }
}

type Transform = Arc<dyn RealToComplex<f64>>;

/// Transforms by the lengths that were planned together. A planner with other plans in its cache may choose other
/// steps, which round differently.
static PLANS: LazyLock<Mutex<HashMap<Vec<usize>, Vec<Transform>>>> = LazyLock::new(Mutex::default);

/// Returns transforms of these lengths. They are cached, because thousands of simulations use the same few lengths and
/// planning takes longer than a transform.
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
        // 103.5 Hz at 20,000 readouts per second. The spectrum contains 100 Hz and 105 Hz.
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

    /// Tests lengths of recordings at which bands of frequencies are empty or nearly empty.
    #[test]
    fn short_recordings_have_finite_spectra() {
        for readouts in [256, 499, 500, 534, 599, 600, 601] {
            let totals: Vec<u32> = (0..readouts).map(|t| 100 + t % 7).collect();
            let mut v = StatisticsVector { statistics: Vec::new(), values: Vec::new() };
            push_spectrum(&mut v, 0, &totals, 0.3);
            assert!(v.values.iter().all(|x| x.is_finite()), "{readouts}: {:?}", v.values);
        }
    }
}
