//! Tests of the interpolation between frames with estimated motion.

use std::collections::VecDeque;

use spikelane::reconstruct::psnr;
use spikelane::{ErrorKind, Geometry, Result, Seeds, presets};
use spikelane_io::light::{
    FlowInterpolator, Frame, Interpolation, Objects, OwnedSamples, Rate, Source, Timeline,
};
use spikelane_io::simulate::{RunObserver, RunOptions, run};

/// Returns a smooth, aperiodic pattern that is moved by (dx, dy) pixels.
fn pattern(geometry: Geometry, dx: f32, dy: f32) -> Frame {
    let light = |k: usize| {
        let (x, y) = ((k % geometry.width()) as f32 - dx, (k / geometry.width()) as f32 - dy);
        let waves = [(0.31, 0.07), (-0.12, 0.29), (0.053, -0.17), (0.23, 0.21), (0.017, 0.041)];
        let sum: f32 = (1..).zip(waves).map(|(i, (a, b))| (a * x + b * y + i as f32).sin()).sum();
        0.5 + 0.09 * sum
    };
    Frame::new(geometry, OwnedSamples::F32((0..geometry.pixels()).map(light).collect())).unwrap()
}

fn size() -> Geometry {
    Geometry::new(96, 64).unwrap()
}

fn median(mut values: Vec<f32>) -> f32 {
    values.sort_by(f32::total_cmp);
    values[values.len() / 2]
}

#[test]
fn the_motion_of_a_moved_pattern_is_found() {
    for (dx, dy) in [(0.0, 0.0), (0.4, -0.3), (3.3, -1.7), (-6.0, 4.5)] {
        let between = FlowInterpolator::new(&pattern(size(), 0.0, 0.0), &pattern(size(), dx, dy)).unwrap();
        let (u, v) = between.motion();
        let error = |p: usize| (u[p] - dx).hypot(v[p] - dy);
        let median_error = median((0..size().pixels()).map(error).collect());
        assert!(median_error < 0.05, "{dx}, {dy}: off by {median_error} px");
    }
}

#[test]
fn flow_interpolation_is_more_accurate_than_blending() {
    let (a, b) = (pattern(size(), 0.0, 0.0), pattern(size(), 6.0, -3.0));
    let between = FlowInterpolator::new(&a, &b).unwrap();
    // Content that enters at the border is visible in only one of the two frames, so the border is not compared.
    let inner = |frame: &Frame| -> Vec<f32> {
        (12..52).flat_map(|row| (12..84).map(move |col| (row, col))).map(|(r, c)| frame.get(r, c)).collect()
    };
    for weight in [0.25, 0.5, 0.8] {
        let truth = inner(&pattern(size(), 6.0 * weight, -3.0 * weight));
        let score = |frame: Frame| psnr(&inner(&frame), &truth, 1.0).unwrap();
        let (moved, blended) =
            (score(between.interpolate(weight).unwrap()), score(Frame::blend(&a, &b, weight).unwrap()));
        assert!(moved > blended + 10.0, "at {weight}: {moved} dB moved, {blended} dB blended");
    }
}

#[test]
fn interpolation_reproduces_its_end_frames_and_static_scenes() {
    let (a, b) = (pattern(size(), 0.0, 0.0), pattern(size(), 2.0, 1.0));
    let between = FlowInterpolator::new(&a, &b).unwrap();
    for (weight, frame) in [(0.0, &a), (1.0, &b)] {
        let interpolated = between.interpolate(weight).unwrap().to_f32();
        assert!(psnr(&interpolated, &frame.to_f32(), 1.0).unwrap() > 60.0, "at {weight}");
    }
    let still = FlowInterpolator::new(&a, &a).unwrap().interpolate(0.37).unwrap();
    assert!(psnr(&still.to_f32(), &a.to_f32(), 1.0).unwrap() > 90.0);
    assert_eq!(between.interpolate(1.5).unwrap_err().kind(), ErrorKind::Usage);
}

#[test]
fn flow_interpolation_of_objects_beats_blending() {
    let (geometry, rate) = (Geometry::new(160, 100).unwrap(), Rate::new(100, 1).unwrap());
    let objects = Objects::new(geometry, rate, 2, 4, 8).unwrap();
    let (a, b) = (objects.frame_at(0.0), objects.frame_at(0.01));
    let truth = objects.frame_at(0.005).to_f32();
    let score = |frame: Frame| psnr(&frame.to_f32(), &truth, 1.0).unwrap();
    let moved = score(FlowInterpolator::new(&a, &b).unwrap().interpolate(0.5).unwrap());
    let blended = score(Frame::blend(&a, &b, 0.5).unwrap());
    assert!(moved > blended + 3.0, "{moved} dB moved, {blended} dB blended");
}

#[test]
fn objects_follow_their_seed_and_move_smoothly() {
    let (geometry, rate) = (Geometry::new(80, 50).unwrap(), Rate::new(1000, 1).unwrap());
    let objects = |seed| Objects::new(geometry, rate, 3, seed, 10).unwrap();
    assert_eq!(objects(1).frame_at(0.2), objects(1).frame_at(0.2));
    assert_ne!(objects(1).frame_at(0.2), objects(2).frame_at(0.2));
    let psnr_after = |t: f64| {
        psnr(&objects(1).frame_at(0.2).to_f32(), &objects(1).frame_at(0.2 + t).to_f32(), 1.0).unwrap()
    };
    assert!(
        psnr_after(1e-5) > psnr_after(1e-3) + 20.0 && psnr_after(1e-3) > psnr_after(3e-2),
        "{} {}",
        psnr_after(1e-5),
        psnr_after(1e-3)
    );
    let mut source = objects(1);
    let mut frame = Frame::dark(geometry);
    let frames = (0..).take_while(|_| source.next_frame(&mut frame).unwrap()).count();
    assert_eq!(frames, 3);
}

struct Frames(VecDeque<Frame>);

impl Source for Frames {
    fn geometry(&self) -> Geometry {
        size()
    }
    fn frames(&self) -> Option<u64> {
        Some(self.0.len() as u64)
    }
    fn next_frame(&mut self, into: &mut Frame) -> Result<bool> {
        let Some(frame) = self.0.pop_front() else { return Ok(false) };
        *into = frame;
        Ok(true)
    }
    fn rate(&self) -> Option<Rate> {
        None
    }
    fn describe(&self) -> String {
        "frames".into()
    }
}

/// Returns the simulated stream of `frames` with `each` readouts per frame.
fn stream(frames: &[Frame], each: u64, interpolation: Interpolation) -> Vec<u8> {
    let dir = tempfile::tempdir().unwrap();
    let mut camera = presets::builtin("physical").unwrap();
    camera.sensor.geometry = size();
    let seeds = Seeds { camera: 1, shot: 2, sequence: 3 };
    let job = RunOptions::new(camera, seeds, Timeline::from_readouts_per_frame(each, interpolation).unwrap());
    let path = dir.path().join("a.dat");
    run(&job, &mut Frames(frames.to_vec().into()), &path, None, RunObserver::default()).unwrap();
    std::fs::read(path).unwrap()
}

#[test]
fn a_stream_with_flow_interpolation_equals_one_of_interpolated_frames() {
    let key: Vec<Frame> = (0..3_u8).map(|i| pattern(size(), 2.0 * f32::from(i), f32::from(i))).collect();
    let mut all = Vec::new();
    for pair in key.windows(2) {
        let between = FlowInterpolator::new(&pair[0], &pair[1]).unwrap();
        all.push(pair[0].clone());
        all.extend((1..4_u8).map(|i| between.interpolate(f32::from(i) / 4.0).unwrap()));
    }
    // The last frame has no next frame, so its light is constant.
    all.extend(std::iter::repeat_n(key[2].clone(), 4));
    assert!(stream(&key, 4, Interpolation::Flow) == stream(&all, 1, Interpolation::Hold));
    assert!(stream(&key, 4, Interpolation::Flow) != stream(&key, 4, Interpolation::Linear));
}
