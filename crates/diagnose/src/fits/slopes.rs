//! Derivatives of the statistics by the parameters of the fitted effects.

use crate::fits::fit::{DerivativeOrigin, Fit};
use crate::fits::fitter::Fitter;
use crate::null_model::derivatives::step as base_step;
use crate::null_model::model::NullModel;
use crate::null_model::vectors::{average, differences, matrix, shrink};
use crate::sensors::model::find_base_knob;
use crate::thresholds::{
    MAX_SLOPE_MOVE, MIN_CHANGE_SIMULATIONS, MIN_CROWDED_STATISTICS, MIN_EFFECT_CHANGE_SDS,
};
use nalgebra::{DMatrix, DVector};
use spikelane::effects::definition::SearchScale;
use spikelane::error::Result;
use spikelane::unstable::threads;

/// The positions between which a derivative is computed as a difference quotient.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Secant {
    /// The fitted position and a larger one. This requires only half of the simulations. If an effect has an onset,
    /// the derivative is too large, so the next steps toward zero are too short.
    Ahead,
    /// One position on each side of the fitted position.
    Around,
}

/// Returns the two positions of a difference quotient at `u`. Their distance is `h`.
fn ends(u: f64, h: f64, secant: Secant) -> [f64; 2] {
    match secant {
        Secant::Ahead => [u, u + h],
        Secant::Around => [u - 0.5 * h, u + 0.5 * h],
    }
}

/// Returns the step of the derivative by a knob at position `u`.
fn step(scale: SearchScale, u: f64) -> f64 {
    match scale {
        SearchScale::Log | SearchScale::LogComplement => 0.35,
        _ => (0.4 * u.abs()).max(0.4),
    }
}

/// Returns whether the parameters of the effects are still near the positions at which the derivatives were
/// computed.
fn near(fit: &Fit) -> bool {
    let moved = |j: usize| (fit.u[j] - fit.taken.at[j]).abs() / step(fit.model.knobs[j].scale, fit.u[j]);
    fit.taken.at.len() == fit.u.len() && (fit.base_knobs()..fit.u.len()).all(|j| moved(j) <= MAX_SLOPE_MOVE)
}

impl Fitter<'_> {
    /// Computes the derivatives by the knobs of the effects. They use the same draws as the simulations of the fit,
    /// so most of the noise cancels.
    pub(crate) fn derive(&self, fit: &mut Fit, count: usize, secant: Secant) -> Result<()> {
        let count = count.min(fit.each.len());
        let around = secant == Secant::Around;
        if fit.taken.count >= count && (fit.taken.around || !around) && near(fit) {
            return Ok(());
        }
        self.tell_unmoved(fit)?;
        let (each, unmoved) = (&fit.each[..count], &fit.taken.unmoved);
        let column = |(effect, j): (usize, usize)| -> Result<DVector<f64>> {
            let knob = fit.model.knobs[j];
            let h = step(knob.scale, fit.u[j]);
            let [mut low, mut high] = ends(fit.u[j], h, secant).map(|u| knob.clamped(u));
            if high - low < 0.5 * h {
                (low, high) = (knob.clamped(high - h), high);
            }
            if low == high || fit.count(j).is_some() {
                // The range of the parameter, or a count of events, fixes the parameter.
                return Ok(DVector::zeros(fit.mean.len()));
            }
            let at = |end: f64| -> Result<Vec<DVector<f64>>> {
                if end == fit.u[j] {
                    return Ok(each.to_vec());
                }
                let mut u = fit.u.clone();
                u[j] = end;
                Ok(self.reference.mean_of(&fit.model, &u, count, Vec::new())?.each)
            };
            let (from, to) = (at(low)?, at(high)?);
            let change = average(&differences(&to, &from));
            let mut plain = shrink(change, &self.reference.spread, count);
            unmoved[effect].iter().for_each(|i| plain[*i] = 0.0);
            Ok(plain / (high - low))
        };
        let knobs: Vec<(usize, usize)> =
            (0..fit.effects.len()).flat_map(|e| fit.knobs_of(e).map(move |j| (e, j))).collect();
        let columns = threads::try_map(knobs, column)?;
        fit.jacobian = matrix(&columns, fit.mean.len());
        fit.crossed = coupled_base_jacobian(self.reference, fit, count)?;
        fit.taken = DerivativeOrigin { at: fit.u.clone(), count, around, ..std::mem::take(&mut fit.taken) };
        Ok(())
    }

    /// Finds the statistics that each effect hardly changes. The result is reused until the effects change or the
    /// number of simulations doubles.
    fn tell_unmoved(&self, fit: &mut Fit) -> Result<()> {
        let n = fit.each.len();
        if fit.taken.unmoved.is_empty() || n >= 2 * fit.taken.told_by {
            let all = (0..fit.effects.len()).map(|e| self.unmoved(fit, e)).collect::<Result<Vec<_>>>()?;
            (fit.taken.unmoved, fit.taken.told_by) = (all, n);
        }
        Ok(())
    }

    /// Returns the statistics that one effect hardly changes. The derivative of such a statistic is only noise. The
    /// change by the whole effect shows these statistics, and the change by a small step does not. Each effect is
    /// examined alone, because the changes by several effects may cancel.
    fn unmoved(&self, fit: &Fit, effect: usize) -> Result<Vec<usize>> {
        let n = fit.each.len();
        if n < MIN_CHANGE_SIMULATIONS || self.reference.spread.len() < MIN_CROWDED_STATISTICS {
            return Ok(Vec::new());
        }
        let other = fit.without(effect);
        let without = if other.u.iter().all(|u| *u == 0.0) {
            average(&self.reference.baseline[..n])
        } else {
            average(&self.reference.mean_of(&other.model, &other.u, n, Vec::new())?.each)
        };
        let change = average(&fit.each) - without;
        let limit = MIN_EFFECT_CHANGE_SDS * (2.0 / n as f64).sqrt();
        Ok((0..change.len()).filter(|i| change[*i].abs() < limit * self.reference.spread[*i]).collect())
    }
}

/// Returns the derivatives by the base knobs at `fit`, or `None` if no effect couples the spreads of the base
/// model. `count` is the number of pairs of simulations.
///
/// If gain and dark current are correlated, the spread of the gain also changes the covariance of both maps. The
/// covariance is `c s_gain s_dark + s_threshold^2`. Here `c` is the correlation, and each `s` is the spread of the
/// named parameter. At `c = -0.8`, the spread of the gain changes the covariance four times as much as the spread
/// of the thresholds does. At `c = 0`, it changes nothing.
///
/// Measured: a fit with the derivatives of the base model halved the spread of the thresholds. It reported -0.78
/// (-0.85 to -0.71) for `c = -1`.
pub(crate) fn coupled_base_jacobian(
    reference: &NullModel,
    fit: &Fit,
    count: usize,
) -> Result<Option<DMatrix<f64>>> {
    if fit.effects.iter().all(|e| !e.0.couples_spreads) {
        return Ok(None);
    }
    let column = |j: usize| -> Result<DVector<f64>> {
        let (knob, plain) = (&reference.model.knobs[j], reference.jacobian.column(j));
        if !find_base_knob(knob).is_some_and(|number| number.is_spread) {
            return Ok(plain.into_owned());
        }
        let h = base_step(knob);
        let mut beside = fit.u.clone();
        beside[j] += h;
        let mut alone = vec![0.0; reference.model.knobs.len()];
        alone[j] = h;
        let beside = reference.mean_of(&fit.model, &beside, count, Vec::new())?.each;
        let alone = reference.mean_of(&reference.model, &alone, count, Vec::new())?.each;
        let (with, without) = (differences(&beside, &fit.each), differences(&alone, &reference.baseline));
        let change = average(&differences(&with, &without));
        Ok(plain + shrink(change, &reference.spread, count) / h)
    };
    let columns = threads::try_map(0..reference.model.knobs.len(), column)?;
    Ok(Some(DMatrix::from_columns(&columns)))
}
