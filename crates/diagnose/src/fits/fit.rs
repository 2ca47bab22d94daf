//! A model with effects that is fitted to a recording set.

use crate::events::locations::{EventCount, Events, PinnedEvents};
use crate::fits::likelihood::Likelihood;
use crate::light::offsets::columns;
use crate::null_model::metric::{Bound, Metric};
use crate::null_model::model::NullModel;
use crate::null_model::signature::Signature;
use crate::null_model::vectors::beside;
use crate::sensors::catalog::Candidate;
use crate::sensors::model::Model;
use crate::thresholds::{
    CALIBRATION_INFORMATION, FEW_SIMULATIONS, FIXED_RANGE_SQUARE, MIN_NOISY_LOG_VOLUME, SOME_SIMULATIONS,
};
use nalgebra::{DMatrix, DVector};
use spikelane::effects::Definition;
use spikelane::effects::definition::SearchScale;

/// The state at which derivatives were computed. If the parameters move away from this state, the derivatives are
/// computed again.
#[derive(Clone, Debug, Default)]
pub(crate) struct DerivativeOrigin {
    pub(super) at: Vec<f64>,
    pub(super) count: usize,
    pub(super) around: bool,
    /// Statistics that each effect hardly changes, by effect. `told_by` is the number of simulations from which
    /// they were found.
    pub(super) unmoved: Vec<Vec<usize>>,
    pub(super) told_by: usize,
}

/// A model with effects, fitted to a recording set.
#[derive(Clone, Debug)]
pub(crate) struct Fit {
    /// Effects in the order in which they were added. Each has the number of its knobs.
    pub effects: Vec<(&'static Definition, usize)>,
    pub model: Model,
    /// Lost and repeated readouts of the fitted set and of the held-out set.
    pub located: Events,
    pub u: Vec<f64>,
    pub mean: DVector<f64>,
    pub each: Vec<DVector<f64>>,
    /// The parameters and the lamp offsets with which `each` was simulated. It is empty if the effects have changed
    /// since then. It is also empty for the base model, whose noise is that of the null model.
    pub(super) at: Vec<f64>,
    /// Derivatives of the statistics by the knobs of the effects.
    pub jacobian: DMatrix<f64>,
    /// Derivatives of the statistics by the base knobs. `None` if no effect changes these derivatives, so that
    /// those of the null model are used.
    pub crossed: Option<DMatrix<f64>>,
    /// The state at which `jacobian` was computed.
    pub taken: DerivativeOrigin,
    /// Change of the statistics per standard deviation of each number of events that cannot be located.
    pub events: DMatrix<f64>,
    /// Squared distance between the mean and the data, in the noise of the null model. Directions that calibration
    /// fits do not count.
    pub misfit: f64,
    /// Likelihood with the noise of this model, which is at least the noise of the null model.
    pub(super) likelihood: Likelihood,
    /// [`Likelihood::deviance`] of the data.
    pub cost: f64,
}

impl Fit {
    /// Returns the fit of the base model.
    pub(crate) fn base(reference: &NullModel, data: &DVector<f64>, located: Events) -> Self {
        let off = data - &reference.mean;
        Self {
            effects: Vec::new(),
            model: reference.model.clone(),
            located,
            u: vec![0.0; reference.model.knobs.len()],
            mean: reference.mean.clone(),
            each: reference.baseline.clone(),
            at: Vec::new(),
            jacobian: DMatrix::zeros(data.len(), 0),
            crossed: None,
            taken: DerivativeOrigin::default(),
            events: DMatrix::zeros(data.len(), 0),
            misfit: reference.metric.square(&off),
            cost: reference.metric.square(&off),
            likelihood: Likelihood::of_null(reference),
        }
    }

    /// Returns the deviance of data that differ by `off` from the mean. The deviance is twice the negative
    /// logarithm of the likelihood, up to a constant.
    pub(crate) fn deviance_of(&self, off: &DVector<f64>) -> f64 {
        self.likelihood.deviance(off)
    }

    /// Returns the squared length of `off` in the noise of this model.
    pub(crate) fn length_of(&self, off: &DVector<f64>) -> f64 {
        self.likelihood.metric.square(off)
    }

    /// Returns the logarithm of the determinant of the noise of this model, relative to the null model.
    pub(crate) fn noise_of_its_own(&self) -> f64 {
        self.likelihood.log_volume
    }

    /// Returns the numbers of simulations of a mean in the first and in the second leg of a tournament. A model
    /// with much noise has more simulations. Measured: for a model with lost readouts, means of two simulations
    /// raised the cost from 1,000 to 2,500, so the draws decided the order of the effects.
    pub(crate) fn draws(&self) -> [usize; 2] {
        if self.is_noisy() {
            [SOME_SIMULATIONS, 2 * SOME_SIMULATIONS]
        } else {
            [FEW_SIMULATIONS, SOME_SIMULATIONS]
        }
    }

    pub(crate) fn is_noisy(&self) -> bool {
        self.noise_of_its_own() > MIN_NOISY_LOG_VOLUME
    }

    /// Returns the score of the fit: its cost plus 2 for each fitted parameter (Akaike's information criterion).
    pub(crate) fn price(&self) -> f64 {
        self.cost + 2.0 * self.u.len() as f64
    }

    /// Returns whether the model does not contain the effect of a signature.
    pub(crate) fn lacks(&self, signature: &Signature) -> bool {
        self.effects.iter().all(|e| e.0 != signature.candidate.effect)
    }

    /// Returns the derivatives by the parameters, and then the changes per uncertainty of each lamp, as columns.
    pub(crate) fn directions_with_lamps(&self, reference: &NullModel) -> DMatrix<f64> {
        beside(&self.directions(reference), &columns(&reference.lamp_slopes, &reference.model))
    }

    /// Returns whether one of the effects has an onset.
    pub(crate) fn sets_in(&self) -> bool {
        self.effects.iter().any(|e| e.0.has_onset)
    }

    /// Returns the number of base knobs.
    pub(crate) fn base_knobs(&self) -> usize {
        self.u.len() - self.effects.iter().map(|e| e.1).sum::<usize>()
    }

    /// Returns the indices of the knobs of an effect.
    pub(crate) fn knobs_of(&self, effect: usize) -> std::ops::Range<usize> {
        let start = self.base_knobs() + self.effects[..effect].iter().map(|e| e.1).sum::<usize>();
        start..start + self.effects[effect].1
    }

    /// Returns a copy with `candidate`, whose amplitude is multiplied by `scale`.
    pub(crate) fn with(&self, candidate: &Candidate, scale: f64) -> Self {
        let mut next = self.of_other_effects();
        next.effects.push((candidate.effect, candidate.knobs.len()));
        for (i, (knob, at)) in candidate.knobs.iter().zip(&candidate.at).enumerate() {
            next.model.knobs.push(*knob);
            next.u.push(knob.clamped(if i == 0 { at * scale } else { *at }));
        }
        next.pin();
        next
    }

    /// Returns a copy without one of the effects. The other parameters do not change.
    pub(crate) fn without(&self, effect: usize) -> Self {
        let mut next = self.of_other_effects();
        let range = self.knobs_of(effect);
        next.model.knobs.drain(range.clone());
        next.u.drain(range);
        next.effects.remove(effect);
        next.pin();
        next
    }

    /// Returns a copy without one of the effects, whose other parameters compensate for the removed effect. They
    /// move by the step that a linear fit predicts, within their bounds. `metric` has the parameters as directions.
    pub(crate) fn without_and_moved(&self, effect: usize, metric: &Metric) -> Self {
        let amplitude = self.knobs_of(effect).start;
        let (step, bounds) = (metric.along(amplitude, -self.u[amplitude]), self.bounds());
        let by = |j: usize| step[j].clamp(bounds[j].low, bounds[j].high);
        self.moved(&DVector::from_fn(self.u.len(), |j, _| by(j))).without(effect)
    }

    /// Returns a copy whose effects can be changed: without the record of its simulations and its derivatives.
    fn of_other_effects(&self) -> Self {
        Self { at: Vec::new(), taken: DerivativeOrigin::default(), crossed: None, ..self.clone() }
    }

    /// Returns the parameters, and then the lamp offsets.
    pub(super) fn place(&self) -> Vec<f64> {
        self.u.iter().copied().chain(self.model.lamps.iter().map(|lamp| lamp.offset)).collect()
    }

    /// Returns a copy whose parameters are moved by `by`, within their ranges.
    pub(crate) fn moved(&self, by: &DVector<f64>) -> Self {
        let mut next = self.clone();
        for (j, by) in by.iter().enumerate() {
            next.u[j] = next.model.knobs[j].clamped(self.u[j] + by);
        }
        next
    }

    /// Returns the bounds of a step that keeps the base parameters fixed.
    pub(crate) fn bounds_of_effects(&self) -> Vec<Bound> {
        let mut bounds = self.bounds();
        bounds[..self.base_knobs()].iter_mut().for_each(|b| (b.low, b.high) = (0.0, 0.0));
        bounds
    }

    /// Returns the bounds of a step for each parameter. A step must stay in the range of the parameter, and within
    /// the distance over which the model is nearly linear.
    pub(crate) fn bounds(&self) -> Vec<Bound> {
        let bound = |j: usize| {
            let (knob, u, base) = (self.model.knobs[j], self.u[j], j < self.base_knobs());
            let most = match self.count(j) {
                Some(_) => 0.0,
                None if base => 0.3,
                None => trust(knob.scale, u),
            };
            let [low, high] = [u - most, u + most].map(|u| knob.clamped(u));
            Bound {
                low: low - u,
                high: high - u,
                leans: -u,
                weight: if base { CALIBRATION_INFORMATION } else { 0.0 },
            }
        };
        (0..self.u.len()).map(bound).collect()
    }

    /// Returns the prior information about each parameter. For a base parameter, it comes from the calibration. For
    /// an effect, it is that of a uniform distribution over the range. For a probability whose events were counted,
    /// it comes from the count.
    pub(crate) fn known(&self) -> Vec<f64> {
        let of_effect = |j: usize| {
            let knob = self.model.knobs[j];
            // If a parameter cannot move, the width of its range is zero. The limit keeps the information finite,
            // because infinite information would make the covariance NaN.
            12.0 / (knob.position(knob.range.1) - knob.position(knob.range.0)).powi(2).max(FIXED_RANGE_SQUARE)
        };
        let of_number = |j: usize| match self.count(j) {
            Some(count) => (self.model.knobs[j].unit / count.deviation()).powi(2),
            None if j < self.base_knobs() => CALIBRATION_INFORMATION,
            None => of_effect(j),
        };
        (0..self.u.len()).map(of_number).collect()
    }

    /// Returns a copy with the calibrated base parameters. The fitted base parameters may have absorbed a part of a
    /// missing effect.
    pub(crate) fn with_calibrated_base(&self) -> Self {
        let mut next = self.clone();
        let base = self.base_knobs();
        next.u[..base].fill(0.0);
        next
    }

    /// Returns the derivatives of the statistics by the base knobs, and then by the knobs of the effects, as
    /// columns.
    pub(crate) fn directions(&self, reference: &NullModel) -> DMatrix<f64> {
        beside(self.crossed.as_ref().unwrap_or(&reference.jacobian), &self.jacobian)
    }
}

/// Returns the largest step of a knob at position `u` in one iteration.
pub(crate) fn trust(scale: SearchScale, u: f64) -> f64 {
    match scale {
        SearchScale::Log | SearchScale::LogComplement => 0.8,
        _ => (0.7 * u.abs()).max(0.8),
    }
}

impl Fit {
    /// Places the lost and repeated readouts of the effects at the readouts that were located in the fitted set.
    /// Sets the probabilities of these effects to the counted rates.
    pub(crate) fn pin(&mut self) {
        self.model.pinned = PinnedEvents::new(&self.located.fitted, self.effects.iter().map(|e| e.0));
        for e in 0..self.effects.len() {
            let j = self.knobs_of(e).start;
            if let Some(count) = self.count(j) {
                let knob = self.model.knobs[j];
                self.u[j] = knob.clamped(knob.position(count.rate()));
            }
        }
    }

    /// Returns the model with the lost and repeated readouts that were located in the held-out set.
    pub(crate) fn judging(&self) -> Model {
        Model { pinned: self.model.pinned.of(&self.located.judging), ..self.model.clone() }
    }

    /// Returns the number of located events if parameter `j` is the probability of these events. A fit does not
    /// move such a parameter.
    pub(crate) fn count(&self, j: usize) -> Option<EventCount> {
        let knob = self.model.knobs[j];
        (j >= self.base_knobs()).then(|| self.located.of(knob.effect)).flatten()
    }

    /// Returns whether the recording sets can contain the effect of a signature.
    pub(crate) fn allows(&self, signature: &Signature) -> bool {
        self.located.allow(signature.candidate.effect)
    }
}
