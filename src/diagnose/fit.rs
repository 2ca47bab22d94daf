//! Fitting effects to a set: Gauss-Newton over simulated means, in a region of trust.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::candidates::Candidate;
use super::metric::Metric;
use super::model::{Model, Scale};
use super::reference::{Reference, average};
use crate::error::Result;

/// A model with effects, fitted.
#[derive(Clone, Debug)]
pub(super) struct Fit {
    /// Effects in the order in which they were added, with the number of knobs of each.
    pub effects: Vec<(&'static str, usize)>,
    pub model: Model,
    pub u: Vec<f64>,
    pub mean: DVector<f64>,
    pub each: Vec<DVector<f64>>,
    /// Changes per unit of the effects' knobs.
    pub jacobian: DMatrix<f64>,
    /// Squared distance to the data, calibration projected out.
    pub misfit: f64,
}

impl Fit {
    /// The base model.
    pub fn base(reference: &Reference, data: &DVector<f64>) -> Self {
        let off = data - &reference.mean;
        Self {
            effects: Vec::new(),
            model: reference.model.clone(),
            u: vec![0.0; reference.model.knobs.len()],
            mean: reference.mean.clone(),
            each: reference.baseline.clone(),
            jacobian: DMatrix::zeros(data.len(), 0),
            misfit: reference.metric.square(&off),
        }
    }

    /// Number of base knobs.
    fn base_knobs(&self) -> usize {
        self.u.len() - self.effects.iter().map(|e| e.1).sum::<usize>()
    }

    /// Places of an effect's knobs.
    pub fn knobs_of(&self, effect: usize) -> std::ops::Range<usize> {
        let start = self.base_knobs() + self.effects[..effect].iter().map(|e| e.1).sum::<usize>();
        start..start + self.effects[effect].1
    }

    /// With `candidate` added, its amplitude scaled.
    pub fn with(&self, candidate: &Candidate, scale: f64) -> Self {
        let mut next = self.clone();
        next.effects.push((candidate.name, candidate.knobs.len()));
        for (i, (knob, at)) in candidate.knobs.iter().zip(&candidate.at).enumerate() {
            next.model.knobs.push(*knob);
            next.u.push(knob.clamped(if i == 0 { at * scale } else { *at }));
        }
        next
    }

    /// Without one of its effects.
    pub fn without(&self, effect: usize) -> Self {
        let mut next = self.clone();
        let range = self.knobs_of(effect);
        next.model.knobs.drain(range.clone());
        next.u.drain(range);
        next.effects.remove(effect);
        next
    }

    /// Directions that the data have been fitted along: base knobs and effects' knobs.
    pub fn directions(&self, reference: &Reference) -> DMatrix<f64> {
        let (rows, base, own) = (self.mean.len(), reference.jacobian.ncols(), self.jacobian.ncols());
        let mut all = DMatrix::zeros(rows, base + own);
        all.columns_mut(0, base).copy_from(&reference.jacobian);
        all.columns_mut(base, own).copy_from(&self.jacobian);
        all
    }
}

/// A step by which a knob's derivative is taken.
fn step(scale: Scale, u: f64) -> f64 {
    match scale {
        Scale::Log | Scale::Kept => 0.35,
        _ => (0.4 * u.abs()).max(0.4),
    }
}

/// Furthest that a knob moves in one round.
fn trust(scale: Scale, u: f64) -> f64 {
    match scale {
        Scale::Log | Scale::Kept => 0.8,
        _ => (0.7 * u.abs()).max(0.8),
    }
}

impl Reference {
    /// Simulates the fit's mean and compares it with `data`.
    pub(super) fn evaluate(&self, fit: &mut Fit, data: &DVector<f64>, count: usize) -> Result<()> {
        let means = self.mean_of(&fit.model, &fit.u, count)?;
        fit.misfit = self.metric.square(&(data - &means.mean));
        fit.mean = means.mean;
        fit.each = means.each;
        Ok(())
    }

    /// Derivatives by the effects' knobs, with the draws of the fit's own simulations.
    pub(super) fn derive(&self, fit: &mut Fit, count: usize) -> Result<()> {
        let base = fit.base_knobs();
        let column = |j: usize| -> Result<DVector<f64>> {
            let knob = fit.model.knobs[j];
            let h = step(knob.scale, fit.u[j]);
            let mut u = fit.u.clone();
            u[j] = knob.clamped(fit.u[j] + h);
            if (u[j] - fit.u[j]).abs() < 0.5 * h {
                u[j] = knob.clamped(fit.u[j] - h);
            }
            if u[j] == fit.u[j] {
                // Held by its range.
                return Ok(DVector::zeros(fit.mean.len()));
            }
            let moved = self.mean_of(&fit.model, &u, count.min(fit.each.len()))?;
            let change: Vec<_> = moved.each.iter().zip(&fit.each).map(|(a, b)| a - b).collect();
            Ok(average(&change) / (u[j] - fit.u[j]))
        };
        let columns = (base..fit.u.len()).into_par_iter().map(column).collect::<Result<Vec<_>>>()?;
        fit.jacobian = if columns.is_empty() {
            DMatrix::zeros(fit.mean.len(), 0)
        } else {
            DMatrix::from_columns(&columns)
        };
        Ok(())
    }

    /// Gauss-Newton from where `fit` stands, `rounds` at most, each mean from `count` simulations.
    pub(super) fn refine(
        &self,
        mut fit: Fit,
        data: &DVector<f64>,
        rounds: usize,
        count: usize,
    ) -> Result<Fit> {
        self.evaluate(&mut fit, data, count)?;
        for round in 0..rounds {
            self.derive(&mut fit, count)?;
            let next = self.line_search(&fit, data, count)?;
            let Some(next) = next else { break };
            let gained = fit.misfit - next.misfit;
            let jacobian = std::mem::replace(&mut fit, next).jacobian;
            fit.jacobian = jacobian;
            if round + 1 < rounds && gained < 0.01 * fit.misfit {
                break;
            }
        }
        Ok(fit)
    }

    /// The whole step if it helps, or a part of it.
    fn line_search(&self, fit: &Fit, data: &DVector<f64>, count: usize) -> Result<Option<Fit>> {
        let base = fit.base_knobs();
        let off = data - &fit.mean;
        let wanted = Metric::new(&self.noise, fit.directions(self)).fit(&off);
        for share in [1.0, 0.4] {
            let mut next = fit.clone();
            let mut left = off.clone();
            for j in base..fit.u.len() {
                let knob = fit.model.knobs[j];
                let most = trust(knob.scale, fit.u[j]);
                next.u[j] = knob.clamped(fit.u[j] + share * wanted[j].clamp(-most, most));
                left -= fit.jacobian.column(j - base) * (next.u[j] - fit.u[j]);
            }
            // The base follows what the effects leave.
            let calibrated = self.metric.fit(&left);
            for j in 0..base {
                let knob = fit.model.knobs[j];
                next.u[j] = knob.clamped(fit.u[j] + share * calibrated[j].clamp(-0.3, 0.3));
            }
            self.evaluate(&mut next, data, count)?;
            if next.misfit < fit.misfit {
                return Ok(Some(next));
            }
        }
        Ok(None)
    }
}
