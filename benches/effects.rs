//! What each effect costs beside full noise, with stored charge bounded and without, and a dead time, as the published code has it:
//! packed frames in memory, one thread, held light, on the fastest backend. Prints the table of `docs/why/performance.md`.

use std::time::Instant;

use spikelane::effects;
use spikelane::simulate::FrameRef;
use spikelane::{Camera, Plan, Seeds, Sensor, Simulator};

const READOUTS: usize = 128;

/// Full noise with threshold noise at every readout, as in `benches/kernels.rs`.
fn base() -> Camera {
    let typical = |name: &str| effects::find(name).unwrap().typical();
    let names = ["start_phase", "saturation_clamp", "prnu", "dark_current", "bias_voltage", "shot_noise"];
    let camera = Camera::ideal(Sensor::new(400, 250, 20_000.0).unwrap());
    let camera = names.into_iter().fold(camera, |c, name| c.with(typical(name)));
    camera.with(typical("thermal_noise").with_text("redraw", "every-readout").unwrap())
}

/// The same without a bound, and with a dead time.
fn published() -> Camera {
    base().without("saturation_clamp").with(effects::find("dead_time").unwrap().typical())
}

/// Gpixel-readouts per second: the best of ten runs.
fn speed(camera: &Camera) -> f64 {
    let geometry = camera.sensor.geometry;
    let mut simulator = Simulator::of_plan(Plan::new(camera, Seeds::default()).unwrap());
    let light: Vec<u8> = (0..geometry.pixels()).map(|p| 60 + (p * 7 % 40) as u8).collect();
    let mut bytes = vec![0; READOUTS * geometry.frame_bytes()];
    let times = (0..10).map(|_| {
        let begin = Instant::now();
        simulator.push(FrameRef::u8(&light, geometry), &mut bytes).unwrap();
        begin.elapsed().as_secs_f64()
    });
    let best = times.fold(f64::MAX, f64::min);
    (geometry.pixels() * READOUTS) as f64 / best / 1e9
}

fn main() {
    let bases = [base(), published()];
    let row = |what: &str, cameras: [Camera; 2]| {
        let [bounded, published] = cameras.map(|c| speed(&c));
        println!("| {what} | {bounded:.2} | {published:.2} |");
    };
    println!("Gpixel-readouts/s\n\n| beside full noise | bounded | not bounded, dead time |\n|---|--:|--:|");
    row("nothing", bases.clone());
    let missing = || effects::ALL.iter().filter(|d| bases[0].effect(d.name).is_none());
    for definition in missing() {
        let with = |c: &Camera| c.clone().with(definition.typical());
        row(&format!("`{}`", definition.name), [with(&bases[0]), with(&bases[1])]);
    }
    let all = |c: &Camera| missing().fold(c.clone(), |c, definition| c.with(definition.typical()));
    row("all of them", [all(&bases[0]), all(&bases[1])]);
}
