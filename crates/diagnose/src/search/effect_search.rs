//! The search: adds effects as long as a significant discrepancy remains and held-out recordings confirm them.

use crate::fits::fit::Fit;
use crate::null_model::signature::Signature;
use crate::search::round::{EliminationReason, Round, Undecided};
use crate::search::state::{Search, TestedFit};
use crate::search::tournament::entrants;
use crate::sensors::deadline::in_time;
use crate::thresholds::{
    COMPLETE_REMAINDER, MAX_EFFECTS, MAX_REJECTED, MAX_STATIC_EFFECTS, MIN_EXPLAINED_EXCESS,
    MIN_HELD_OUT_GAIN, REMAINDER_SHARE,
};
use spikelane::error::Result;
use spikelane_calibrate::ProgressCallback;

/// Progress at the start of a search and at the start of backward elimination, as shares of the diagnosis.
const BEGIN: f64 = 0.8;
const AGAIN: f64 = 0.9;

/// Label of the step before any effect is added.
const NOTHING_ADDED: &str = "nothing added";

/// The result of a search.
pub(crate) struct SearchResult {
    /// The final model.
    pub last: TestedFit,
    pub rounds: Vec<Round>,
    /// The steps from the base model to the final model. The first step has no added effect.
    pub steps: Vec<SearchStep>,
    /// Questions that the time limit left open.
    pub undecided: Vec<Undecided>,
}

impl SearchResult {
    /// Returns the discrepancy after each step. `set` is 0 for the fitted set, and 1 for the held-out set.
    pub(crate) fn discrepancies(&self, set: usize) -> Vec<f64> {
        self.steps.iter().map(|step| step.discrepancies[set]).collect()
    }
}

/// One step of a search, with the discrepancies of the fitted set and of the held-out set after the step.
pub(crate) struct SearchStep {
    pub label: String,
    pub discrepancies: [f64; 2],
}

impl Search<'_> {
    /// Tests the model `next`, which has one effect more than `before`. Returns it if the held-out set confirms the
    /// effect.
    fn accepted(&self, before: &TestedFit, mut next: Fit) -> Result<Option<TestedFit>> {
        let evidence = Evidence {
            before: before.deviance(),
            after: self.deviance(&next)?,
            whole: before.fit.length_of(&(&self.held_out_data - &self.fitter.reference.mean)),
            others: before.fit.effects.len(),
        };
        // A model with more noise can make the fitted set more likely without reducing the squared distance. If
        // nothing is held out, the distance must also decrease.
        if evidence.beyond() <= 0.0 || !(self.recordings.held_out.is_any() || next.misfit < before.fit.misfit)
        {
            return Ok(None);
        }
        let own = self.fitter.converged(&mut next)?;
        let next = self.judged(next, own)?;
        Ok(evidence.suffices(next.left_fitted).then_some(next))
    }

    /// Returns the effects whose signatures resemble the deviations that remain, the most similar first.
    fn similar_effects(&self, at: &TestedFit, signatures: &[&Signature]) -> Vec<&'static str> {
        let off = &self.fitter.data - &at.fit.mean;
        let similar = entrants(&at.fit, &at.own.metric, &off, signatures);
        similar.into_iter().map(|(_, signature)| signature.candidate.effect.name).collect()
    }

    /// Returns the result if the time limit is reached before the null model is complete: the base model, and the
    /// open question `undecided`.
    pub(crate) fn unfinished(&self, undecided: Undecided) -> Result<SearchResult> {
        Ok(self.ended(self.base()?, vec![undecided]))
    }

    /// Returns the result without any effect if the sets are within the limits of the base model. Otherwise returns
    /// `None`.
    pub(crate) fn agreement(&self) -> Result<Option<SearchResult>> {
        if self.base_alarm() {
            return Ok(None);
        }
        Ok(Some(self.ended(self.base()?, Vec::new())))
    }

    /// Returns the result of a search that ends without any effect.
    fn ended(&self, last: TestedFit, undecided: Vec<Undecided>) -> SearchResult {
        let steps = vec![self.search_step(NOTHING_ADDED, &last)];
        SearchResult { last, rounds: Vec::new(), steps, undecided }
    }

    /// Returns a step with the name `label`. It ends at the model `at`.
    pub(crate) fn search_step(&self, label: &str, at: &TestedFit) -> SearchStep {
        SearchStep { label: label.to_owned(), discrepancies: self.gaps(at) }
    }
}

/// The evidence of the held-out set for a further effect, or for another value of a parameter.
pub(super) struct Evidence {
    /// Deviance of the held-out set without the effect, and with it.
    pub before: f64,
    pub after: f64,
    /// Squared distance between the held-out set and the base model.
    pub whole: f64,
    /// Number of the other added effects and free parameters of the model.
    pub others: usize,
}

impl Evidence {
    /// Returns the decrease of the deviance that is evidence for the effect. The decrease by chance is subtracted,
    /// and a part of the deviance that any additional effect explains.
    pub(super) fn beyond(&self) -> f64 {
        let share = 0.02 * self.before.clamp(0.0, 1e4) / (1.0 + self.others as f64);
        self.before - self.after - MIN_HELD_OUT_GAIN - share
    }

    /// Returns whether the evidence is sufficient. The decrease must be too large for an error of the other
    /// effects, or little may remain with the effect. `left` states whether the fitted set still exceeds a limit
    /// with the effect. The held-out set does not count for this, because it may exceed a limit although the effect
    /// is right.
    ///
    /// Measured: `supply_droop` beside `adaptation` reduced the held-out deviance from 5,741 to 1,152. No limit was
    /// exceeded in the fitted set, but one statistic of the held-out set deviated by 6.5 standard deviations.
    fn suffices(&self, left: bool) -> bool {
        self.beyond() > REMAINDER_SHARE * self.whole || self.after < COMPLETE_REMAINDER * self.before || !left
    }
}

impl Search<'_> {
    /// Adds effects as long as a significant discrepancy remains and the held-out recordings confirm each effect.
    /// Then eliminates unnecessary effects.
    pub(crate) fn add_effects(&self, progress: ProgressCallback<'_>) -> Result<SearchResult> {
        let mut at = self.base()?;
        let mut steps = vec![self.search_step(NOTHING_ADDED, &at)];
        let mut rounds: Vec<Round> = Vec::new();
        let mut turned_down: Vec<&'static str> = Vec::new();
        let mut undecided = Vec::new();
        let untested = self.fitter.reference.setup.only_still() && !self.recordings.held_out.is_any();
        let most = if untested { MAX_STATIC_EFFECTS } else { MAX_EFFECTS };
        while at.left && at.fit.effects.len() < most && turned_down.len() < MAX_REJECTED {
            let rounds_begun = at.fit.effects.len() + turned_down.len();
            let tried = BEGIN + (AGAIN - BEGIN) * (rounds_begun as f64 / MAX_EFFECTS as f64).min(1.0);
            progress("tournament", tried);
            let open: Vec<&Signature> =
                self.signatures.iter().filter(|s| !turned_down.contains(&s.candidate.effect.name)).collect();
            let Some(round) = in_time(self.tournament(&at.fit, &at.own, &open))? else {
                undecided.push(Undecided::FurtherEffects(self.similar_effects(&at, &open)));
                break;
            };
            let Some((next, round)) = round else { break };
            progress(round.winner, tried);
            let Some(next) = in_time(self.accepted(&at, next))? else {
                undecided.push(Undecided::FurtherEffects(self.similar_effects(&at, &open)));
                break;
            };
            let Some(next) = next else {
                turned_down.push(round.winner);
                rounds.push(round);
                continue;
            };
            steps.push(self.search_step(&format!("with {}", round.winner), &next));
            let share = round.share;
            let step = self.step(&at, &next);
            rounds.push(Round {
                fate: EliminationReason::Retained,
                evidence: step.words(),
                step: Some(step),
                ..round
            });
            at = next;
            if share < MIN_EXPLAINED_EXCESS {
                // The winner explains too little, so the remaining discrepancy has another cause. Further effects
                // would only resemble it.
                break;
            }
        }
        if at.fit.effects.len() > 1 {
            let kept = at.fit.effects.clone();
            progress("looking again", AGAIN);
            let (fitted, fitted_rounds) = (at.clone(), rounds.clone());
            if in_time(self.eliminate_backward(&mut at, &mut rounds))?.is_none() {
                (at, rounds) = (fitted, fitted_rounds);
                undecided.push(Undecided::NecessityOfEffects);
            }
            if at.fit.effects != kept {
                steps.push(self.search_step("after removal and swaps", &at));
            }
        }
        Ok(SearchResult { last: at, rounds, steps, undecided })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_remainder_is_asked_of_a_name_that_leaves_much() {
        // Three models: adaptation with comparator noise, adaptation with an effect that describes only a part, and
        // a clamp with a dark tail.
        let beside = |whole, before, after| Evidence { before, after, whole, others: 1 };
        assert!(beside(1.33e7, 3637.0, 278.0).suffices(true), "a thirteenth is left");
        assert!(!beside(1.33e7, 3637.0, 804.0).suffices(true), "a quarter is left");
        assert!(beside(1.33e7, 629.0, 380.0).suffices(false), "nothing is left beyond the noise");
        assert!(beside(1.33e7, 9000.0, 4000.0).suffices(true), "more than the remainder");
    }

    #[test]
    fn chance_is_no_evidence() {
        let alone = |before, after| Evidence { before, after, whole: 0.0, others: 0 };
        assert!(alone(200.0, 188.0).beyond() <= 0.0);
        assert!(alone(200.0, 185.0).beyond() > 0.0);
    }
}
