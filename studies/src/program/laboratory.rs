//! Writes recordings of a hidden sensor in the same form as a laboratory.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;

use spikelane::{Camera, Effect};
use spikelane_calibrate::RecordingSet;
use spikelane_diagnose::{ReadoutSelection, RecordingPart, Setup, published_camera};

use super::factors::Factors;
use super::hidden_sensor::{Scene, Sensor, record_exact};

/// Relative standard deviation of the light of a recording, if the light of its sources is known.
const SOURCE_REPEATABILITY: f64 = 1e-4;

/// Writes the recordings of one take and opens their recording set. The set states the standard deviation of the lamps.
pub(crate) fn record_take(sensor: &Sensor, factors: &Factors, take: u64, folder: &Path) -> RecordingSet {
    std::fs::create_dir_all(folder).unwrap();
    let (width, height, hz) = (sensor.width, sensor.height, factors.readout_hz());
    let uncertainty = factors.lamp_deviation;
    let mut toml = format!(
        "width = {width}\nheight = {height}\nreadout_hz = {hz:?}\nlight_uncertainty = {uncertainty}\nsource_repeatability = {SOURCE_REPEATABILITY}\n"
    );
    let mut light_of_source = BTreeMap::new();
    for (k, (name, scene, readouts)) in factors.scenes().into_iter().enumerate() {
        let sources = factors.sources(&name);
        let own = factors.lamp_error(k, take);
        let lit = match (sources.as_slice(), scene) {
            ([source], Scene::Flat(light)) => {
                light_of_source.insert(source.clone(), own * light);
                scene.scale(own)
            }
            ([_, _, ..], _) => {
                let sum: f64 = sources.iter().map(|source| light_of_source[source]).sum();
                Scene::Flat(sum * (1.0 + SOURCE_REPEATABILITY * (own - 1.0) / uncertainty))
            }
            _ => scene.scale(own),
        };
        let bits = record_exact(sensor, lit, readouts, take * 100 + k as u64);
        std::fs::write(folder.join(format!("{name}.dat")), bits).unwrap();
        write!(
            toml,
            "[[recording]]\nfile = \"{name}.dat\"\nlight = {}\nsources = {sources:?}\n",
            scene.toml()
        )
        .unwrap();
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
