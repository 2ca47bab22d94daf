//! Measures a recording set: all statistics of its recordings and of its maps.

use crate::events::locations::{LocatedEvents, locate_events};
use crate::recordings::bits::PixelBits;
use crate::recordings::scan::{BLOCK_COUNT, PHASE_LAGS, PixelScan, Scan, scan_bits};
use crate::recordings::setup::Setup;
use crate::statistics::maps::{Lines, Map, fit_lines};
use crate::statistics::order::Spread;
use crate::statistics::vector::{StatisticsVector, ln};
use crate::statistics::{maps, readouts};
use spikelane::error::{Error, ErrorKind, Result};
use spikelane::spikes::SpikeFramesRef;
use spikelane_calibrate::{RecordingSet, measure_levels};

/// A measured set: its statistics vector, the scans of its recordings, and the located events.
#[derive(Clone, Debug)]
pub(crate) struct MeasuredSet {
    pub scans: Vec<Scan>,
    pub values: Vec<f64>,
    pub located: LocatedEvents,
}

/// Reads and measures the recordings of `set`.
pub(crate) fn measure(setup: &Setup, set: &RecordingSet) -> Result<MeasuredSet> {
    if setup.has_rate_maps {
        let values = measure_rate_maps(setup, set)?;
        return Ok(MeasuredSet { scans: Vec::new(), values, located: LocatedEvents::default() });
    }
    let (mut scans, mut located) = (Vec::new(), Vec::new());
    for (scene, recording) in setup.recordings.iter().zip(&set.recordings) {
        let bytes = setup.part(set, recording, scene)?;
        let frames = SpikeFramesRef::new(setup.geometry, &bytes)?;
        let bits = PixelBits::new(frames)?;
        let mut scan = scan_bits(frames, &bits, scene.scan_options())?;
        if let Some(static_scene) = &scene.static_scene {
            static_scene.retain_uniform(&mut scan);
        }
        located.push(locate_events(frames, &bits, &scan, scene));
        scans.push(scan);
    }
    let values = statistics_vector(setup, &scans).values;
    Ok(MeasuredSet { scans, values, located: LocatedEvents(located) })
}

/// Returns the statistics vector of a scanned set. The number of statistics depends only on `setup`.
pub(crate) fn statistics_vector(setup: &Setup, scans: &[Scan]) -> StatisticsVector {
    let mut v = StatisticsVector { statistics: Vec::new(), values: Vec::new() };
    let fitted = fit_lines(setup, scans);
    let fitted = fitted.as_ref().map(|lines| (lines, Map::new(&lines.gain), Map::new(&lines.dark)));
    for (k, scan) in scans.iter().enumerate() {
        let scene = &setup.recordings[k];
        if scene.is_constant() {
            push_intervals(&mut v, k, scan, scene.is_dim());
            // Square waves are excluded: the light of a block of time depends on the positions of the steps in it.
            push_stability(&mut v, k, scan);
        }
        if scene.static_scene.is_some() {
            v.push(k, "pixels side by side, spread of rates", ln(scan.contrast), 5e-3);
            // All further statistics of a static scene depend on the unknown scene, so they are omitted.
            continue;
        }
        readouts::push_totals(&mut v, k, scan, scene);
        readouts::push_steps(&mut v, k, scan, scene);
        if let Some((lines, gain, dark)) = &fitted {
            readouts::push_after_falls(&mut v, k, scan, scene, lines, [gain, dark]);
            readouts::push_checkerboard(&mut v, k, scan, scene, lines);
        }
    }
    if let Some((lines, gain, dark)) = &fitted {
        push_residuals(&mut v, lines, gain);
        maps::push_maps(&mut v, gain, dark, setup.geometry.width());
    }
    v
}

/// Adds the statistics of the intervals of recording `k` to `v`. `dim` states whether all intervals are measured.
fn push_intervals(v: &mut StatisticsVector, k: usize, scan: &Scan, dim: bool) {
    let pixels = &scan.pixels;
    let off_lattice = |i: usize| pixels.iter().map(|p| f64::from(p.off_lattice[i])).sum::<f64>();
    v.push_count(k, "short intervals", off_lattice(0));
    v.push_count(k, "long intervals", off_lattice(1));
    if !dim {
        return;
    }
    const NAMES: [&str; PHASE_LAGS.len()] =
        ["interval variance, lag 1", "interval variance, lag 4", "interval variance, lag 16"];
    for i in 0..PHASE_LAGS.len() {
        let measured: Vec<f64> =
            pixels.iter().filter(|p| p.terms[i] > 0.0).map(|p| p.variance[i] / p.terms[i]).collect();
        let spread = Spread::of(&measured);
        // The unit is 1e-4 thresholds squared. The trimmed mean excludes the pixels with the lowest and the highest
        // 5 % of the values.
        v.push(k, NAMES[i], 1e4 * spread.trimmed, 2e-3);
        if i == 1 {
            v.push(k, "interval variance over pixels, spread", ln(spread.iqr() * 1e4), 2e-3);
            v.push(k, "interval variance over pixels, tail", ln(spread.upper_tail()), 5e-3);
        }
    }
    for (i, name) in ["interval covariance, lag 1", "interval covariance, lag 2"].into_iter().enumerate() {
        let measured: Vec<f64> =
            pixels.iter().filter(|p| p.count > 4).map(|p| p.covariance[i] / f64::from(p.count - 2)).collect();
        v.push(k, name, 1e4 * Spread::of(&measured).trimmed, 2e-3);
    }
}

/// Adds the changes of recording `k` between blocks of time to `v`.
fn push_stability(v: &mut StatisticsVector, k: usize, scan: &Scan) {
    let n = scan.pixels.len() as f64;
    let half = |p: &PixelScan, second: bool| -> f64 {
        let part = if second { &p.blocks[BLOCK_COUNT / 2..] } else { &p.blocks[..BLOCK_COUNT / 2] };
        part.iter().map(|c| f64::from(*c)).sum()
    };
    let early: f64 = scan.pixels.iter().map(|p| half(p, false)).sum();
    let late: f64 = scan.pixels.iter().map(|p| half(p, true)).sum();
    v.push(k, "second half over first", ln(late) - ln(early), 2e-5);
    let ratio = if early > 0.0 { late / early } else { 1.0 };
    let change: Vec<f64> = scan.pixels.iter().map(|p| half(p, true) - half(p, false) * ratio).collect();
    let square = |x: &[f64]| x.iter().map(|d| d.clamp(-6.0, 6.0).powi(2)).sum::<f64>() / n;
    v.push(k, "change between halves, variance", square(&change), 1e-3);
    let outliers = change.iter().filter(|d| d.abs() > 2.5).count() as f64;
    v.push_count(k, "change between halves, tail", outliers);
    let mean = |b: usize| scan.pixels.iter().map(|p| u64::from(p.blocks[b])).sum::<u64>() as f64 / n;
    let common: [f64; BLOCK_COUNT - 1] = std::array::from_fn(|b| mean(b + 1) - mean(b));
    let mut squares = [0.0; BLOCK_COUNT - 1];
    for p in &scan.pixels {
        for b in 0..BLOCK_COUNT - 1 {
            let step = f64::from(p.blocks[b + 1]) - f64::from(p.blocks[b]) - common[b];
            squares[b] += step.clamp(-6.0, 6.0).powi(2);
        }
    }
    let sum = squares.iter().fold(0.0, |sum, square| sum + square / n);
    v.push(k, "change between blocks, variance", sum / (BLOCK_COUNT - 1) as f64, 1e-3);
}

/// Adds the deviations of the rates at each level from the lines of the pixels to `v`.
fn push_residuals(v: &mut StatisticsVector, fitted: &Lines, gain: &Map<'_>) {
    for (k, off) in &fitted.residuals {
        let spread = Spread::of(off);
        // The deviations are divided by the light, or by 0.01 if the light is lower.
        v.push(*k, "rate against the pixel's line", 1e3 * spread.trimmed, 0.01);
        v.push(*k, "spread about the line", ln(spread.iqr()), 2e-3);
        let (low, high) = (spread.q[0], spread.q[6]);
        v.push(*k, "spread about the line, tails", ln((high - low) / spread.iqr()), 5e-3);
        v.push(*k, "rate against the line, by gain", 1e3 * gain.slope(off, &spread), 0.05);
    }
}

/// Returns the statistics of a set of measured rate maps. They come from the darkest and from the brightest map.
pub(crate) fn measure_rate_maps(setup: &Setup, set: &RecordingSet) -> Result<Vec<f64>> {
    let observed = measure_levels(set, &mut |_, _| {})?;
    let (Some(dark), Some(bright)) = (observed.levels.first(), observed.levels.last()) else {
        return Err(Error::new(ErrorKind::Input, "rate maps")
            .found("none")
            .expected("one dark rate map and one lit rate map"));
    };
    let step = bright.light - dark.light;
    let gain: Vec<f64> = bright.rate.iter().zip(&dark.rate).map(|(b, d)| (b - d) / step).collect();
    Ok(rate_map_statistics(&gain, &dark.rate, setup).values)
}

/// Returns the statistics of the maps `gain` and `dark`, which are in thresholds per readout.
pub(crate) fn rate_map_statistics(gain: &[f64], dark: &[f64], setup: &Setup) -> StatisticsVector {
    let mut v = StatisticsVector { statistics: Vec::new(), values: Vec::new() };
    maps::push_maps(&mut v, &Map::new(gain), &Map::new(dark), setup.geometry.width());
    v
}
