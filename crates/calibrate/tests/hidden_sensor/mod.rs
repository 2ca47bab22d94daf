//! A spike camera that shares no code with the library: the truth of the diagnosis' tests.
//!
//! It imports nothing from `spikelane`. Charge is counted in electrons and kept as what is *missing* to
//! the threshold, the comparison stands at the start of a readout, on the charge of the ones before, the generator
//! is xoshiro256++, and every effect is written anew from the catalogue's table. Where the library
//! precomputes tables of integers, this goes pixel by pixel in `f64`.

#![allow(dead_code, unused_imports, reason = "each test and the study use a part of it")]

mod kinds;
mod physics;
mod run;

pub use kinds::{INSIDE, Kind, OUTSIDE, kind};
pub use physics::{Physics, Sensor};

use std::fmt::Write as _;
use std::path::Path;

/// Readouts per second of every hidden sensor.
pub const READOUT_HZ: f64 = 20_000.0;

/// What stands in front of the sensor, in fractions of the light that saturates.
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

    fn toml(self) -> String {
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

/// How large a set is.
#[derive(Clone, Copy, Debug)]
pub struct Size {
    pub width: usize,
    pub height: usize,
    pub readouts: usize,
}

/// The study's size.
pub const SMALL: Size = Size { width: 48, height: 48, readouts: 4000 };

/// The large size.
pub const LARGE: Size = Size { width: 128, height: 96, readouts: 10_000 };

/// Whether a sensor of these numbers gives other bits than a clean one of the same seed; recordings in
/// which most effects show come first.
pub fn changes_bits(physics: &Physics, size: Size, seed: u64) -> bool {
    let [own, clean] =
        [physics.clone(), Physics::default()].map(|p| Sensor::new(p, size.width, size.height, seed));
    [1, 6, 7, 0, 2, 3, 4, 5].into_iter().any(|k| {
        let bits = |s: &Sensor| run::record(s, SCENES[k].1, size.readouts, k as u64);
        std::thread::scope(|scope| {
            let changed = scope.spawn(|| bits(&own));
            let plain = bits(&clean);
            changed.join().unwrap() != plain
        })
    })
}

/// Writes the eight recordings of `sensor` and `recordings.toml` into `folder`; `take` numbers
/// repeated sets of one sensor, whose temporal noise and lamp differ.
pub fn write_set(sensor: &Sensor, size: Size, take: u64, folder: &Path) {
    std::fs::create_dir_all(folder).unwrap();
    let streams = streams(sensor, size, take);
    let mut toml = format!("width = {}\nheight = {}\nreadout_hz = {READOUT_HZ:?}\n", size.width, size.height);
    for ((name, scene), bits) in SCENES.iter().zip(&streams) {
        std::fs::write(folder.join(format!("{name}.dat")), bits).unwrap();
        let light = scene.toml();
        write!(toml, "[[recording]]\nfile = \"{name}.dat\"\nlight = {light}\n").unwrap();
    }
    std::fs::write(folder.join("recordings.toml"), toml).unwrap();
}

/// The bytes of all eight recordings, bottom row first, on as many threads as there are processors.
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

/// One recording.
pub fn record(sensor: &Sensor, scene: Scene, readouts: usize, number: u64) -> Vec<u8> {
    run::record(sensor, scene, readouts, number)
}
