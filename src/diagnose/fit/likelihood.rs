//! How likely a fitted model makes data, by the noise that it has itself.

use nalgebra::DVector;

use super::fit::Fit;
use crate::diagnose::null::mean::average;
use crate::diagnose::null::metric::{Metric, Noise};
use crate::diagnose::null::reference::Reference;
use crate::error::Result;

/// Simulations that the null's variances count for beside a model's own few.
const PRIOR: f64 = 10.0;

/// Ratio of variances from which on a model's own are believed: three deviations of a ratio of one
/// with [`PRIOR`] and eight simulations.
const WIDER: f64 = 1.6;

/// The noise of a fitted model. Rare events and strong noise make sets differ that the null would
/// call far apart; a model is judged by how likely *it* makes the data.
#[derive(Clone, Debug)]
pub(in crate::diagnose) struct Likelihood {
    pub metric: Metric,
    pub noise: Noise,
    /// Logarithm of the noise's determinant over the null's.
    pub spread: f64,
}

impl Likelihood {
    /// Twice the negative logarithm of the likelihood, less a constant.
    pub fn deviance(&self, off: &DVector<f64>) -> f64 {
        self.metric.square(off) + self.spread
    }
}

impl Reference {
    pub(in crate::diagnose) fn likelihood(&self, fit: &Fit) -> Result<Likelihood> {
        let plain = Likelihood { metric: self.metric.clone(), noise: self.noise.clone(), spread: 0.0 };
        if fit.each.len() < 2 {
            return Ok(plain);
        }
        let Some(noise) = self.own_noise(fit, &fit.each, &average(&fit.each), fit.each.len() as f64 - 1.0)?
        else {
            return Ok(plain);
        };
        let spread = noise.log_determinant() - self.noise.log_determinant();
        Ok(Likelihood { metric: Metric::new(&noise, self.jacobian.clone()), noise, spread })
    }

    /// The noise of simulations of a fitted model about `mean`; `None` where it is the null's.
    pub(in crate::diagnose) fn own_noise(
        &self,
        fit: &Fit,
        each: &[DVector<f64>],
        mean: &DVector<f64>,
        freedom: f64,
    ) -> Result<Option<Noise>> {
        let off: Vec<DVector<f64>> =
            each.iter().map(|s| self.without_events(s - mean, &fit.events)).collect();
        let factors = self.factors(&off, freedom);
        if factors.iter().all(|f| *f == 1.0) && fit.events.is_empty() {
            return Ok(None);
        }
        self.noise.scaled(&factors)?.with_columns(&fit.events).map(Some)
    }

    /// By how much every statistic's deviation exceeds the null's, one where it hardly does.
    fn factors(&self, off: &[DVector<f64>], freedom: f64) -> Vec<f64> {
        let factor = |j: usize| {
            let own = off.iter().map(|s| s[j].powi(2)).sum::<f64>();
            let null = self.noise.covariance[(j, j)];
            let ratio = (own + PRIOR * null) / (freedom + PRIOR) / null;
            if ratio > WIDER { ratio.sqrt() } else { 1.0 }
        };
        (0..self.spread.len()).map(factor).collect()
    }
}
