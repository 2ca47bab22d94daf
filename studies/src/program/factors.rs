//! Factors that differ between laboratories. The level of every factor is drawn independently for each sensor, so the
//! study has no groups of sensors with equal levels.

use spikelane_calibrate::Protocol;

use super::hidden_sensor::{Physics, Scene};
use super::jobs::uniform_hash;

/// The levels of the factors that were drawn for one sensor.
#[derive(Clone, Debug)]
pub(crate) struct Factors {
    pub camera: &'static str,
    pub base_deviation: f64,
    pub lamp_deviation: f64,
    pub protocol: &'static str,
    pub second_set: bool,
    pub camera_file: bool,
    seed: u64,
}

/// Number of readouts of a recording.
const READOUTS: usize = 4000;

const CAMERAS: [&str; 4] = ["published", "40 kHz", "few electrons", "every dark current positive"];
const BASE_DEVIATIONS: [f64; 4] = [0.0, 0.01, 0.03, 0.1];
const LAMP_DEVIATIONS: [f64; 4] = [0.001, 0.003, 0.01, 0.03];
const PROTOCOLS: [&str; 6] = ["eight", "four levels", "flats only", "twelve", "mixed lengths", "additive"];

fn pick<T: Copy>(choices: &[T], u: f64) -> T {
    choices[((u * choices.len() as f64) as usize).min(choices.len() - 1)]
}

impl Factors {
    pub(crate) fn random(seed: u64) -> Self {
        let u = |place: u64| uniform_hash(seed, 500 + place);
        Self {
            camera: pick(&CAMERAS, u(0)),
            base_deviation: pick(&BASE_DEVIATIONS, u(1)),
            lamp_deviation: pick(&LAMP_DEVIATIONS, u(2)),
            protocol: pick(&PROTOCOLS, u(3)),
            second_set: u(4) < 0.5,
            camera_file: u(5) < 0.5,
            seed,
        }
    }

    /// Returns names and levels of the factors. The table is grouped by them.
    pub(crate) fn levels(&self) -> [(&'static str, String); 6] {
        [
            ("camera", self.camera.to_owned()),
            ("base numbers off by", format!("{} %", 100.0 * self.base_deviation)),
            ("lamps off by", format!("{} %", 100.0 * self.lamp_deviation)),
            ("protocol", self.protocol.to_owned()),
            ("second set", self.second_set.to_string()),
            ("camera file", self.camera_file.to_string()),
        ]
    }

    pub(crate) fn readout_hz(&self) -> f64 {
        if self.camera == "40 kHz" { 40_000.0 } else { 20_000.0 }
    }

    /// Returns the parameters of a clean sensor. Each parameter deviates by up to `base_deviation` in either direction.
    pub(crate) fn physics(&self) -> Physics {
        let off = |place: u64| 1.0 + self.base_deviation * (2.0 * uniform_hash(self.seed, 600 + place) - 1.0);
        let default_physics = Physics::default();
        let mut p = Physics {
            electrons: default_physics.electrons * off(0),
            threshold_spread: default_physics.threshold_spread * off(1),
            gain_spread: default_physics.gain_spread * off(2),
            dark_mean: default_physics.dark_mean * off(3),
            dark_spread: default_physics.dark_spread * off(4),
            threshold_noise: default_physics.threshold_noise * off(5),
            ..default_physics
        };
        match self.camera {
            // The time between readouts is half as long as at 20 kHz, so half as much charge is collected.
            "40 kHz" => (p.dark_mean, p.dark_spread) = (0.5 * p.dark_mean, 0.5 * p.dark_spread),
            // The number of electrons per threshold is a tenth of the usual number. The dark current is scaled by the
            // same factor, so the dark rate does not change.
            "few electrons" => {
                p.electrons *= 0.1;
                (p.dark_mean, p.dark_spread) = (0.1 * p.dark_mean, 0.1 * p.dark_spread);
            }
            "every dark current positive" => p.dark_spread = 0.25 * p.dark_mean,
            _ => {}
        }
        p
    }

    /// Returns the recordings of the protocol: name, scene and number of readouts of each.
    pub(crate) fn scenes(&self) -> Vec<(String, Scene, usize)> {
        let flat = |light: f64| (format!("flat_{:04.0}", 1e4 * light), Scene::Flat(light), READOUTS);
        let steps = ("steps".to_owned(), Scene::Square { high: 0.8, low: 0.03, half_period: 500 }, READOUTS);
        let board = ("checker".to_owned(), Scene::Checkerboard { high: 0.8, low: 0.03, cell: 8 }, READOUTS);
        let flats = |lights: &[f64]| lights.iter().map(|l| flat(*l)).collect::<Vec<_>>();
        let default_levels = [0.0, 0.03, 0.1, 0.3, 0.6, 0.9];
        match self.protocol {
            "additive" => {
                let plan = Protocol::additive(READOUTS as u32);
                let flat = |light: &spikelane_calibrate::Stimulus| Scene::Flat(light.level().unwrap());
                plan.recordings.iter().map(|(name, light)| (name.clone(), flat(light), READOUTS)).collect()
            }
            "four levels" => flats(&[0.0, 0.1, 0.3, 0.7]),
            "flats only" => flats(&default_levels),
            "twelve" => {
                let lights = [0.0, 0.03, 0.06, 0.1, 0.2, 0.3, 0.45, 0.6, 0.75, 0.9];
                [flats(&lights), vec![steps, board]].concat()
            }
            "mixed lengths" => {
                let mut all = [flats(&default_levels), vec![steps, board]].concat();
                all[0].2 = 2 * READOUTS;
                all[4].2 = READOUTS / 2;
                all
            }
            _ => [flats(&default_levels), vec![steps, board]].concat(),
        }
    }

    /// Returns the sources of a recording; none if the protocol is not additive.
    pub(crate) fn sources(&self, recording: &str) -> Vec<String> {
        let sources = if self.protocol == "additive" { Protocol::additive(1).sources } else { Vec::new() };
        sources.into_iter().find(|(name, _)| name == recording).map_or_else(Vec::new, |(_, names)| names)
    }

    /// Returns the actual light of the lamp in one recording, divided by the stated light.
    pub(crate) fn lamp_error(&self, recording: usize, take: u64) -> f64 {
        let place = 700 + 50 * take + 2 * recording as u64;
        let (u, v) = (uniform_hash(self.seed, place).max(1e-12), uniform_hash(self.seed, place + 1));
        let normal = (-2.0 * u.ln()).sqrt() * (std::f64::consts::TAU * v).cos();
        1.0 + self.lamp_deviation * normal
    }
}
