//! A set as a camera would give it.

use std::borrow::Cow;

use rayon::prelude::*;

use super::fixed::{Pinned, put_in, replaced};
use crate::calibrate::{Light, Scene as Pattern};
use crate::diagnose::protocol::recorded::Scene;
use crate::diagnose::protocol::recorded_set::Setup;
use crate::diagnose::protocol::still;
use crate::diagnose::recording::scan::{Scan, scan};
use crate::diagnose::statistics::all::{Statistic, Vector, vector};
use crate::draws::Seeds;
use crate::effects::{Camera, Model};
use crate::error::Result;
use crate::pixel::Op;
use crate::plan::Plan;
use crate::simulate::{FrameRef, Simulator};
use crate::spikes::{Geometry, Packed};

/// A camera and how far each scene's light is off: factors near one.
#[derive(Clone, Debug)]
pub(in crate::diagnose) struct Sample {
    pub camera: Camera,
    pub lamps: Vec<f64>,
    /// Lost and repeated readouts that are not left to chance.
    pub pinned: Pinned,
}

impl Setup {
    /// The entries of the vector.
    pub(in crate::diagnose) fn statistics(&self, sample: &Sample, seed: u64) -> Result<Vec<Statistic>> {
        Ok(self.vector(sample, seed)?.statistics)
    }

    fn vector(&self, sample: &Sample, seed: u64) -> Result<Vector> {
        if self.maps {
            return still::simulated_maps(self, sample, seed);
        }
        Ok(vector(self, &self.simulate(sample, seed)?))
    }

    /// Scans of the set as `sample` would give it.
    pub(in crate::diagnose) fn simulate(&self, sample: &Sample, seed: u64) -> Result<Vec<Scan>> {
        let scenes = (0..self.scenes.len()).into_par_iter();
        if self.only_still() {
            return scenes.map(|k| self.scene(sample, k, seed)).collect();
        }
        let model = self.model(sample, seed)?;
        let scene = |k: usize| match self.scenes[k].still {
            Some(_) => self.scene(sample, k, seed),
            None => scan_of(self.geometry, &self.bits_of(&model, sample, k, seed)?, &self.scenes[k]),
        };
        scenes.map(scene).collect()
    }

    pub(in crate::diagnose) fn values(&self, sample: &Sample, seed: u64) -> Result<Vec<f64>> {
        Ok(self.vector(sample, seed)?.values)
    }

    /// One recording of the simulated set.
    pub(in crate::diagnose) fn scene(&self, sample: &Sample, k: usize, seed: u64) -> Result<Scan> {
        let scene = &self.scenes[k];
        if let Some(still) = &scene.still {
            return still.simulate(self.sized(&sample.camera), seeds(seed, k), scene);
        }
        scan_of(self.geometry, &self.bits(sample, k, seed)?, scene)
    }

    /// The camera at this set's size and rate.
    fn sized(&self, camera: &Camera) -> Camera {
        let mut camera = camera.clone();
        camera.sensor.geometry = self.geometry;
        camera.sensor.readout_hz = self.readout_hz;
        camera
    }

    /// The camera with its fixed pattern drawn: the same for all recordings, and a good part of the work of planning one.
    fn model(&self, sample: &Sample, seed: u64) -> Result<Model> {
        self.sized(&sample.camera).model(seeds(seed, 0))
    }

    /// The bits of one recording of the simulated set.
    pub(in crate::diagnose) fn bits(&self, sample: &Sample, k: usize, seed: u64) -> Result<Vec<u8>> {
        self.bits_of(&self.model(sample, seed)?, sample, k, seed)
    }

    fn bits_of(&self, model: &Model, sample: &Sample, k: usize, seed: u64) -> Result<Vec<u8>> {
        let scene = &self.scenes[k];
        let lamp = sample.lamps[k];
        let mut model = in_any_phase(model, seed, k);
        let events = sample.pinned.places(k);
        if model.ops.iter().any(|op| replaced(op, &events)) {
            model.to_mut().ops.retain(|op| !replaced(op, &events));
        }
        let plan = Plan::of_model(&model, seeds(seed, k), (scene.greatest() * lamp).max(0.01))?;
        let mut simulator = Simulator::of_plan(plan);
        let (bytes, width) = (self.geometry.frame_bytes(), self.geometry.width());
        let total = scene.skip + scene.readouts + events[0].map_or(0, <[usize]>::len);
        let mut out = vec![0; total * bytes];
        let hold = match scene.light {
            Light::Scene(Pattern::Square { half_period, .. }) => half_period as usize,
            _ => total,
        };
        let (mut filled, mut at) = (0, 0);
        while filled < total {
            // A camera that drops readouts does not stop the light: edges then come early in the file.
            let now = (hold - at % hold).min(total - filled);
            let level = |p: usize| scene.light.at(p / width, p % width, at as u64).unwrap_or(0.0);
            let samples: Vec<f32> = (0..self.geometry.pixels()).map(|p| (lamp * level(p)) as f32).collect();
            let frame = FrameRef::f32(&samples, self.geometry);
            filled += simulator.expose(frame, now, &mut out[filled * bytes..])?;
            at += now;
        }
        put_in(&mut out, bytes, &events, scene.skip);
        out.drain(..scene.skip * bytes);
        Ok(out)
    }
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

fn scan_of(geometry: Geometry, bytes: &[u8], scene: &Scene) -> Result<Scan> {
    Ok(scan(Packed::new(geometry, bytes)?, scene.look()))
}
