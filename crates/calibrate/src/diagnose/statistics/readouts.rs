//! Statistics of whole readouts.

use super::entry::Vector;
use super::entry::ln;
use super::transforms::transforms;
use crate::diagnose::protocol::recorded::RecordedScene;
use crate::diagnose::recording::scan::Scan;
use spikelane::unstable::kernels::dispatch;
use spikelane_measure::squared_magnitudes;

/// Highest frequency at which lines are looked for, in cycles per readout: bright pixels' own
/// rates lie above.
const HIGHEST_LINE: f64 = 0.13;

/// Light from which on pixels' own rates stay above [`HIGHEST_LINE`].
const LINES_FROM: f64 = 0.2;

pub(in crate::diagnose) fn frames(v: &mut Vector, k: usize, scan: &Scan, scene: &RecordedScene) {
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
        spectrum(v, k, &scan.totals, scene.brightness());
    }
    let even: f64 = scan.totals.iter().step_by(2).map(|c| f64::from(*c)).sum();
    let odd: f64 = scan.totals.iter().skip(1).step_by(2).map(|c| f64::from(*c)).sum();
    v.push(k, "even readouts over odd", ln(even) - ln(odd), 1e-4);
    if scene.rows() {
        v.push(k, "halves of a row together", scan.row_halves, 5e-5);
    }
    const NAMES: [&str; 4] = [
        "neighbors beside, same readout",
        "neighbors below, same readout",
        "neighbors beside, next readout",
        "neighbors below, next readout",
    ];
    // In a wave neighbors fire together because the light does, by how much of it is bright.
    for (name, value) in NAMES.into_iter().zip(scan.neighbors).filter(|_| scene.is_constant()) {
        v.push(k, name, value, 5e-5);
    }
    let mean_changes =
        scan.changes.iter().map(|c| f64::from(*c)).sum::<f64>() / scan.changes.len().max(1) as f64;
    let equal = scan.changes.iter().filter(|c| f64::from(**c) < 0.4 * mean_changes).count() as f64;
    // With few spikes a readout resembles the one before by chance.
    let equal = if mean_changes > 0.002 * n { equal } else { 0.0 };
    v.rare(k, "readouts equal to the one before", equal);
    if scene.dim() && scene.brightness() > 0.0 {
        jumps(v, k, scan);
    }
}

/// Intervals of all pixels that cross a lost readout are short by one.
fn jumps(v: &mut Vector, k: usize, scan: &Scan) {
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
    v.rare(k, "moments with short intervals", below);
    v.rare(k, "moments with long intervals", above);
}

/// Power of the readouts' totals over that of independent pixels, and lines in it.
pub(in crate::diagnose) fn power(totals: &[u32]) -> Vec<f64> {
    let n = totals.len();
    let mean = totals.iter().map(|c| f64::from(*c)).sum::<f64>() / n.max(1) as f64;
    if n < 2 {
        return Vec::new();
    }
    let [fft] = transforms([n]);
    let squares = squared_magnitudes(&*fft, totals, std::iter::repeat(1.0)).unwrap_or_default();
    squares.iter().map(|square| square / (n as f64 * mean.max(1e-9))).collect()
}

/// The frequency near `place` at which all of `totals` together have most power, in cycles per readout: between two frequencies of a
/// spectrum it is known to a few hundredths of their distance, for a line that is plain at all.
pub(in crate::diagnose) fn sharpened(totals: &[&[u32]], place: f64) -> f64 {
    let longest = totals.iter().map(|t| t.len()).max().unwrap_or(1) as f64;
    let at = |i: i32| place + f64::from(i) / (STEPS_OF_A_BIN * longest);
    let power = |frequency: f64| totals.iter().map(|t| power_at(t, frequency)).sum::<f64>();
    let reach = STEPS_OF_A_BIN as i32;
    let all: Vec<f64> = (-reach - 1..=reach + 1).map(|i| power(at(i))).collect();
    let best = (1..all.len() - 1).max_by(|a, b| all[*a].total_cmp(&all[*b])).unwrap_or(1);
    let [a, b, c] = [all[best - 1], all[best], all[best + 1]];
    let top = if 2.0 * b > a + c { 0.5 * (a - c) / (a - 2.0 * b + c) } else { 0.0 };
    at(best as i32 - 1 - reach) + top.clamp(-0.5, 0.5) / (STEPS_OF_A_BIN * longest)
}

/// Frequencies that are tried between two of a spectrum.
const STEPS_OF_A_BIN: f64 = 10.0;

/// Power of the totals at any frequency, over their mean.
fn power_at(totals: &[u32], frequency: f64) -> f64 {
    let mean = totals.iter().map(|c| f64::from(*c)).sum::<f64>() / totals.len().max(1) as f64;
    let (mut re, mut im) = (0.0, 0.0);
    for (t, c) in totals.iter().enumerate() {
        let (sin, cos) = (std::f64::consts::TAU * frequency * t as f64).sin_cos();
        (re, im) = (re + (f64::from(*c) - mean) * cos, im + (f64::from(*c) - mean) * sin);
    }
    (re * re + im * im) / mean.max(1e-9)
}

fn spectrum(v: &mut Vector, k: usize, totals: &[u32], light: f64) {
    let power = power(totals);
    let t = totals.len();
    let mean = |from: usize, to: usize| {
        // Below six hundred readouts the low frequencies are the slow ones.
        let part = &power[from.min(power.len())..to.max(from).min(power.len())];
        part.iter().sum::<f64>() / part.len().max(1) as f64
    };
    v.push(k, "slow power of the total", ln(mean(1, 6)), 1e-3);
    v.push(k, "low power of the total", ln(mean(6, t / 100)), 1e-3);
    v.push(k, "middle power of the total", ln(mean(t / 100, t / 10)), 1e-3);
    v.push(k, "high power of the total", ln(mean(t / 10, t / 2)), 1e-3);
    if light >= LINES_FROM {
        v.push(k, "line in the total", ln(line(&power, t).1), 1e-2);
    }
}

/// Fewest periods of a line in a recording. A mean and a drift have fewer.
pub(in crate::diagnose) const MIN_PERIODS: f64 = 2.0;

/// Frequencies on either side of a line that it is compared with.
const REACH: usize = 40;

/// Place of the highest line, in cycles per readout, and its power over the mean.
pub(in crate::diagnose) fn line(power: &[f64], readouts: usize) -> (f64, f64) {
    let end = ((HIGHEST_LINE * readouts as f64) as usize).min(power.len());
    let mut best = (0.0, 1.0);
    let sums = dispatch(
        #[inline(always)]
        || around(power, end),
    );
    for i in MIN_PERIODS as usize..end {
        let count = i - i.saturating_sub(REACH).max(1) + (i + REACH).min(power.len()) - (i + 1);
        let ratio = power[i] * count as f64 / f64::max(sums[i], 1e-12);
        if ratio > best.1 {
            best = (i as f64 / readouts as f64, ratio);
        }
    }
    best
}

/// Sums of the powers around each frequency below `end`, in order of frequency and none taken as more than its own. The first two are not
/// looked at.
#[inline(always)]
fn around(power: &[f64], end: usize) -> Vec<f64> {
    let mut sums = vec![0.0; end];
    for step in (1..=REACH).rev() {
        add(&mut sums, power, step + 1, power.get(1..).unwrap_or(&[]));
    }
    for step in 1..REACH {
        add(&mut sums, power, 2, power.get(2 + step..).unwrap_or(&[]));
    }
    sums
}

/// Adds one neighbor of all frequencies from `first` on: all neighbors of one frequency would wait for each other's addition.
#[inline(always)]
fn add(sums: &mut [f64], power: &[f64], first: usize, others: &[f64]) {
    let sums = sums.get_mut(first..).unwrap_or(&mut []);
    for ((sum, own), other) in sums.iter_mut().zip(power.get(first..).unwrap_or(&[])).zip(others) {
        *sum += other.min(*own);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_between_two_frequencies_of_the_spectrum_is_found() {
        // 103.5 Hz of 20,000 readouts per second, where the spectrum has 100 and 105.
        let total = |phase: f64| {
            move |t: u32| {
                let noise = f64::from(t.wrapping_mul(2_654_435_761) >> 28) - 7.5;
                (900.0 + 8.0 * (std::f64::consts::TAU * (103.5 * f64::from(t) / 2e4 + phase)).sin() + noise)
                    as u32
            }
        };
        let both: Vec<Vec<u32>> = [0.2, 0.7].map(|p| (0..4000).map(total(p)).collect()).into();
        let all: Vec<&[u32]> = both.iter().map(Vec::as_slice).collect();
        let found = 2e4 * sharpened(&all, 105.0 / 2e4);
        assert!((found - 103.5).abs() < 0.25, "{found}");
    }

    /// Every length that a part of a recording may have, where the bands of frequencies are empty or nearly so.
    #[test]
    fn short_recordings_have_a_spectrum() {
        for readouts in [256, 499, 500, 534, 599, 600, 601] {
            let totals: Vec<u32> = (0..readouts).map(|t| 100 + t % 7).collect();
            let mut v = Vector { statistics: Vec::new(), values: Vec::new() };
            spectrum(&mut v, 0, &totals, 0.3);
            assert!(v.values.iter().all(|x| x.is_finite()), "{readouts}: {:?}", v.values);
        }
    }
}
