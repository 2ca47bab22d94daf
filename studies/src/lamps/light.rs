//! Courses of the light, as one number for each readout.

use std::f64::consts::TAU;

use crate::calibrate_support::Random;

/// The kinds of light. Sensor `i` has the kind `i` modulo the number of kinds.
pub(crate) const KINDS: [&str; 9] = [
    "sine, 100 or 120 Hz",
    "rectified sine, 100 or 120 Hz",
    "pulses, 100 to 1,000 Hz",
    "two sines that beat",
    "linear drift",
    "warm-up",
    "steps",
    "sine and drift",
    "sine, and a light leak in the dark",
];

/// Readouts per second.
pub(crate) const READOUT_HZ: f64 = 20_000.0;

/// Returns a number between `low` and `high` whose logarithm is uniformly distributed.
pub(crate) fn log_uniform(random: &mut Random, low: f64, high: f64) -> f64 {
    low * (high / low).powf(random.uniform())
}

/// The parameters of the light of one sensor.
pub(crate) struct Lamp {
    kind: usize,
    depth: f64,
    second_depth: f64,
    drift: f64,
    hz: f64,
    duty: f64,
}

impl Lamp {
    pub(crate) fn new(kind: usize, random: &mut Random) -> Self {
        let mains = if random.uniform() < 0.5 { 100.0 } else { 120.0 };
        let pulses = log_uniform(random, 100.0, 1000.0);
        let drift = log_uniform(random, 0.002, 0.05);
        Self {
            kind,
            depth: log_uniform(random, 0.002, 0.1),
            second_depth: log_uniform(random, 0.002, 0.1),
            drift: if random.uniform() < 0.5 { drift } else { -drift },
            hz: if KINDS[kind].starts_with("pulses") { pulses } else { mains },
            duty: 0.2 + 0.6 * random.uniform(),
        }
    }

    /// Returns the relative light of each readout of a recording, with the mean 1, as sums: entry `t` is the light before
    /// readout `t`.
    pub(crate) fn sums(&self, readouts: u32, random: &mut Random) -> Vec<f64> {
        let start = random.uniform();
        let steps: Vec<f64> = (0..3).map(|_| random.uniform()).collect();
        let sine = |t: f64, hz: f64| (TAU * (hz * t / READOUT_HZ + start)).sin();
        let light = |t: u32| {
            let (t, share) = (f64::from(t), f64::from(t) / f64::from(readouts));
            match KINDS[self.kind] {
                k if k.starts_with("rectified") => {
                    1.0 + self.depth * (1.57 * sine(t, 0.5 * self.hz).abs() - 1.0)
                }
                k if k.starts_with("pulses") => {
                    let is_on = (self.hz * t / READOUT_HZ + start).fract() < self.duty;
                    1.0 + if is_on { self.depth } else { -self.depth }
                }
                k if k.starts_with("two sines") => {
                    1.0 + self.depth * sine(t, self.hz) + self.second_depth * sine(t, self.hz * 1.063)
                }
                "linear drift" => 1.0 + self.drift * share,
                "warm-up" => 1.0 + self.drift * (1.0 - (-5.0 * share).exp()),
                "steps" => {
                    let passed = steps.iter().enumerate().filter(|(_, at)| **at < share);
                    1.0 + passed.map(|(i, _)| if i == 1 { -self.drift } else { self.drift }).sum::<f64>()
                }
                "sine and drift" => (1.0 + self.depth * sine(t, self.hz)) * (1.0 + self.drift * share),
                _ => 1.0 + self.depth * sine(t, self.hz),
            }
        };
        let all: Vec<f64> = (0..readouts).map(light).collect();
        let mean = all.iter().sum::<f64>() / f64::from(readouts);
        let mut sum = 0.0;
        let mut sums = vec![0.0];
        sums.extend(all.iter().map(|l| {
            sum += l / mean;
            sum
        }));
        sums
    }

    /// Returns the light that reaches the sensor in all recordings, relative to saturation.
    pub(crate) fn leak(&self, random: &mut Random) -> f64 {
        if KINDS[self.kind].ends_with("in the dark") { log_uniform(random, 1e-4, 3e-3) } else { 0.0 }
    }
}
