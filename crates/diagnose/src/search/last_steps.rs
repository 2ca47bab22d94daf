//! The last steps of a fit whose base numbers lie far from where they were calibrated.
//!
//! A camera's own numbers are corrected before any effect is known and take over what they can of it: a threshold noise of 6.4 mV beside
//! a row noise of 6 mV began at 9.2 mV. What a base number moves is known at that place only, so a step goes three quarters of the way,
//! and a cost that is free along the base model's numbers does not ask for the next one. Left there, the two were said to be 6.6 and
//! 5.7 mV, each three deviations off.

use crate::fits::fit::Fit;
use crate::null_model::metric::Bound;
use crate::search::effect_search::SearchResult;
use crate::search::round::Undecided;
use crate::search::state::Search;
use crate::sensors::deadline::in_time;
use crate::thresholds::{
    CALIBRATION_INFORMATION, MAX_FINAL_BASE_STEP, MAX_FINAL_STEPS, MEAN_SIMULATIONS, MIN_FINAL_STEP,
    MIN_FIRST_FINAL_STEP,
};
use nalgebra::DVector;
use spikelane::effects::Camera;
use spikelane::error::Result;
use spikelane_calibrate::ProgressCallback;

impl Search<'_> {
    /// Searches for effects and takes the last steps. `start` is the camera from which the base model came.
    pub(crate) fn find_effects(
        &self,
        start: &Camera,
        progress: ProgressCallback<'_>,
    ) -> Result<SearchResult> {
        let mut found = self.add_effects(progress)?;
        progress("last steps", 0.94);
        if in_time(self.end(&mut found, start))?.is_none() {
            found.undecided.push(Undecided::BaseNumbers);
        }
        Ok(found)
    }

    /// Takes the last steps, where some are asked for; `given` is the camera that the base model came from.
    fn end(&self, found: &mut SearchResult, given: &Camera) -> Result<()> {
        let places = self.fitter.reference.model.places_in(given);
        // Beside noise as strong as that, what a base number moves is another change altogether; a still scene or maps tell too few apart.
        let setup = &self.fitter.reference.setup;
        if found.fit.effects.is_empty() || found.fit.is_noisy() || setup.only_still() || setup.has_rate_maps {
            return Ok(());
        }
        let Some(mut fit) = self.onward(found, &places)? else { return Ok(()) };
        let own = self.fitter.self_consistency(&mut fit)?;
        let next = self.judged(fit, own)?;
        let [train, heldout] = self.gaps(&next);
        let before = found.heldout.last().copied().unwrap_or_default();
        // Where more is left than before, what asked for the steps is no number of the base model.
        if next.left && !found.left || heldout > before + 2.0 * next.own.floor_sd {
            return Ok(());
        }
        found.train.push(train);
        found.heldout.push(heldout);
        found.steps.push("with the base model's numbers fitted further".to_owned());
        (found.fit, found.own, found.off, found.left) = (next.fit, next.own, next.off, next.left);
        Ok(())
    }

    /// As many steps as each ask for less than the one before, where the first asks for enough.
    fn onward(&self, found: &SearchResult, places: &[f64]) -> Result<Option<Fit>> {
        let wanted =
            |fit: &Fit| found.own.metric.bounded(&(&self.fitter.data - &fit.mean), &bounds(fit, places));
        let mut at = None;
        let mut step = wanted(&found.fit);
        let mut far = length(&step, &found.own.deviations);
        for _ in 0..MAX_FINAL_STEPS {
            if far < if at.is_none() { MIN_FIRST_FINAL_STEP } else { MIN_FINAL_STEP } {
                break;
            }
            let mut next = at.as_ref().unwrap_or(&found.fit).moved(&step);
            self.fitter.evaluate(&mut next, MEAN_SIMULATIONS)?;
            step = wanted(&next);
            let asked = length(&step, &found.own.deviations);
            if asked >= far {
                break;
            }
            (at, far) = (Some(next), asked);
        }
        Ok(at)
    }
}

/// A step by the largest of its numbers, in deviations.
fn length(step: &DVector<f64>, deviations: &[f64]) -> f64 {
    step.iter().zip(deviations).map(|(s, d)| (s / d).abs()).fold(0.0, f64::max)
}

/// How far each number may move, the base model's drawn to where the camera has them.
///
/// A number that gave way to a missing effect is small by now: a strength of the light's noise of 0.1 for 1. In shares of that it would be
/// held where it is.
fn bounds(fit: &Fit, places: &[f64]) -> Vec<Bound> {
    let mut bounds = fit.bounds();
    for (j, place) in places.iter().enumerate() {
        let (knob, u, size) = (fit.model.knobs[j], fit.u[j], 1.0 + place);
        let most = MAX_FINAL_BASE_STEP * size.max(1.0);
        let [low, high] = [u - most, u + most].map(|u| knob.clamped(u) - fit.u[j]);
        bounds[j] = Bound { low, high, leans: place - u, weight: CALIBRATION_INFORMATION / (size * size) };
    }
    bounds
}
