//! A model judged by the sets at hand.

use nalgebra::DVector;

use super::alarm::alarm;
use crate::events::locations::Events;
use crate::fit::fit::Fit;
use crate::fit::fitter::Fitter;
use crate::fit::self_consistency::SelfConsistency;
use crate::null_model::reference::NullModel;
use crate::null_model::signature::Signature;
use crate::protocol::recorded_set::Setup;
use crate::search::round::Step;
use crate::sensors::context::in_time;
use crate::sensors::lamp::lamps_of;
use crate::sensors::model::Model;
use spikelane::error::Result;

/// The set that judges: another take, or the second half of the first one, which the model must be
/// simulated up to.
pub(crate) struct HeldOutSet<'a> {
    pub data: &'a DVector<f64>,
    /// The protocol and the light, where they are not those of the fitted set.
    pub setup: Option<&'a Setup>,
    /// Whether it is other data than what was fitted.
    pub held_out: bool,
}

impl HeldOutSet<'_> {
    /// Returns the mean that `fit` predicts for this set. The lamps of this set differ from those of the fitted set.
    fn mean(&self, reference: &NullModel, fit: &Fit) -> Result<DVector<f64>> {
        let mut model = fit.judging();
        if let Some(setup) = self.setup {
            // A fit moves the lamps of the fitted set if its effects change the rates. The lamps of this set move as much.
            let of_set = lamps_of(setup);
            let found = model.lamps.iter().zip(&reference.model.lamps).zip(&of_set);
            let found = found.map(|((lamp, base), own)| own.offset + lamp.offset - base.offset);
            let found: Vec<f64> = found.collect();
            model.lit_by(&found);
        }
        let simulated = |model: &Model| match self.setup {
            Some(setup) => reference.mean_under(setup, model, &fit.u),
            None => Ok(reference.mean_of(model, &fit.u, fit.each.len(), Vec::new())?.mean),
        };
        let is_known = self.setup.is_none() && !fit.model.pinned.is_any();
        if is_known { Ok(fit.mean.clone()) } else { simulated(&model) }
    }

    fn off(&self, reference: &NullModel, fit: &Fit) -> Result<DVector<f64>> {
        Ok(self.data - self.mean(reference, fit)?)
    }
}

/// What a search goes by.
pub(crate) struct Search<'a> {
    /// The base model and the set that is fitted.
    pub fitter: Fitter<'a>,
    pub signatures: &'a [Signature],
    pub judge: HeldOutSet<'a>,
    /// Lost and repeated readouts of both sets.
    pub located: &'a Events,
}

/// A fitted model, what its own sensors show, and what the data have beyond that.
#[derive(Clone)]
pub(crate) struct TestedFit {
    pub fit: Fit,
    pub own: SelfConsistency,
    /// What the held-out set is off.
    pub off: DVector<f64>,
    /// Whether anything is above its limit in either set, and in the fitted one.
    pub left: bool,
    pub left_fitted: bool,
}

impl TestedFit {
    /// How unlikely the held-out set is.
    pub(crate) fn deviance(&self) -> f64 {
        self.fit.deviance_of(&self.off)
    }
}

impl Search<'_> {
    /// Whether anything is beyond the limits of the base model.
    pub(crate) fn base_alarm(&self) -> bool {
        let Fitter { reference, data } = self.fitter;
        let (fit, own) =
            (Fit::base(reference, data, self.located.clone()), SelfConsistency::of_base(reference));
        self.alarm(&fit, &own, &(data - &own.mean))
    }

    pub(crate) fn base(&self) -> Result<TestedFit> {
        let Fitter { reference, data } = self.fitter;
        let (fit, own) =
            (Fit::base(reference, data, self.located.clone()), SelfConsistency::of_base(reference));
        let left = self.alarm(&fit, &own, &(data - &own.mean));
        // Without time for simulations at the light of the held-out set, the light of the fitted set must do.
        let off = in_time(self.judge.off(reference, &fit))?;
        let off = off.unwrap_or_else(|| self.judge.data - &reference.mean);
        Ok(TestedFit { off, fit, own, left, left_fitted: left })
    }

    pub(crate) fn judged(&self, fit: Fit, own: SelfConsistency) -> Result<TestedFit> {
        let off = self.judge.off(self.fitter.reference, &fit)?;
        let left_fitted = self.alarm(&fit, &own, &(self.fitter.data - &own.mean));
        let left = left_fitted || self.alarm(&fit, &own, &off);
        Ok(TestedFit { fit, own, off, left, left_fitted })
    }

    /// How unlikely the held-out set is under a fit that was not judged yet.
    pub(crate) fn deviance(&self, fit: &Fit) -> Result<f64> {
        Ok(fit.deviance_of(&self.judge.off(self.fitter.reference, fit)?))
    }

    /// Squared distance of the fitted and of the held-out set, with what calibration fits taken out.
    pub(crate) fn gaps(&self, at: &TestedFit) -> [f64; 2] {
        [at.fit.misfit, self.fitter.reference.metric.square(&at.off)]
    }

    /// What a step from one model to another did to them.
    pub(crate) fn step(&self, before: &TestedFit, after: &TestedFit) -> Step {
        Step { before: self.gaps(before), after: self.gaps(after) }
    }

    fn alarm(&self, fit: &Fit, own: &SelfConsistency, off: &DVector<f64>) -> bool {
        alarm(fit, own, off, self.signatures)
    }
}
