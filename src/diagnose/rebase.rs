//! A camera that is given, and whose own numbers are wrong: they are corrected before anything is added.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::model::Model;
use super::reference::average;
use super::setup::Setup;
use crate::effects::Camera;
use crate::error::Result;

/// Simulations of the mean, of each derivative, and steps at most.
const MEAN: usize = 12;
const DERIVATIVE: usize = 4;
const STEPS: usize = 10;

/// Relative step of a derivative, and the furthest that a number moves at once.
const STEP: f64 = 0.08;
const TRUST: f64 = 0.45;

/// Relative uncertainty of a number before the data are seen: what they do not show stays as it was.
const PRIOR: f64 = 1.0;

/// Length of a step, in deviations of what the set tells, after which no other is taken.
const SMALL: f64 = 0.5;

/// A statistic further off than this many deviations counts as this far: one effect that is missing
/// must not bend every number.
const USUAL: f64 = 6.0;

/// `camera` with its base numbers fitted to `data`.
pub(super) fn rebased(setup: &Setup, camera: &Camera, data: &DVector<f64>, seed: u64) -> Result<Camera> {
    let mut camera = camera.clone();
    let floors: Vec<f64> = setup
        .statistics(&Model::base(camera.clone(), setup).sample(&[], &[], setup.scenes.len())?, seed)?
        .iter()
        .map(|s| s.floor)
        .collect();
    let (mut best, mut best_camera) = (f64::INFINITY, camera.clone());
    for step in 0..STEPS {
        let model = Model::base(camera.clone(), setup);
        let each = simulate(setup, &model, &[], seed, MEAN)?;
        let mean = average(&each);
        let sd: Vec<f64> = (0..mean.len()).map(|j| deviation(&each, &mean, j).hypot(floors[j])).collect();
        let z = DVector::from_fn(mean.len(), |j, _| (data[j] - mean[j]) / sd[j]);
        let cost: f64 =
            z.iter().map(|z| if z.abs() < USUAL { z * z } else { USUAL * (2.0 * z.abs() - USUAL) }).sum();
        if cost < best {
            (best, best_camera) = (cost, camera.clone());
        } else if step > 3 {
            break;
        }
        let (moved, length) = wanted(setup, &model, &each, &sd, &z, seed)?;
        camera = model.sample(moved.as_slice(), &[], setup.scenes.len())?.camera;
        if length < SMALL {
            return Ok(camera);
        }
    }
    Ok(best_camera)
}

fn simulate(setup: &Setup, model: &Model, u: &[f64], seed: u64, count: usize) -> Result<Vec<DVector<f64>>> {
    let sample = model.sample(u, &[], setup.scenes.len())?;
    let one = |i: usize| Ok(DVector::from_vec(setup.values(&sample, seed + i as u64)?));
    (0..count).into_par_iter().map(one).collect()
}

fn deviation(each: &[DVector<f64>], mean: &DVector<f64>, j: usize) -> f64 {
    (each.iter().map(|v| (v[j] - mean[j]).powi(2)).sum::<f64>() / (each.len() - 1) as f64).sqrt()
}

/// The robust Gauss-Newton step, and its length in its own deviations.
fn wanted(
    setup: &Setup,
    model: &Model,
    each: &[DVector<f64>],
    sd: &[f64],
    z: &DVector<f64>,
    seed: u64,
) -> Result<(DVector<f64>, f64)> {
    let n = model.knobs.len();
    let column = |j: usize| -> Result<DVector<f64>> {
        let mut u = vec![0.0; n];
        u[j] = STEP;
        let moved = simulate(setup, model, &u, seed, DERIVATIVE)?;
        let change: Vec<DVector<f64>> = moved.iter().zip(each).map(|(a, b)| a - b).collect();
        let mean = average(&change);
        Ok(DVector::from_fn(sd.len(), |i, _| {
            let weight = (USUAL / z[i].abs().max(1e-9)).min(1.0).sqrt();
            weight * mean[i] / sd[i] / STEP
        }))
    };
    let columns = (0..n).map(column).collect::<Result<Vec<_>>>()?;
    let j = DMatrix::from_columns(&columns);
    let off = z.map(|z| z * (USUAL / z.abs().max(1e-9)).min(1.0).sqrt());
    let information = j.transpose() * &j + DMatrix::identity(n, n) / (PRIOR * PRIOR);
    let wanted = information.clone().lu().solve(&(j.transpose() * off)).unwrap_or_else(|| DVector::zeros(n));
    let step = wanted.map(|s| s.clamp(-TRUST, TRUST));
    let length = step.dot(&(information * &step)).sqrt();
    Ok((step, length))
}
