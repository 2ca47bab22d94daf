//! Recordings of a hidden sensor as a laboratory would write them.

use std::fmt::Write as _;
use std::path::Path;

use spikelane::{Camera, Effect};
use spikelane_calibrate::RecordingSet;
use spikelane_calibrate::diagnose::{Extent, Part, Setup, published};

use super::factors::Factors;
use super::hidden_sensor::{Scene, Sensor, record};

fn scaled(scene: Scene, by: f64) -> Scene {
    match scene {
        Scene::Flat(light) => Scene::Flat(light * by),
        Scene::Square { high, low, half_period } => {
            Scene::Square { high: high * by, low: low * by, half_period }
        }
        Scene::Checkerboard { high, low, cell } => {
            Scene::Checkerboard { high: high * by, low: low * by, cell }
        }
    }
}

fn words(scene: Scene) -> String {
    match scene {
        Scene::Flat(light) => format!("{light:?}"),
        Scene::Square { high, low, half_period } => {
            format!("{{ kind = \"square\", high = {high:?}, low = {low:?}, half_period = {half_period} }}")
        }
        Scene::Checkerboard { high, low, cell } => {
            format!("{{ kind = \"checkerboard\", high = {high:?}, low = {low:?}, cell = {cell} }}")
        }
    }
}

/// Writes a take and reads its set.
pub(crate) fn take(sensor: &Sensor, factors: &Factors, take: u64, folder: &Path) -> RecordingSet {
    std::fs::create_dir_all(folder).unwrap();
    let (width, height, hz) = (sensor.width, sensor.height, factors.readout_hz());
    let mut toml = format!("width = {width}\nheight = {height}\nreadout_hz = {hz:?}\n");
    for (k, (name, scene, readouts)) in factors.scenes().into_iter().enumerate() {
        let lit = scaled(scene, factors.lamp(k, take));
        let bits = record(sensor, lit, readouts, take * 100 + k as u64);
        std::fs::write(folder.join(format!("{name}.dat")), bits).unwrap();
        write!(toml, "[[recording]]\nfile = \"{name}.dat\"\nlight = {}\n", words(scene)).unwrap();
    }
    std::fs::write(folder.join("recordings.toml"), toml).unwrap();
    RecordingSet::open(&folder.join("recordings.toml")).unwrap()
}

/// The camera file that such a laboratory has: the published model with the sensor's true numbers.
pub(crate) fn camera_file(set: &RecordingSet, factors: &Factors) -> Camera {
    let setup = Setup::of(set, Part::Whole, Extent::Enough).unwrap();
    let mut camera = published(&setup).unwrap();
    let p = factors.physics();
    let fc = 1.602_176_634e-4 * p.electrons;
    let swing = camera.sensor.swing_v + camera.effect("bias_voltage").unwrap().get("mean").unwrap();
    camera.sensor.capacitance_ff = fc / swing;
    let to_pa = 1.602_176_634e-4 * 1e-3 * factors.readout_hz();
    for (effect, key, value) in [
        ("bias_voltage", "sigma", p.threshold_spread * swing),
        ("prnu", "sigma", p.gain_spread),
        ("dark_current", "mean", p.dark_mean * to_pa),
        ("dark_current", "sigma", p.dark_spread * to_pa),
        ("thermal_noise", "sigma", p.threshold_noise * swing),
    ] {
        let changed: Effect = camera.effect(effect).unwrap().clone().with(key, value).unwrap();
        camera = camera.with(changed);
    }
    camera
}
