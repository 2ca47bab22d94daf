//! Benchmarks short work: calls of `fill` with few readouts, and crops of 41 readouts.

use spikelane::Light;
use spikelane::unstable::Count;
use std::hint::black_box;
use std::time::Duration;

use spikelane::{Geometry, Plan, Result, Seeds, Simulator, presets, spikes};
use spikelane_io::light::{Interpolation, Timeline};
use spikelane_io::simulate::FrameRef;

use super::cameras::{NoiseSet, test_frames};
use super::report::BenchmarkFigure;
use super::timing::best_rate;

/// Number of readouts of 400x250 pixels that are simulated in several calls.
const READOUTS: usize = 200;

/// Side in pixels and number of readouts of a crop. Networks are trained with such crops.
const CROP_SIDE_AND_READOUTS: (u32, usize) = (96, 41);

fn figure(name: String, value: f64, unit: &'static str) -> BenchmarkFigure {
    BenchmarkFigure { name, value, unit }
}

/// Benchmarks 200 readouts with all noise on one thread, in calls of 16, 4 and 1 readouts. Speeds are divided by the speed
/// of a single call of `fill`.
pub(crate) fn benchmark_short_calls(budget: Duration) -> Result<Vec<BenchmarkFigure>> {
    let mut simulator = Simulator::new(&NoiseSet::AllNoise.camera()?, Seeds::default())?;
    let light = test_frames(NoiseSet::AllNoise, READOUTS);
    let refs: Vec<_> = light.iter().map(FrameRef::new).collect();
    let mut facts = Vec::new();
    for (lit, moving) in [("held", false), ("new frame", true)] {
        let [whole, single] =
            [READOUTS, 1].map(|size| call_speed(&mut simulator, &refs, size, moving, budget));
        let name = format!(
            "speed of calls of one readout, divided by the speed of one call of {READOUTS} readouts, {lit}"
        );
        facts.push(figure(name, single? / whole?, "ratio"));
    }
    Ok(facts)
}

/// Returns the speed in pixel-readouts per second for calls of `size` readouts.
fn call_speed(
    simulator: &mut Simulator,
    frames: &[FrameRef<'_>],
    size: usize,
    moving: bool,
    budget: Duration,
) -> Result<f64> {
    let geometry = simulator.plan().geometry();
    let timeline = Timeline::from_readouts_per_frame(1, Interpolation::Hold)?;
    let mut out = vec![0; READOUTS * geometry.frame_bytes()];
    let mut result = Ok(());
    let speed = best_rate(budget, (READOUTS * geometry.pixels()) as f64, || {
        for (part, frames_of_it) in out.chunks_mut(size * geometry.frame_bytes()).zip(frames.chunks(size)) {
            let pushed = if moving {
                simulator.fill(Light::sequence(frames_of_it, &timeline), part).map(drop)
            } else {
                simulator.fill(frames[0], part)
            };
            result = std::mem::replace(&mut result, Ok(())).and(pushed);
        }
    });
    result?;
    black_box(&out);
    Ok(speed)
}

/// Benchmarks repeated recordings of one crop with the preset `physical`. All recordings use one plan, have new noise
/// and are stored as bytes. Also measures the time to create the plan.
pub(crate) fn benchmark_crops(budget: Duration) -> Result<Vec<BenchmarkFigure>> {
    let (side, readouts) = CROP_SIDE_AND_READOUTS;
    let mut camera = presets::builtin("physical")?;
    camera.sensor.geometry = Geometry::new(side, side)?;
    let geometry = camera.sensor.geometry;
    let light: Vec<u8> = (0..geometry.pixels()).map(|p| (40 + p * 7 % 40) as u8).collect();
    let mut failed = Ok(());
    let planned =
        best_rate(budget, 1.0, || failed = Plan::new(&camera, Seeds::default()).map(|p| drop(black_box(p))));
    failed?;
    let mut simulator = Simulator::new(&camera, Seeds::default())?;
    let mut packed = vec![0; readouts * geometry.frame_bytes()];
    let mut bytes = vec![0; readouts * geometry.pixels()];
    let (mut shot, mut failed) = (0, Ok(()));
    let whole = best_rate(budget, 1.0, || {
        shot += 1;
        let one = simulator
            .restart(Seeds { shot, sequence: shot, ..Seeds::default() })
            .and_then(|()| simulator.fill(&light, &mut packed))
            .and_then(|()| spikes::unpack(geometry, &packed, &mut bytes));
        failed = std::mem::replace(&mut failed, Ok(())).and(one);
    });
    failed?;
    Ok(vec![
        figure(format!("plan of a `physical` camera, {side}x{side}"), 1e3 / planned, "ms"),
        figure(
            format!("recordings of {} with this plan, one byte per pixel", Count(readouts, "readout")),
            whole,
            "per second",
        ),
    ])
}
