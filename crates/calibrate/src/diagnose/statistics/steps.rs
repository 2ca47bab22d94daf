//! What happens after a step of the light, and beside one.

use super::entry::Vector;
use super::entry::ln;
use super::lines::Lines;
use super::maps::Map;
use super::quantiles::Spread;
use crate::diagnose::protocol::recorded::RecordedScene;
use crate::diagnose::recording::scan::{Scan, dark_windows};
use crate::diagnose::recording::stretches::STEADY;
use crate::diagnose::recording::stretches::Stretch;
use crate::{Stimulus, StimulusPattern};

/// Windows after an edge, in readouts.
const WINDOWS: [(usize, usize); 4] = [(2, 20), (20, 60), (60, 120), (120, 300)];

pub(in crate::diagnose) fn steps(v: &mut Vector, k: usize, scan: &Scan, scene: &RecordedScene) {
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
    for (names, bright) in [(UP, true), (DOWN, false)] {
        let mean = |window: &dyn Fn(&Stretch) -> (usize, usize)| {
            let (mut sum, mut count) = (0.0, 0.0);
            for (from, to) in scan.stretches.iter().filter(|s| s.bright == bright).map(window) {
                sum += scan.totals[from..to].iter().map(|c| f64::from(*c)).sum::<f64>();
                count += (to - from) as f64;
            }
            sum / f64::max(count, 1.0)
        };
        let steady = mean(&|s| (s.from + STEADY, s.to));
        for (name, (from, to)) in names.into_iter().zip(WINDOWS) {
            let now = mean(&|s| (s.from + from, s.from + to));
            v.push(k, name, 10.0 * (ln(now) - ln(steady)), 1e-3);
        }
    }
}

/// Whether what is left after a fall follows a pixel's gain, as late light does, or its dark current.
pub(in crate::diagnose) fn after_falls(
    v: &mut Vector,
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

/// Pixels at the border of a square and inside of it, against what their lines promise.
pub(in crate::diagnose) fn checkerboard(
    v: &mut Vector,
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
        let own = bright(row, col);
        let beside = [(row.wrapping_sub(1), col), (row + 1, col), (row, col.wrapping_sub(1)), (row, col + 1)];
        let edge = beside.iter().any(|(r, c)| *r < height && *c < width && bright(*r, *c) != own);
        let rate = scan.pixels[p].rate;
        let expected = lines.expected(p, if own { high } else { low });
        if expected > 0.0 && rate < 0.985 {
            groups[2 * usize::from(!own) + usize::from(edge)].push(rate / expected - 1.0);
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
