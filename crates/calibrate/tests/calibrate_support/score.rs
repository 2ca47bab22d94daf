//! What an estimator found against the truth, and against the Cramer-Rao bound.

use rayon::prelude::*;
use spikelane::spikes::Geometry;
use spikelane_calibrate::{Observed, Weighting};

use super::{Noise, Pixel, Random, level};

/// The paper's 25 grey levels.
pub(crate) const LEVELS: u32 = 25;

pub(crate) fn light(k: u32) -> f64 {
    f64::from(10 * k) / 255.0
}

/// The paper's levels of all pixels.
pub(crate) fn observed(noise: &Noise, truth: &[Pixel], width: u32, readouts: u32) -> Observed {
    let lights: Vec<f64> = (0..LEVELS).map(light).collect();
    observed_at(&lights, noise, truth, width, readouts, 77)
}

/// Some levels of all pixels; the generators' seeds count up from `seed`.
pub(crate) fn observed_at(
    lights: &[f64],
    noise: &Noise,
    truth: &[Pixel],
    width: u32,
    readouts: u32,
    seed: u64,
) -> Observed {
    let one = |(l, k): (&f64, u64)| level(noise, truth, *l, readouts, k, *l < 0.12);
    Observed {
        geometry: Geometry::new(width, truth.len() as u32 / width).unwrap(),
        readout_hz: 20_000.0,
        levels: lights.iter().zip(seed..).map(one).collect(),
        others: Vec::new(),
    }
}

/// The draws at which a pixel fires, by increment in units of the noise. It fires at the first draw below its
/// charge, so a slow pixel fires at low draws of little variance. Simulated directly: 50,000
/// spikes a point, so 0.6 % of the variance.
pub(crate) struct Firing {
    /// Logarithm of the increment, variance over that of all draws, rate gained over `sigma^2`.
    by_log: Vec<[f64; 3]>,
}

impl Firing {
    pub(crate) fn new() -> Self {
        let at = |i: i32| {
            let g = (0.25 * f64::from(i)).exp();
            let (mean, variance) = simulate(g, (1000 + i) as u64);
            // Charge balances: what low draws save is gained in rate.
            [g.ln(), variance, -g * mean]
        };
        Self { by_log: (-12..=20).into_par_iter().map(at).collect() }
    }

    /// Variance of the draws that fire, over that of all draws.
    pub(crate) fn variance(&self, g: f64) -> f64 {
        self.at(g, 1)
    }

    /// Rate that the noise adds, over its variance. Above 4 only one draw decides a spike, all fire
    /// alike within 0.3 %, and the simulated mean would be less sharp than that.
    pub(crate) fn gain(&self, g: f64) -> f64 {
        if g > 4.0 { 1.0 } else { self.at(g, 2) }
    }

    /// Beyond the table as at its ends.
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

/// Mean and variance of the draws that fire.
fn simulate(g: f64, seed: u64) -> (f64, f64) {
    let mut random = Random::new(seed);
    let (mut sum, mut squares) = (0.0, 0.0);
    let n = 50_000;
    for _ in 0..n {
        // The threshold is far away in units of its noise: every approach has a phase of its own.
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

/// Bounds on the variances of `a` and `d` of a pixel.
pub(crate) struct Bound {
    /// With the pixel's threshold known.
    pub known: [f64; 2],
    /// With the threshold known as far as `a`, `d` and the population tell it.
    pub unknown: [f64; 2],
}

/// Fisher information of a pixel's rates by time about `a`, `d` and its threshold, with the phase noise of
/// each level (light's quanta only where there is light). The threshold moves the rate that
/// redrawn noise adds; its own prior is that of normal thresholds, gains and currents, of which `(a, d)` is given.
pub(crate) fn bound(noise: &Noise, firing: &Firing, pixel: &Pixel, readouts: u32) -> Bound {
    let mut j = [[0.0; 3]; 3];
    for light in (0..LEVELS).map(light) {
        let x = pixel.a() * light + pixel.d();
        if x > 0.983 {
            continue;
        }
        let sigma = noise.sigma_t / pixel.phi;
        let threshold = sigma * sigma * firing.variance(x / sigma);
        let weights = Weighting { threshold, light: pixel.a() / noise.photons, dark: 0.0 };
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
    Bound { known: inverse(j[0][0], j[0][1], j[1][1]), unknown: inverse(left(0, 0), left(0, 1), left(1, 1)) }
}

/// Errors of `a` and `d`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Score {
    /// Root mean square error over the bound's, thresholds unknown.
    pub ratio: [f64; 2],
    /// The same, thresholds known.
    pub ratio_known: [f64; 2],
    /// Root mean square error.
    pub rmse: [f64; 2],
    /// Share of the pixels whose 95 % interval holds the truth.
    pub coverage: [f64; 2],
}

/// One pixel's result: `a`, `d` and their variances.
pub(crate) type Line = [f64; 4];

/// All pixels with a dark rate (three spikes or more expected, so that a bound exists).
pub(crate) fn score(noise: &Noise, truth: &[Pixel], found: &[Line], readouts: u32) -> Score {
    let firing = Firing::new();
    let (mut squares, mut bounds, mut known) = ([0.0; 2], [0.0; 2], [0.0; 2]);
    let (mut inside, mut n) = ([0.0; 2], 0.0);
    for (pixel, [a, d, var_a, var_d]) in truth.iter().zip(found) {
        if pixel.d() * f64::from(readouts) < 3.0 || !a.is_finite() {
            continue;
        }
        let bound = bound(noise, &firing, pixel, readouts);
        let off = [a - pixel.a(), d - pixel.d()];
        for (i, v) in [var_a, var_d].into_iter().enumerate() {
            squares[i] += off[i] * off[i];
            bounds[i] += bound.unknown[i];
            known[i] += bound.known[i];
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

/// Mean and standard deviation.
pub(crate) fn spread(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let values: Vec<f64> = values.collect();
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    let squares = values.iter().map(|x| (x - mean).powi(2)).sum::<f64>();
    (mean, (squares / (values.len() as f64 - 1.0)).sqrt())
}
