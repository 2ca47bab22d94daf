//! Shared code of the physics tests. It contains the exact law with an independent random generator, streams as lists
//! of spike times, and statistics for comparing the plan with the law.
#![allow(dead_code, reason = "every test file uses its own part")]

use rand_distr::{Distribution, Poisson, StandardNormal};
use rand_pcg::Pcg64;
use rand_pcg::rand_core::{Rng, SeedableRng};
use spikelane::FrameRef;
use spikelane::effects::{Camera, Model};
use spikelane::pixel::{Law, NoiseSource};
use spikelane::{Geometry, Plan, Seeds, Sensor, Simulator};

/// Random draws for the exact law. They use no code of this crate.
pub(crate) struct IndependentNoise {
    rng: Pcg64,
    /// The mean and the distribution of the last Poisson draw. The distribution is stored because creating it is slower
    /// than a draw. Under constant light the next draw uses it again.
    poisson: (f64, Option<Poisson<f64>>),
}

impl IndependentNoise {
    pub(crate) fn new(seed: u64) -> Self {
        Self { rng: Pcg64::seed_from_u64(seed), poisson: (f64::NAN, None) }
    }
}

impl NoiseSource for IndependentNoise {
    fn normal(&mut self) -> f64 {
        StandardNormal.sample(&mut self.rng)
    }

    fn poisson(&mut self, mean: f64) -> f64 {
        if self.poisson.0 != mean {
            self.poisson = (mean, Poisson::new(mean).ok());
        }
        self.poisson.1.map_or(0.0, |p| p.sample(&mut self.rng))
    }

    fn uniform(&mut self) -> f64 {
        (self.rng.next_u64() >> 11) as f64 / (1u64 << 53) as f64
    }
}

/// Spike times of every pixel, in readouts.
pub(crate) struct SpikeTimes {
    pub readouts: usize,
    pub pixels: Vec<Vec<u32>>,
}

/// Returns a sensor with the circuit of the presets.
pub(crate) fn sensor(width: u32, height: u32) -> Sensor {
    Sensor::new(width, height, 20_000.0).unwrap()
}

/// Returns `camera` with a sensor of `width` x `height` pixels.
pub(crate) fn with_size(mut camera: Camera, width: u32, height: u32) -> Camera {
    camera.sensor.geometry = Geometry::new(width, height).unwrap();
    camera
}

pub(crate) fn preset(name: &str, width: u32, height: u32) -> Camera {
    with_size(spikelane::presets::builtin(name).unwrap(), width, height)
}

pub(crate) fn seeds(shot: u64) -> Seeds {
    Seeds { camera: 5, shot, sequence: 0 }
}

/// Simulates every pixel with the exact law under constant `light` in full scales. The first `warm` readouts are
/// discarded.
pub(crate) fn oracle(model: &Model, light: &[f32], warm: usize, readouts: usize, seed: u64) -> SpikeTimes {
    let pixels = (0..model.circuit.pixels()).map(|p| {
        let mut noise = IndependentNoise::new(seed.wrapping_mul(1_000_003).wrapping_add(p as u64));
        oracle_pixel(model, &model.law(p), f64::from(light[p]), warm, readouts, &mut noise)
    });
    SpikeTimes { readouts, pixels: pixels.collect() }
}

fn oracle_pixel(
    model: &Model,
    law: &Law,
    light: f64,
    warm: usize,
    readouts: usize,
    noise: &mut IndependentNoise,
) -> Vec<u32> {
    let (first, second) = (noise.uniform(), noise.uniform());
    let mut state = law.initial_state(model.start_charge(law.threshold, first, second), noise);
    for _ in 0..warm {
        law.step(&mut state, light, noise);
    }
    let mut times = Vec::new();
    for t in 0..readouts {
        if law.step(&mut state, light, noise) {
            times.push(t as u32);
        }
    }
    times
}

/// Simulates `camera` with its plan on the fastest backend. The other arguments have the same meaning as in [`oracle`].
pub(crate) fn simulate_times(
    camera: &Camera,
    seeds: Seeds,
    light: &[f32],
    warm: usize,
    readouts: usize,
) -> SpikeTimes {
    let bytes = simulate_packed(camera, seeds, light, warm + readouts);
    let frame = camera.sensor.geometry.frame_bytes();
    unpack(&bytes[warm * frame..], camera.sensor.geometry)
}

/// Returns the packed stream that the plan of `camera` produces.
pub(crate) fn simulate_packed(camera: &Camera, seeds: Seeds, light: &[f32], readouts: usize) -> Vec<u8> {
    let max_light = light.iter().fold(1.0f32, |a, &b| a.max(b));
    let plan = Plan::with_max_light(camera, seeds, f64::from(max_light)).unwrap();
    let mut bytes = vec![0; readouts * camera.sensor.geometry.frame_bytes()];
    let mut simulator = Simulator::from_plan(plan);
    simulator.fill(FrameRef::new(light), &mut bytes).unwrap();
    bytes
}

pub(crate) fn unpack(bytes: &[u8], geometry: Geometry) -> SpikeTimes {
    let mut pixels = vec![Vec::new(); geometry.pixels()];
    let frames = bytes.chunks_exact(geometry.frame_bytes());
    let readouts = frames.len();
    for (t, frame) in frames.enumerate() {
        for (i, &byte) in frame.iter().enumerate() {
            let mut rest = byte;
            while rest != 0 {
                pixels[8 * i + rest.trailing_zeros() as usize].push(t as u32);
                rest &= rest - 1;
            }
        }
    }
    SpikeTimes { readouts, pixels }
}

/// A mean of the values of all pixels, and its standard error. The standard error is computed from the scatter between
/// pixels.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Estimate {
    pub mean: f64,
    pub error: f64,
    pub pixels: usize,
}

impl Estimate {
    pub(crate) fn from_values(values: impl Iterator<Item = f64>) -> Self {
        let values: Vec<f64> = values.collect();
        let n = values.len() as f64;
        let mean = values.iter().sum::<f64>() / n;
        let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0).max(1.0);
        Self { mean, error: (variance / n).sqrt(), pixels: values.len() }
    }

    /// Returns the difference divided by the joint standard error. The divisor is at least `floor`.
    pub(crate) fn sigmas(self, other: Self, floor: f64) -> f64 {
        (self.mean - other.mean) / self.error.hypot(other.error).max(floor)
    }
}

impl std::fmt::Display for Estimate {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:.6} +- {:.6}", self.mean, self.error)
    }
}

impl SpikeTimes {
    /// Returns the spikes per readout of every pixel.
    pub(crate) fn rates(&self) -> impl Iterator<Item = f64> + '_ {
        self.pixels.iter().map(|t| t.len() as f64 / self.readouts as f64)
    }

    pub(crate) fn rate(&self) -> Estimate {
        Estimate::from_values(self.rates())
    }

    /// Returns the standard deviation of the pixels' rates, divided by the mean rate.
    pub(crate) fn spread(&self) -> f64 {
        let rate = self.rate();
        rate.error * (rate.pixels as f64).sqrt() / rate.mean
    }

    /// Returns `D(n)`. The value of a pixel is the mean square of `t[k+n] - t[k] - n m`, where `t[k]` is the time of
    /// spike `k`. `D(n)` is the mean of the values of all pixels.
    ///
    /// `m` is the mean interval of the pixel: the duration from its first to its last spike, divided by the number of
    /// intervals. Pixels with at most `1.5 n` spikes are excluded.
    pub(crate) fn interval_sum_variance(&self, n: usize) -> Estimate {
        Estimate::from_values(self.pixels.iter().filter(|t| 2 * t.len() > 3 * n && t.len() > n + 1).map(
            |t| {
                let mean = mean_interval(t);
                let square = |(a, b): (&u32, &u32)| (f64::from(b - a) - n as f64 * mean).powi(2);
                t.iter().zip(&t[n..]).map(square).sum::<f64>() / (t.len() - n) as f64
            },
        ))
    }

    /// Returns the share of outliers. An outlier is an interval that is neither the floor nor the ceiling of its pixel's
    /// mean interval.
    pub(crate) fn outliers(&self) -> f64 {
        let (mut outside, mut all) = (0, 0);
        for t in self.pixels.iter().filter(|t| t.len() > 1) {
            let mean = mean_interval(t);
            let beyond = |w: &&[u32]| {
                let interval = f64::from(w[1] - w[0]);
                interval < mean.floor() || interval > mean.ceil()
            };
            outside += t.windows(2).filter(beyond).count();
            all += t.len() - 1;
        }
        f64::from(outside as u32) / f64::from(all as u32)
    }
}

pub(crate) fn mean_interval(times: &[u32]) -> f64 {
    f64::from(times[times.len() - 1] - times[0]) / (times.len() - 1) as f64
}

/// Returns one light value per pixel. The values are Gaussian with the mean `mean` and the relative standard deviation
/// `spread`.
pub(crate) fn spread_light(mean: f64, spread: f64, pixels: usize, seed: u64) -> Vec<f32> {
    let mut noise = IndependentNoise::new(seed);
    (0..pixels).map(|_| (mean * (1.0 + spread * noise.normal())).max(0.0) as f32).collect()
}

/// Returns the correlation coefficient of two series.
pub(crate) fn correlation(a: &[f64], b: &[f64]) -> f64 {
    let n = a.len() as f64;
    let (ma, mb) = (a.iter().sum::<f64>() / n, b.iter().sum::<f64>() / n);
    let dot = |x: &[f64], mx: f64, y: &[f64], my: f64| -> f64 {
        x.iter().zip(y).map(|(x, y)| (x - mx) * (y - my)).sum()
    };
    dot(a, ma, b, mb) / (dot(a, ma, a, ma) * dot(b, mb, b, mb)).sqrt()
}

/// Returns the stored charge of every pixel in the pixel's own thresholds, read from the saved state.
pub(crate) fn charges(plan: &Plan, state: &spikelane::unstable::plan::SimulatorState) -> Vec<f64> {
    let bytes = state.to_bytes();
    let word = |i: usize| i16::from_le_bytes([bytes[64 + 2 * i], bytes[65 + 2 * i]]);
    let padded = plan.padded_pixels();
    (0..plan.geometry().pixels())
        .map(|p| {
            let threshold = f64::from(plan.tables().threshold[p]);
            let fraction = f64::from(word(padded + p) as u16 ^ 0x8000) / 65_536.0;
            (f64::from(word(p)) + threshold + fraction) / threshold
        })
        .collect()
}

/// Returns an ideal camera with `effects`. Each entry contains the name of an effect, and the keys and values of
/// parameters.
pub(crate) fn camera_with(width: u32, height: u32, effects: &[(&str, &[(&str, f64)])]) -> Camera {
    effects.iter().fold(Camera::ideal(sensor(width, height)), |camera, (name, values)| {
        let effect = spikelane::effects::find(name).unwrap().neutral();
        camera.with_effect(values.iter().fold(effect, |e, (key, v)| e.with_value(key, *v).unwrap()))
    })
}
