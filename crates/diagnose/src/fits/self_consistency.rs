//! Comparison of a fitted model with its own simulations.

use crate::fits::fit::{Fit, trust};
use crate::fits::fitter::{Fitter, metric_allowing_events};
use crate::fits::likelihood::{own_noise, with_lamps};
use crate::fits::slopes::Secant;
use crate::light::offsets::LampDraw;
use crate::null_model::limits::{ALARM, Limits, center, gamma_limit, strays_by};
use crate::null_model::metric::Metric;
use crate::null_model::model::NullModel;
use crate::null_model::signature::Signature;
use crate::null_model::vectors::{mean_squares, normal_vectors};
use crate::sensors::simulate;
use crate::thresholds::{
    CALIBRATION_INFORMATION, MAX_REFITS, MEAN_SIMULATIONS, REDRAWN_SIMULATIONS, SOME_SIMULATIONS,
};
use nalgebra::{DMatrix, DVector};
use spikelane::error::Result;
use spikelane::unstable::threads;

/// Noise, limits and standard deviations of a fitted model, from its own simulations.
#[derive(Clone)]
pub(crate) struct SelfConsistency {
    pub metric: Metric,
    /// Median and standard deviation of the total misfit of these simulations, in the metric of the null model.
    pub floor: f64,
    pub floor_sd: f64,
    /// Median of the total misfit in the metric in which the numbers of events are free.
    pub allowed_floor: f64,
    /// Limits that sensors of this model hardly ever exceed.
    pub limits: Limits,
    pub mean: DVector<f64>,
    /// Standard deviation of each parameter.
    pub deviations: Vec<f64>,
    /// The part of `deviations` that does not depend on the fitted value. It comes from the noise of the null
    /// model.
    pub additive: Vec<f64>,
}

impl SelfConsistency {
    /// Returns the values of the base model, which the null model contains already.
    pub(crate) fn of_base(reference: &NullModel) -> Self {
        let known = vec![CALIBRATION_INFORMATION; reference.model.knobs.len()];
        let deviations = roots(&reference.metric.clone().knowing(&known).covariance());
        Self {
            additive: deviations.clone(),
            deviations,
            metric: reference.metric.clone(),
            floor: reference.clean.floor,
            floor_sd: reference.clean.floor_sd,
            allowed_floor: reference.clean.floor,
            limits: reference.clean.limits,
            mean: reference.mean.clone(),
        }
    }
}

/// A simulation whose parameters are drawn from their posterior.
struct Redrawn {
    moved: DVector<f64>,
    vector: DVector<f64>,
    /// Change of the vector by the drawn deviations of the lamps.
    by_lamps: DVector<f64>,
}

impl Fitter<'_> {
    /// Simulates the fitted model with parameters that are drawn from their posterior. Computes the noise and the
    /// limits of the model from these simulations.
    pub(crate) fn self_consistency(&self, fit: &mut Fit) -> Result<SelfConsistency> {
        let reference = self.reference;
        self.evaluate(fit, MEAN_SIMULATIONS)?;
        self.derive(fit, SOME_SIMULATIONS, Secant::Around)?;
        let known = fit.known();
        let redrawn = self.redrawn(fit, &known)?;
        let mean = fit.mean.clone();
        let each: Vec<DVector<f64>> = redrawn.iter().map(|r| r.vector.clone()).collect();
        let at_known_light: Vec<DVector<f64>> = redrawn.iter().map(|r| &r.vector - &r.by_lamps).collect();
        let noise = match own_noise(reference, &fit.events, &at_known_light, &mean, each.len() as f64)? {
            Some(noise) => with_lamps(reference, &noise)?,
            None => reference.noise.clone(),
        };
        let metric = Metric::new(&noise, fit.directions(reference)).knowing(&known);
        let open: Vec<&Signature> = reference.signatures.iter().filter(|s| fit.lacks(s)).collect();
        let strays: Vec<[f64; 3]> = each.iter().map(|s| strays_by(&metric, &(s - &mean), &open)).collect();
        let highest = |i: usize| strays.iter().map(|s| s[i]).fold(0.0, f64::max);
        let lengths: Vec<f64> = each.iter().map(|s| reference.metric.square(&(s - &mean))).collect();
        let (floor, floor_sd) = center(&lengths);
        let allowing = metric_allowing_events(reference, &fit.events)?;
        let allowed: Vec<f64> = each.iter().map(|s| allowing.square(&(s - &mean))).collect();
        Ok(SelfConsistency {
            floor,
            floor_sd,
            allowed_floor: center(&allowed).0,
            // The mean of the model also has noise, so the limits are widened.
            limits: Limits {
                misfit: (1.1 * gamma_limit(&strays.iter().map(|s| s[0]).collect::<Vec<_>>(), ALARM))
                    .max(reference.clean.limits.misfit),
                deviation: (1.15 * highest(1)).max(reference.clean.limits.deviation),
                score: (1.15 * highest(2)).max(reference.clean.limits.score),
            },
            deviations: missed(&metric, &redrawn, &mean),
            additive: roots(
                &Metric::new(&reference.noise, fit.directions(reference)).knowing(&known).covariance(),
            ),
            metric,
            mean,
        })
    }

    /// Simulates the model with parameters that are drawn from their posterior. Draws are limited to the distance
    /// over which the model is nearly linear ([`trust`]). Some parameters are hardly determined by the set, and the
    /// linear fit would have other errors beyond this distance.
    fn redrawn(&self, fit: &Fit, known: &[f64]) -> Result<Vec<Redrawn>> {
        let reference = self.reference;
        let lamps = &fit.model.lamps;
        let rough = Metric::new(&reference.noise, fit.directions(reference)).knowing(known);
        let n = fit.u.len();
        let root = rough.covariance().cholesky().map_or_else(|| DMatrix::zeros(n, n), |c| c.l());
        let one = |i: usize| -> Result<Redrawn> {
            let seed = reference.seed + 50_000 + i as u64;
            let mut draw = normal_vectors(seed, "own");
            let wanted = &root * draw(n);
            let off = LampDraw::new(lamps, &draw(lamps.len()));
            let place = |j: usize| {
                let (knob, most) = (fit.model.knobs[j], trust(fit.model.knobs[j].scale, fit.u[j]));
                knob.clamped(fit.u[j] + wanted[j].clamp(-most, most))
            };
            let u: Vec<f64> = (0..n).map(place).collect();
            let sample = fit.model.sample(&u, off.simulated.as_slice())?;
            let moved = DVector::from_fn(n, |j, _| u[j] - fit.u[j]);
            let vector = simulate::values(&reference.setup, &sample, seed)?
                + &reference.lamp_slopes * off.remainder()
                - reference.lamp_shift(&fit.model);
            Ok(Redrawn { moved, vector, by_lamps: &reference.lamp_slopes * &off.whole })
        };
        threads::try_map(0..REDRAWN_SIMULATIONS, one)
    }

    /// Simulates the fitted model, estimates the noise of the statistics from these simulations, and fits the model
    /// again with this noise. Repeats this as long as a parameter of an effect moves by more than one standard
    /// deviation and the cost decreases.
    pub(crate) fn converged(&self, fit: &mut Fit) -> Result<SelfConsistency> {
        let mut own = self.self_consistency(fit)?;
        for _ in 0..MAX_REFITS {
            let moved = own.metric.bounded(&(&self.data - &own.mean), &fit.bounds());
            let base = self.reference.model.knobs.len();
            let far = (base..fit.u.len()).any(|j| moved[j].abs() > own.deviations[j]);
            if !far {
                break;
            }
            let mut next = self.refine(fit.moved(&moved), 2, 2 * SOME_SIMULATIONS)?;
            if next.cost > fit.cost {
                break;
            }
            own = self.self_consistency(&mut next)?;
            *fit = next;
        }
        Ok(own)
    }
}

/// Returns the standard deviation of each parameter by a parametric bootstrap of the last linear fit. The
/// parameters of each redrawn sensor are known, and each sensor is fitted like the data.
///
/// The result includes noise that changes many statistics together, for example the random number of hot pixels of
/// a sensor. The variances of single statistics do not include such noise.
fn missed(metric: &Metric, redrawn: &[Redrawn], mean: &DVector<f64>) -> Vec<f64> {
    let errors: Vec<DVector<f64>> =
        redrawn.iter().map(|r| metric.fit(&(&r.vector - mean)) - &r.moved).collect();
    // The mean of the model also has noise.
    let squares = mean_squares(&errors) * (1.0 + 1.0 / MEAN_SIMULATIONS as f64);
    squares
        .iter()
        .zip(metric.covariance().diagonal().iter())
        .map(|(s, linear)| s.max(*linear).sqrt())
        .collect()
}

pub(crate) fn roots(covariance: &DMatrix<f64>) -> Vec<f64> {
    covariance.diagonal().iter().map(|v| v.sqrt()).collect()
}
