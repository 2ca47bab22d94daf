//! The last steps of a fit whose base parameters are far from their calibrated values.
//!
//! The parameters of a given camera are fitted before any effect is known. They therefore absorb a part of the
//! effects. Measured with a threshold noise of 6.4 mV and a row noise of 6 mV: the threshold noise started at 9.2
//! mV.
//!
//! The derivatives by the base parameters hold only near the start, so one step covers three quarters of the
//! distance. The cost does not depend on the base parameters, so it does not request another step. Without the last
//! steps, the threshold noise was 6.6 mV and the row noise was 5.7 mV. Each was three standard deviations from the
//! truth.

use crate::fits::fit::Fit;
use crate::null_model::metric::Bound;
use crate::search::effect_search::SearchResult;
use crate::search::round::Undecided;
use crate::search::state::{Search, TestedFit};
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
    /// Searches for effects and then makes the last steps. `start` is the camera of the base model.
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

    /// Makes the last steps, if they are large enough. `given` is the camera of the base model.
    fn end(&self, found: &mut SearchResult, given: &Camera) -> Result<()> {
        let places = self.fitter.reference.model.places_in(given);
        // The derivatives come from the base model. They do not hold if the effects add strong noise. Static scenes
        // and rate maps determine too few parameters.
        let setup = &self.fitter.reference.setup;
        let fit = &found.last.fit;
        if fit.effects.is_empty() || fit.is_noisy() || setup.only_still() || setup.has_rate_maps {
            return Ok(());
        }
        let Some(mut fit) = self.onward(&found.last, &places)? else { return Ok(()) };
        let own = self.fitter.self_consistency(&mut fit)?;
        let next = self.judged(fit, own)?;
        let step = self.search_step("with the base model's numbers fitted further", &next);
        let before = found.steps.last().map_or(0.0, |step| step.discrepancies[1]);
        // If a larger discrepancy remains than before, a base parameter is not the cause of the steps.
        if next.left && !found.last.left || step.discrepancies[1] > before + 2.0 * next.own.floor_sd {
            return Ok(());
        }
        found.steps.push(step);
        found.last = next;
        Ok(())
    }

    /// Makes steps as long as each is shorter than the previous one. Returns the last fit, or `None` if the first
    /// step is too small.
    fn onward(&self, found: &TestedFit, places: &[f64]) -> Result<Option<Fit>> {
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

/// Returns the largest component of a step, in standard deviations.
fn length(step: &DVector<f64>, deviations: &[f64]) -> f64 {
    step.iter().zip(deviations).map(|(s, d)| (s / d).abs()).fold(0.0, f64::max)
}

/// Returns the bounds of a step for each parameter. The prior of a base parameter is centered at its value in the
/// camera.
///
/// The bounds of a base parameter are proportional to its value in the camera. The present value may be too small,
/// because a missing effect has changed it. For example, a strength of shot noise of 0.1 instead of 1 could hardly
/// move if the bounds were proportional to 0.1.
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
