//! One random sensor: its recordings with steady and with changing light, and the comparison with the truth.

use std::fmt::Write as _;

use serde_json::{Value, json};
use spikelane_calibrate::{CalibrateOptions, Calibration, RecordingSet, calibrate, measure_levels};

use crate::calibrate_support::{LightCourse, Noise, Pixel, Random, pixels, traces};
use crate::light::{KINDS, Lamp, READOUT_HZ};

/// The compared quantities.
pub(crate) const QUANTITIES: [&str; 7] = [
    "mean gain",
    "spread of gain",
    "mean dark rate",
    "spread of dark rate",
    "threshold noise",
    "electrons",
    "redraw share",
];

/// Width of the sensors in pixels.
const WIDTH: usize = 48;
/// Height of the sensors in pixels.
const HEIGHT: usize = 32;
/// Number of readouts of a recording.
const READOUTS: u32 = 4000;
/// Stated light of the recordings.
const LEVELS: [f64; 6] = [0.0, 0.03, 0.1, 0.3, 0.6, 0.85];
/// Standard deviation of the light of a lamp from the stated light. `calibrate` assumes the same value.
const LAMP_SD: f64 = 0.01;
/// Electrons per threshold of the nominal circuit. If the dark current draws shot noise, no recording shows this number,
/// and `calibrate` assumes it.
const NOMINAL_ELECTRONS: f64 = 29_851.6;

struct Sensor {
    noise: Noise,
    pixels: Vec<Pixel>,
    lamp: Lamp,
    leak: f64,
    /// True light of each level.
    light: Vec<f64>,
}

impl Sensor {
    fn new(index: u64) -> Self {
        let mut random = Random::new(0x1A3B_0000 + index);
        let kind = index as usize % KINDS.len();
        let lamp = Lamp::new(kind, &mut random);
        let leak = lamp.leak(&mut random);
        let mut between = |low: f64, high: f64| low + (high - low) * random.uniform();
        // A third of the sensors each: noise redrawn at readouts, noise drawn at resets, and a dark current with shot noise.
        let physics = index as usize / KINDS.len() % 3;
        let dark = between(0.003, 0.008);
        let sigma = 5e-4 * 16.0_f64.powf(between(0.0, 1.0));
        let noise = Noise {
            threshold_sd: between(0.005, 0.04),
            gain_sd: between(0.01, 0.05),
            dark,
            dark_sd: dark * between(0.15, 0.3),
            sigma_t: sigma,
            photons: if physics == 2 { NOMINAL_ELECTRONS } else { between(2e4, 6e4) },
            dead_time_fraction: 0.002,
            is_redrawn: physics == 0,
            dark_electrons: if physics == 2 { NOMINAL_ELECTRONS } else { f64::INFINITY },
            false_spikes: 0.0,
        };
        let light = LEVELS.iter().map(|l| l * (1.0 + LAMP_SD * random.normal())).collect();
        Self { noise, pixels: pixels(&noise, WIDTH * HEIGHT, 9_000 + index), lamp, leak, light }
    }

    /// Calibrates the sensor with recordings of its lamp, or of a steady lamp.
    fn calibration(&self, index: u64, is_steady: bool) -> spikelane::error::Result<Calibration> {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let mut set = format!(
            "width = {WIDTH}\nheight = {HEIGHT}\nreadout_hz = {READOUT_HZ:?}\nlayout = \"dat-top\"\n"
        );
        let mut random = Random::new(0x5EED_0000 + index);
        for (k, light) in self.light.iter().enumerate() {
            let sums = self.lamp.sums(READOUTS, &mut random);
            let sums = (!is_steady).then_some(&sums[..]);
            let course = LightCourse { light: light + self.leak, rise: 0.0, sums };
            let times = traces(&self.noise, &self.pixels, course, READOUTS, index * 100 + k as u64);
            let bytes_per_frame = WIDTH * HEIGHT / 8;
            let mut bytes = vec![0_u8; bytes_per_frame * READOUTS as usize];
            for (p, times) in times.iter().enumerate() {
                times.iter().for_each(|t| bytes[bytes_per_frame * *t as usize + p / 8] |= 1 << (p % 8));
            }
            std::fs::write(folder.path().join(format!("level_{k}.dat")), bytes).expect("a recording");
            write!(set, "[[recording]]\nfile = \"level_{k}.dat\"\nlight = {:?}\n", LEVELS[k]).expect("text");
        }
        let path = folder.path().join("set.toml");
        std::fs::write(&path, set).expect("a recording set");
        let observed = measure_levels(&RecordingSet::open(&path)?, &mut |_, _| {})?;
        calibrate(&observed, &CalibrateOptions::default())
    }

    /// Returns the true values in the order of [`QUANTITIES`]. Light that reaches the sensor in all recordings belongs to
    /// the dark rate.
    fn truth(&self) -> [f64; QUANTITIES.len()] {
        let n = &self.noise;
        // `one` and `two` are the means of `1 / phi` and of `1 / phi^2` for a normal threshold `phi` with mean 1.
        let s = n.threshold_sd * n.threshold_sd;
        let (one, two) = (1.0 + s + 3.0 * s * s, 1.0 + 3.0 * s + 15.0 * s * s);
        let spread = |mean: f64, sd: f64| ((mean * mean + sd * sd) * two - (mean * one).powi(2)).sqrt();
        let dark = n.dark + self.leak;
        [
            one,
            spread(1.0, n.gain_sd),
            dark * one,
            spread(dark, n.dark_sd.hypot(self.leak * n.gain_sd)),
            n.sigma_t,
            n.photons,
            if n.is_redrawn { 1.0 } else { 0.0 },
        ]
    }
}

/// Returns, for changing and for steady light, the deviation and the error of each quantity, or the text of an error.
pub(crate) fn assess(index: u64) -> Value {
    let sensor = Sensor::new(index);
    let truth = sensor.truth();
    let of = |is_steady: bool| match sensor.calibration(index, is_steady) {
        Ok(c) => {
            let p = &c.population;
            let electrons = c.photons_at_full_light;
            let found = [p.mean_a, p.sd_a, p.mean_d, p.sd_d, c.sigma_t, electrons, c.redraw_share];
            let entry = |(e, truth): (&spikelane_measure::Estimate, &f64)| match e.error.is_finite() {
                true => json!([e.value - truth, e.error]),
                false => Value::Null,
            };
            json!(found.iter().zip(&truth).map(entry).collect::<Vec<_>>())
        }
        Err(error) => json!(error.to_string()),
    };
    json!({ "changing": of(false), "steady": of(true) })
}
