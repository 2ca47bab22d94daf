//! Gauss-Newton over simulated means, in a region of trust.

use nalgebra::DVector;

use super::fit::Fit;
use super::fitter::Fitter;
use super::slopes::Secant;
use crate::diagnose::null::metric::Bound;
use spikelane::error::Result;

/// What a step must promise to be simulated: this fall of the cost, and this share of it.
const WORTH: (f64, f64) = (0.5, 0.003);

/// Move of a number of the base model from which on a step is always simulated: the cost is free along these, and promises nothing.
const WORTH_OF_BASE: f64 = 0.1;

impl Fitter<'_> {
    /// Gauss-Newton from where `fit` stands, `rounds` at most, each mean from `count` simulations.
    pub(in crate::diagnose) fn refine(&self, mut fit: Fit, rounds: usize, count: usize) -> Result<Fit> {
        self.evaluate(&mut fit, count)?;
        for round in 0..rounds {
            // Common draws: a difference needs fewer simulations than a mean.
            self.derive(&mut fit, count.div_ceil(2), Secant::Ahead)?;
            let Some(next) = self.line_search(&fit, count)? else { break };
            let gained = fit.cost - next.cost;
            fit = next;
            if round + 1 < rounds && gained < 0.01 * fit.cost.max(0.0) + 1.0 {
                break;
            }
        }
        Ok(fit)
    }

    /// The first of these steps that helps: the whole one, that of the effects alone (first where one sets in), or a part of the whole one. Where the base
    /// model's numbers stay, draws are alike to those of all of its simulations, and the mean has less noise than a small
    /// move of theirs gains.
    fn line_search(&self, fit: &Fit, count: usize) -> Result<Option<Fit>> {
        let off = self.data - &fit.mean;
        let metric = fit.metric(self.reference);
        let wanted = |bounds: &[Bound]| metric.bounded(&off, bounds);
        let whole = wanted(&fit.bounds());
        let worth = |step: &DVector<f64>| {
            let promised = fit.cost - fit.deviance_of(&metric.after(&off, step));
            promised > WORTH.0 + WORTH.1 * fit.cost || step.rows(0, fit.base_knobs()).amax() > WORTH_OF_BASE
        };
        let lamps_after =
            |step: &DVector<f64>| self.reference.lamps_of(fit.noise(), &metric.after(&off, step));
        let mut steps = [whole.clone(), wanted(&fit.bounds_of_effects()), whole * 0.4];
        // What the slope of an effect that sets in leaves far from the data, the base model's numbers would take in, as far as they may
        // move. A clamp at 1.257 thresholds was left at 1.249 so, at 70 times the cost, and a partial reset was named.
        if fit.sets_in() {
            steps.swap(0, 1);
        }
        for step in steps {
            let lamps = lamps_after(&step);
            if !worth(&step) && !fit.model.needs_offsets(&lamps) {
                continue;
            }
            let mut next = fit.moved(&step);
            next.model.lit_by(&lamps);
            self.evaluate(&mut next, count)?;
            if next.cost < fit.cost {
                return Ok(Some(next));
            }
        }
        Ok(None)
    }
}
