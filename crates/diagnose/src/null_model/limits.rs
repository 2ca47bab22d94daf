//! Limits that the deviations of clean sensors hardly ever exceed. A clean sensor follows the base model.

use crate::null_model::metric::{Metric, noise};
use crate::null_model::posterior_draw::CleanSensor;
use crate::null_model::signature::Signature;
use crate::thresholds::{LIMIT_FOLDS, MISFIT_MARGIN, SCORE_SD_PRIOR};
use nalgebra::{DMatrix, DVector};
use spikelane::error::Result;
use spikelane::unstable::threads;
use spikelane_calibrate::unstable::chi_square_over_freedom;

/// The confidence level of limits.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LimitLevel {
    /// Probability that a clean sensor exceeds a limit.
    pub(super) probability: f64,
    /// Quantile of the standard normal distribution that is exceeded with this probability.
    normal_quantile: f64,
    /// Factor by which the limit of the total misfit is raised.
    margin: f64,
    /// Whether each score is divided by its own standard deviation.
    has_own_score_sds: bool,
}

/// Level of an alarm: if a value exceeds its limit, the model is missing an effect.
pub(crate) const ALARM: LimitLevel =
    LimitLevel { probability: 0.001, normal_quantile: 3.09, margin: MISFIT_MARGIN, has_own_score_sds: false };

/// Level of agreement: a set whose values are within these limits agrees with the first simulations.
pub(crate) const AGREEMENT: LimitLevel =
    LimitLevel { probability: 0.05, normal_quantile: 1.645, margin: 1.0, has_own_score_sds: true };

/// Limits for the deviations of clean sensors. With a complete null model, one of a thousand clean sensors exceeds
/// a limit.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Limits {
    /// Limit of the total misfit: the squared distance of all statistics from the model, without the directions
    /// that calibration fits.
    pub misfit: f64,
    /// Limit of the largest deviation of one statistic, in standard deviations.
    pub deviation: f64,
    /// Limit of the largest score of a candidate. A score is the component of the deviation along a signature, in
    /// standard deviations.
    pub score: f64,
}

/// Limits and noise floor for clean sensors.
#[derive(Clone, Debug, Default)]
pub(crate) struct Clean {
    pub limits: Limits,
    /// Median (the noise floor) and standard deviation of the total misfit of clean sensors.
    pub floor: f64,
    pub floor_sd: f64,
    /// Standard deviation of the score of each signature; empty if all are 1.
    pub(super) score_sds: Vec<f64>,
}

/// The quantities of the base model that the limits require.
pub(crate) struct Base<'a> {
    pub mean: &'a DVector<f64>,
    /// Changes per unit of the base knobs.
    pub jacobian: &'a DMatrix<f64>,
    pub signatures: &'a [Signature],
}

impl Clean {
    /// Computes the limits by cross-validation. The sensors are divided into [`LIMIT_FOLDS`] parts, and each part
    /// is judged by the noise of the other parts.
    pub(crate) fn new(
        sensors: &[CleanSensor],
        residuals: &[DVector<f64>],
        lamps: &DMatrix<f64>,
        floors: &[f64],
        base: Base<'_>,
        level: LimitLevel,
    ) -> Result<Self> {
        let fold = |f: usize| -> Result<Vec<Strays>> {
            let others: Vec<DVector<f64>> = residuals
                .iter()
                .enumerate()
                .filter(|(i, _)| i % LIMIT_FOLDS != f)
                .map(|(_, r)| r.clone())
                .collect();
            let metric = Metric::new(&noise(&others, floors)?.with_columns(lamps)?, base.jacobian.clone());
            let own = sensors.iter().enumerate().filter(|(i, _)| i % LIMIT_FOLDS == f);
            let all: Vec<&Signature> = base.signatures.iter().collect();
            Ok(own.map(|(_, d)| Strays::new(&metric, &(&d.vector - base.mean), &all)).collect())
        };
        let folds = threads::try_map(0..LIMIT_FOLDS, fold)?;
        let all: Vec<Strays> = folds.into_iter().flatten().collect();
        let misfits: Vec<f64> = all.iter().map(|s| s.misfit).collect();
        let deviations: Vec<f64> = all.iter().map(|s| s.deviation).collect();
        let score_sds = if level.has_own_score_sds { score_sds(&all) } else { Vec::new() };
        let scores: Vec<f64> = all.iter().map(|s| s.largest_score(&score_sds)).collect();
        let (floor, floor_sd) = center(&misfits);
        let limits = Limits {
            // The factor is needed because two simulators of the same camera do not agree in all digits.
            misfit: level.margin * gamma_limit(&misfits, level),
            deviation: gumbel_limit(&deviations, level),
            score: gumbel_limit(&scores, level),
        };
        Ok(Self { limits, floor, floor_sd, score_sds })
    }
}

/// Returns the standard deviation of the score of each signature, at least 1. Noise that is estimated from few
/// simulations lacks most correlations. The standard deviations of scores then exceed 1.
fn score_sds(all: &[Strays]) -> Vec<f64> {
    let sensors = all.len() as f64;
    let square = |k: usize| all.iter().map(|s| s.scores[k].powi(2)).sum::<f64>();
    let sd = |k: usize| ((square(k) + SCORE_SD_PRIOR) / (sensors + SCORE_SD_PRIOR)).sqrt().max(1.0);
    (0..all.first().map_or(0, |s| s.scores.len())).map(sd).collect()
}

/// Deviations of one sensor from the model.
pub(crate) struct Strays {
    /// Total misfit: the squared distance of all statistics from the model, without the directions that calibration
    /// fits.
    pub misfit: f64,
    /// Largest deviation of one statistic, in standard deviations.
    pub deviation: f64,
    /// The score of each signature: the component of the deviation along the signature, in standard deviations.
    pub scores: Vec<f64>,
}

impl Strays {
    /// Computes the deviations of a vector that differs by `off` from the mean.
    pub(crate) fn new(metric: &Metric, off: &DVector<f64>, signatures: &[&Signature]) -> Self {
        let dual = metric.dual(off);
        Self {
            misfit: off.dot(&dual),
            deviation: metric.scores(off).into_iter().fold(0.0, |m: f64, x: f64| m.max(x.abs())),
            scores: signatures.iter().map(|s| score_of(metric, &s.mean, &dual) / s.score_sd).collect(),
        }
    }

    /// Returns the largest score. Each score is divided by the standard deviation in `sds`, or by 1 if `sds` has no
    /// such element.
    fn largest_score(&self, sds: &[f64]) -> f64 {
        let sds = sds.iter().copied().chain(std::iter::repeat(1.0));
        self.scores.iter().zip(sds).map(|(score, sd)| score / sd).fold(0.0, f64::max)
    }
}

/// Returns the total misfit, the largest deviation of a statistic and the largest score for the deviation `off`.
pub(crate) fn strays_by(metric: &Metric, off: &DVector<f64>, signatures: &[&Signature]) -> [f64; 3] {
    let strays = Strays::new(metric, off, signatures);
    [strays.misfit, strays.deviation, strays.largest_score(&[])]
}

/// Returns the absolute component of a deviation along `change`, in standard deviations. `dual` is the dual vector
/// of the deviation ([`Metric::dual`]).
pub(super) fn score_of(metric: &Metric, change: &DVector<f64>, dual: &DVector<f64>) -> f64 {
    let length = metric.square(change).sqrt();
    if length > 0.0 { (change.dot(dual) / length).abs() } else { 0.0 }
}

/// Returns the median and the standard deviation.
pub(crate) fn center(values: &[f64]) -> (f64, f64) {
    let (mean, n) = (moments(values).0, values.len() as f64);
    let square = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n;
    (spikelane_measure::median(&mut values.to_vec()), square.sqrt())
}

/// Returns the mean and the variance.
fn moments(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    (mean, values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0))
}

/// Returns the limit of a gamma distribution that has the mean and the variance of `values`.
pub(crate) fn gamma_limit(values: &[f64], level: LimitLevel) -> f64 {
    let (mean, variance) = moments(values);
    let freedom = 2.0 * mean * mean / variance.max(1e-12);
    mean * chi_square_over_freedom(freedom, level.normal_quantile)
}

/// Returns the limit of a Gumbel distribution that has the mean and the variance of `values`.
fn gumbel_limit(values: &[f64], level: LimitLevel) -> f64 {
    let (mean, variance) = moments(values);
    let beta = (6.0 * variance).sqrt() / std::f64::consts::PI;
    mean - 0.577_215_7 * beta - beta * (-(1.0 - level.probability).ln()).ln()
}
