//! Benchmarks a camera with full noise, without and with each single additional effect. Each effect is measured on two
//! cameras. One camera clamps the charge. The other camera has no clamp, so it counts surplus charge, and it has a dead
//! time as in the published code of SCSim.
//!
//! The benchmark runs on one thread under constant light, with the fastest backend. It writes packed frames to memory and
//! prints the table of `docs/why/performance.md`.

use std::time::Instant;

use spikelane::effects;
use spikelane::{Camera, Plan, Seeds, Sensor, Simulator};

const READOUTS: usize = 128;

/// Returns a camera with full noise. The threshold noise is drawn at every readout, as in `benches/kernels.rs`.
fn noisy_camera() -> Camera {
    let typical = |name: &str| effects::find(name).unwrap().typical();
    let names = ["start_phase", "saturation_clamp", "prnu", "dark_current", "bias_voltage", "shot_noise"];
    let camera = Camera::ideal(Sensor::new(400, 250, 20_000.0).unwrap());
    let camera = names.into_iter().fold(camera, |c, name| c.with_effect(typical(name)));
    camera.with_effect(typical("thermal_noise").with_text("noise_sampling", "every-readout").unwrap())
}

/// Returns the camera of [`noisy_camera`] without a clamp and with a dead time.
fn scsim_camera() -> Camera {
    noisy_camera()
        .without_effect("saturation_clamp")
        .with_effect(effects::find("dead_time").unwrap().typical())
}

/// Returns the speed of the fastest of ten runs, in Gpixel-readouts per second.
fn speed(camera: &Camera) -> f64 {
    let geometry = camera.sensor.geometry;
    let mut simulator = Simulator::from_plan(Plan::new(camera, Seeds::default()).unwrap());
    let light: Vec<u8> = (0..geometry.pixels()).map(|p| 60 + (p * 7 % 40) as u8).collect();
    let mut bytes = vec![0; READOUTS * geometry.frame_bytes()];
    let times = (0..10).map(|_| {
        let begin = Instant::now();
        simulator.fill(&light, &mut bytes).unwrap();
        begin.elapsed().as_secs_f64()
    });
    let best = times.fold(f64::MAX, f64::min);
    (geometry.pixels() * READOUTS) as f64 / best / 1e9
}

fn main() {
    let bases = [noisy_camera(), scsim_camera()];
    let row = |what: &str, cameras: [Camera; 2]| {
        let [bounded, published] = cameras.map(|c| speed(&c));
        println!("| {what} | {bounded:.2} | {published:.2} |");
    };
    println!("Gpixel-readouts/s\n\n| beside full noise | bounded | not bounded, dead time |\n|---|--:|--:|");
    row("nothing", bases.clone());
    let missing = || effects::ALL.iter().filter(|d| bases[0].effect(d.name).is_none());
    for definition in missing() {
        let with = |c: &Camera| c.clone().with_effect(definition.typical());
        row(&format!("`{}`", definition.name), [with(&bases[0]), with(&bases[1])]);
    }
    let all = |c: &Camera| missing().fold(c.clone(), |c, definition| c.with_effect(definition.typical()));
    row("all of them", [all(&bases[0]), all(&bases[1])]);
}
