//! Noise that moves a whole recording: how many lost or repeated readouts it happens to hold, where they cannot be located.
//!
//! Six events expected are four or nine found, and every statistic of that recording that sees them moves with their number.
//! Taken as noise of each statistic by itself, that would make the wrong event, which is also noisy, as likely as the right one.

use nalgebra::{DMatrix, DVector};

use super::fit::Fit;
use crate::events::locations::kind_index;
use crate::null_model::mean::average;
use crate::null_model::metric::Metric;
use crate::null_model::reference::NullModel;
use crate::null_model::shrinkage::shrink;
use spikelane::error::Result;

/// Pairs of simulations that tell what an event moves.
const PAIRS: usize = 2;

/// One column for every recording and event: the change of its statistics for one standard deviation of their number.
pub(crate) fn columns(reference: &NullModel, fit: &Fit) -> Result<DMatrix<f64>> {
    let mut columns = Vec::new();
    for (e, (effect, _)) in fit.effects.iter().enumerate() {
        let j = fit.knobs_of(e).start;
        let probability = fit.model.knobs[j].value(fit.u[j]);
        let Some(kind) = kind_index(effect).filter(|_| probability > 0.0) else { continue };
        let by_chance = |k: &usize| fit.model.pinned.places(*k)[kind].is_none();
        let scenes: Vec<usize> = (0..reference.setup.recordings.len()).filter(by_chance).collect();
        if scenes.is_empty() {
            continue;
        }
        // From half of them: twice the root of a count is no straight line from none.
        let mut fewer = fit.u.clone();
        fewer[j] *= 0.5;
        let fewer = reference.mean_of(&fit.model, &fewer, PAIRS.min(fit.each.len()), Vec::new())?;
        let change: Vec<DVector<f64>> = fewer.each.iter().zip(&fit.each).map(|(a, b)| b - a).collect();
        let change = shrink(2.0 * average(&change), &reference.spread, change.len());
        for k in scenes {
            let expected = probability * reference.setup.recordings[k].readouts as f64;
            let own = |i: usize| f64::from(u8::from(reference.statistics[i].recording == Some(k)));
            columns.push(DVector::from_fn(change.len(), |i, _| own(i) * change[i] / expected.sqrt()));
        }
    }
    columns.retain(|c| c.amax() > 0.0);
    Ok(if columns.is_empty() { DMatrix::zeros(fit.mean.len(), 0) } else { DMatrix::from_columns(&columns) })
}

/// The null's metric, with any number of events allowed: what they move is no misfit.
pub(crate) fn allowing(reference: &NullModel, events: &DMatrix<f64>) -> Result<Metric> {
    if events.is_empty() {
        return Ok(reference.metric.clone());
    }
    Ok(Metric::new(&reference.noise.with_columns(events)?, reference.jacobian.clone()))
}
