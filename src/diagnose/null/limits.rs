//! How far clean sensors stray.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::metric::{Metric, noise};
use super::redraw::Redrawn;
use super::reference::Reference;
use super::signature::Signature;
use crate::error::Result;

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

impl Reference {
    /// What clean sensors with redrawn numbers show, each part judged by the noise of the others.
    pub(in crate::diagnose) fn null(
        &self,
        redrawn: &[Redrawn],
        residuals: &[DVector<f64>],
        lamps: &DMatrix<f64>,
        floors: &[f64],
    ) -> Result<Clean> {
        let fold = |f: usize| -> Result<Vec<[f64; 3]>> {
            let others: Vec<DVector<f64>> = residuals
                .iter()
                .enumerate()
                .filter(|(i, _)| i % FOLDS != f)
                .map(|(_, r)| r.clone())
                .collect();
            let metric = Metric::new(&noise(&others, floors)?.with_columns(lamps)?, self.jacobian.clone());
            let own = redrawn.iter().enumerate().filter(|(i, _)| i % FOLDS == f);
            let all: Vec<&Signature> = self.signatures.iter().collect();
            Ok(own.map(|(_, d)| self.strays_by(&metric, &(&d.vector - &self.mean), &all)).collect())
        };
        let folds = (0..FOLDS).into_par_iter().map(fold).collect::<Result<Vec<_>>>()?;
        let all: Vec<[f64; 3]> = folds.into_iter().flatten().collect();
        let column = |i: usize| all.iter().map(|a| a[i]).collect::<Vec<f64>>();
        let (floor, floor_sd) = centre(&column(0));
        let limits = Limits {
            // Two simulators of one camera differ in their last digits.
            misfit: MARGIN * gamma_limit(&column(0)),
            deviation: gumbel_limit(&column(1)),
            score: gumbel_limit(&column(2)),
        };
        Ok(Clean { limits, floor, floor_sd })
    }
}

/// Median and standard deviation.
pub(in crate::diagnose) fn centre(values: &[f64]) -> (f64, f64) {
    let median = crate::measure::median(&mut values.to_vec());
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    (median, (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n).sqrt())
}

fn moments(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    (mean, values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0))
}

/// Upper limit of a gamma law of these moments at [`LEVEL`], by Wilson and Hilferty's cube root.
pub(in crate::diagnose) fn gamma_limit(values: &[f64]) -> f64 {
    let (mean, variance) = moments(values);
    let freedom = 2.0 * mean * mean / variance.max(1e-12);
    let c = 2.0 / (9.0 * freedom);
    // The normal quantile of LEVEL.
    let z = 3.09;
    mean * (1.0 - c + z * c.sqrt()).powi(3)
}

/// Upper limit of a Gumbel law of these moments at [`LEVEL`].
fn gumbel_limit(values: &[f64]) -> f64 {
    let (mean, variance) = moments(values);
    let beta = (6.0 * variance).sqrt() / std::f64::consts::PI;
    mean - 0.577_215_7 * beta - beta * (-(1.0 - LEVEL).ln()).ln()
}
