//! Simulated scenes of which the light is known.

use spikelane::effects::find;
use spikelane::{Camera, Geometry, Packed, Seeds, Sensor, Simulator, presets};
use spikelane_io::simulate::FrameRef;

use super::score::{Row, row};

const SIDE: (u32, u32) = (200, 128);
const READOUTS: usize = 201;

/// Readouts before the stream that is looked at: any start is forgotten.
const WARM: usize = 400;

/// Readouts of the near-truth of a camera with a fixed pattern.
const LONG: usize = 4000;

/// Smooth light without a period in the picture, `low` to `high` thresholds a readout, moved right by `dx` pixels.
fn light(geometry: Geometry, (low, high): (f32, f32), dx: f32) -> Vec<f32> {
    let waves = [(0.31, 0.07), (-0.12, 0.29), (0.053, -0.17), (0.63, 0.41), (0.017, 0.041)];
    let of = |k: usize| {
        let (x, y) = ((k % geometry.width()) as f32 - dx, (k / geometry.width()) as f32);
        let sum: f32 = (1..).zip(waves).map(|(i, (a, b))| (a * x + b * y + i as f32).sin()).sum();
        low + (high - low) * (0.5 + 0.1 * sum)
    };
    (0..geometry.pixels()).map(of).collect()
}

/// Every effect of the preset `physical` that changes with time, and none that differs from pixel to pixel.
fn temporal(false_spikes: f64) -> Camera {
    let sensor = Sensor::new(SIDE.0, SIDE.1, 20_000.0).unwrap();
    let camera = Camera::ideal(sensor)
        .with(find("start_phase").unwrap().typical())
        .with(find("shot_noise").unwrap().typical())
        .with(find("thermal_noise").unwrap().typical());
    if false_spikes == 0.0 {
        return camera;
    }
    camera.with(find("false_spikes").unwrap().neutral().with("probability", false_spikes).unwrap())
}

fn silent() -> Camera {
    let sensor = Sensor::new(SIDE.0, SIDE.1, 20_000.0).unwrap();
    Camera::ideal(sensor).with(find("start_phase").unwrap().typical())
}

fn physical() -> Camera {
    let mut camera = presets::builtin("physical").unwrap();
    camera.sensor.geometry = Geometry::new(SIDE.0, SIDE.1).unwrap();
    camera
}

/// A stream of light that moves by `speed` pixels a readout; its middle readout sees `light(.., 0)`.
fn stream(camera: &Camera, range: (f32, f32), speed: f32, readouts: usize) -> Vec<u8> {
    let geometry = camera.sensor.geometry;
    let mut simulator = Simulator::new(camera, Seeds { camera: 1, shot: 2, sequence: 0 }).unwrap();
    let bytes = geometry.frame_bytes();
    let mut warm = vec![0; WARM * bytes];
    let mut out = vec![0; readouts * bytes];
    let at = |t: usize| light(geometry, range, speed * (t as f32 - (readouts / 2) as f32));
    simulator.push(FrameRef::f32(&at(0), geometry), &mut warm).unwrap();
    if speed == 0.0 {
        simulator.push(FrameRef::f32(&at(0), geometry), &mut out).unwrap();
        return out;
    }
    for (t, frame) in out.chunks_exact_mut(bytes).enumerate() {
        simulator.push(FrameRef::f32(&at(t), geometry), frame).unwrap();
    }
    out
}

fn known(name: &str, camera: &Camera, range: (f32, f32), speed: f32) -> Row {
    let geometry = camera.sensor.geometry;
    let bytes = stream(camera, range, speed, READOUTS);
    let truth = light(geometry, range, 0.0);
    row(name, Packed::new(geometry, &bytes).unwrap(), 0..geometry.pixels(), &|_| truth.clone())
}

/// A camera whose pixels differ: near-truth is the mean of all other readouts of a long recording.
fn near(name: &str, camera: &Camera, range: (f32, f32)) -> Row {
    let geometry = camera.sensor.geometry;
    let bytes = stream(camera, range, 0.0, LONG);
    let packed = Packed::new(geometry, &bytes).unwrap();
    row(name, packed, 0..geometry.pixels(), &|used| super::real::mean_of_others(packed, used))
}

pub(crate) fn geometry() -> Geometry {
    Geometry::new(SIDE.0, SIDE.1).unwrap()
}

/// Streams of light that stands still, and the light: without noise, of `physical` by day, and of it in a tenth of the light.
pub(crate) fn still_scenes() -> [(Vec<u8>, Vec<f32>); 3] {
    let (day, dim) = ((0.05, 0.45), (0.005, 0.045));
    let of = |camera: &Camera, range| (stream(camera, range, 0.0, LONG), light(geometry(), range, 0.0));
    [of(&silent(), day), of(&physical(), day), of(&physical(), dim)]
}

pub(crate) fn rows() -> Vec<Row> {
    let (day, dim) = ((0.05, 0.45), (0.005, 0.045));
    let mut rows = vec![
        known("still, no noise", &silent(), day, 0.0),
        known("still, noise in time", &temporal(0.0), day, 0.0),
        near("still, `physical`", &physical(), day),
        known("still, dim (a tenth)", &temporal(0.0), dim, 0.0),
    ];
    for p in [1e-4, 1e-3, 1e-2] {
        rows.push(known(&format!("still, {p} false spikes a readout"), &temporal(p), day, 0.0));
    }
    rows.push(known("dim, 0.001 false spikes a readout", &temporal(1e-3), dim, 0.0));
    for speed in [0.01, 0.03, 0.1, 0.3] {
        rows.push(known(&format!("moving, {speed} pixels a readout"), &temporal(0.0), day, speed));
    }
    rows
}
