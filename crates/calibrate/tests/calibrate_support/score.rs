//! Compares the errors of an estimator with the Cramer-Rao bound.
//!
//! * `a`: gain of a pixel in thresholds per readout at full light. `d`: dark rate of a pixel in thresholds per readout.
//! * `sigma`: standard deviation of the threshold noise in thresholds.
//! * `g`: increment per readout in units of `sigma`.

use rayon::prelude::*;
use spikelane::spikes::Geometry;
use spikelane_calibrate::{CalibrateOptions, Calibration, Observations, RateWeighting, calibrate};
use spikelane_measure::Estimate;

use super::{Noise, Pixel, Random, level};

/// Number of gray levels in the paper.
pub(crate) const LEVELS: u32 = 25;

pub(crate) fn gray_level_light(k: u32) -> f64 {
    f64::from(10 * k) / 255.0
}

/// Fits a camera with the default options.
pub(crate) fn fit(observed: &Observations) -> Calibration {
    calibrate(observed, &CalibrateOptions::default()).unwrap()
}

/// Checks that the estimate deviates from the truth by less than three of its errors.
#[track_caller]
pub(crate) fn assert_within_error(name: &str, estimate: Estimate, truth: f64) {
    let z = (estimate.value - truth) / estimate.error;
    assert!(z.abs() < 3.0, "{name}: {:.6} +- {:.6} for {truth:.6}", estimate.value, estimate.error);
}

/// Simulates all pixels at the levels of the paper.
pub(crate) fn observations(noise: &Noise, truth: &[Pixel], width: u32, readouts: u32) -> Observations {
    let lights: Vec<f64> = (0..LEVELS).map(gray_level_light).collect();
    observations_at(&lights, noise, truth, width, readouts, 77)
}

/// Simulates all pixels at the levels `lights`. Level `i` uses the seed `seed + i`.
pub(crate) fn observations_at(
    lights: &[f64],
    noise: &Noise,
    truth: &[Pixel],
    width: u32,
    readouts: u32,
    seed: u64,
) -> Observations {
    let one = |(l, k): (&f64, u64)| level(noise, truth, *l, readouts, k, *l < 0.12);
    Observations {
        geometry: Geometry::new(width, truth.len() as u32 / width).unwrap(),
        readout_hz: 20_000.0,
        levels: lights.iter().zip(seed..).map(one).collect(),
        other_recordings: Vec::new(),
        filters: spikelane_calibrate::ColorFilters::Unknown,
        camera: None,
    }
}

/// Statistics of the draws at which a pixel fires, as functions of the increment in units of the noise.
///
/// A pixel fires at the first draw below its charge, so a slow pixel fires at low draws with a small variance. The draws
/// are simulated directly, with 50,000 spikes per point. The error of the variance is then 0.6 %.
pub(crate) struct Firing {
    /// Each row contains three numbers: the logarithm of the increment, the relative variance of the draws that fire,
    /// and the added rate divided by `sigma^2`. The relative variance is divided by the variance of all draws.
    by_log: Vec<[f64; 3]>,
}

impl Firing {
    pub(crate) fn new() -> Self {
        let at = |i: i32| {
            let g = (0.25 * f64::from(i)).exp();
            let (mean, variance) = simulate(g, (1000 + i) as u64);
            // The charge balances: the rate increases by the charge that low draws save.
            [g.ln(), variance, -g * mean]
        };
        Self { by_log: (-12..=20).into_par_iter().map(at).collect() }
    }

    /// Returns the variance of the draws that fire, divided by the variance of all draws.
    pub(crate) fn variance(&self, g: f64) -> f64 {
        self.at(g, 1)
    }

    /// Returns the rate that the noise adds, divided by the variance of the noise. Above `g = 4` a single draw decides
    /// whether a pixel fires. All draws are then equally likely to fire, to within 0.3 %. The exact gain 1 is therefore
    /// more accurate than the simulated mean.
    pub(crate) fn gain(&self, g: f64) -> f64 {
        if g > 4.0 { 1.0 } else { self.at(g, 2) }
    }

    /// Interpolates a column of the table. Outside the table, the first or last value is returned.
    fn at(&self, g: f64, column: usize) -> f64 {
        let x = g.ln();
        let next = self.by_log.partition_point(|p| p[0] <= x);
        match (next.checked_sub(1).map(|i| self.by_log[i]), self.by_log.get(next)) {
            (Some(a), Some(b)) => a[column] + (x - a[0]) / (b[0] - a[0]) * (b[column] - a[column]),
            (Some(a), None) => a[column],
            _ => self.by_log[0][column],
        }
    }
}

/// Simulates the draws that fire. Returns their mean and their variance.
fn simulate(g: f64, seed: u64) -> (f64, f64) {
    let mut random = Random::new(seed);
    let (mut sum, mut squares) = (0.0, 0.0);
    let n = 50_000;
    for _ in 0..n {
        // The charge starts far below the threshold in units of the noise, so the phase of every approach is independent.
        let mut charge = -6.0 - random.uniform() * g;
        let z = loop {
            charge += g;
            let z = random.normal();
            if charge >= z {
                break z;
            }
        };
        sum += z;
        squares += z * z;
    }
    let (n, mean) = (f64::from(n), sum / f64::from(n));
    (mean, squares / n - mean * mean)
}

/// Lower bounds of the variances of `a` and `d` of a pixel.
pub(crate) struct Bound {
    /// Bounds if the threshold is known.
    pub known_threshold: [f64; 2],
    /// Bounds if only `a`, `d` and the population provide information about the threshold.
    pub unknown_threshold: [f64; 2],
}

/// Returns the bounds from the Fisher information of a pixel's rates about `a`, `d` and the threshold.
///
/// The rates are computed from spike times and have the phase noise of each level. Quanta of light contribute only at lit
/// levels. The threshold changes the rate that redrawn noise adds. The prior of the threshold follows from normal
/// thresholds, gains and dark currents, given `(a, d)`.
pub(crate) fn bound(noise: &Noise, firing: &Firing, pixel: &Pixel, readouts: u32) -> Bound {
    let mut j = [[0.0; 3]; 3];
    for light in (0..LEVELS).map(gray_level_light) {
        let x = pixel.a() * light + pixel.d();
        if x > 0.983 {
            continue;
        }
        let sigma = noise.sigma_t / pixel.phi;
        let threshold = sigma * sigma * firing.variance(x / sigma);
        let weights = RateWeighting {
            threshold_variance: threshold,
            light_variance: pixel.a() / noise.photons,
            dark_variance: 0.0,
        };
        let v = weights.variance(x, x * f64::from(readouts), pixel.a() * light / x);
        let gained = |phi: f64| {
            let sigma = noise.sigma_t / phi;
            sigma * sigma * firing.gain(x / sigma)
        };
        let by_phi = (gained(pixel.phi * 1.05) - gained(pixel.phi * 0.95)) / (0.1 * pixel.phi);
        let slope = [light, 1.0, by_phi];
        if v > 0.0 {
            for (row, a) in j.iter_mut().zip(slope) {
                row.iter_mut().zip(slope).for_each(|(cell, b)| *cell += a * b / v);
            }
        }
    }
    let square = |x: f64| x * x;
    j[2][2] += 1.0 / square(noise.threshold_sd)
        + square(pixel.a() / noise.gain_sd)
        + square(pixel.d() / noise.dark_sd);
    let left = |r: usize, c: usize| j[r][c] - j[r][2] * j[c][2] / j[2][2];
    let inverse = |aa: f64, ad: f64, dd: f64| [dd, aa].map(|x| x / (aa * dd - ad * ad));
    Bound {
        known_threshold: inverse(j[0][0], j[0][1], j[1][1]),
        unknown_threshold: inverse(left(0, 0), left(0, 1), left(1, 1)),
    }
}

/// Errors of `a` and `d`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Score {
    /// Root mean square error divided by the bound for unknown thresholds.
    pub ratio: [f64; 2],
    /// Root mean square error divided by the bound for known thresholds.
    pub ratio_known: [f64; 2],
    /// Root mean square error.
    pub rmse: [f64; 2],
    /// Share of the pixels whose 95 % interval contains the truth.
    pub coverage: [f64; 2],
}

/// Result for one pixel: `a`, `d` and their variances.
pub(crate) type Line = [f64; 4];

/// Scores the pixels with at least three expected dark spikes. Other pixels have no bound.
pub(crate) fn score(noise: &Noise, truth: &[Pixel], fits: &[Line], readouts: u32) -> Score {
    let firing = Firing::new();
    let (mut squares, mut bounds, mut known) = ([0.0; 2], [0.0; 2], [0.0; 2]);
    let (mut inside, mut n) = ([0.0; 2], 0.0);
    for (pixel, [a, d, var_a, var_d]) in truth.iter().zip(fits) {
        if pixel.d() * f64::from(readouts) < 3.0 || !a.is_finite() {
            continue;
        }
        let bound = bound(noise, &firing, pixel, readouts);
        let off = [a - pixel.a(), d - pixel.d()];
        for (i, v) in [var_a, var_d].into_iter().enumerate() {
            squares[i] += off[i] * off[i];
            bounds[i] += bound.unknown_threshold[i];
            known[i] += bound.known_threshold[i];
            inside[i] += f64::from(u8::from(off[i].abs() < 1.96 * v.sqrt()));
        }
        n += 1.0;
    }
    Score {
        ratio: [0, 1].map(|i| (squares[i] / bounds[i]).sqrt()),
        ratio_known: [0, 1].map(|i| (squares[i] / known[i]).sqrt()),
        rmse: [0, 1].map(|i| (squares[i] / n).sqrt()),
        coverage: inside.map(|i| i / n),
    }
}

/// Returns the mean and the standard deviation of `values`.
pub(crate) fn mean_and_sd(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let values: Vec<f64> = values.collect();
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    let squares = values.iter().map(|x| (x - mean).powi(2)).sum::<f64>();
    (mean, (squares / (values.len() as f64 - 1.0)).sqrt())
}
