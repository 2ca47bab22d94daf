//! Backward elimination: tests whether each added effect is necessary, and whether another effect fits better in
//! its place.

use std::ops::Range;

use crate::fits::fit::Fit;
use crate::fits::fitter::Fitter;
use crate::fits::scored_fit::ScoredFit;
use crate::null_model::metric::Metric;
use crate::null_model::signature::Signature;
use crate::search::round::{EliminationReason, Entrant, Round, kept_mut, tied};
use crate::search::state::{Search, TestedFit};
use crate::search::tournament::{cheaper, last};
use crate::thresholds::{
    ENTRY_STEPS, MAX_REPLACEMENTS, MAX_SIMULATION_COST, MAX_SWAPS, MAX_VARIANCE_INFLATION, MEAN_SIMULATIONS,
    MIN_ELIMINATION_COST, MIN_HELD_OUT_GAIN_SHARE, NOISY_SIMULATIONS, REMAINDER_SHARE, SOME_SIMULATIONS,
    STEPS_OF_FURTHER_EFFECT,
};
use spikelane::error::Result;
use spikelane::unstable::threads;

impl Search<'_> {
    /// Eliminates and replaces effects until nothing changes. A wrong effect leaves a part of the deviations. An
    /// effect that was added later may describe only this part.
    pub(crate) fn eliminate_backward(&self, at: &mut TestedFit, rounds: &mut [Round]) -> Result<()> {
        self.eliminate(at, rounds)?;
        for _ in 0..MAX_SWAPS {
            if !self.swap(at, rounds)? {
                break;
            }
            self.eliminate(at, rounds)?;
        }
        if at.fit.effects.len() > 1 {
            self.mark_faint(at, rounds);
        }
        Ok(())
    }

    /// Removes unnecessary effects. These are effects whose amplitude is within three standard deviations of zero,
    /// or that other parameters can replace, and without which the data are equally likely.
    ///
    /// The order of the additions can cause such effects. If a similar wrong effect was added first, the right
    /// effect explains only a part of the deviations. The two directions are then nearly parallel, and a fit along
    /// them takes short steps.
    fn eliminate(&self, at: &mut TestedFit, rounds: &mut [Round]) -> Result<()> {
        while at.fit.effects.len() > 1 {
            let Some((place, without)) = self.dispensable(at)? else { break };
            let name = at.fit.effects[place].0.name;
            *at = without;
            if let Some(round) = kept_mut(rounds, name) {
                round.fate = EliminationReason::Eliminated;
            }
        }
        Ok(())
    }

    /// Returns the weakest effect that is unnecessary, and the tested model without it. The data must be equally
    /// likely without the effect.
    fn dispensable(&self, at: &TestedFit) -> Result<Option<(usize, TestedFit)>> {
        let Fitter { reference, data } = &self.fitter;
        let (fit, own) = (&at.fit, &at.own);
        let worth = MIN_ELIMINATION_COST + REMAINDER_SHARE * fit.length_of(&(data - &reference.mean));
        let amplitude = |e: usize| fit.knobs_of(e).start;
        let strength = |e: usize| fit.u[amplitude(e)].abs() / own.deviations[amplitude(e)];
        let mut places: Vec<usize> = (0..fit.effects.len()).collect();
        places.sort_by(|a, b| strength(*a).total_cmp(&strength(*b)));
        let cost = self.fitter.priced(fit.clone()).cost();
        for place in places {
            if strength(place) > 3.0 && own.metric.inflation(amplitude(place)) < MAX_VARIANCE_INFLATION {
                continue;
            }
            let mut without = self.refitted_without(fit, place, &own.metric)?;
            let costlier = self.fitter.priced(without.clone()).cost() - cost;
            // If the interval of the amplitude contains zero, the gain in the fitted set is no evidence. The
            // held-out set then decides.
            let weak = strength(place) < 2.0 && !self.shown(at, &without, costlier)?;
            if !weak && costlier >= worth {
                continue;
            }
            let own = self.fitter.self_consistency(&mut without)?;
            let without = self.judged(without, own)?;
            // If the model contains a strong effect, a small gain is no evidence, because the signature of the
            // strong effect is approximate. A small gain counts only if a significant deviation remains without the
            // effect and none with it.
            if weak || costlier < MIN_ELIMINATION_COST || at.left || !without.left {
                return Ok(Some((place, without)));
            }
        }
        Ok(None)
    }

    /// Returns whether the held-out set prefers the model `at` to `other` as well. `gained` is the gain of `at` in
    /// the fitted set.
    ///
    /// The interval of an amplitude may contain zero although the effect is real. One reason is that other
    /// parameters can replace the effect. Another reason is that a probability changes the noise more than the
    /// mean. Measured: a lag with an amplitude of 1.7 standard deviations gained 156 in the fitted set and 157 in
    /// the held-out set. Lost readouts with an amplitude of 1.1 standard deviations gained 8,527 and 8,360.
    fn shown(&self, at: &TestedFit, other: &Fit, gained: f64) -> Result<bool> {
        Ok(self.recordings.held_out.is_any()
            && self.deviance(other)? - at.deviance() >= gained * MIN_HELD_OUT_GAIN_SHARE)
    }

    /// Fits the model without one effect from two starts, and returns the more likely fit. One start has the
    /// present parameters. In the other start, the remaining parameters have moved to compensate for the removed
    /// effect.
    fn refitted_without(&self, fit: &Fit, place: usize, metric: &Metric) -> Result<Fit> {
        let starts = [fit.without(place), fit.without_and_moved(place, metric)];
        let refit = |start: Fit| -> Result<Fit> {
            let mut fit = self.fitter.refine(start, STEPS_OF_FURTHER_EFFECT[0], SOME_SIMULATIONS)?;
            self.fitter.evaluate(&mut fit, MEAN_SIMULATIONS)?;
            Ok(fit)
        };
        let [stayed, moved] = starts.map(refit);
        let (stayed, moved) = (stayed?, moved?);
        Ok(if moved.cost < stayed.cost { moved } else { stayed })
    }

    /// Tries other effects in the place of each accepted effect, because the other accepted effects are now known.
    /// If another effect is better, replaces the first such effect and returns `true`. Otherwise, records the
    /// effects that are equally likely as ties.
    fn swap(&self, at: &mut TestedFit, rounds: &mut [Round]) -> Result<bool> {
        let [_, some] = draws_of_elimination(&at.fit);
        let mut with = at.fit.clone();
        self.fitter.evaluate(&mut with, some)?;
        let with = self.fitter.priced(with);
        let mut ties = Vec::new();
        for (place, (effect, _)) in at.fit.effects.iter().enumerate() {
            // Only this effect loses or repeats whole readouts, so no other effect can replace it.
            if at.fit.located.demand(effect) {
                continue;
            }
            let others = self.other_names(at, &with, place)?;
            let Some(best) = others.first() else { continue };
            let gained = with.price - best.price;
            if gained < 4.0 || at.deviance() - self.deviance(&best.fit)? < gained * MIN_HELD_OUT_GAIN_SHARE {
                ties.push((effect.name, others.iter().map(|o| self.entrant(&with, o)).collect()));
                continue;
            }
            let before = Entrant { name: effect.name, ..self.entrant(best, &with) };
            let others = others[1..].iter().map(|o| self.entrant(best, o));
            let rivals = std::iter::once(before).chain(others).collect();
            *at = self.exchanged(at, best.fit.clone(), kept_mut(rounds, effect.name), rivals)?;
            return Ok(true);
        }
        for (name, rivals) in ties {
            if let Some(round) = kept_mut(rounds, name) {
                round.ties_with(rivals);
            }
        }
        Ok(false)
    }

    /// Returns the tested model `best`, in which another effect replaces the winner of `round`. The new effect is
    /// the last one.
    fn exchanged(
        &self,
        at: &TestedFit,
        mut best: Fit,
        round: Option<&mut Round>,
        rivals: Vec<Entrant>,
    ) -> Result<TestedFit> {
        let own = self.fitter.converged(&mut best)?;
        let next = self.judged(best, own)?;
        if let Some(round) = round {
            let step = self.step(at, &next);
            round.evidence = format!("in the place of {} {}", round.winner, step.words());
            round.step = Some(step);
            round.winner = last(&next.fit);
            round.mean = next.fit.mean.clone();
            round.entrants.clear();
            round.ties_with(rivals);
        }
        Ok(next)
    }

    /// Returns models that have another effect in `place` and are nearly as likely as `with`, or more likely.
    /// `with` has the present effect. The most likely model is first.
    fn other_names(&self, at: &TestedFit, with: &ScoredFit, place: usize) -> Result<Vec<ScoredFit>> {
        let (fitter, fit) = (&self.fitter, &at.fit);
        let all: Vec<&Signature> = self.signatures.iter().collect();
        let name = fit.effects[place].0.name;
        let [few, some] = draws_of_elimination(fit);
        let without = fitter.refine(fit.without(place), 1, few)?;
        let metric = without_effect(&at.own.metric, fit, place);
        let others = self.entrants(&without, &metric, &(&fitter.data - &without.mean), &all)?;
        let others: Vec<_> =
            others.into_iter().filter(|e| e.1.candidate.effect.name != name).take(MAX_REPLACEMENTS).collect();
        let without = fitter.priced(without);
        let halfway = 0.5 * (without.price + with.price) + MAX_SIMULATION_COST;
        let enter = |(scale, s): &(f64, Signature)| {
            let start = without.fit.with(&s.candidate, *scale);
            let entered = fitter.refined(start, ENTRY_STEPS, few)?;
            if entered.price > halfway {
                return Ok(None);
            }
            fitter.refined(entered.fit, STEPS_OF_FURTHER_EFFECT[0] - ENTRY_STEPS, few).map(Some)
        };
        let fits = threads::try_map(&others, enter)?;
        let fits: Vec<ScoredFit> = fits.into_iter().flatten().collect();
        // The noise of a model is estimated from its simulations and reduced toward that of the null model. With
        // few simulations, the reduction raises the cost by the difference between both noises.
        let drawn = MAX_SIMULATION_COST + with.fit.noise_of_its_own().max(0.0);
        let front = fits.iter().map(|f| f.price).fold(with.price, f64::min) + drawn;
        let near: Vec<Fit> = fits.into_iter().filter(|f| f.price <= front).map(|f| f.fit).collect();
        let mut others = threads::try_map(near, |f| fitter.refined(f, STEPS_OF_FURTHER_EFFECT[1], some))?;
        others.sort_by(cheaper);
        Ok(others)
    }
}

/// Returns the numbers of simulations of a mean in both legs of a replacement.
fn draws_of_elimination(fit: &Fit) -> [usize; 2] {
    if fit.is_noisy() { NOISY_SIMULATIONS } else { fit.draws() }
}

/// Returns the metric of a fit without one of its effects. In the metric of the fit itself, a change along the
/// effect has no length. An effect that could replace it would then promise no gain. Measured: `crosstalk` in the
/// place of `spike_coupling` beside `image_lag` promised to explain only 12 of 50,000.
fn without_effect(metric: &Metric, fit: &Fit, effect: usize) -> Metric {
    without_directions(metric, fit.knobs_of(effect), fit.known())
}

/// Removes the directions `gone` from a metric. `known` is the prior information about all positions.
fn without_directions(metric: &Metric, gone: Range<usize>, mut known: Vec<f64>) -> Metric {
    known.drain(gone.clone());
    Metric::new(&metric.noise, metric.directions.clone().remove_columns(gone.start, gone.len()))
        .knowing(&known)
}

impl Search<'_> {
    /// Marks effects that are weaker than their smallest detectable strength and have no ties.
    ///
    /// Strong effects leave small deviations of many shapes. A weak effect may fit some of these deviations,
    /// although the camera does not have the effect. Measured: a `leak` of half its detectable strength was added
    /// after a wrong effect. It stayed in the model when the wrong effect was replaced. About a hundred right
    /// effects were found in models with other effects. Each of those without ties was stronger than its smallest
    /// detectable strength.
    pub(crate) fn mark_faint(&self, at: &TestedFit, rounds: &mut [Round]) {
        for (i, (effect, _)) in at.fit.effects.iter().enumerate() {
            let Some(round) = kept_mut(rounds, effect.name) else { continue };
            if !tied(round).is_empty() {
                continue;
            }
            let amplitude = at.fit.knobs_of(i).start;
            let knob = at.fit.model.knobs[amplitude];
            let strength = (knob.value(at.fit.u[amplitude]) - knob.value(0.0)).abs();
            let Some(smallest) = self.fitter.reference.detectability_of(effect).map(|n| n.strength) else {
                continue;
            };
            if strength < smallest {
                round.faint = true;
                round.evidence +=
                    &format!("; a strength of {strength:.2e} where this set can name {smallest:.2e}");
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{DMatrix, DVector};

    use super::*;
    use crate::null_model::metric::noise;

    #[test]
    fn what_an_effect_explained_is_off_again_without_it() {
        // Three statistics with standard deviation 1. The first two are free directions.
        let unit = |i: usize| DVector::from_fn(3, |j, _| if i == j { 1.0 } else { 0.0 });
        let all = noise(&[unit(0), unit(1), unit(2)], &[(2.0_f64 / 3.0).sqrt(); 3]).unwrap();
        let metric = Metric::new(&all, DMatrix::from_columns(&[unit(0), unit(1)])).knowing(&[0.0; 2]);
        let without = without_directions(&metric, 0..1, vec![0.0; 2]);
        let squares = |m: &Metric| [0, 1, 2].map(|i| m.square(&unit(i)));
        // The ridge of 1e-6 leaves about this squared length along a free direction.
        for (found, expected) in squares(&metric).iter().zip([0.0, 0.0, 1.0]) {
            assert!((found - expected).abs() < 1e-5, "{found} for {expected}");
        }
        for (found, expected) in squares(&without).iter().zip([1.0, 0.0, 1.0]) {
            assert!((found - expected).abs() < 1e-5, "{found} for {expected}");
        }
    }
}
