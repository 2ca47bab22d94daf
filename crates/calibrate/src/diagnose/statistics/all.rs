//! The vector of statistics of a recording set.

use super::entry::Vector;
use super::entry::ln;
use super::lines::{Lines, lines};
use super::maps::{self, Map};
use super::quantiles::Spread;
use super::readouts;
use super::steps;
use crate::diagnose::protocol::recorded_set::Setup;
use crate::diagnose::recording::pixel::BLOCKS;
use crate::diagnose::recording::pixel::LAGS;
use crate::diagnose::recording::pixel::PixelScan;
use crate::diagnose::recording::scan::Scan;

/// The whole vector of a scanned set. Its length depends on the setup alone.
pub(in crate::diagnose) fn vector(setup: &Setup, scans: &[Scan]) -> Vector {
    let mut v = Vector { statistics: Vec::new(), values: Vec::new() };
    let fitted = lines(setup, scans);
    let fitted = fitted.as_ref().map(|lines| (lines, Map::new(&lines.gain), Map::new(&lines.dark)));
    for (k, scan) in scans.iter().enumerate() {
        let scene = &setup.recordings[k];
        if scene.is_constant() {
            intervals(&mut v, k, scan, scene.dim());
            // Parts of a wave hold more or less light by where its steps fall.
            stability(&mut v, k, scan);
        }
        if scene.static_scene.is_some() {
            v.push(k, "pixels side by side, spread of rates", ln(scan.contrast), 5e-3);
            // Totals and neighbors belong to the scene as well.
            continue;
        }
        readouts::frames(&mut v, k, scan, scene);
        steps::steps(&mut v, k, scan, scene);
        if let Some((lines, gain, dark)) = &fitted {
            steps::after_falls(&mut v, k, scan, scene, lines, [gain, dark]);
            steps::checkerboard(&mut v, k, scan, scene, lines);
        }
    }
    if let Some((lines, gain, dark)) = &fitted {
        residuals(&mut v, lines, gain);
        maps::of_lines(&mut v, gain, dark, setup.geometry.width());
    }
    v
}

fn intervals(v: &mut Vector, k: usize, scan: &Scan, dim: bool) {
    let pixels = &scan.pixels;
    let off = |i: usize| pixels.iter().map(|p| f64::from(p.off_lattice[i])).sum::<f64>();
    v.rare(k, "short intervals", off(0));
    v.rare(k, "long intervals", off(1));
    if !dim {
        return;
    }
    const NAMES: [&str; LAGS.len()] =
        ["interval variance, lag 1", "interval variance, lag 4", "interval variance, lag 16"];
    for i in 0..LAGS.len() {
        let usual: Vec<f64> =
            pixels.iter().filter(|p| p.terms[i] > 0.0).map(|p| p.variance[i] / p.terms[i]).collect();
        let spread = Spread::of(&usual);
        // Ten-thousandths of a threshold squared, without the few worst pixels.
        v.push(k, NAMES[i], 1e4 * spread.trimmed, 2e-3);
        if i == 1 {
            v.push(k, "interval variance over pixels, spread", ln(spread.iqr() * 1e4), 2e-3);
            v.push(k, "interval variance over pixels, tail", ln(spread.upper_tail()), 5e-3);
        }
    }
    for (i, name) in ["interval covariance, lag 1", "interval covariance, lag 2"].into_iter().enumerate() {
        let usual: Vec<f64> =
            pixels.iter().filter(|p| p.count > 4).map(|p| p.covariance[i] / f64::from(p.count - 2)).collect();
        v.push(k, name, 1e4 * Spread::of(&usual).trimmed, 2e-3);
    }
}

/// Blocks of time against each other.
fn stability(v: &mut Vector, k: usize, scan: &Scan) {
    let n = scan.pixels.len() as f64;
    let half = |p: &PixelScan, second: bool| -> f64 {
        let part = if second { &p.blocks[BLOCKS / 2..] } else { &p.blocks[..BLOCKS / 2] };
        part.iter().map(|c| f64::from(*c)).sum()
    };
    let early: f64 = scan.pixels.iter().map(|p| half(p, false)).sum();
    let late: f64 = scan.pixels.iter().map(|p| half(p, true)).sum();
    v.push(k, "second half over first", ln(late) - ln(early), 2e-5);
    let ratio = if early > 0.0 { late / early } else { 1.0 };
    let change: Vec<f64> = scan.pixels.iter().map(|p| half(p, true) - half(p, false) * ratio).collect();
    let square = |x: &[f64]| x.iter().map(|d| d.clamp(-6.0, 6.0).powi(2)).sum::<f64>() / n;
    v.push(k, "change between halves, variance", square(&change), 1e-3);
    let wild = change.iter().filter(|d| d.abs() > 2.5).count() as f64;
    v.rare(k, "change between halves, tail", wild);
    let mean = |b: usize| scan.pixels.iter().map(|p| u64::from(p.blocks[b])).sum::<u64>() as f64 / n;
    let common: [f64; BLOCKS - 1] = std::array::from_fn(|b| mean(b + 1) - mean(b));
    let mut squares = [0.0; BLOCKS - 1];
    for p in &scan.pixels {
        for b in 0..BLOCKS - 1 {
            let step = f64::from(p.blocks[b + 1]) - f64::from(p.blocks[b]) - common[b];
            squares[b] += step.clamp(-6.0, 6.0).powi(2);
        }
    }
    let sum = squares.iter().fold(0.0, |sum, square| sum + square / n);
    v.push(k, "change between blocks, variance", sum / (BLOCKS - 1) as f64, 1e-3);
}

/// Levels against every pixel's own line.
fn residuals(v: &mut Vector, fitted: &Lines, gain: &Map<'_>) {
    for (k, off) in &fitted.residuals {
        let spread = Spread::of(off);
        // Relative to the light, or to a hundredth of full light in the dark.
        v.push(*k, "rate against the pixel's line", 1e3 * spread.trimmed, 0.01);
        v.push(*k, "spread about the line", ln(spread.iqr()), 2e-3);
        let (low, high) = (spread.q[0], spread.q[6]);
        v.push(*k, "spread about the line, tails", ln((high - low) / spread.iqr()), 5e-3);
        v.push(*k, "rate against the line, by gain", 1e3 * gain.slope(off, &spread), 0.05);
    }
}
