//! Simulates cameras with known parameters, pixel by pixel in f64. From the library, this module uses only the types of
//! the results.
#![allow(dead_code, reason = "each test takes what it needs")]

pub(crate) mod score;

use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Dxsm;
use rand_pcg::rand_core::{Rng, SeedableRng};
use rayon::prelude::*;
use spikelane_calibrate::LightLevel;

/// A generator of random numbers that the library does not use. Normal draws come from another crate.
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

/// The published noise. Thresholds are divided by the nominal threshold, and light by the light that saturates.
#[derive(Clone, Copy)]
pub(crate) struct Noise {
    pub threshold_sd: f64,
    pub gain_sd: f64,
    pub dark: f64,
    pub dark_sd: f64,
    pub sigma_t: f64,
    pub photons: f64,
    pub dead_time_fraction: f64,
    /// Whether threshold noise is drawn at every readout. Otherwise it is drawn at every reset.
    pub is_redrawn: bool,
    /// Electrons of the dark current per threshold. Infinite for a dark current without shot noise.
    pub dark_electrons: f64,
    /// Probability that a silent readout contains a false spike.
    pub false_spikes: f64,
}

pub(crate) const PUBLISHED_NOISE: Noise = Noise {
    threshold_sd: 0.0497 / 1.0924,
    gain_sd: 0.0577,
    dark: 0.00468,
    dark_sd: 0.00182,
    sigma_t: 0.00636 / 1.0924,
    photons: 5e4,
    dead_time_fraction: 0.002,
    is_redrawn: true,
    dark_electrons: f64::INFINITY,
    false_spikes: 0.0,
};

/// A pixel with known parameters. `phi` and `gain` are divided by their nominal values. `dark` is the dark current in
/// nominal thresholds per readout. Only the voltage of the threshold differs from the nominal pixel.
#[derive(Clone, Copy)]
pub(crate) struct Pixel {
    pub phi: f64,
    pub gain: f64,
    pub dark: f64,
    /// Relative light on the pixel.
    pub light: f64,
    /// Relative amplitude of the telegraph noise of the dark current. The mean duration of a state is [`BLINK_READOUTS`].
    pub blink: f64,
}

/// Mean duration of a state of a blinking pixel, in readouts.
const BLINK_READOUTS: f64 = 300.0;

impl Pixel {
    pub(crate) fn a(&self) -> f64 {
        self.gain * self.light / self.phi
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
        light: 1.0,
        blink: 0.0,
    };
    (0..count).map(|_| pixel()).collect()
}

/// Spike times of a pixel in readouts.
pub(crate) struct SpikeTrace {
    pub times: Vec<u32>,
}

/// Mean light on the sensor, and its changes during the recording.
#[derive(Clone, Copy)]
pub(crate) struct LightCourse<'a> {
    pub light: f64,
    /// Relative linear rise.
    pub rise: f64,
    /// Sum of the relative light of all readouts before each readout, and of all readouts. The mean of the relative light is 1.
    /// `None` for constant light.
    pub sums: Option<&'a [f64]>,
}

impl LightCourse<'_> {
    pub(crate) const fn constant(light: f64) -> Self {
        Self { light, rise: 0.0, sums: None }
    }

    /// Returns the light of `n` readouts from readout `t`.
    fn sum(&self, t: u32, n: f64, readouts: u32) -> f64 {
        match self.sums {
            Some(sums) => self.light * (sums[t as usize + n as usize] - sums[t as usize]),
            None => {
                n * self.light * (1.0 + self.rise * ((f64::from(t) + 0.5 * n) / f64::from(readouts) - 0.5))
            }
        }
    }
}

/// Simulates one pixel in the light `lit`.
///
/// While the charge is too far from the threshold for noise to cause a spike, the charge of many readouts is added in one
/// step. This charge is the sum of as many normal draws.
pub(crate) fn simulate_pixel(
    noise: &Noise,
    pixel: &Pixel,
    lit: LightCourse<'_>,
    readouts: u32,
    random: &mut Random,
) -> SpikeTrace {
    let light = lit.light * pixel.light;
    let charge_of = |t: u32, n: f64, dark: f64| pixel.gain * pixel.light * lit.sum(t, n, readouts) + n * dark;
    // Photons are counted before the gain is applied. For more than about a hundred photons, a normal distribution is exact
    // enough.
    let sd = (pixel.gain * (light / noise.photons).sqrt()).hypot((pixel.dark / noise.dark_electrons).sqrt());
    let peak = lit.sums.map_or(1.0, |sums| sums.windows(2).map(|w| w[1] - w[0]).fold(1.0, f64::max));
    let reach = pixel.phi - 6.0 * noise.sigma_t;
    let mut charge = random.uniform() * pixel.phi;
    let mut times = Vec::new();
    let mut fired = false;
    let mut t = 0;
    // A blinking pixel has a dark current above or below its mean until `switch`.
    let duration = |random: &mut Random| {
        if pixel.blink > 0.0 {
            1 + (-BLINK_READOUTS * (1.0 - random.uniform()).ln()) as u32
        } else {
            readouts
        }
    };
    let mut dark = pixel.dark * (1.0 + pixel.blink);
    let mut switch = duration(random);
    let draw_threshold = |random: &mut Random| pixel.phi + noise.sigma_t * random.normal();
    let mut theta = if noise.is_redrawn { pixel.phi } else { draw_threshold(random) };
    while t < readouts {
        if t >= switch {
            dark = 2.0 * pixel.dark - dark;
            switch = t + duration(random);
        }
        let mean = charge_of(t, 1.0, dark);
        let most = if lit.sums.is_some() { pixel.gain * light * peak + dark } else { mean };
        let free = ((reach - charge - 8.0 * sd) / (most + 8.0 * sd)).floor();
        if free >= 2.0 && !fired {
            let n = free.min(f64::from(readouts.min(switch) - t));
            charge += charge_of(t, n, dark) + n.sqrt() * sd * random.normal();
            t += n as u32;
            continue;
        }
        let mut step = mean + sd * random.normal();
        if fired {
            step *= 1.0 - noise.dead_time_fraction;
        }
        charge += step;
        fired = false;
        if charge > reach {
            if noise.is_redrawn {
                theta = draw_threshold(random);
            }
            if charge >= theta {
                charge -= theta;
                fired = true;
                times.push(t);
                if !noise.is_redrawn {
                    theta = draw_threshold(random);
                }
            }
        }
        t += 1;
    }
    add_false_spikes(noise.false_spikes, readouts, &mut times, random);
    SpikeTrace { times }
}

/// Adds a spike to each silent readout with the given probability.
fn add_false_spikes(probability: f64, readouts: u32, times: &mut Vec<u32>, random: &mut Random) {
    if probability == 0.0 {
        return;
    }
    let mut at = 0.0;
    loop {
        // The distance to the next false spike is geometric.
        at += 1.0 + ((1.0 - random.uniform()).ln() / (1.0 - probability).ln()).floor();
        if at > f64::from(readouts) {
            break;
        }
        times.push(at as u32 - 1);
    }
    times.sort_unstable();
    times.dedup();
}

/// Returns the phase variance per spike and the variance of the ends of a span. They are computed from spans of a few intervals, by regression of the variances of
/// the spans.
///
/// The length of `l` successive intervals has the variance `V(l) = l s + q` in readouts squared. `s` is the phase variance
/// per spike times the squared mean interval. `q` is the contribution of rounding both ends to readouts. If the mean is
/// estimated from all `n` intervals, the expected mean square deviation of the `K = n - l + 1` lengths is
/// `s (l - l^2/n) + q (1 + l^2/n^2 - 2l/(nK))`. The first result is `s` divided by the squared mean interval. The second
/// result is the end variance: the value of `q` that the spans of one interval have for this `s`, in readouts squared.
///
/// For a pixel without noise `q` is 1/6. In the dark `q` is five times as large, because the charge after a spike varies
/// with the redrawn threshold. If `q` were neglected, `s` of a pixel with 46 intervals would be too high by 1.1 %.
fn phase_variance(times: &[u32]) -> [f64; 2] {
    let n = times.len().saturating_sub(1);
    // In a dim pixel, even spans of one and two intervals are long enough to end at any phase between two readouts.
    let spans: &[usize] = if n < 32 { &[1, 2, 4, 8] } else { &[4, 8, 16] };
    let used = spans.iter().filter(|lag| **lag * 2 <= n);
    if n < 4 {
        return [f64::NAN; 2];
    }
    let mean = f64::from(times[n] - times[0]) / n as f64;
    // A false spike divides an interval, and a missed spike doubles it.
    let is_regular = |w: &[u32]| (0.6 * mean..1.4 * mean).contains(&f64::from(w[1] - w[0]));
    if !times.windows(2).all(is_regular) {
        return [f64::NAN; 2];
    }
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
    let s = (sv * qq - qv * sq) / (ss * qq - sq * sq);
    let n = n as f64;
    [s / (mean * mean), (variance(1) - s * (1.0 - 1.0 / n)) / (1.0 - 1.0 / (n * n))]
}

/// Returns the spike times of each pixel in the light `lit`.
pub(crate) fn traces(
    noise: &Noise,
    pixels: &[Pixel],
    lit: LightCourse<'_>,
    readouts: u32,
    seed: u64,
) -> Vec<Vec<u32>> {
    let trace = |(p, pixel): (usize, &Pixel)| {
        let mut random = Random::new(seed.wrapping_mul(1_000_003).wrapping_add(p as u64));
        simulate_pixel(noise, pixel, lit, readouts, &mut random).times
    };
    pixels.par_iter().enumerate().map(trace).collect()
}

/// Creates a level from the spike times of each pixel. If `dim` is true, the level includes interval noise.
pub(crate) fn level_from_times(times: &[Vec<u32>], light: f64, readouts: u32, dim: bool) -> LightLevel {
    let count = times.iter().map(|t| t.len() as u32).collect();
    let ends = |at: fn(&Vec<u32>) -> Option<&u32>| -> Vec<u32> {
        times.iter().map(|t| at(t).copied().unwrap_or(u32::MAX)).collect()
    };
    let (first, last) = (ends(|t| t.first()), ends(|t| t.last()));
    let early: Vec<u32> = times.iter().map(|t| t.partition_point(|t| *t < readouts / 2) as u32).collect();
    let mut level =
        LightLevel::from_counts(&format!("light {light:.4}"), light, readouts, count, &first, &last)
            .with_first_half(&early);
    if dim {
        let both: Vec<[f64; 2]> = times.par_iter().map(|t| phase_variance(t)).collect();
        let map = |i: usize| both.iter().map(|values| values[i]).collect();
        // Only dark levels can have too few spikes for lags of up to 16 intervals. In the dark the choice of lags makes
        // no difference.
        level.interval_noise = Some(spikelane_calibrate::IntervalNoise {
            map: map(0),
            end_variance: map(1),
            lags: vec![4, 8, 16],
        });
    }
    level
}

/// Simulates and measures all pixels in constant light.
pub(crate) fn level(
    noise: &Noise,
    pixels: &[Pixel],
    light: f64,
    readouts: u32,
    seed: u64,
    dim: bool,
) -> LightLevel {
    level_from_times(
        &traces(noise, pixels, LightCourse::constant(light), readouts, seed),
        light,
        readouts,
        dim,
    )
}
