//! A camera that is given, and whose own numbers are wrong: they are corrected before anything is added.

use std::sync::atomic::AtomicUsize;

use crate::diagnose::null::baseline::StartingCamera;
use crate::diagnose::null::derivatives::{Changes, changes, pairs};
use crate::diagnose::null::mean::average;
use crate::diagnose::protocol::recorded_set::Setup;
use crate::diagnose::sensors::context::SimulationContext;
use crate::diagnose::sensors::model::Model;
use crate::diagnose::sensors::simulate;
use nalgebra::{DMatrix, DVector};
use spikelane::effects::Camera;
use spikelane::error::Result;
use spikelane::unstable::threads;

/// Simulations of the mean at least, and steps at most.
const MEAN: usize = 24;
const STEPS: usize = 10;

/// The furthest that a number moves at once, relative to itself, and how far it may move before derivatives are taken anew.
const TRUST: f64 = 0.45;
const STALE: f64 = 0.15;

/// Relative uncertainty of the camera's own numbers before the data are seen: what they do not show stays as it was.
const PRIOR: f64 = 0.3;

/// Length of a step, in deviations of what the set tells, after which no other is taken.
const SMALL: f64 = 0.5;

/// A statistic further off than this many deviations counts as this far: one effect that is missing
/// must not bend every number.
const USUAL: f64 = 6.0;

/// A camera's place: what its sensors show, and how far the data are off.
struct Place {
    model: Model,
    each: Vec<DVector<f64>>,
    /// Deviations of one sensor, without and with floors.
    spread: Vec<f64>,
    sd: Vec<f64>,
    /// How far the data are off, in deviations, and robustly in all.
    z: DVector<f64>,
    cost: f64,
}

/// `camera` with its base numbers fitted to `data`; what was simulated of it on the way serves its reference. A camera of which no
/// number is off stays as it is.
pub(in crate::diagnose) fn rebased(
    setup: &Setup,
    camera: &Camera,
    data: &DVector<f64>,
    seed: u64,
    context: &SimulationContext,
) -> Result<StartingCamera> {
    let floors = floors(setup, camera, seed)?;
    let of = |camera| Place::of(setup, Model::base(camera, setup).with_context(context), data, seed, &floors);
    let mut best = of(camera.clone())?;
    let given = best.model.clone();
    let mut moved = best.changes(setup, seed)?;
    let mut derivatives = moved.jacobian(&best.model, &best.spread);
    let mut fresh = true;
    for _ in 0..STEPS {
        let (by, length) = best.wanted(&derivatives, &given);
        if length < SMALL {
            break;
        }
        let camera = best.model.sample(by.as_slice(), &[], setup.recordings.len())?.camera;
        let next = of(camera)?;
        let closer = next.cost < best.cost;
        if closer {
            // Columns are per share of a number's own value.
            for (j, by) in by.iter().enumerate() {
                derivatives.column_mut(j).scale_mut(1.0 + by);
            }
            (best, moved) = (next, Changes::default());
        }
        if !closer && fresh {
            break;
        }
        fresh = !closer || by.amax() > STALE;
        if fresh {
            moved = best.changes(setup, seed)?;
            derivatives = moved.jacobian(&best.model, &best.spread);
        }
    }
    Ok(StartingCamera {
        camera: best.model.camera,
        vectors: best.each,
        changes: moved,
        context: context.clone(),
    })
}

/// What deviations are too small to matter.
fn floors(setup: &Setup, camera: &Camera, seed: u64) -> Result<Vec<f64>> {
    let still = Model::base(camera.clone(), setup).sample(&[], &[], setup.recordings.len())?;
    Ok(simulate::statistics(setup, &still, seed)?.iter().map(|s| s.floor).collect())
}

impl Place {
    fn of(setup: &Setup, model: Model, data: &DVector<f64>, seed: u64, floors: &[f64]) -> Result<Self> {
        let still = model.sample(&[], &[], setup.recordings.len())?;
        let one = |i: usize| Ok(DVector::from_vec(simulate::values(setup, &still, seed + i as u64)?));
        let count = MEAN.max(pairs(setup));
        let each: Vec<DVector<f64>> = threads::try_map(0..count, one)?;
        let mean = average(&each);
        let square = |j: usize| each.iter().map(|v| (v[j] - mean[j]).powi(2)).sum::<f64>();
        let spread: Vec<f64> = (0..mean.len()).map(|j| (square(j) / (count - 1) as f64).sqrt()).collect();
        let sd: Vec<f64> = spread.iter().zip(floors).map(|(s, f)| s.hypot(*f)).collect();
        let z = DVector::from_fn(mean.len(), |j, _| (data[j] - mean[j]) / sd[j]);
        let huber = |z: &f64| if z.abs() < USUAL { z * z } else { USUAL * (2.0 * z.abs() - USUAL) };
        let cost = z.iter().map(huber).sum();
        Ok(Self { model, each, spread, sd, z, cost })
    }

    /// What its numbers move: entries that are noise count as none, as among hundreds they would hide what a number does, and
    /// it would not move.
    fn changes(&self, setup: &Setup, seed: u64) -> Result<Changes> {
        changes(setup, &self.model, seed, &self.each, 0..pairs(setup), &AtomicUsize::new(0))
    }

    /// The robust Gauss-Newton step, drawn to the numbers of `given`, and its length in its own deviations. Statistics count as
    /// independent: correlations of a few dozen simulations are noise for the most part, and steps by them wander.
    fn wanted(&self, derivatives: &DMatrix<f64>, given: &Model) -> (DVector<f64>, f64) {
        let n = derivatives.ncols();
        let weight = |i: usize| (USUAL / self.z[i].abs().max(1e-9)).min(1.0).sqrt();
        let j = DMatrix::from_fn(derivatives.nrows(), n, |i, k| weight(i) * derivatives[(i, k)] / self.sd[i]);
        let off = DVector::from_fn(self.z.len(), |i, _| weight(i) * self.z[i]);
        let now_by_first = |k: usize| self.model.knobs[k].center / given.knobs[k].center;
        let known = DVector::from_fn(n, |k, _| (now_by_first(k) / PRIOR).powi(2));
        let leans = DVector::from_fn(n, |k, _| known[k] * (1.0 / now_by_first(k) - 1.0));
        let information = j.transpose() * &j + DMatrix::from_diagonal(&known);
        let right = j.transpose() * off + leans;
        let wanted = information.clone().lu().solve(&right).unwrap_or_else(|| DVector::zeros(n));
        let step = wanted.map(|s| s.clamp(-TRUST, TRUST));
        let length = step.dot(&(information * &step)).sqrt();
        (step, length)
    }
}
