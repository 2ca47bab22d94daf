//! Fits wrong parameters of a given camera before any effect is added.
//!
//! The lamps are part of the fit. The found light has an error of some thousandths, and the rates of the pixels
//! have an error of a hundredth of this. Without the lamps, the base parameters would move by several standard
//! deviations to explain this error of the light.

use std::sync::atomic::AtomicUsize;

use crate::null_model::baseline::StartingCamera;
use crate::null_model::derivatives::{Changes, changes, lit, pairs, with_lamps};
use crate::null_model::vectors::{average, matrix, spread};
use crate::recordings::setup::Setup;
use crate::sensors::deadline::SimulationContext;
use crate::sensors::model::Model;
use crate::sensors::simulate;
use crate::thresholds::{
    BASE_FIT_LAMP_DRAWS, BASE_FIT_LAMP_STEPS, BASE_PARAMETER_UNCERTAINTY, MAX_BASE_FIT_STEP,
    MAX_BASE_FIT_STEPS, MAX_BASE_FIT_Z, MAX_DERIVATIVE_MOVE, MIN_BASE_FIT_SIMULATIONS, MIN_BASE_FIT_STEP,
};
use nalgebra::{DMatrix, DVector};
use spikelane::effects::Camera;
use spikelane::error::Result;
use spikelane::unstable::threads;

/// The lamps of the lit recordings as parameters of the fit.
struct Lamps {
    /// Change of each statistic per unit of the deviation of each lamp.
    slopes: DMatrix<f64>,
    /// Standard deviation of each lamp.
    uncertainties: Vec<f64>,
}

impl Lamps {
    fn new(setup: &Setup, model: &Model, entries: usize, seed: u64) -> Result<Self> {
        let lit = lit(model);
        let draw = |i: usize| Ok(with_lamps(setup, model, seed + i as u64)?.lamps);
        let all: Vec<Vec<DVector<f64>>> = threads::try_map(0..BASE_FIT_LAMP_DRAWS, draw)?;
        let mean = |k: usize| average(&all.iter().map(|own| own[k].clone()).collect::<Vec<_>>());
        let slopes = matrix(&(0..lit.len()).map(mean).collect::<Vec<_>>(), entries);
        let uncertainties = lit.iter().map(|k| setup.recordings[*k].light_uncertainty).collect();
        Ok(Self { slopes, uncertainties })
    }

    /// Returns the slopes, divided by the standard deviations of the statistics and multiplied by `weight`, the
    /// square root of a weight.
    fn weighted(&self, sd: &[f64], weight: impl Fn(usize) -> f64) -> DMatrix<f64> {
        DMatrix::from_fn(self.slopes.nrows(), self.slopes.ncols(), |i, k| {
            weight(i) * self.slopes[(i, k)] / sd[i]
        })
    }

    fn known(&self) -> DVector<f64> {
        DVector::from_iterator(self.uncertainties.len(), self.uncertainties.iter().map(|u| u.powi(-2)))
    }

    /// Returns the deviations of the lamps that explain `z` best, and the remaining part of `z`. `z` is the
    /// deviation of the statistics in standard deviations.
    fn fit(&self, z: DVector<f64>, sd: &[f64]) -> (DVector<f64>, DVector<f64>) {
        let all = self.weighted(sd, |_| 1.0);
        let mut found = DVector::zeros(self.uncertainties.len());
        let mut left = z.clone();
        for _ in 0..BASE_FIT_LAMP_STEPS {
            let weight = |i: usize| usual_weight(left[i]);
            let l = self.weighted(sd, weight);
            let off = DVector::from_fn(z.len(), |i, _| weight(i) * z[i]);
            let information = l.transpose() * &l + DMatrix::from_diagonal(&self.known());
            let Some(factor) = information.cholesky() else { break };
            found = factor.solve(&(l.transpose() * off));
            left = &z - &all * &found;
        }
        (found, left)
    }
}

/// Returns the square root of the Huber weight of a statistic that deviates by `z` standard deviations.
fn usual_weight(z: f64) -> f64 {
    (MAX_BASE_FIT_Z / z.abs().max(1e-9)).min(1.0).sqrt()
}

/// A camera with its simulations and its deviation from the data.
struct Place {
    model: Model,
    each: Vec<DVector<f64>>,
    /// Standard deviation of each statistic between sensors: `spread` without floors, `sd` with floors.
    spread: Vec<f64>,
    sd: Vec<f64>,
    /// Deviations of the lamps from the found light.
    lamps: DVector<f64>,
    /// Deviation of the data in standard deviations, without the part that the lamps explain. `cost` is its robust
    /// square.
    z: DVector<f64>,
    cost: f64,
}

/// Fits the base parameters of `camera` to `data`. The result contains the last simulations, which the null model
/// reuses. If the camera does not deviate from the data, it is returned unchanged.
pub(crate) fn rebased(
    setup: &Setup,
    camera: &Camera,
    data: &DVector<f64>,
    seed: u64,
    context: &SimulationContext,
) -> Result<StartingCamera> {
    let floors = floors(setup, camera, seed)?;
    let model = |camera| Model::base(camera, setup).with_context(context);
    let lamps = Lamps::new(setup, &model(camera.clone()), floors.len(), seed)?;
    let of = |camera| Place::of(setup, model(camera), data, seed, &floors, &lamps);
    let mut best = of(camera.clone())?;
    let given = best.model.clone();
    // The base parameters of a camera without noise and without spreads cannot be fitted to a static scene.
    if given.knobs.is_empty() {
        return Ok(StartingCamera::new(best.model.camera, context));
    }
    let mut moved = best.changes(setup, seed)?;
    let mut derivatives = moved.jacobian(&best.model, &best.spread);
    let mut fresh = true;
    for _ in 0..MAX_BASE_FIT_STEPS {
        let (by, length) = best.wanted(&derivatives, &given, &lamps);
        if length < MIN_BASE_FIT_STEP {
            break;
        }
        let camera = best.model.sample(by.as_slice(), &[])?.camera;
        let next = of(camera)?;
        let closer = next.cost < best.cost;
        if closer {
            // A column is the change per relative change of a parameter. The parameter is now larger by the factor
            // `1 + by`.
            for (j, by) in by.iter().enumerate() {
                derivatives.column_mut(j).scale_mut(1.0 + by);
            }
            (best, moved) = (next, Changes::default());
        }
        if !closer && fresh {
            break;
        }
        fresh = !closer || by.amax() > MAX_DERIVATIVE_MOVE;
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

/// Returns the smallest relevant deviation of each statistic.
fn floors(setup: &Setup, camera: &Camera, seed: u64) -> Result<Vec<f64>> {
    let still = Model::base(camera.clone(), setup).sample(&[], &[])?;
    Ok(simulate::statistics(setup, &still, seed)?.iter().map(|s| s.floor).collect())
}

impl Place {
    fn of(
        setup: &Setup,
        model: Model,
        data: &DVector<f64>,
        seed: u64,
        floors: &[f64],
        lamps: &Lamps,
    ) -> Result<Self> {
        let still = model.sample(&[], &[])?;
        let one = |i: usize| simulate::values(setup, &still, seed + i as u64);
        let count = MIN_BASE_FIT_SIMULATIONS.max(pairs(setup));
        let each: Vec<DVector<f64>> = threads::try_map(0..count, one)?;
        let (mean, spread) = (average(&each), spread(&each));
        let sd: Vec<f64> = spread.iter().zip(floors).map(|(s, f)| s.hypot(*f)).collect();
        let (lamps, z) = lamps.fit(DVector::from_fn(mean.len(), |j, _| (data[j] - mean[j]) / sd[j]), &sd);
        let huber = |z: &f64| {
            if z.abs() < MAX_BASE_FIT_Z { z * z } else { MAX_BASE_FIT_Z * (2.0 * z.abs() - MAX_BASE_FIT_Z) }
        };
        let cost = z.iter().map(huber).sum();
        Ok(Self { model, each, spread, sd, lamps, z, cost })
    }

    /// Returns the changes of the statistics by a step of each parameter.
    fn changes(&self, setup: &Setup, seed: u64) -> Result<Changes> {
        changes(setup, &self.model, seed, &self.each, 0..pairs(setup), &AtomicUsize::new(0))
    }

    /// Returns the robust Gauss-Newton step, and its length in standard deviations. The prior is centered at the
    /// parameters of `given`. Statistics count as independent, because correlations from a few dozen simulations
    /// are mostly noise. With such correlations, the steps would follow the noise.
    fn wanted(&self, derivatives: &DMatrix<f64>, given: &Model, lamps: &Lamps) -> (DVector<f64>, f64) {
        let n = derivatives.ncols();
        let all = n + self.lamps.len();
        let weight = |i: usize| usual_weight(self.z[i]);
        let mut j = DMatrix::zeros(self.z.len(), all);
        j.columns_mut(0, n).copy_from(&DMatrix::from_fn(self.z.len(), n, |i, k| {
            weight(i) * derivatives[(i, k)] / self.sd[i]
        }));
        j.columns_mut(n, all - n).copy_from(&lamps.weighted(&self.sd, weight));
        let off = DVector::from_fn(self.z.len(), |i, _| weight(i) * self.z[i]);
        let now_by_first = |k: usize| self.model.knobs[k].center / given.knobs[k].center;
        let of_lamps = lamps.known();
        let known = DVector::from_fn(all, |k, _| match k.checked_sub(n) {
            None => (now_by_first(k) / BASE_PARAMETER_UNCERTAINTY).powi(2),
            Some(k) => of_lamps[k],
        });
        let leans = DVector::from_fn(all, |k, _| match k.checked_sub(n) {
            None => known[k] * (1.0 / now_by_first(k) - 1.0),
            Some(lamp) => -known[k] * self.lamps[lamp],
        });
        let information = j.transpose() * &j + DMatrix::from_diagonal(&known);
        let right = j.transpose() * off + leans;
        let Some(covariance) = information.try_inverse() else { return (DVector::zeros(n), 0.0) };
        let wanted = &covariance * right;
        let step = wanted.rows(0, n).map(|s| s.clamp(-MAX_BASE_FIT_STEP, MAX_BASE_FIT_STEP));
        let own = covariance.view((0, 0), (n, n)).into_owned().try_inverse();
        let length = own.map_or(0.0, |own| step.dot(&(own * &step)).sqrt());
        (step, length)
    }
}
