//! Simulates scenes whose light is known.

use spikelane::effects::find;
use spikelane::{Camera, Geometry, Seeds, Sensor, Simulator, SpikeFramesRef, presets};
use spikelane_io::simulate::FrameRef;

use super::score::{Row, row};

/// Ranges of light in thresholds per readout. `DIM` is a tenth of `DAY`.
const DAY: (f32, f32) = (0.05, 0.45);
const DIM: (f32, f32) = (0.005, 0.045);

const SIZE_PX: (u32, u32) = (200, 128);
const READOUTS: usize = 201;

/// Number of readouts before the scored stream. They are discarded, so that the start state has no effect.
const WARM_UP_READOUTS: usize = 400;

/// Number of readouts of a long recording. For a camera with a fixed pattern, the mean of this recording is the
/// reference.
const REFERENCE_READOUTS: usize = 4000;

/// Returns smooth light with no period shorter than the image. Its values range from `low` to `high` thresholds per
/// readout. It is shifted right by `dx` pixels.
fn light(geometry: Geometry, (low, high): (f32, f32), dx: f32) -> Vec<f32> {
    let waves = [(0.31, 0.07), (-0.12, 0.29), (0.053, -0.17), (0.63, 0.41), (0.017, 0.041)];
    let shifted = |k: usize| {
        let (x, y) = ((k % geometry.width()) as f32 - dx, (k / geometry.width()) as f32);
        let sum: f32 = (1..).zip(waves).map(|(i, (a, b))| (a * x + b * y + i as f32).sin()).sum();
        low + (high - low) * (0.5 + 0.1 * sum)
    };
    (0..geometry.pixels()).map(shifted).collect()
}

/// Returns a camera with the temporal noise of the preset `physical` and without a fixed pattern.
fn temporal_noise_camera(false_spikes: f64) -> Camera {
    let sensor = Sensor::new(SIZE_PX.0, SIZE_PX.1, 20_000.0).unwrap();
    let camera = Camera::ideal(sensor)
        .with_effect(find("start_phase").unwrap().typical())
        .with_effect(find("shot_noise").unwrap().typical())
        .with_effect(find("thermal_noise").unwrap().typical());
    if false_spikes == 0.0 {
        return camera;
    }
    camera
        .with_effect(find("false_spikes").unwrap().neutral().with_value("probability", false_spikes).unwrap())
}

fn noise_free_camera() -> Camera {
    let sensor = Sensor::new(SIZE_PX.0, SIZE_PX.1, 20_000.0).unwrap();
    Camera::ideal(sensor).with_effect(find("start_phase").unwrap().typical())
}

fn physical_camera() -> Camera {
    let mut camera = presets::builtin("physical").unwrap();
    camera.sensor.geometry = Geometry::new(SIZE_PX.0, SIZE_PX.1).unwrap();
    camera
}

/// Returns a stream of light that moves by `speed` pixels per readout. At the middle readout the light is `light(.., 0)`.
fn stream(camera: &Camera, range: (f32, f32), speed: f32, readouts: usize) -> Vec<u8> {
    let geometry = camera.sensor.geometry;
    let mut simulator = Simulator::new(camera, Seeds { camera: 1, shot: 2, sequence: 0 }).unwrap();
    let bytes = geometry.frame_bytes();
    let mut warm = vec![0; WARM_UP_READOUTS * bytes];
    let mut out = vec![0; readouts * bytes];
    let at = |t: usize| light(geometry, range, speed * (t as f32 - (readouts / 2) as f32));
    simulator.fill(FrameRef::new(&at(0)), &mut warm).unwrap();
    if speed == 0.0 {
        simulator.fill(FrameRef::new(&at(0)), &mut out).unwrap();
        return out;
    }
    for (t, frame) in out.chunks_exact_mut(bytes).enumerate() {
        simulator.fill(FrameRef::new(&at(t)), frame).unwrap();
    }
    out
}

fn known_row(name: &str, camera: &Camera, range: (f32, f32), speed: f32) -> Row {
    let geometry = camera.sensor.geometry;
    let bytes = stream(camera, range, speed, READOUTS);
    let truth = light(geometry, range, 0.0);
    row(name, SpikeFramesRef::new(geometry, &bytes).unwrap(), 0..geometry.pixels(), &|_| truth.clone())
}

/// Scores a camera with a fixed pattern. The reference of an image is the mean of the readouts of a long recording from
/// which the image is not computed.
fn near_truth_row(name: &str, camera: &Camera, range: (f32, f32)) -> Row {
    let geometry = camera.sensor.geometry;
    let bytes = stream(camera, range, 0.0, REFERENCE_READOUTS);
    let packed = SpikeFramesRef::new(geometry, &bytes).unwrap();
    row(name, packed, 0..geometry.pixels(), &|used| super::real_scenes::mean_of_others(packed, used))
}

pub(crate) fn geometry() -> Geometry {
    Geometry::new(SIZE_PX.0, SIZE_PX.1).unwrap()
}

/// Returns two streams of static light from the preset `physical`: in daylight, and at a tenth of daylight.
pub(crate) fn static_streams() -> [Vec<u8>; 2] {
    [DAY, DIM].map(|range| stream(&physical_camera(), range, 0.0, REFERENCE_READOUTS))
}

pub(crate) fn rows() -> Vec<Row> {
    let camera = temporal_noise_camera;
    let mut rows = vec![
        known_row("still, no noise", &noise_free_camera(), DAY, 0.0),
        near_truth_row("still, `physical`", &physical_camera(), DAY),
        known_row("still, a tenth of the light", &camera(0.0), DIM, 0.0),
        known_row("still, 0.01 false spikes per readout", &camera(1e-2), DAY, 0.0),
        known_row("dim, 0.001 false spikes per readout", &camera(1e-3), DIM, 0.0),
    ];
    for speed in [0.03, 0.1, 0.3] {
        let name = format!("moving, {speed} pixels per readout");
        rows.push(known_row(&name, &camera(0.0), DAY, speed));
    }
    rows
}
