//! What the base model's spreads move beside an effect that couples them.
//!
//! Where gain and dark current go together, a wider gain moves how they do as well: the covariance of both lines' numbers over the pixels is
//! `c s_gain s_dark + s_threshold^2`, and at `c = -0.8` the gain's spread moves it four times as much as that of the thresholds, where
//! without the effect it moves nothing. Fitted by what they move without it, these numbers said at `c = -1` that the thresholds'
//! spread is a half of what it is, and -0.78 (-0.85 to -0.71).

use super::fit::Fit;
use crate::null_model::derivatives::step;
use crate::null_model::mean::average;
use crate::null_model::reference::NullModel;
use crate::null_model::shrinkage::shrink;
use crate::sensors::model::find_base_knob;
use nalgebra::{DMatrix, DVector};
use spikelane::error::Result;
use spikelane::unstable::threads;

/// Changes per unit of the base knobs where `fit` stands: those of the base model, and what is plainly another change beside the
/// fit's effects, by `count` pairs of pairs of simulations with the same draws. Nothing where no effect couples them.
pub(crate) fn jacobian(reference: &NullModel, fit: &Fit, count: usize) -> Result<Option<DMatrix<f64>>> {
    if fit.effects.iter().all(|e| !e.0.couples_spreads) {
        return Ok(None);
    }
    let column = |j: usize| -> Result<DVector<f64>> {
        let (knob, plain) = (&reference.model.knobs[j], reference.jacobian.column(j));
        if !find_base_knob(knob).is_some_and(|number| number.is_spread) {
            return Ok(plain.into_owned());
        }
        let h = step(knob);
        let mut beside = fit.u.clone();
        beside[j] += h;
        let mut alone = vec![0.0; reference.model.knobs.len()];
        alone[j] = h;
        let beside = reference.mean_of(&fit.model, &beside, count, Vec::new())?.each;
        let alone = reference.mean_of(&reference.model, &alone, count, Vec::new())?.each;
        let with = beside.iter().zip(&fit.each).map(|(a, b)| a - b);
        let without = alone.iter().zip(&reference.baseline).map(|(a, b)| a - b);
        let change: Vec<DVector<f64>> = with.zip(without).map(|(a, b)| a - b).collect();
        Ok(plain + shrink(average(&change), &reference.spread, count) / h)
    };
    let columns = threads::try_map(0..reference.model.knobs.len(), column)?;
    Ok(Some(DMatrix::from_columns(&columns)))
}
