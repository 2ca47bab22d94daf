//! The phases of the pixels at the start of a recording.
//!
//! The phases are a property of the recording, not of the camera. The pixels of a running camera have random
//! phases. The pixels of a simulation may begin together, and then fire in bursts until their different rates have
//! driven them apart. The bursts exceed all noise of the recording, and no calibrated parameter is precise enough
//! to predict them. The readouts with bursts are therefore excluded.

use crate::recordings::scan::{PixelScan, Scan};
use crate::recordings::setup::Setup;
use crate::statistics::order::Spread;
use crate::thresholds::{
    MAX_ASIDE_DIVISOR, MAX_CHANCE_PHASE, MAX_DRIFT_PIXELS, MAX_PHASE_RATE, MIN_COMMON_PHASE,
    MIN_PHASE_PIXELS, SQUARE_WAVE_ASIDE,
};
use spikelane_calibrate::unstable::SATURATION_RATE;

/// Returns the number of readouts that are excluded at the start of each recording. In these readouts, pixels that
/// began together still fire together.
pub(crate) fn in_step(setup: &Setup, scans: &[Scan]) -> Vec<usize> {
    let scenes =
        || setup.recordings.iter().zip(scans).filter(|(s, _)| s.is_constant() && s.static_scene.is_none());
    // A bright pixel fires within the first readouts, so its first spike does not show its start phase. The first
    // spike of a dim pixel shows it. All recordings of a set begin in the same way. Therefore one dim recording
    // that began together is evidence for all recordings.
    if setup.has_rate_maps || !scenes().any(|(_, scan)| began_together(scan)) {
        return vec![0; setup.recordings.len()];
    }
    let bright =
        scenes().filter(|(s, _)| s.brightness() > MAX_PHASE_RATE).map(|(s, scan)| apart(scan, s.readouts));
    let bright = bright.max().unwrap_or(SQUARE_WAVE_ASIDE);
    let aside = |(k, scan): (usize, &Scan)| match &setup.recordings[k] {
        scene if scene.static_scene.is_some() => 0,
        scene if scene.is_constant() => apart(scan, scene.readouts),
        _ => bright,
    };
    scans.iter().enumerate().map(aside).collect()
}

/// Returns the range of the charges at the first readout, in thresholds. Returns `None` if the pixels did not begin
/// together.
///
/// A model must begin like the recordings. If a reset loses charge, the spikes of a pixel lock to the readouts, and
/// such pixels never drift apart.
pub(crate) fn begun_over(setup: &Setup, scans: &[Scan]) -> Option<f64> {
    let scenes =
        || setup.recordings.iter().zip(scans).filter(|(s, _)| s.is_constant() && s.static_scene.is_none());
    if setup.has_rate_maps || !scenes().any(|(_, scan)| began_together(scan)) {
        return None;
    }
    let dim = |scan: &&Scan| scan.pixels.iter().filter(|p| first_tells(p)).count();
    let (_, scan) = scenes().filter(|(s, _)| s.first_readout == 0).max_by_key(|(_, scan)| dim(scan))?;
    let charges: Vec<f64> = scan.pixels.iter().filter(|p| first_tells(p)).map(charge).collect();
    let median = Spread::of(&charges).median();
    Some((2.0 * median).clamp(0.0, 1.0))
}

/// Returns whether the first spike of a pixel shows its start phase.
fn first_tells(p: &PixelScan) -> bool {
    p.count >= 3 && p.rate < MAX_PHASE_RATE
}

/// Returns the charge at the first readout, in thresholds. It assumes that the first spike occurs in the middle of
/// its readout.
fn charge(p: &PixelScan) -> f64 {
    1.0 - p.rate * (f64::from(p.first) + 0.5)
}

/// Returns the rates of the pixels that fire, but not at every readout. Saturated pixels never drift apart, and
/// they do not cause bursts. For a large sensor, only a part of the pixels is used.
fn rates(scan: &Scan) -> Vec<f64> {
    let step = scan.pixels.len().div_ceil(MAX_DRIFT_PIXELS).max(1);
    scan.pixels
        .iter()
        .step_by(step)
        .filter(|p| p.count >= 3 && p.rate < SATURATION_RATE)
        .map(|p| p.rate)
        .collect()
}

/// Returns the length of the mean of unit vectors at the phases `turns`. A phase of 1 is a full turn.
fn mean_length(turns: impl Iterator<Item = f64>) -> f64 {
    let (mut sum, mut n) = ([0.0; 2], 0.0);
    for turn in turns {
        let (sin, cos) = (std::f64::consts::TAU * turn).sin_cos();
        sum = [sum[0] + cos, sum[1] + sin];
        n += 1.0;
    }
    sum[0].hypot(sum[1]) / f64::max(n, 1.0)
}

fn began_together(scan: &Scan) -> bool {
    let dim = || scan.pixels.iter().filter(|p| first_tells(p));
    dim().count() >= MIN_PHASE_PIXELS && mean_length(dim().map(charge)) > MIN_COMMON_PHASE
}

/// Returns the first readout at which pixels that began together have drifted apart. The result is at most the
/// length of the recording divided by [`MAX_ASIDE_DIVISOR`].
fn apart(scan: &Scan, readouts: usize) -> usize {
    let rates = rates(scan);
    let most = readouts / MAX_ASIDE_DIVISOR;
    let saturated = scan.pixels.iter().filter(|p| p.rate >= SATURATION_RATE).count();
    if 2 * saturated > scan.pixels.len() {
        return 0;
    }
    if rates.len() < MIN_PHASE_PIXELS {
        return most;
    }
    let chance = MAX_CHANCE_PHASE / (rates.len() as f64).sqrt();
    // Phases of pixels with long cycles change slowly, so a step of a sixteenth of a mean cycle is sufficient.
    let mean = rates.iter().sum::<f64>() / rates.len() as f64;
    let step = ((1.0 / (16.0 * mean)) as usize).max(1);
    let last = most.saturating_sub(1) / step * step;
    let turn = |readouts: usize| -> Vec<[f64; 2]> {
        let of = |f: &f64| (std::f64::consts::TAU * (f * readouts as f64).fract()).sin_cos();
        rates.iter().map(of).map(|(sin, cos)| [cos, sin]).collect()
    };
    // The loop starts at the last readout and rotates all phases back by one step per iteration. This requires a
    // complex product instead of a sine and a cosine.
    let (back, mut at) = (turn(step), turn(last));
    for t in (0..most).step_by(step).rev() {
        let sum = at.iter().fold([0.0; 2], |sum: [f64; 2], z| [sum[0] + z[0], sum[1] + z[1]]);
        if sum[0].hypot(sum[1]) / rates.len() as f64 > chance {
            return (t + step).min(most);
        }
        for (z, by) in at.iter_mut().zip(&back) {
            *z = [z[0] * by[0] + z[1] * by[1], z[1] * by[0] - z[0] * by[1]];
        }
    }
    0
}

#[cfg(test)]
mod tests {
    use super::*;
    use spikelane::spikes::Geometry;
    use spikelane::unstable::draws::pattern_rng::PatternRng;
    use spikelane::unstable::draws::{RandomStream, Seeds};

    /// Returns a scan of 48x48 pixels with rates of 0.03 and a relative spread of 0.1. The start charges are
    /// uniform from 0 to `share` thresholds.
    fn begun(share: f64) -> Scan {
        let seeds = Seeds { camera: 1, shot: 0, sequence: 0 };
        let mut normals = PatternRng::new(seeds, RandomStream::from_name("phases")).normals();
        let mut pixel = |i: usize| {
            let rate = 0.03 * (1.0 + 0.1 * normals.next().unwrap());
            let charge = share * (i as f64 * 0.618_034).fract();
            let first = ((1.0 - charge) / rate).ceil() as u32 - 1;
            PixelScan { count: 100, first, rate, ..PixelScan::default() }
        };
        Scan {
            geometry: Geometry::new(48, 48).unwrap(),
            pixels: (0..48 * 48).map(&mut pixel).collect(),
            totals: Vec::new(),
            changes: Vec::new(),
            row_halves: 0.0,
            neighbors: [0.0; 4],
            deviations: Vec::new(),
            stretches: Vec::new(),
            contrast: 0.0,
        }
    }

    #[test]
    fn pixels_that_began_together_are_told_from_those_that_were_running() {
        assert!(!began_together(&begun(1.0)));
        for share in [0.0, 0.2, 0.7] {
            assert!(began_together(&begun(share)), "{share}");
        }
    }

    #[test]
    fn pixels_drift_apart_as_their_rates_say() {
        // The mean length is `exp(-2 pi^2 (0.003 t)^2)`. It falls to 3 / 48, the limit of the test, at t = 125.
        let found = apart(&begun(0.2), 4000);
        assert!((110..150).contains(&found), "{found}");
        assert_eq!(apart(&begun(0.2), 300), 100, "a third at most");
    }
}
