//! The comparison of recordings with a null model, and the models that are fitted in it.

use crate::events::locations::Events;
use crate::fits::fit::Fit;
use crate::fits::fitter::Fitter;
use crate::fits::self_consistency::SelfConsistency;
use crate::light::lamp::lamps_of;
use crate::null_model::limits::strays_by;
use crate::null_model::model::NullModel;
use crate::null_model::signature::Signature;
use crate::prepared::recordings::{HeldOut, Recordings};
use crate::recordings::setup::Setup;
use crate::search::line_signatures::with_line;
use crate::search::round::Step;
use crate::sensors::deadline::in_time;
use nalgebra::DVector;
use spikelane::error::Result;

/// The comparison of recordings with one null model, in which effects are searched.
pub(crate) struct Search<'a> {
    pub recordings: &'a Recordings,
    /// The null model and the statistics of the fitted set.
    pub fitter: Fitter<'a>,
    /// Statistics of the held-out set, shifted by the lamp offsets of the null model ([`NullModel::shifted`]).
    pub held_out_data: DVector<f64>,
    /// Signatures of the effects. Oscillating light has the frequency of the line in the fitted set.
    pub signatures: Vec<Signature>,
    /// Lost and repeated readouts of both sets.
    pub located: Events,
}

/// A fitted model with the results of its own simulations, and the deviations of the data from it.
#[derive(Clone)]
pub(crate) struct TestedFit {
    pub fit: Fit,
    pub own: SelfConsistency,
    /// Deviation of the held-out set from the mean of the model.
    pub off: DVector<f64>,
    /// Whether at least one of both sets exceeds a limit. `left_fitted` states this for the fitted set alone.
    pub left: bool,
    pub left_fitted: bool,
}

impl TestedFit {
    /// Returns the deviance of the held-out set under this model: twice the negative logarithm of its likelihood.
    pub(crate) fn deviance(&self) -> f64 {
        self.fit.deviance_of(&self.off)
    }
}

impl<'a> Search<'a> {
    /// Compares `recordings` with the null model `reference`. If the time limit is reached, the signatures of
    /// oscillating light keep the frequencies of the null model.
    pub(crate) fn new(recordings: &'a Recordings, reference: &'a NullModel) -> Result<Self> {
        let [fitted, judging] = [&recordings.fitted.measured, &recordings.judging.measured];
        let signatures = in_time(with_line(reference, fitted))?;
        let scenes = &recordings.fitted.setup.recordings;
        let is_held_out = recordings.held_out.is_any();
        let located = Events::new(fitted.located.clone(), judging.located.clone(), is_held_out, scenes);
        let [data, held_out_data] =
            [fitted, judging].map(|m| reference.shifted(&DVector::from_column_slice(&m.values)));
        Ok(Self {
            recordings,
            fitter: Fitter { reference, data },
            held_out_data,
            signatures: signatures.unwrap_or_else(|| reference.signatures.clone()),
            located,
        })
    }
}

impl Search<'_> {
    /// Returns the setup of the held-out set if its part of the recordings or its light differs from that of the
    /// fitted set.
    fn held_out_setup(&self) -> Option<&Setup> {
        let Recordings { fitted, judging, held_out, .. } = self.recordings;
        let is_other = *held_out == HeldOut::SecondHalves || !judging.setup.has_light_of(&fitted.setup);
        is_other.then_some(&judging.setup)
    }

    /// Returns the mean that `fit` predicts for the held-out set.
    fn held_out_mean(&self, fit: &Fit) -> Result<DVector<f64>> {
        let reference = self.fitter.reference;
        let setup = self.held_out_setup();
        if setup.is_none() && !fit.model.pinned.is_any() {
            return Ok(fit.mean.clone());
        }
        let mut model = fit.judging();
        let Some(setup) = setup else {
            return Ok(reference.mean_of(&model, &fit.u, fit.each.len(), Vec::new())?.mean);
        };
        // The effects of a fit change the rates, so the fit has moved the lamps of the fitted set. The lamps of the
        // held-out set move by the same deviations.
        let of_set = lamps_of(setup);
        let found = model.lamps.iter().zip(&reference.model.lamps).zip(&of_set);
        let found: Vec<f64> =
            found.map(|((lamp, base), own)| own.offset + lamp.offset - base.offset).collect();
        model.lit_by(&found);
        reference.mean_under(setup, &model, &fit.u)
    }

    /// Returns the deviation of the held-out set from the mean of `fit`.
    fn held_out_off(&self, fit: &Fit) -> Result<DVector<f64>> {
        Ok(&self.held_out_data - self.held_out_mean(fit)?)
    }

    /// Returns the fit of the base model, the properties of its own simulations, and whether the fitted set exceeds
    /// a limit of the base model.
    fn base_fit(&self) -> (Fit, SelfConsistency, bool) {
        let Fitter { reference, data } = &self.fitter;
        let fit = Fit::base(reference, data, self.located.clone());
        let own = SelfConsistency::of_base(reference);
        let is_exceeded = self.alarm(&fit, &own, &(data - &own.mean));
        (fit, own, is_exceeded)
    }

    /// Returns whether the fitted set exceeds a limit of the base model.
    pub(crate) fn base_alarm(&self) -> bool {
        self.base_fit().2
    }

    pub(crate) fn base(&self) -> Result<TestedFit> {
        let reference = self.fitter.reference;
        let (fit, own, left) = self.base_fit();
        // If there is no time for simulations at the light of the held-out set, the mean at the light of the fitted
        // set is used.
        let off = in_time(self.held_out_off(&fit))?;
        let off = off.unwrap_or_else(|| &self.held_out_data - &reference.mean);
        Ok(TestedFit { off, fit, own, left, left_fitted: left })
    }

    pub(crate) fn judged(&self, fit: Fit, own: SelfConsistency) -> Result<TestedFit> {
        let off = self.held_out_off(&fit)?;
        let left_fitted = self.alarm(&fit, &own, &(&self.fitter.data - &own.mean));
        let left = left_fitted || self.alarm(&fit, &own, &off);
        Ok(TestedFit { fit, own, off, left, left_fitted })
    }

    /// Returns the deviance of the held-out set under a fit that was not tested yet.
    pub(crate) fn deviance(&self, fit: &Fit) -> Result<f64> {
        Ok(fit.deviance_of(&self.held_out_off(fit)?))
    }

    /// Returns the discrepancies of the fitted set and of the held-out set: squared distances without the
    /// directions that calibration fits.
    pub(crate) fn gaps(&self, at: &TestedFit) -> [f64; 2] {
        [at.fit.misfit, self.fitter.reference.metric.square(&at.off)]
    }

    /// Returns the discrepancies before and after a step from one model to another.
    pub(crate) fn step(&self, before: &TestedFit, after: &TestedFit) -> Step {
        Step { before: self.gaps(before), after: self.gaps(after) }
    }

    /// Returns whether one of the values for the deviation `off` exceeds its limit.
    fn alarm(&self, fit: &Fit, own: &SelfConsistency, off: &DVector<f64>) -> bool {
        values_and_limits(fit, own, off, &self.signatures).iter().any(|(value, limit)| value > limit)
    }
}

/// Returns three values, each with its limit: the total misfit, the largest deviation of a statistic, and the
/// largest score of an effect that the model lacks. `off` is the deviation of the statistics from the mean of
/// `fit`.
pub(crate) fn values_and_limits(
    fit: &Fit,
    own: &SelfConsistency,
    off: &DVector<f64>,
    signatures: &[Signature],
) -> [(f64, f64); 3] {
    let open: Vec<&Signature> = signatures.iter().filter(|s| fit.lacks(s)).collect();
    let [misfit, deviation, score] = strays_by(&own.metric, off, &open);
    let limits = own.limits;
    [(misfit, limits.misfit), (deviation, limits.deviation), (score, limits.score)]
}
