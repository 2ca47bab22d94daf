//! A set as a camera would give it.

use std::borrow::Cow;

use super::fixed::replaced;
use super::key::hash;
use super::sample::Sample;
use super::still;
use crate::diagnose::events::places::put_in;
use crate::diagnose::protocol::recorded::RecordedScene;
use crate::diagnose::protocol::recorded_set::Setup;
use crate::diagnose::recording::scan::{Scan, scan};
use crate::diagnose::statistics::all::vector;
use crate::diagnose::statistics::entry::DiagnosticStatistic;
use crate::diagnose::statistics::entry::Vector;
use crate::{Stimulus, StimulusPattern};
use spikelane::effects::{Camera, Model};
use spikelane::error::Result;
use spikelane::pixel::Op;
use spikelane::spikes::{Geometry, SpikeFramesRef};
use spikelane::unstable::draws::Seeds;
use spikelane::unstable::inputs;
use spikelane::unstable::plan::Plan;
use spikelane::unstable::threads;
use spikelane_io::simulate::{FrameRef, Simulator};

/// The entries of the vector.
pub(in crate::diagnose) fn statistics(
    setup: &Setup,
    sample: &Sample,
    seed: u64,
) -> Result<Vec<DiagnosticStatistic>> {
    Ok(statistics_of(setup, sample, seed)?.statistics)
}

fn statistics_of(setup: &Setup, sample: &Sample, seed: u64) -> Result<Vector> {
    if setup.has_rate_maps {
        return still::maps(setup, sample, seed);
    }
    Ok(vector(setup, &scans(setup, sample, seed)?))
}

/// Scans of the set as `sample` would give it.
pub(in crate::diagnose) fn scans(setup: &Setup, sample: &Sample, seed: u64) -> Result<Vec<Scan>> {
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

/// The vector.
pub(in crate::diagnose) fn values(setup: &Setup, sample: &Sample, seed: u64) -> Result<Vec<f64>> {
    kept_or(setup, sample, seed, || Ok(statistics_of(setup, sample, seed)?.values))
}

/// The vector of `sample` from the cache, or from `simulate` if there is time.
pub(in crate::diagnose) fn kept_or(
    setup: &Setup,
    sample: &Sample,
    seed: u64,
    simulate: impl FnOnce() -> Result<Vec<f64>>,
) -> Result<Vec<f64>> {
    let simulate = || sample.context.deadline.check().and_then(|()| simulate());
    match &sample.context.cache {
        Some(cache) => cache.or(cache.key(|hasher| hash(setup, sample, seed, hasher)), simulate),
        None => simulate(),
    }
}

/// One recording of the simulated set.
pub(in crate::diagnose) fn scan_of_recording(
    setup: &Setup,
    sample: &Sample,
    k: usize,
    seed: u64,
) -> Result<Scan> {
    let scene = &setup.recordings[k];
    if let Some(still) = &scene.static_scene {
        return still::recording(still, sized(setup, &sample.camera), seeds(seed, k), scene);
    }
    scan_of(setup.geometry, &bits(setup, sample, k, seed)?, scene)
}

/// The camera at this set's size and rate.
fn sized(setup: &Setup, camera: &Camera) -> Camera {
    let mut camera = camera.clone();
    camera.sensor.geometry = setup.geometry;
    camera.sensor.readout_hz = setup.readout_hz;
    camera
}

/// The camera with its fixed pattern drawn: the same for all recordings, and a good part of the work of planning one.
fn model_of(setup: &Setup, sample: &Sample, seed: u64) -> Result<Model> {
    sized(setup, &sample.camera).model(seeds(seed, 0))
}

/// The bits of one recording of the simulated set.
pub(in crate::diagnose) fn bits(setup: &Setup, sample: &Sample, k: usize, seed: u64) -> Result<Vec<u8>> {
    bits_of(setup, &model_of(setup, sample, seed)?, sample, k, seed)
}

fn bits_of(setup: &Setup, model: &Model, sample: &Sample, k: usize, seed: u64) -> Result<Vec<u8>> {
    let scene = &setup.recordings[k];
    let lamp = sample.lamps[k];
    let mut model = in_any_phase(model, seed, k);
    let events = sample.pinned.places(k);
    if model.ops.iter().any(|op| replaced(op, &events)) {
        model.to_mut().ops.retain(|op| !replaced(op, &events));
    }
    let plan = Plan::from_model(&model, seeds(seed, k), (scene.greatest() * lamp).max(0.01))?;
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
        // A camera that drops readouts does not stop the light: edges then come early in the file.
        let now = (hold - at % hold).min(total - filled);
        let level = |p: usize| scene.light.level_at(p / width, p % width, at as u64).unwrap_or(0.0);
        let samples: Vec<f32> = (0..setup.geometry.pixels()).map(|p| (lamp * level(p)) as f32).collect();
        let frame = FrameRef::new(&samples);
        filled += simulator.advance(frame, now, &mut out[filled * bytes..])?;
        at += now;
    }
    put_in(&mut out, bytes, &events, scene.first_readout);
    out.drain(..scene.first_readout * bytes);
    Ok(out)
}

/// A recording begins anywhere in a flicker's swing: with one phase for all, slow flicker would have to move a
/// square wave's response as it does at that phase.
fn in_any_phase(model: &Model, seed: u64, k: usize) -> Cow<'_, Model> {
    let is_flicker = |op: &Op| matches!(op, Op::Flicker { depth, .. } if *depth != 0.0);
    if !model.ops.iter().any(is_flicker) {
        return Cow::Borrowed(model);
    }
    // Fractions of the golden ratio's and of the plastic number's multiples spread evenly.
    let phase = (0.618_034 * (seed % 1_000_003) as f64 + 0.754_878 * k as f64).fract();
    let mut turned = model.clone();
    for op in &mut turned.ops {
        if let Op::Flicker { phase_turns, .. } = op {
            *phase_turns = phase;
        }
    }
    Cow::Owned(turned)
}

fn seeds(seed: u64, k: usize) -> Seeds {
    Seeds { camera: seed, shot: seed ^ 0x5EED, sequence: k as u64 }
}

fn scan_of(geometry: Geometry, bytes: &[u8], scene: &RecordedScene) -> Result<Scan> {
    scan(SpikeFramesRef::new(geometry, bytes)?, scene.look())
}
