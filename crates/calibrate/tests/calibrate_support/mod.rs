//! Cameras of known truth, simulated pixel by pixel in f64, with nothing of the library but
//! its types for results.
#![allow(dead_code, reason = "each test takes what it needs")]

pub(crate) mod score;

use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Dxsm;
use rand_pcg::rand_core::{Rng, SeedableRng};
use rayon::prelude::*;
use spikelane_calibrate::Level;

/// A generator that the library does not use, and normal draws of another library.
pub(crate) struct Random(Pcg64Dxsm);

impl Random {
    pub(crate) fn new(seed: u64) -> Self {
        Self(Pcg64Dxsm::seed_from_u64(seed))
    }

    pub(crate) fn uniform(&mut self) -> f64 {
        (self.0.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
    }

    pub(crate) fn normal(&mut self) -> f64 {
        StandardNormal.sample(&mut self.0)
    }
}

/// The published noise: relative to nominal threshold and to the light that saturates.
#[derive(Clone, Copy)]
pub(crate) struct Noise {
    pub threshold_sd: f64,
    pub gain_sd: f64,
    pub dark: f64,
    pub dark_sd: f64,
    pub sigma_t: f64,
    pub photons: f64,
    pub lost: f64,
}

pub(crate) const PUBLISHED: Noise = Noise {
    threshold_sd: 0.0497 / 1.0924,
    gain_sd: 0.0577,
    dark: 0.00468,
    dark_sd: 0.00182,
    sigma_t: 0.00636 / 1.0924,
    photons: 5e4,
    lost: 0.002,
};

/// A pixel of known truth: threshold (of its voltage alone), gain and dark current.
#[derive(Clone, Copy)]
pub(crate) struct Pixel {
    pub phi: f64,
    pub gain: f64,
    pub dark: f64,
}

impl Pixel {
    pub(crate) fn a(&self) -> f64 {
        self.gain / self.phi
    }

    pub(crate) fn d(&self) -> f64 {
        self.dark / self.phi
    }
}

pub(crate) fn pixels(noise: &Noise, count: usize, seed: u64) -> Vec<Pixel> {
    let mut random = Random::new(seed);
    let mut pixel = || Pixel {
        phi: 1.0 + noise.threshold_sd * random.normal(),
        gain: 1.0 + noise.gain_sd * random.normal(),
        dark: (noise.dark + noise.dark_sd * random.normal()).max(0.0),
    };
    (0..count).map(|_| pixel()).collect()
}

/// When a pixel fired, in readouts.
pub(crate) struct Trace {
    pub times: Vec<u32>,
}

/// Light on the sensor, and by how much of it it rises while it is recorded.
#[derive(Clone, Copy)]
pub(crate) struct Lit {
    pub light: f64,
    pub rise: f64,
}

impl Lit {
    pub(crate) const fn steady(light: f64) -> Self {
        Self { light, rise: 0.0 }
    }
}

/// One pixel under one light. Between the zone where threshold noise can decide and a
/// spike, charge is added in one step of many readouts: the sum of that many normal draws.
pub(crate) fn run(noise: &Noise, pixel: &Pixel, lit: Lit, readouts: u32, random: &mut Random) -> Trace {
    let light = lit.light;
    let mean_at =
        |t: f64| pixel.gain * light * (1.0 + lit.rise * (t / f64::from(readouts) - 0.5)) + pixel.dark;
    // Photons before the gain; a normal law is exact enough above some hundred of them.
    let sd = if light > 0.0 { pixel.gain * (light / noise.photons).sqrt() } else { 0.0 };
    let reach = pixel.phi - 6.0 * noise.sigma_t;
    let mut charge = random.uniform() * pixel.phi;
    let mut times = Vec::new();
    let mut fired = false;
    let mut t = 0;
    while t < readouts {
        let mean = mean_at(f64::from(t));
        let free = ((reach - charge - 8.0 * sd) / (mean + 8.0 * sd)).floor();
        if free >= 2.0 && !fired {
            let n = free.min(f64::from(readouts - t));
            charge += n * mean_at(f64::from(t) + 0.5 * n) + n.sqrt() * sd * random.normal();
            t += n as u32;
            continue;
        }
        let mut step = mean + sd * random.normal();
        if fired {
            step *= 1.0 - noise.lost;
        }
        charge += step;
        fired = false;
        if charge > reach {
            let theta = pixel.phi + noise.sigma_t * random.normal();
            if charge >= theta {
                charge -= theta;
                fired = true;
                times.push(t);
            }
        }
        t += 1;
    }
    Trace { times }
}

/// Phase variance per spike from spans of a few intervals, by regression on what their variances are made of.
///
/// True spans of `l` intervals vary by `V(l) = l s + q`, where `q` is what the readouts cut off at both ends. About the mean
/// of the same `n` intervals that becomes `s (l - l^2/n) + q (1 + l^2/n^2 - 2l/(nK))`, `K = n - l + 1`. In the dark `q` is
/// five times the 1/6 of a noise-free pixel, as the charge left by a redrawn threshold varies with its
/// noise: forgotten, it would add 1.1 % to `s` of a pixel of 46 intervals.
fn slope(times: &[u32]) -> f64 {
    let n = times.len().saturating_sub(1);
    // A dim pixel's spans of one and two intervals are long enough to lie anywhere between two readouts.
    let spans: &[usize] = if n < 32 { &[1, 2, 4, 8] } else { &[4, 8, 16] };
    let used = spans.iter().filter(|lag| **lag * 2 <= n);
    if n < 4 {
        return f64::NAN;
    }
    let mean = f64::from(times[n] - times[0]) / n as f64;
    let variance = |lag: usize| {
        let spans = times.windows(lag + 1).map(|w| (f64::from(w[lag] - w[0]) - lag as f64 * mean).powi(2));
        spans.sum::<f64>() / (n - lag + 1) as f64
    };
    let (mut ss, mut sq, mut qq, mut sv, mut qv) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for lag in used {
        let (l, n, v) = (*lag as f64, n as f64, variance(*lag));
        let (s, q) = (l - l * l / n, 1.0 + l * l / (n * n) - 2.0 * l / (n * (n - l + 1.0)));
        ss += s * s;
        sq += s * q;
        qq += q * q;
        sv += s * v;
        qv += q * v;
    }
    (sv * qq - qv * sq) / (ss * qq - sq * sq) / (mean * mean)
}

/// When each pixel fired, at one light.
pub(crate) fn traces(noise: &Noise, pixels: &[Pixel], lit: Lit, readouts: u32, seed: u64) -> Vec<Vec<u32>> {
    let trace = |(p, pixel): (usize, &Pixel)| {
        let mut random = Random::new(seed.wrapping_mul(1_000_003).wrapping_add(p as u64));
        run(noise, pixel, lit, readouts, &mut random).times
    };
    pixels.par_iter().enumerate().map(trace).collect()
}

/// What is counted of spikes at a light; intervals are looked at where `dim`.
pub(crate) fn level_of(times: &[Vec<u32>], light: f64, readouts: u32, dim: bool) -> Level {
    let count = times.iter().map(|t| t.len() as u32).collect();
    let ends = |at: fn(&Vec<u32>) -> Option<&u32>| -> Vec<u32> {
        times.iter().map(|t| at(t).copied().unwrap_or(u32::MAX)).collect()
    };
    let (first, last) = (ends(|t| t.first()), ends(|t| t.last()));
    let early: Vec<u32> = times.iter().map(|t| t.partition_point(|t| *t < readouts / 2) as u32).collect();
    let mut level = Level::from_counts(&format!("light {light:.4}"), light, readouts, count, &first, &last)
        .with_first_half(&early);
    if dim {
        let map = times.par_iter().map(|t| slope(t)).collect();
        // The dark alone may have fewer spikes than these spans ask for; there it makes no difference.
        level.noise = Some(spikelane_calibrate::IntervalNoise { map, lags: vec![4, 8, 16] });
    }
    level
}

/// All pixels at one steady light.
pub(crate) fn level(
    noise: &Noise,
    pixels: &[Pixel],
    light: f64,
    readouts: u32,
    seed: u64,
    dim: bool,
) -> Level {
    level_of(&traces(noise, pixels, Lit::steady(light), readouts, seed), light, readouts, dim)
}
