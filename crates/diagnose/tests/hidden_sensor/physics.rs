//! The parameters of a hidden sensor, and the per-pixel maps that are drawn with these parameters.

use rand::rngs::Xoshiro256PlusPlus as Generator;
use rand::{Rng, RngExt, SeedableRng};
use rand_distr::StandardNormal;

/// All parameters of a sensor. The names of the fields are the names of the effects.
#[derive(Clone, Debug)]
pub struct Physics {
    // Parameters of the published model.
    pub electrons: f64,
    pub threshold_spread: f64,
    pub gain_spread: f64,
    pub dark_mean: f64,
    pub dark_spread: f64,
    pub threshold_noise: f64,
    pub dead_time: f64,
    // Effects of the catalog.
    pub quadratic: f64,
    pub lost_remainder: f64,
    pub leak: f64,
    pub dark_shot: f64,
    pub comparator: f64,
    /// Time constant, in readouts, with which a deviation of the quanta from their mean arrives in the pixel.
    pub settle: f64,
    /// Largest width in thresholds, center row of the band, and number of rows of the band.
    pub jitter: (f64, f64, f64),
    pub slow: (f64, f64),
    pub adaptation: (f64, f64),
    pub telegraph: (f64, f64, f64),
    pub hot: (f64, f64),
    pub dead: f64,
    pub column_sigma: f64,
    pub row_sigma: f64,
    pub smooth: (f64, f64),
    pub vignetting: f64,
    pub row_noise: f64,
    pub flicker: (f64, f64, f64),
    pub drift: f64,
    pub lag: (f64, f64),
    pub crosstalk: f64,
    pub coupling: f64,
    pub droop: f64,
    pub missed: f64,
    pub spurious: f64,
    pub dropped: f64,
    pub repeated: f64,
    pub clamp: f64,
    pub dark_log_sigma: f64,
    pub gain_dark: f64,
    pub edge: f64,
    // Effects outside of the catalog.
    pub parity: f64,
    pub burst: (f64, f64),
    pub wake: (f64, f64),
    pub banding: (f64, f64),
    pub stuck_row: Option<(usize, f64)>,
    pub dark_memory: (f64, f64),
    pub noisy: (f64, f64),
    pub after_pulse: f64,
}

impl Default for Physics {
    /// Returns the published model: capacitance 4.348 fF, swing 1.0924 V, threshold noise 6.36 mV, dark current
    /// 0.4442 pA, period 50 us.
    fn default() -> Self {
        let electron_fc = 1.602_176_634e-4;
        let electrons = 4.348 * 1.0924 / electron_fc;
        let of_pa = |pa: f64| pa * 0.05 / electron_fc;
        Self {
            electrons,
            threshold_spread: (0.0497 / 1.0924f64).hypot(0.0128 / 4.348),
            gain_spread: 0.0584 / 1.0128,
            dark_mean: of_pa(0.4442),
            dark_spread: of_pa(0.1731),
            threshold_noise: 6.36e-3 / 1.0924,
            dead_time: 0.002,
            quadratic: 0.0,
            lost_remainder: 0.0,
            leak: 0.0,
            dark_shot: 0.0,
            comparator: 0.0,
            settle: 0.0,
            jitter: (0.0, 0.0, 1.0),
            slow: (0.0, 1.0),
            adaptation: (0.0, 0.0),
            telegraph: (0.0, 0.0, 0.0),
            hot: (0.0, 1.0),
            dead: 0.0,
            column_sigma: 0.0,
            row_sigma: 0.0,
            smooth: (0.0, 1.0),
            vignetting: 0.0,
            row_noise: 0.0,
            flicker: (0.0, 0.0, 0.0),
            drift: 0.0,
            lag: (0.0, 1.0),
            crosstalk: 0.0,
            coupling: 0.0,
            droop: 0.0,
            missed: 0.0,
            spurious: 0.0,
            dropped: 0.0,
            repeated: 0.0,
            clamp: f64::INFINITY,
            dark_log_sigma: 0.0,
            gain_dark: 0.0,
            edge: 1.0,
            parity: 0.0,
            burst: (0.0, 0.0),
            wake: (0.0, 1.0),
            banding: (0.0, 1.0),
            stuck_row: None,
            dark_memory: (0.0, 1.0),
            noisy: (0.0, 1.0),
            after_pulse: 0.0,
        }
    }
}

/// A sensor and its maps. Row 0 is the top row. Thresholds and dark currents are in electrons.
#[derive(Clone, Debug)]
pub struct Sensor {
    pub physics: Physics,
    pub width: usize,
    pub height: usize,
    pub seed: u64,
    pub threshold: Vec<f64>,
    pub gain: Vec<f64>,
    pub dark: Vec<f64>,
    /// Threshold noise of each pixel, divided by the nominal threshold noise.
    pub noise: Vec<f64>,
    /// Whether the dark current of each pixel switches.
    pub switching: Vec<bool>,
}

/// Returns a generator for one purpose. Because of the separate generators, a new effect does not change the random
/// numbers of other effects.
pub fn generator(seed: u64, purpose: &str, number: u64) -> Generator {
    let mut mixed = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ number.wrapping_mul(0xD1B5_4A32_D192_ED03);
    for byte in purpose.bytes() {
        mixed = (mixed ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01B3);
    }
    Generator::seed_from_u64(mixed)
}

pub fn normal(rng: &mut impl Rng) -> f64 {
    rng.sample(StandardNormal)
}

impl Sensor {
    pub fn new(physics: Physics, width: usize, height: usize, seed: u64) -> Self {
        let n = width * height;
        let normals = |what: &str, count: usize| -> Vec<f64> {
            let mut rng = generator(seed, what, 0);
            (0..count).map(|_| normal(&mut rng)).collect()
        };
        let uniforms = |what: &str| -> Vec<f64> {
            let mut rng = generator(seed, what, 0);
            (0..n).map(|_| rng.random::<f64>()).collect()
        };
        let p = &physics;
        let (columns, rows) = (normals("columns", width), normals("rows", height));
        let smooth = smooth_field(&normals("smooth", n), width, p.smooth.1);
        let (z_threshold, z_gain, z_dark, z_tail) =
            (normals("threshold", n), normals("gain", n), normals("dark", n), normals("tail", n));
        let (hot, dead, noisy, switching) =
            (uniforms("hot"), uniforms("dead"), uniforms("noisy"), uniforms("switching"));
        let mut sensor = Self {
            width,
            height,
            seed,
            threshold: vec![0.0; n],
            gain: vec![0.0; n],
            dark: vec![0.0; n],
            noise: vec![1.0; n],
            switching: switching.iter().map(|u| *u < p.telegraph.1).collect(),
            physics: physics.clone(),
        };
        let radius = |row: usize, col: usize| {
            let (y, x) = (row as f64 - (height as f64 - 1.0) / 2.0, col as f64 - (width as f64 - 1.0) / 2.0);
            (y * y + x * x) / ((height as f64 - 1.0).powi(2) + (width as f64 - 1.0).powi(2)) * 4.0
        };
        for i in 0..n {
            let (row, col) = (i / width, i % width);
            let lines = 1.0 + p.column_sigma * columns[col] + p.row_sigma * rows[row];
            let band = p.banding.0 * (std::f64::consts::TAU * (row + col) as f64 / p.banding.1).sin();
            sensor.threshold[i] =
                p.electrons * (1.0 + p.threshold_spread * z_threshold[i]) * lines * (1.0 + band);
            let border = row == 0 || col == 0 || row == height - 1 || col == width - 1;
            let falloff = 1.0 - p.vignetting * radius(row, col);
            let edge = if border { p.edge } else { 1.0 };
            sensor.gain[i] =
                (1.0 + p.gain_spread * z_gain[i]) * (1.0 + p.smooth.0 * smooth[i]) * falloff * edge;
            let z = p.gain_dark * z_gain[i] + (1.0 - p.gain_dark * p.gain_dark).sqrt() * z_dark[i];
            let tail = (p.dark_log_sigma * z_tail[i] - p.dark_log_sigma.powi(2) / 2.0).exp();
            sensor.dark[i] = (p.dark_mean + p.dark_spread * z).max(0.0) * tail;
            if hot[i] < p.hot.0 {
                sensor.dark[i] += (p.hot.1 - 1.0) * p.dark_mean;
            }
            if dead[i] < p.dead {
                (sensor.gain[i], sensor.dark[i]) = (0.0, 0.0);
            }
            if noisy[i] < p.noisy.0 {
                sensor.noise[i] = p.noisy.1;
            }
        }
        sensor
    }
}

/// Filters white noise with a Gaussian and scales the result to variance 1. `length` is the standard deviation of the
/// Gaussian in pixels. The Gaussian is cut off at three standard deviations.
fn smooth_field(white: &[f64], width: usize, length: f64) -> Vec<f64> {
    let height = white.len() / width;
    let reach = (3.0 * length).ceil() as isize;
    let weight = |d: isize| (-0.5 * (d as f64 / length).powi(2)).exp();
    let of_pixel = |i: usize| {
        let (row, col) = ((i / width) as isize, (i % width) as isize);
        let (mut sum, mut square) = (0.0, 0.0);
        for r in (row - reach).max(0)..=(row + reach).min(height as isize - 1) {
            for c in (col - reach).max(0)..=(col + reach).min(width as isize - 1) {
                let w = weight(r - row) * weight(c - col);
                sum += w * white[r as usize * width + c as usize];
                square += w * w;
            }
        }
        sum / square.sqrt()
    };
    (0..white.len()).map(of_pixel).collect()
}
