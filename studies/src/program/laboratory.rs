//! Writes recordings of a hidden sensor in the same form as a laboratory.

use std::fmt::Write as _;
use std::path::Path;

use spikelane::{Camera, Effect};
use spikelane_calibrate::RecordingSet;
use spikelane_calibrate::diagnose::{ReadoutSelection, RecordingPart, Setup, published_camera};

use super::factors::Factors;
use super::hidden_sensor::{Sensor, record};

/// Writes the recordings of one take and opens their recording set.
pub(crate) fn record_take(sensor: &Sensor, factors: &Factors, take: u64, folder: &Path) -> RecordingSet {
    std::fs::create_dir_all(folder).unwrap();
    let (width, height, hz) = (sensor.width, sensor.height, factors.readout_hz());
    let mut toml = format!("width = {width}\nheight = {height}\nreadout_hz = {hz:?}\n");
    for (k, (name, scene, readouts)) in factors.scenes().into_iter().enumerate() {
        let lit = scene.scale(factors.lamp_error(k, take));
        let bits = record(sensor, lit, readouts, take * 100 + k as u64);
        std::fs::write(folder.join(format!("{name}.dat")), bits).unwrap();
        write!(toml, "[[recording]]\nfile = \"{name}.dat\"\nlight = {}\n", scene.toml()).unwrap();
    }
    std::fs::write(folder.join("recordings.toml"), toml).unwrap();
    RecordingSet::open(&folder.join("recordings.toml")).unwrap()
}

/// Returns the camera file of a laboratory with `factors`. It is the published model with the true parameters of the
/// sensor.
pub(crate) fn camera_file(set: &RecordingSet, factors: &Factors) -> Camera {
    let setup = Setup::new(set, RecordingPart::Whole, ReadoutSelection::Leading).unwrap();
    let mut camera = published_camera(&setup).unwrap();
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
        let changed: Effect = camera.effect(effect).unwrap().clone().with_value(key, value).unwrap();
        camera = camera.with_effect(changed);
    }
    camera
}
