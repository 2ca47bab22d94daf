//! Statistics over time: spikes per readout, their spectrum, and the response to steps of the light.

use crate::recordings::recorded_scene::RecordedScene;
use crate::recordings::scan::{Scan, dark_windows};
use crate::recordings::stretches::Stretch;
use crate::statistics::maps::{Lines, Map};
use crate::statistics::order::Spread;
use crate::statistics::spectrum::{line, power};
use crate::statistics::vector::{StatisticsVector, ln};
use crate::thresholds::{MIN_LINE_LIGHT, STEADY_READOUTS, STEP_WINDOWS};
use spikelane_calibrate::unstable::SATURATION_RATE;
use spikelane_calibrate::{Stimulus, StimulusPattern};

/// Adds the statistics of the spikes per readout, and of the coincidences of neighbors, to `v`.
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
    // Square waves are excluded. Their light makes neighbors fire together, and how often depends on the share of
    // bright readouts.
    for (name, value) in NAMES.into_iter().zip(scan.neighbors).filter(|_| scene.is_constant()) {
        v.push(k, name, value, 5e-5);
    }
    let mean_changes =
        scan.changes.iter().map(|c| f64::from(*c)).sum::<f64>() / scan.changes.len().max(1) as f64;
    let equal = scan.changes.iter().filter(|c| f64::from(**c) < 0.4 * mean_changes).count() as f64;
    // With few spikes, two successive readouts are often equal by chance, so they are not counted.
    let equal = if mean_changes > 0.002 * n { equal } else { 0.0 };
    v.push_count(k, "readouts equal to the one before", equal);
    if scene.is_dim() && scene.brightness() > 0.0 {
        push_jumps(v, k, scan);
    }
}

/// Adds the number of moments at which the intervals of all pixels are short, and at which they are long. Intervals
/// that contain a lost readout are shorter by one readout.
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

/// Adds the power of the spikes per readout in four frequency bands, and the strongest line.
fn push_spectrum(v: &mut StatisticsVector, k: usize, totals: &[u32], light: f64) {
    let power = power(totals);
    let t = totals.len();
    let mean = |from: usize, to: usize| {
        // In recordings of fewer than 600 readouts, the low band is empty, because the slow band contains its
        // frequencies.
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

/// Adds the rates in four windows after each step of a square wave, relative to the steady rate.
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

/// Adds two slopes of the excess rate after a fall of the light: as a function of the gain, and of the dark
/// current. If some light arrives late, the excess is proportional to the gain.
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

/// Adds the deviations of the rates in a checkerboard from the lines of the pixels. The inside and the edges of
/// bright and of dark squares are separate statistics.
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
        if expected > 0.0 && rate < SATURATION_RATE {
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Lengths of recordings at which some frequency bands are empty or have few frequencies.
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
