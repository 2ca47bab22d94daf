//! What many short calls cost beside one long one: 200 readouts of 400x250 pixels under full noise, one thread, pushed 1, 4, 16 and
//! 200 at a time, held and with a new frame at every readout. All ways give the same bits. Prints the best of twenty runs, and for one
//! readout a call the bytes that move and the speed at which they do, beside what the memory gives.

#[path = "../src/cli/bench/timing.rs"]
mod timing;

use std::time::{Duration, Instant};

use spikelane::effects::find;
use spikelane::light::{Insertion, Timeline};
use spikelane::simulate::FrameRef;
use spikelane::{Camera, Seeds, Sensor, Simulator};

const READOUTS: usize = 200;
const PIXELS: usize = 100_000;

fn camera() -> Camera {
    let effects = ["start_phase", "saturation_clamp", "prnu", "dark_current", "bias_voltage", "shot_noise"];
    let sensor = Sensor::new(400, 250, 40_000.0).unwrap();
    let thermal = find("thermal_noise").unwrap().typical().with_text("redraw", "every-readout").unwrap();
    let with = |c: Camera, name: &&str| c.with(find(name).unwrap().typical());
    effects.iter().fold(Camera::ideal(sensor), with).with(thermal)
}

/// Bytes that a push of one readout moves for each pixel of this camera: threshold, half a key, gain, dark current, bound, threshold
/// noise and three numbers of shot noise are read; charge and its fraction are read and written; a grey level is read.
const BYTES: usize = 2 + 2 + 4 + 4 + 2 + 2 + 3 * 4 + 2 * 4 + 1;

fn main() {
    let sensor = camera().sensor;
    let level = |p: usize, t: usize| 60 + ((p * 7 + t * 13) % 40) as u8;
    let frames: Vec<Vec<u8>> = (0..READOUTS).map(|t| (0..PIXELS).map(|p| level(p, t)).collect()).collect();
    let refs: Vec<FrameRef<'_>> = frames.iter().map(|f| FrameRef::u8(f, sensor.geometry)).collect();
    let mut simulator = Simulator::new(&camera(), Seeds::default()).unwrap();
    let begin = simulator.state().clone();
    let timeline = Timeline::per_frame(1, Insertion::Hold).unwrap();
    let mut out = vec![0; READOUTS * sensor.geometry.frame_bytes()];
    println!("400x250, full noise, {}, one thread, {READOUTS} readouts", simulator.backend());
    println!("| light | readouts a push | Gpixel-readouts/s | of one push |\n|---|--:|--:|--:|");
    for moving in [false, true] {
        let (mut whole, mut expected) = (0.0, Vec::new());
        for size in [READOUTS, 16, 4, 1] {
            let mut run = || {
                simulator.resume(begin.clone()).unwrap();
                let start = Instant::now();
                for (part, frames) in
                    out.chunks_mut(size * sensor.geometry.frame_bytes()).zip(refs.chunks(size))
                {
                    if moving {
                        simulator.push_frames(frames, &timeline, part).unwrap();
                    } else {
                        simulator.push(refs[0], part).unwrap();
                    }
                }
                start.elapsed().as_secs_f64()
            };
            let best = (0..20).map(|_| run()).fold(f64::MAX, f64::min);
            if size == READOUTS {
                (whole, expected) = (best, out.clone());
            }
            assert_eq!(out, expected, "{size} readouts a push");
            let light = if moving { "new frame" } else { "held" };
            let speed = (PIXELS * READOUTS) as f64 / best / 1e9;
            println!("| {light} | {size} | {speed:.3} | {:.2} |", whole / best);
            if size == 1 {
                let bytes = (PIXELS * BYTES + PIXELS / 8) as f64;
                let memory = timing::read_bandwidth(Duration::from_millis(300)) / 1e9;
                let speed = bytes * READOUTS as f64 / best / 1e9;
                println!(
                    "one readout a push moves {:.2} MB, {speed:.1} GB/s; memory reads at {memory:.1} GB/s",
                    bytes / 1e6
                );
            }
        }
    }
}
