//! How far clean sensors stray.

use super::metric::{Metric, noise};
use super::redraw::Redrawn;
use super::signature::Signature;
use crate::formulas::chi_square::chi_square_over_freedom;
use nalgebra::{DMatrix, DVector};
use spikelane::error::Result;
use spikelane::unstable::threads;

/// Parts of the null that are judged by the rest of it.
const FOLDS: usize = 5;

/// Margin that the total misfit of a real sensor is given. One hidden clean sensor of eight was 4 % above
/// the limit without it; the figure is a choice, not a measurement.
const MARGIN: f64 = 1.15;

/// Chance that a clean sensor passes one of the three limits.
const LEVEL: f64 = 0.001;

/// Limits that a clean sensor passes once in a thousand times.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Limits {
    /// Total misfit.
    pub misfit: f64,
    /// Largest deviation of one statistic, in standard deviations.
    pub deviation: f64,
    /// Largest score of a candidate.
    pub score: f64,
}

/// What clean sensors show.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::diagnose) struct Clean {
    pub limits: Limits,
    /// Median of the total misfit, and its deviation.
    pub floor: f64,
    pub floor_sd: f64,
}

/// The base model's sensors that the null is made of.
pub(in crate::diagnose) struct Base<'a> {
    pub mean: &'a DVector<f64>,
    /// Changes per unit of the base knobs.
    pub jacobian: &'a DMatrix<f64>,
    pub signatures: &'a [Signature],
}

impl Clean {
    /// What clean sensors with redrawn numbers show, each part judged by the noise of the others.
    pub(in crate::diagnose) fn of(
        redrawn: &[Redrawn],
        residuals: &[DVector<f64>],
        lamps: &DMatrix<f64>,
        floors: &[f64],
        base: Base<'_>,
    ) -> Result<Self> {
        let fold = |f: usize| -> Result<Vec<[f64; 3]>> {
            let others: Vec<DVector<f64>> = residuals
                .iter()
                .enumerate()
                .filter(|(i, _)| i % FOLDS != f)
                .map(|(_, r)| r.clone())
                .collect();
            let metric = Metric::new(&noise(&others, floors)?.with_columns(lamps)?, base.jacobian.clone());
            let own = redrawn.iter().enumerate().filter(|(i, _)| i % FOLDS == f);
            let all: Vec<&Signature> = base.signatures.iter().collect();
            Ok(own.map(|(_, d)| strays_by(&metric, &(&d.vector - base.mean), &all)).collect())
        };
        let folds = threads::try_map(0..FOLDS, fold)?;
        let all: Vec<[f64; 3]> = folds.into_iter().flatten().collect();
        let column = |i: usize| all.iter().map(|a| a[i]).collect::<Vec<f64>>();
        let (floor, floor_sd) = center(&column(0));
        let limits = Limits {
            // Two simulators of one camera differ in their last digits.
            misfit: MARGIN * gamma_limit(&column(0)),
            deviation: gumbel_limit(&column(1)),
            score: gumbel_limit(&column(2)),
        };
        Ok(Self { limits, floor, floor_sd })
    }
}

/// Total misfit, largest deviation and largest score of what is `off`.
pub(in crate::diagnose) fn strays_by(
    metric: &Metric,
    off: &DVector<f64>,
    signatures: &[&Signature],
) -> [f64; 3] {
    let dual = metric.dual(off);
    let score = |s: &Signature| score_of(metric, &s.mean, &dual);
    let largest = |m: f64, x: f64| m.max(x.abs());
    [
        off.dot(&dual),
        metric.scores(off).into_iter().fold(0.0, largest),
        signatures.iter().map(|s| score(s)).fold(0.0, largest),
    ]
}

/// How far something lies along `change`, in deviations; `dual` is its dual in `metric`.
pub(super) fn score_of(metric: &Metric, change: &DVector<f64>, dual: &DVector<f64>) -> f64 {
    let length = metric.square(change).sqrt();
    if length > 0.0 { (change.dot(dual) / length).abs() } else { 0.0 }
}

/// Median and standard deviation.
pub(in crate::diagnose) fn center(values: &[f64]) -> (f64, f64) {
    let median = spikelane_measure::median(&mut values.to_vec());
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    (median, (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n).sqrt())
}

fn moments(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    (mean, values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0))
}

/// Upper limit of a gamma law of these moments at [`LEVEL`].
pub(in crate::diagnose) fn gamma_limit(values: &[f64]) -> f64 {
    let (mean, variance) = moments(values);
    let freedom = 2.0 * mean * mean / variance.max(1e-12);
    // The normal quantile of LEVEL.
    mean * chi_square_over_freedom(freedom, 3.09)
}

/// Upper limit of a Gumbel law of these moments at [`LEVEL`].
fn gumbel_limit(values: &[f64]) -> f64 {
    let (mean, variance) = moments(values);
    let beta = (6.0 * variance).sqrt() / std::f64::consts::PI;
    mean - 0.577_215_7 * beta - beta * (-(1.0 - LEVEL).ln()).ln()
}
