//! What each effect costs beside full noise: packed frames in memory, one thread, held light, on the fastest
//! backend. Prints the table of `docs/performance.md`.

use std::time::Instant;

use spikelane::effects::{self, Definition};
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
    let base = base();
    let with = |definition: &'static Definition| base.clone().with(definition.typical());
    println!("| beside full noise | Gpixel-readouts/s |\n|---|--:|\n| nothing | {:.3} |", speed(&base));
    for definition in effects::ALL.iter().filter(|d| base.effect(d.name).is_none()) {
        println!("| `{}` | {:.3} |", definition.name, speed(&with(definition)));
    }
    let all = effects::ALL.iter().filter(|d| base.effect(d.name).is_none());
    let camera = all.fold(base.clone(), |camera, definition| camera.with(definition.typical()));
    println!("| all of them | {:.3} |", speed(&camera));
}
