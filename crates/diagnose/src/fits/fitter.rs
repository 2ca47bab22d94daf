//! The fit of a model to the statistics of one set, and the noise from events that cannot be located.

use crate::events::locations::kind_index;
use crate::fits::fit::Fit;
use crate::fits::likelihood::Likelihood;
use crate::null_model::metric::Metric;
use crate::null_model::model::NullModel;
use crate::null_model::vectors::{average, differences, matrix, shrink};
use crate::thresholds::EVENT_PAIRS;
use nalgebra::{DMatrix, DVector};
use spikelane::error::Result;

/// Fits models to the data of one set. The other files of this module add methods.
#[derive(Clone, Debug)]
pub(crate) struct Fitter<'a> {
    pub reference: &'a NullModel,
    /// Statistics of the set, shifted by the lamp offsets of the null model (`NullModel::shifted`).
    pub data: DVector<f64>,
}

impl Fitter<'_> {
    /// Computes the mean of a fit from `count` simulations and compares it with the data. Does nothing if `fit`
    /// already contains this mean.
    pub(crate) fn evaluate(&self, fit: &mut Fit, count: usize) -> Result<()> {
        let known = if fit.at == fit.place() { std::mem::take(&mut fit.each) } else { Vec::new() };
        if known.len() >= count {
            fit.each = known;
            return Ok(());
        }
        let means = self.reference.mean_of(&fit.model, &fit.u, count, known)?;
        let residual = &self.data - &means.mean;
        fit.misfit = self.reference.metric.square(&residual);
        fit.mean = means.mean;
        fit.each = means.each;
        fit.at = fit.place();
        fit.events = unlocated_event_columns(self.reference, fit)?;
        fit.likelihood = Likelihood::of(self.reference, &fit.each, &fit.events)?;
        fit.cost = fit.likelihood.deviance(&residual);
        Ok(())
    }
}

/// Returns one column for each recording and each kind of event that cannot be located. A column is the change of
/// the statistics of this recording per standard deviation of the number of events.
///
/// The number of events varies by chance: a recording with six expected lost readouts may have four or nine. All
/// statistics of the recording then change together. If the noise of each statistic were independent instead, a
/// wrong effect of the same kind would be as likely as the right one.
pub(crate) fn unlocated_event_columns(reference: &NullModel, fit: &Fit) -> Result<DMatrix<f64>> {
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
        // The change is the difference between all and half of the events. With fewer events, the statistics of
        // counts would not be linear: each is twice the square root of a count.
        let mut fewer = fit.u.clone();
        fewer[j] *= 0.5;
        let fewer = reference.mean_of(&fit.model, &fewer, EVENT_PAIRS.min(fit.each.len()), Vec::new())?;
        let change = differences(&fit.each, &fewer.each);
        let change = shrink(2.0 * average(&change), &reference.spread, change.len());
        for k in scenes {
            let expected = probability * reference.setup.recordings[k].readouts as f64;
            let own = |i: usize| f64::from(u8::from(reference.statistics[i].recording == Some(k)));
            columns.push(DVector::from_fn(change.len(), |i, _| own(i) * change[i] / expected.sqrt()));
        }
    }
    columns.retain(|c| c.amax() > 0.0);
    Ok(matrix(&columns, fit.mean.len()))
}

/// Returns the metric of the null model in which the number of events is free. A wrong number of events is then no
/// misfit.
pub(crate) fn metric_allowing_events(reference: &NullModel, events: &DMatrix<f64>) -> Result<Metric> {
    if events.is_empty() {
        return Ok(reference.metric.clone());
    }
    Ok(Metric::new(&reference.noise.with_columns(events)?, reference.jacobian.clone()))
}
