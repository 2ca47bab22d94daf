//! A model with effects, fitted to a set.

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

/// What derivatives were taken from: they are taken again where that has changed.
#[derive(Clone, Debug, Default)]
pub(crate) struct DerivativeOrigin {
    pub(super) at: Vec<f64>,
    pub(super) count: usize,
    pub(super) around: bool,
    /// Statistics that each effect hardly moves, and the simulations that told.
    pub(super) unmoved: Vec<Vec<usize>>,
    pub(super) told_by: usize,
}

/// A model with effects, fitted.
#[derive(Clone, Debug)]
pub(crate) struct Fit {
    /// Effects in the order in which they were added, with the number of knobs of each.
    pub effects: Vec<(&'static Definition, usize)>,
    pub model: Model,
    /// Lost and repeated readouts of the sets at hand.
    pub located: Events,
    pub u: Vec<f64>,
    pub mean: DVector<f64>,
    pub each: Vec<DVector<f64>>,
    /// The numbers and the offsets of the lamps that `each` was simulated and compared with the data with; empty where that was
    /// done with other effects, and for the base model, which the null's noise judges.
    pub(super) at: Vec<f64>,
    /// Changes per unit of the effects' knobs.
    pub jacobian: DMatrix<f64>,
    /// The same of the base knobs, where effects couple what these move.
    pub crossed: Option<DMatrix<f64>>,
    /// What `jacobian` was taken from.
    pub taken: DerivativeOrigin,
    /// Changes per standard deviation of the numbers of events.
    pub events: DMatrix<f64>,
    /// Squared distance to the data by the first null's noise, calibration projected out.
    pub misfit: f64,
    /// What the model's own simulations stray, where that is more than the null's.
    pub(super) likelihood: Likelihood,
    /// [`Likelihood::deviance`] of the data.
    pub cost: f64,
}

impl Fit {
    /// The base model.
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

    /// How unlikely data are that lie `off` from this model's mean: twice the negative logarithm, less a constant.
    pub(crate) fn deviance_of(&self, off: &DVector<f64>) -> f64 {
        self.likelihood.deviance(off)
    }

    /// Squared length of a difference in this model's noise.
    pub(crate) fn length_of(&self, off: &DVector<f64>) -> f64 {
        self.likelihood.metric.square(off)
    }

    /// Logarithm of the determinant of this model's noise over the null's.
    pub(crate) fn noise_of_its_own(&self) -> f64 {
        self.likelihood.log_volume
    }

    /// Simulations of a mean in a tournament, and in its second leg. Beside lost readouts two of them raised a cost of 1,000 to 2,500, and
    /// the names were ranked by their draws.
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

    /// The cost with a price for every number that was fitted.
    pub(crate) fn price(&self) -> f64 {
        self.cost + 2.0 * self.u.len() as f64
    }

    /// Whether it does not have the effect of this signature.
    pub(crate) fn lacks(&self, signature: &Signature) -> bool {
        self.effects.iter().all(|e| e.0 != signature.candidate.effect)
    }

    /// Directions of the numbers, and then those of the lamps with a unit for each uncertainty.
    pub(crate) fn directions_with_lamps(&self, reference: &NullModel) -> DMatrix<f64> {
        beside(&self.directions(reference), &columns(&reference.lamp_slopes, &reference.model))
    }

    /// Whether one of its effects sets in late.
    pub(crate) fn sets_in(&self) -> bool {
        self.effects.iter().any(|e| e.0.has_onset)
    }

    /// Number of base knobs.
    pub(crate) fn base_knobs(&self) -> usize {
        self.u.len() - self.effects.iter().map(|e| e.1).sum::<usize>()
    }

    /// Places of an effect's knobs.
    pub(crate) fn knobs_of(&self, effect: usize) -> std::ops::Range<usize> {
        let start = self.base_knobs() + self.effects[..effect].iter().map(|e| e.1).sum::<usize>();
        start..start + self.effects[effect].1
    }

    /// With `candidate` added, its amplitude scaled.
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

    /// Without one of its effects.
    pub(crate) fn without(&self, effect: usize) -> Self {
        let mut next = self.of_other_effects();
        let range = self.knobs_of(effect);
        next.model.knobs.drain(range.clone());
        next.u.drain(range);
        next.effects.remove(effect);
        next.pin();
        next
    }

    /// Without one of its effects, the other numbers moved to where they take its part over: by a linear step in `metric`, which has
    /// its numbers as directions, as far as one is trusted.
    pub(crate) fn without_and_moved(&self, effect: usize, metric: &Metric) -> Self {
        let amplitude = self.knobs_of(effect).start;
        let (step, bounds) = (metric.along(amplitude, -self.u[amplitude]), self.bounds());
        let by = |j: usize| step[j].clamp(bounds[j].low, bounds[j].high);
        self.moved(&DVector::from_fn(self.u.len(), |j, _| by(j))).without(effect)
    }

    /// A copy of which the effects are about to change: nothing that was simulated holds for it.
    fn of_other_effects(&self) -> Self {
        Self { at: Vec::new(), taken: DerivativeOrigin::default(), crossed: None, ..self.clone() }
    }

    /// Its numbers and the offsets of its lamps.
    pub(super) fn place(&self) -> Vec<f64> {
        self.u.iter().copied().chain(self.model.lamps.iter().map(|lamp| lamp.offset)).collect()
    }

    /// With its numbers moved.
    pub(crate) fn moved(&self, by: &DVector<f64>) -> Self {
        let mut next = self.clone();
        for (j, by) in by.iter().enumerate() {
            next.u[j] = next.model.knobs[j].clamped(self.u[j] + by);
        }
        next
    }

    /// The same with the base model's numbers held.
    pub(crate) fn bounds_of_effects(&self) -> Vec<Bound> {
        let mut bounds = self.bounds();
        bounds[..self.base_knobs()].iter_mut().for_each(|b| (b.low, b.high) = (0.0, 0.0));
        bounds
    }

    /// How far each number may move: to the end of its range, and as far as a linear step is trusted.
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

    /// What is known of every number beforehand, as information: of the base model's by calibration, of an effect's that it
    /// lies anywhere in its range.
    pub(crate) fn known(&self) -> Vec<f64> {
        let of_effect = |j: usize| {
            let knob = self.model.knobs[j];
            // A number that cannot move is known exactly. Infinite information would make the covariance NaN.
            12.0 / (knob.position(knob.range.1) - knob.position(knob.range.0)).powi(2).max(FIXED_RANGE_SQUARE)
        };
        let of_number = |j: usize| match self.count(j) {
            Some(count) => (self.model.knobs[j].unit / count.deviation()).powi(2),
            None if j < self.base_knobs() => CALIBRATION_INFORMATION,
            None => of_effect(j),
        };
        (0..self.u.len()).map(of_number).collect()
    }

    /// With the base model's numbers as they were calibrated: they may have moved to take in what is added now.
    pub(crate) fn with_calibrated_base(&self) -> Self {
        let mut next = self.clone();
        let base = self.base_knobs();
        next.u[..base].fill(0.0);
        next
    }

    /// Directions that the data have been fitted along: base knobs and effects' knobs.
    pub(crate) fn directions(&self, reference: &NullModel) -> DMatrix<f64> {
        beside(self.crossed.as_ref().unwrap_or(&reference.jacobian), &self.jacobian)
    }
}

/// Furthest that a knob moves in one round.
pub(crate) fn trust(scale: SearchScale, u: f64) -> f64 {
    match scale {
        SearchScale::Log | SearchScale::LogComplement => 0.8,
        _ => (0.7 * u.abs()).max(0.8),
    }
}

impl Fit {
    /// Has lost and repeated readouts that are its effects' where the fitted set has them, as often as the sets at hand do.
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

    /// Its model with the lost and repeated readouts of the set that judges.
    pub(crate) fn judging(&self) -> Model {
        Model { pinned: self.model.pinned.of(&self.located.judging), ..self.model.clone() }
    }

    /// How many events a number is the probability of, where they are located: then no fit moves it.
    pub(crate) fn count(&self, j: usize) -> Option<EventCount> {
        let knob = self.model.knobs[j];
        (j >= self.base_knobs()).then(|| self.located.of(knob.effect)).flatten()
    }

    /// Whether a signature is of an effect that the sets at hand can have.
    pub(crate) fn allows(&self, signature: &Signature) -> bool {
        self.located.allow(signature.candidate.effect)
    }
}
