//! The table of docs/calibration.md: errors of `a` and `d` of the default estimator and of the paper's, on a
//! camera of known truth, and the seconds each takes.
//!
//! `cargo bench --bench calibrate -- WIDTH HEIGHT READOUTS...`; 400 250 10000 when nothing is given.

#[path = "../tests/calibrate_support/mod.rs"]
mod calibrate_support;

use std::time::Instant;

use calibrate_support::{PUBLISHED, Pixel, level, pixels};
use spikelane::calibrate::{Observed, Options, SneeOptions, calibrate, snee};
use spikelane::spikes::Geometry;

/// Relative RMSE in per cent of `(a, d)` against the truth.
fn rmse(found: impl Iterator<Item = (f64, f64)>, truth: &[Pixel]) -> (f64, f64) {
    let (mut a, mut d, mut n) = (0.0, 0.0, 0.0);
    for ((fa, fd), t) in found.zip(truth).filter(|((fa, _), _)| fa.is_finite()) {
        a += (fa - t.a()).powi(2);
        d += (fd - t.d()).powi(2);
        n += 1.0;
    }
    let percent = |sum: f64, mean: f64| 100.0 * (sum / n).sqrt() / mean;
    (percent(a, 1.0), percent(d, PUBLISHED.dark))
}

fn main() {
    let numbers: Vec<u32> = std::env::args().skip(1).filter_map(|a| a.parse().ok()).collect();
    let (width, height) = (numbers.first().copied().unwrap_or(400), numbers.get(1).copied().unwrap_or(250));
    let lengths = if numbers.len() > 2 { numbers[2..].to_vec() } else { vec![10_000] };
    let truth = pixels(&PUBLISHED, (width * height) as usize, 9);
    println!("| readouts | default: a / d, seconds | paper's: a / d, seconds, on the box |");
    println!("|---|---|---|");
    for readouts in lengths {
        let one = |k: u32| {
            let light = f64::from(10 * k) / 255.0;
            level(&PUBLISHED, &truth, light, readouts, 77 + u64::from(k), light < 0.12)
        };
        let geometry = Geometry::new(width, height).expect("a sensor");
        let levels = (0..25).map(one).collect();
        let observed = Observed { geometry, readout_hz: 20_000.0, levels, others: Vec::new() };
        let clock = Instant::now();
        let found = calibrate(&observed, &Options::default()).expect("a calibration");
        let own = (rmse(found.fits.iter().map(|f| (f.a, f.d)), &truth), clock.elapsed().as_secs_f64());
        let clock = Instant::now();
        let paper = snee(&observed, &SneeOptions::default()).expect("the paper's estimator");
        let lines = paper
            .pixels
            .iter()
            .map(|s| s.map_or((f64::NAN, f64::NAN), |s| (s.alpha / s.phi, s.dark / s.phi)));
        let theirs = (rmse(lines, &truth), clock.elapsed().as_secs_f64());
        println!(
            "| {readouts} | {:.5} % / {:.4} %, {:.1} s | {:.3} % / {:.2} %, {:.1} s, {:.1} % |",
            own.0.0,
            own.0.1,
            own.1,
            theirs.0.0,
            theirs.0.1,
            theirs.1,
            100.0 * paper.on_box
        );
    }
}
