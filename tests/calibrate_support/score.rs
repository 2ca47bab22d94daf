//! What an estimator found against the truth, and against the Cramer-Rao bound.

use rayon::prelude::*;
use spikelane::calibrate::{Observed, Weighting};
use spikelane::spikes::Geometry;

use super::{Noise, Pixel, Random, level};

/// The paper's 25 grey levels.
pub const LEVELS: u32 = 25;

pub fn light(k: u32) -> f64 {
    f64::from(10 * k) / 255.0
}

/// All levels of all pixels.
pub fn observed(noise: &Noise, truth: &[Pixel], width: u32, readouts: u32) -> Observed {
    let one = |k: u32| level(noise, truth, light(k), readouts, 77 + u64::from(k), light(k) < 0.12);
    Observed {
        geometry: Geometry::new(width, truth.len() as u32 / width).unwrap(),
        readout_hz: 20_000.0,
        levels: (0..LEVELS).map(one).collect(),
        others: Vec::new(),
    }
}

/// Variance of the draws at which a pixel fires over that of all draws, by increment in units of
/// the noise. A pixel fires at the first draw below its charge, so slow ones fire at low draws of little
/// variance. Simulated directly: 50,000 spikes a point, so 0.6 % each.
pub struct Firing {
    by_log: Vec<(f64, f64)>,
}

impl Firing {
    pub fn new() -> Self {
        let at = |i: i32| {
            let g = (0.25 * f64::from(i)).exp();
            (g.ln(), simulate(g, 1000 + i as u64))
        };
        Self { by_log: (-12..=20).into_par_iter().map(at).collect() }
    }

    /// Above the table all draws fire alike.
    pub fn at(&self, g: f64) -> f64 {
        let x = g.ln();
        let next = self.by_log.partition_point(|p| p.0 <= x);
        match (next.checked_sub(1).map(|i| self.by_log[i]), self.by_log.get(next)) {
            (Some(a), Some(b)) => a.1 + (x - a.0) / (b.0 - a.0) * (b.1 - a.1),
            (Some(a), None) => a.1,
            _ => self.by_log[0].1,
        }
    }
}

fn simulate(g: f64, seed: u64) -> f64 {
    let mut random = Random::new(seed);
    let (mut sum, mut squares) = (0.0, 0.0);
    let n = 50_000;
    let mut charge = -random.uniform() * g - 6.0;
    for _ in 0..n {
        let z = loop {
            charge += g;
            let z = random.normal();
            if charge >= z {
                break z;
            }
        };
        sum += z;
        squares += z * z;
        // The threshold is far away in units of its noise: the next approach begins at a phase of its own.
        charge = -6.0 - random.uniform() * g;
    }
    let (n, mean) = (f64::from(n), sum / f64::from(n));
    squares / n - mean * mean
}

/// Bound on the variances of `a` and `d` of a pixel: Fisher information of its rates by time, with the
/// phase noise of each level (light's quanta only where there is light), the pixel's threshold known.
pub fn bound(noise: &Noise, firing: &Firing, pixel: &Pixel, readouts: u32) -> (f64, f64) {
    let (mut s0, mut s1, mut s2) = (0.0, 0.0, 0.0);
    for light in (0..LEVELS).map(light) {
        let x = pixel.a() * light + pixel.d();
        if x > 0.983 {
            continue;
        }
        let sigma = noise.sigma_t / pixel.phi;
        let threshold = sigma * sigma * firing.at(x / sigma);
        let weights = Weighting { threshold, light: pixel.a() / noise.photons, dark: 0.0 };
        let v = weights.variance(x, x * f64::from(readouts), pixel.a() * light / x);
        if v > 0.0 {
            s0 += 1.0 / v;
            s1 += light / v;
            s2 += light * light / v;
        }
    }
    let det = s0 * s2 - s1 * s1;
    (s0 / det, s2 / det)
}

/// Errors of `a` and `d`.
#[derive(Clone, Copy, Debug)]
pub struct Score {
    /// Root mean square error over the bound's.
    pub ratio: [f64; 2],
    /// Root mean square error.
    pub rmse: [f64; 2],
    /// Share of the pixels whose 95 % interval holds the truth.
    pub coverage: [f64; 2],
}

/// One pixel's result: `a`, `d` and their variances.
pub type Line = [f64; 4];

/// All pixels with a dark rate (three spikes or more expected, so that a bound exists).
pub fn score(noise: &Noise, truth: &[Pixel], found: &[Line], readouts: u32) -> Score {
    let firing = Firing::new();
    let (mut squares, mut bounds, mut inside, mut n) = ([0.0; 2], [0.0; 2], [0.0; 2], 0.0);
    for (pixel, [a, d, var_a, var_d]) in truth.iter().zip(found) {
        if pixel.d() * f64::from(readouts) < 3.0 || !a.is_finite() {
            continue;
        }
        let (va, vd) = bound(noise, &firing, pixel, readouts);
        let off = [a - pixel.a(), d - pixel.d()];
        for (i, (b, v)) in [(va, var_a), (vd, var_d)].into_iter().enumerate() {
            squares[i] += off[i] * off[i];
            bounds[i] += b;
            inside[i] += f64::from(u8::from(off[i].abs() < 1.96 * v.sqrt()));
        }
        n += 1.0;
    }
    Score {
        ratio: [0, 1].map(|i| (squares[i] / bounds[i]).sqrt()),
        rmse: [0, 1].map(|i| (squares[i] / n).sqrt()),
        coverage: inside.map(|i| i / n),
    }
}

/// Mean and standard deviation.
pub fn spread(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let values: Vec<f64> = values.collect();
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    let squares = values.iter().map(|x| (x - mean).powi(2)).sum::<f64>();
    (mean, (squares / (values.len() as f64 - 1.0)).sqrt())
}
