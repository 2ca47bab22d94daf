//! A simulated spike camera that shares no code with the library. Tests of diagnoses use it as the truth.
//!
//! The module imports nothing from `spikelane`. Charge is counted in electrons. The state of a pixel is the charge that is
//! *missing* to the threshold. Each readout first adds its charge and then compares. The generator is xoshiro256++. Every
//! effect is implemented again from the table of the catalog. The library precomputes tables of integers, but this
//! simulator computes each pixel in `f64`.

#![allow(dead_code, unused_imports, reason = "each test and the study use a part of it")]

mod kinds;
mod physics;
mod run;

pub use kinds::{CATALOG_KINDS, Kind, OUTSIDE_KINDS, kind};
pub use physics::{Physics, Sensor};

use std::fmt::Write as _;
use std::path::Path;

/// Readouts per second of every hidden sensor.
pub const READOUT_HZ: f64 = 20_000.0;

/// The light in front of the sensor. Light 1 is the light that saturates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Scene {
    Flat(f64),
    Square { high: f64, low: f64, half_period: usize },
    Checkerboard { high: f64, low: f64, cell: usize },
}

impl Scene {
    pub fn at(self, row: usize, col: usize, t: usize) -> f64 {
        match self {
            Self::Flat(light) => light,
            Self::Square { high, low, half_period } => {
                if t % (2 * half_period) < half_period {
                    high
                } else {
                    low
                }
            }
            Self::Checkerboard { high, low, cell } => {
                if (row / cell) % 2 == (col / cell) % 2 {
                    high
                } else {
                    low
                }
            }
        }
    }

    /// Returns this scene with every level multiplied by `factor`.
    pub fn scale(self, factor: f64) -> Self {
        match self {
            Self::Flat(level) => Self::Flat(level * factor),
            Self::Square { high, low, half_period } => {
                Self::Square { high: high * factor, low: low * factor, half_period }
            }
            Self::Checkerboard { high, low, cell } => {
                Self::Checkerboard { high: high * factor, low: low * factor, cell }
            }
        }
    }

    /// Returns the light as `recordings.toml` states it.
    pub fn toml(self) -> String {
        match self {
            Self::Flat(light) => format!("{light:?}"),
            Self::Square { high, low, half_period } => {
                format!(
                    "{{ kind = \"square\", high = {high:?}, low = {low:?}, half_period = {half_period} }}"
                )
            }
            Self::Checkerboard { high, low, cell } => {
                format!("{{ kind = \"checkerboard\", high = {high:?}, low = {low:?}, cell = {cell} }}")
            }
        }
    }
}

/// The eight recordings of the study.
pub const SCENES: [(&str, Scene); 8] = [
    ("dark", Scene::Flat(0.0)),
    ("flat_03", Scene::Flat(0.03)),
    ("flat_10", Scene::Flat(0.1)),
    ("flat_30", Scene::Flat(0.3)),
    ("flat_60", Scene::Flat(0.6)),
    ("flat_90", Scene::Flat(0.9)),
    ("steps", Scene::Square { high: 0.8, low: 0.03, half_period: 500 }),
    ("checker", Scene::Checkerboard { high: 0.8, low: 0.03, cell: 8 }),
];

/// Size of a recording set: width and height in pixels, and readouts per recording.
#[derive(Clone, Copy, Debug)]
pub struct Size {
    pub width: usize,
    pub height: usize,
    pub readouts: usize,
}

/// Size of the recording sets of the study.
pub const SMALL_SIZE: Size = Size { width: 48, height: 48, readouts: 4000 };

/// Returns whether a sensor with these parameters produces other bits than a clean sensor with the same seed. The
/// recordings in which most effects are visible are compared first.
pub fn changes_bits(physics: &Physics, size: Size, seed: u64) -> bool {
    let [with_effects, clean] =
        [physics.clone(), Physics::default()].map(|p| Sensor::new(p, size.width, size.height, seed));
    [1, 6, 7, 0, 2, 3, 4, 5].into_iter().any(|k| {
        let bits = |s: &Sensor| run::record(s, SCENES[k].1, size.readouts, k as u64);
        std::thread::scope(|scope| {
            let changed = scope.spawn(|| bits(&with_effects));
            let clean_bits = bits(&clean);
            changed.join().unwrap() != clean_bits
        })
    })
}

/// Writes the eight recordings of `sensor` and `recordings.toml` into `folder`. If two sets of one sensor have different
/// `take` numbers, their temporal noise and their lamp differ. The set states the true uncertainty of the lamps.
pub fn write_set(sensor: &Sensor, size: Size, take: u64, folder: &Path) {
    std::fs::create_dir_all(folder).unwrap();
    let streams = streams(sensor, size, take);
    let mut toml = format!(
        "width = {}\nheight = {}\nreadout_hz = {READOUT_HZ:?}\nlight_uncertainty = {}\n",
        size.width,
        size.height,
        run::LAMP_DEVIATION
    );
    for ((name, scene), bits) in SCENES.iter().zip(&streams) {
        std::fs::write(folder.join(format!("{name}.dat")), bits).unwrap();
        let light = scene.toml();
        write!(toml, "[[recording]]\nfile = \"{name}.dat\"\nlight = {light}\n").unwrap();
    }
    std::fs::write(folder.join("recordings.toml"), toml).unwrap();
}

/// Simulates all eight recordings and returns their bytes, with the bottom row first. Uses one thread per processor.
pub fn streams(sensor: &Sensor, size: Size, take: u64) -> Vec<Vec<u8>> {
    let next = std::sync::atomic::AtomicUsize::new(0);
    let done = std::sync::Mutex::new(vec![Vec::new(); SCENES.len()]);
    let workers = std::thread::available_parallelism().map_or(1, |n| n.get());
    std::thread::scope(|scope| {
        for _ in 0..workers {
            scope.spawn(|| {
                loop {
                    let i = next.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
                    let Some((_, scene)) = SCENES.get(i) else { break };
                    let bits = run::record(sensor, *scene, size.readouts, take * 100 + i as u64);
                    done.lock().unwrap()[i] = bits;
                }
            });
        }
    });
    done.into_inner().unwrap()
}

/// Simulates one recording of exactly this light and returns its bytes.
pub fn record_exact(sensor: &Sensor, scene: Scene, readouts: usize, number: u64) -> Vec<u8> {
    run::record_exact(sensor, scene, readouts, number)
}

/// Simulates one recording and returns its bytes.
pub fn record(sensor: &Sensor, scene: Scene, readouts: usize, number: u64) -> Vec<u8> {
    run::record(sensor, scene, readouts, number)
}
