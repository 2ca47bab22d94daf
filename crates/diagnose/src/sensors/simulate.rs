//! Simulates a recording set.

use std::borrow::Cow;

use crate::events::locations::{apply_events, is_replaced};
use crate::recordings::recorded_scene::{RecordedScene, StaticScene};
use crate::recordings::scan::{Scan, ScanOptions, scan};
use crate::recordings::setup::Setup;
use crate::sensors::cache_key::hash_inputs;
use crate::sensors::model::Sample;
use crate::statistics::measured_set::{rate_map_statistics, statistics_vector};
use crate::statistics::vector::{DiagnosticStatistic, StatisticsVector};
use crate::thresholds::LEAD_READOUTS;
use nalgebra::DVector;
use spikelane::effects::{Camera, Definition, Model, edge_columns, smooth_prnu, start_phase, vignetting};
use spikelane::error::Result;
use spikelane::pixel::Op;
use spikelane::spikes::{Geometry, SpikeFramesRef};
use spikelane::unstable::draws::Seeds;
use spikelane::unstable::plan::Plan;
use spikelane::unstable::{inputs, threads};
use spikelane_calibrate::{Stimulus, StimulusPattern};
use spikelane_io::simulate::{FrameRef, Simulator};

/// Returns the names and the floors of the statistics of a simulated set.
pub(crate) fn statistics(setup: &Setup, sample: &Sample, seed: u64) -> Result<Vec<DiagnosticStatistic>> {
    Ok(simulate_vector(setup, sample, seed)?.statistics)
}

fn simulate_vector(setup: &Setup, sample: &Sample, seed: u64) -> Result<StatisticsVector> {
    if setup.has_rate_maps {
        return simulate_rate_maps(setup, sample, seed);
    }
    Ok(statistics_vector(setup, &scans(setup, sample, seed)?))
}

/// Simulates all recordings of the set and returns their scans.
pub(crate) fn scans(setup: &Setup, sample: &Sample, seed: u64) -> Result<Vec<Scan>> {
    let scenes = 0..setup.recordings.len();
    if setup.only_still() {
        return threads::try_map(scenes, |k| scan_of_recording(setup, sample, k, seed));
    }
    let model = model_of(setup, sample, seed)?;
    let scene = |k: usize| match setup.recordings[k].static_scene {
        Some(_) => scan_of_recording(setup, sample, k, seed),
        None => scan_of(setup.geometry, &bits_of(setup, &model, sample, k, seed)?, &setup.recordings[k]),
    };
    threads::try_map(scenes, scene)
}

/// Returns the simulated statistics vector of `sample`.
pub(crate) fn values(setup: &Setup, sample: &Sample, seed: u64) -> Result<DVector<f64>> {
    cached_or(setup, sample, seed, || Ok(simulate_vector(setup, sample, seed)?.values))
}

/// Returns the statistics vector of `sample` from the cache. If the cache does not contain it, and the deadline has
/// not passed, `simulate` computes it.
pub(crate) fn cached_or(
    setup: &Setup,
    sample: &Sample,
    seed: u64,
    simulate: impl FnOnce() -> Result<Vec<f64>>,
) -> Result<DVector<f64>> {
    let simulate = || sample.context.deadline.check().and_then(|()| simulate());
    let values = match &sample.context.cache {
        Some(cache) => {
            cache.get_or_simulate(cache.key(|hasher| hash_inputs(setup, sample, seed, hasher)), simulate)
        }
        None => simulate(),
    };
    values.map(DVector::from_vec)
}

/// Simulates and scans recording `k` of the set.
pub(crate) fn scan_of_recording(setup: &Setup, sample: &Sample, k: usize, seed: u64) -> Result<Scan> {
    let scene = &setup.recordings[k];
    if let Some(static_scene) = &scene.static_scene {
        return simulate_static_scene(static_scene, camera_for(setup, &sample.camera), seeds(seed, k), scene);
    }
    scan_of(setup.geometry, &bits(setup, sample, k, seed)?, scene)
}

/// Returns `camera` with the frame size and the readout rate of the set.
fn camera_for(setup: &Setup, camera: &Camera) -> Camera {
    let mut camera = camera.clone();
    camera.sensor.geometry = setup.geometry;
    camera.sensor.readout_hz = setup.readout_hz;
    camera
}

/// Returns the camera with a drawn fixed pattern. All recordings use the same pattern. It is drawn only once,
/// because this takes a large part of the time of a simulation plan.
fn model_of(setup: &Setup, sample: &Sample, seed: u64) -> Result<Model> {
    camera_for(setup, &sample.camera).model(seeds(seed, 0))
}

/// Simulates the bits of recording `k` of the set.
pub(crate) fn bits(setup: &Setup, sample: &Sample, k: usize, seed: u64) -> Result<Vec<u8>> {
    bits_of(setup, &model_of(setup, sample, seed)?, sample, k, seed)
}

fn bits_of(setup: &Setup, model: &Model, sample: &Sample, k: usize, seed: u64) -> Result<Vec<u8>> {
    let scene = &setup.recordings[k];
    let lamp = sample.lamps[k];
    let mut model = with_random_phase(model, seed, k);
    let events = sample.pinned.places(k);
    if model.ops.iter().any(|op| is_replaced(op, &events)) {
        model.to_mut().ops.retain(|op| !is_replaced(op, &events));
    }
    let plan = Plan::from_model(&model, seeds(seed, k), (scene.max_light() * lamp).max(0.01))?;
    let mut simulator = Simulator::from_plan(plan);
    let (bytes, width) = (setup.geometry.frame_bytes(), setup.geometry.width());
    let total = scene.first_readout + scene.readouts + events[0].map_or(0, <[usize]>::len);
    let mut out = inputs::zeroed_vec("simulated readouts", total * bytes)?;
    let hold = match scene.light {
        Stimulus::Scene(StimulusPattern::Square { half_period, .. }) => half_period as usize,
        _ => total,
    };
    let (mut filled, mut at) = (0, 0);
    while filled < total {
        // If a camera loses readouts, the light continues. Later steps of the light therefore have a smaller index
        // in the file.
        let count = (hold - at % hold).min(total - filled);
        let level = |p: usize| scene.light.level_at(p / width, p % width, at as u64).unwrap_or(0.0);
        let samples: Vec<f32> = (0..setup.geometry.pixels()).map(|p| (lamp * level(p)) as f32).collect();
        let frame = FrameRef::new(&samples);
        filled += simulator.advance(frame, count, &mut out[filled * bytes..])?;
        at += count;
    }
    apply_events(&mut out, bytes, &events, scene.first_readout);
    out.drain(..scene.first_readout * bytes);
    Ok(out)
}

/// Returns the model with a random phase of flicker for each recording, because a recording begins at any phase.
/// With one phase for all simulations, slow flicker would always change the response to a square wave in the same
/// way.
fn with_random_phase(model: &Model, seed: u64, k: usize) -> Cow<'_, Model> {
    let is_flicker = |op: &Op| matches!(op, Op::Flicker { depth, .. } if *depth != 0.0);
    if !model.ops.iter().any(is_flicker) {
        return Cow::Borrowed(model);
    }
    // The fractional parts of multiples of the golden ratio and of the plastic number are uniformly distributed.
    let phase = (0.618_034 * (seed % 1_000_003) as f64 + 0.754_878 * k as f64).fract();
    let mut shifted = model.clone();
    for op in &mut shifted.ops {
        if let Op::Flicker { phase_turns, .. } = op {
            *phase_turns = phase;
        }
    }
    Cow::Owned(shifted)
}

fn seeds(seed: u64, k: usize) -> Seeds {
    Seeds { camera: seed, shot: seed ^ 0x5EED, sequence: k as u64 }
}

fn scan_of(geometry: Geometry, bytes: &[u8], scene: &RecordedScene) -> Result<Scan> {
    scan(SpikeFramesRef::new(geometry, bytes)?, scene.scan_options())
}

/// Effects whose patterns vary little between neighbors. The surface of a recorded scene already contains these
/// patterns, so they are removed from the simulated camera.
const SURFACE_EFFECTS: [&Definition; 3] = [&vignetting::EFFECT, &edge_columns::EFFECT, &smooth_prnu::EFFECT];

/// Simulates a camera that records the surface of a static scene. The surface is the mean of the measured rates
/// around each pixel, without the differences between neighbors.
pub(crate) fn simulate_static_scene(
    static_scene: &StaticScene,
    camera: Camera,
    seeds: Seeds,
    scene: &RecordedScene,
) -> Result<Scan> {
    let geometry = camera.sensor.geometry;
    // The start phases of the pixels are unknown, so they are random.
    let mut camera = camera.with_effect(start_phase::EFFECT.neutral().with_value("share", 1.0)?);
    for effect in SURFACE_EFFECTS {
        camera = camera.without_effect(effect.name);
    }
    let light = |rate: &f64| {
        let light = camera.operating_point(*rate).light;
        if light.is_finite() { light.clamp(0.0, 1.0) as f32 } else { 0.0 }
    };
    let samples: Vec<f32> = static_scene.surface.iter().map(light).collect();
    let mut simulator = Simulator::from_plan(Plan::with_max_light(&camera, seeds, 1.0)?);
    let mut bits = inputs::zeroed_vec("simulated readouts", LEAD_READOUTS * geometry.frame_bytes())?;
    simulator.fill(&samples, &mut bits)?;
    bits.resize(scene.readouts * geometry.frame_bytes(), 0);
    simulator.fill(&samples, &mut bits)?;
    let mut scan_result = scan(
        SpikeFramesRef::new(geometry, &bits)?,
        ScanOptions { with_intervals: scene.is_dim(), ..ScanOptions::default() },
    )?;
    static_scene.retain_uniform(&mut scan_result);
    Ok(scan_result)
}

/// Returns the statistics of the maps of gain and dark current that the fixed pattern of a simulated camera causes.
pub(crate) fn simulate_rate_maps(setup: &Setup, sample: &Sample, seed: u64) -> Result<StatisticsVector> {
    let seeds = Seeds { camera: seed, shot: 0, sequence: 0 };
    let model = camera_for(setup, &sample.camera).model(seeds)?;
    let laws = (0..setup.geometry.pixels()).map(|p| model.law(p));
    let (gain, dark): (Vec<f64>, Vec<f64>) =
        laws.map(|l| (l.gain / l.threshold, l.dark / l.threshold)).unzip();
    Ok(rate_map_statistics(&gain, &dark, setup))
}
