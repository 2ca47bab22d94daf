//! The likelihood of data under a fitted model that has its own noise.

use crate::light::offsets::columns;
use crate::null_model::metric::{Metric, Noise};
use crate::null_model::model::NullModel;
use crate::null_model::vectors::average;
use crate::thresholds::{MIN_WIDER_VARIANCE, PRIOR_SIMULATIONS};
use nalgebra::{DMatrix, DVector};
use spikelane::error::Result;

/// The noise of a fitted model. Sets with rare events or strong noise differ from each other by more than the noise
/// of the null model.
#[derive(Clone, Debug)]
pub(crate) struct Likelihood {
    pub metric: Metric,
    /// Noise of sensors whose light is known, including the noise from random numbers of events.
    pub noise_without_lamps: Noise,
    /// Logarithm of the determinant of the noise, relative to the null model.
    pub log_volume: f64,
}

impl Likelihood {
    /// Returns the likelihood of a model with the given simulations. `events` contains the changes per standard
    /// deviation of the numbers of events.
    pub(crate) fn of(
        reference: &NullModel,
        simulations: &[DVector<f64>],
        events: &DMatrix<f64>,
    ) -> Result<Self> {
        let plain = || Self::of_null(reference);
        if simulations.len() < 2 {
            return Ok(plain());
        }
        let (mean, freedom) = (average(simulations), simulations.len() as f64 - 1.0);
        let Some(noise_without_lamps) = own_noise(reference, events, simulations, &mean, freedom)? else {
            return Ok(plain());
        };
        let noise = with_lamps(reference, &noise_without_lamps)?;
        let log_volume = noise.log_determinant() - reference.noise.log_determinant();
        let metric = Metric::new(&noise, reference.jacobian.clone());
        Ok(Self { metric, noise_without_lamps, log_volume })
    }

    /// Returns the likelihood of the base model.
    pub(crate) fn of_null(reference: &NullModel) -> Self {
        Self {
            metric: reference.metric.clone(),
            noise_without_lamps: reference.noise_without_lamps.clone(),
            log_volume: 0.0,
        }
    }

    /// Returns twice the negative logarithm of the likelihood, up to a constant.
    pub(crate) fn deviance(&self, residual: &DVector<f64>) -> f64 {
        self.metric.square(residual) + self.log_volume
    }
}

/// Returns the noise of a fitted model whose light is known, from deviations of its simulations from `mean`.
/// `freedom` is the number of degrees of freedom. Returns `None` if the noise equals that of the null model.
pub(super) fn own_noise(
    reference: &NullModel,
    events: &DMatrix<f64>,
    simulations: &[DVector<f64>],
    mean: &DVector<f64>,
    freedom: f64,
) -> Result<Option<Noise>> {
    let rest = |s: &DVector<f64>| without_events(&reference.noise_without_lamps, s - mean, events);
    let factors = factors(reference, &simulations.iter().map(rest).collect::<Vec<_>>(), freedom);
    if factors.iter().all(|f| *f == 1.0) && events.is_empty() {
        return Ok(None);
    }
    reference.noise_without_lamps.scaled(&factors)?.with_columns(events).map(Some)
}

/// Adds the noise of the lamps to `noise`, the noise of sensors whose light is known.
pub(super) fn with_lamps(reference: &NullModel, noise: &Noise) -> Result<Noise> {
    noise.with_columns(&columns(&reference.lamp_slopes, &reference.model))
}

/// Returns the standard deviation of each statistic, divided by that of the null model. Returns 1 for a statistic
/// whose ratio is not significantly larger.
fn factors(reference: &NullModel, residuals: &[DVector<f64>], freedom: f64) -> Vec<f64> {
    let factor = |j: usize| {
        let own = residuals.iter().map(|s| s[j].powi(2)).sum::<f64>();
        let null = reference.noise_without_lamps.covariance[(j, j)];
        let ratio = (own + PRIOR_SIMULATIONS * null) / (freedom + PRIOR_SIMULATIONS) / null;
        if ratio > MIN_WIDER_VARIANCE { ratio.sqrt() } else { 1.0 }
    };
    (0..reference.spread.len()).map(factor).collect()
}

/// Returns `residual` without the part that deviating numbers of events explain. No two columns have a common
/// statistic, so each column is fitted alone.
fn without_events(noise: &Noise, residual: DVector<f64>, columns: &DMatrix<f64>) -> DVector<f64> {
    let weight = |i: usize| noise.covariance[(i, i)].recip();
    columns.column_iter().fold(residual, |residual, c| {
        let along: f64 = (0..residual.len()).map(|i| residual[i] * c[i] * weight(i)).sum();
        let square: f64 = (0..residual.len()).map(|i| c[i] * c[i] * weight(i)).sum();
        residual - c * (along / square)
    })
}
