//! What a camera records of a static scene, and its maps of rates.

use super::sample::Sample;
use crate::diagnose::protocol::recorded::RecordedScene;
use crate::diagnose::protocol::recorded_set::Setup;
use crate::diagnose::protocol::still::StaticScene;
use crate::diagnose::recording::scan::{Look, Scan, scan};
use crate::diagnose::statistics::entry::Vector;
use crate::diagnose::statistics::rate_maps;
use spikelane::effects::{Camera, Definition, edge_columns, smooth_prnu, start_phase, vignetting};
use spikelane::error::Result;
use spikelane::spikes::SpikeFramesRef;
use spikelane::unstable::draws::Seeds;
use spikelane::unstable::inputs;
use spikelane::unstable::plan::Plan;
use spikelane_io::simulate::Simulator;

/// Readouts before the recording, in which models that start in step lose it.
const LEAD: usize = 200;

/// Patterns that the surface of a scene contains, because they vary little between neighbors. A camera with these effects would have
/// them twice.
const IN_THE_SURFACE: [&Definition; 3] = [&vignetting::EFFECT, &edge_columns::EFFECT, &smooth_prnu::EFFECT];

/// A camera in front of the scene's surface: the measured rates without what pixels side by side differ by.
pub(in crate::diagnose) fn recording(
    still: &StaticScene,
    camera: Camera,
    seeds: Seeds,
    scene: &RecordedScene,
) -> Result<Scan> {
    let geometry = camera.sensor.geometry;
    // Nobody knows where in their cycle the pixels were when the recording began.
    let mut camera = camera.with_effect(start_phase::EFFECT.neutral().with_value("share", 1.0)?);
    for effect in IN_THE_SURFACE {
        camera = camera.without_effect(effect.name);
    }
    let light = |rate: &f64| {
        let light = camera.operating_point(*rate).light;
        if light.is_finite() { light.clamp(0.0, 1.0) as f32 } else { 0.0 }
    };
    let samples: Vec<f32> = still.surface.iter().map(light).collect();
    let mut simulator = Simulator::from_plan(Plan::with_max_light(&camera, seeds, 1.0)?);
    let mut bits = inputs::zeroed_vec("simulated readouts", LEAD * geometry.frame_bytes())?;
    simulator.fill(&samples, &mut bits)?;
    bits.resize(scene.readouts * geometry.frame_bytes(), 0);
    simulator.fill(&samples, &mut bits)?;
    let mut found =
        scan(SpikeFramesRef::new(geometry, &bits)?, Look { dim: scene.dim(), ..Look::default() })?;
    still.keep(&mut found);
    Ok(found)
}

/// Statistics of the maps that a camera's fixed pattern gives.
pub(in crate::diagnose) fn maps(setup: &Setup, sample: &Sample, seed: u64) -> Result<Vector> {
    let mut camera = sample.camera.clone();
    camera.sensor.geometry = setup.geometry;
    camera.sensor.readout_hz = setup.readout_hz;
    let model = camera.model(Seeds { camera: seed, shot: 0, sequence: 0 })?;
    let laws = (0..setup.geometry.pixels()).map(|p| model.law(p));
    let (gain, dark): (Vec<f64>, Vec<f64>) =
        laws.map(|l| (l.gain / l.threshold, l.dark / l.threshold)).unzip();
    Ok(rate_maps::of_lines(&gain, &dark, setup))
}
