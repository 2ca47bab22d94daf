//! The loop: is anything left, what explains it best, does it hold on other recordings.

use crate::fits::fit::Fit;
use crate::fits::self_consistency::SelfConsistency;
use crate::null_model::signature::Signature;
use crate::search::round::{EliminationReason, Round, Undecided};
use crate::search::state::{Search, TestedFit};
use crate::search::tournament::entrants;
use crate::sensors::deadline::in_time;
use crate::thresholds::{
    COMPLETE_REMAINDER, MAX_EFFECTS, MAX_REJECTED, MAX_STATIC_EFFECTS, MIN_EXPLAINED_EXCESS,
    MIN_HELD_OUT_GAIN, REMAINDER_SHARE,
};
use nalgebra::DVector;
use spikelane::error::Result;
use spikelane_calibrate::ProgressCallback;

/// Shares of a diagnosis that are done where a search begins, and where it looks at its names again.
const BEGIN: f64 = 0.8;
const AGAIN: f64 = 0.9;

/// The step before any effect is added.
const NOTHING_ADDED: &str = "nothing added";

/// The search's end.
pub(crate) struct SearchResult {
    pub fit: Fit,
    pub rounds: Vec<Round>,
    /// Gap on both sets after each accepted effect, the first without any, and what was done before.
    pub train: Vec<f64>,
    pub heldout: Vec<f64>,
    pub steps: Vec<String>,
    pub own: SelfConsistency,
    /// What the held-out set is off.
    pub off: DVector<f64>,
    /// Whether anything is left above its limit.
    pub left: bool,
    /// Questions that the time limit left open.
    pub undecided: Vec<Undecided>,
}

impl Search<'_> {
    /// `next`, which has one effect more, where the held-out set bears it out.
    fn accepted(&self, before: &TestedFit, mut next: Fit) -> Result<Option<TestedFit>> {
        let evidence = Evidence {
            before: before.deviance(),
            after: self.deviance(&next)?,
            whole: before.fit.length_of(&(&self.held_out_data - &self.fitter.reference.mean)),
            others: before.fit.effects.len(),
        };
        // What was fitted is also made likelier by a model that strays more, of which it need not come nearer.
        if evidence.beyond() <= 0.0 || !(self.recordings.held_out.is_any() || next.misfit < before.fit.misfit)
        {
            return Ok(None);
        }
        let own = self.fitter.converged(&mut next)?;
        let next = self.judged(next, own)?;
        Ok(evidence.suffices(next.left_fitted).then_some(next))
    }

    /// Effects whose signatures resemble what a model leaves, the most similar first.
    fn similar_effects(&self, at: &TestedFit, signatures: &[&Signature]) -> Vec<&'static str> {
        let off = &self.fitter.data - &at.fit.mean;
        let similar = entrants(&at.fit, &at.own.metric, &off, signatures);
        similar.into_iter().map(|(_, signature)| signature.candidate.effect.name).collect()
    }

    /// The base model and what the sets have beyond it, if the time ends before the null model is complete.
    pub(crate) fn unfinished(&self, undecided: Undecided) -> Result<SearchResult> {
        Ok(self.ended(self.base()?, vec![undecided]))
    }

    /// The search's end if nothing is beyond the limits of the base model, and `None` if something is.
    pub(crate) fn agreement(&self) -> Result<Option<SearchResult>> {
        if self.base_alarm() {
            return Ok(None);
        }
        Ok(Some(self.ended(self.base()?, Vec::new())))
    }

    /// The end of a search that adds nothing.
    fn ended(&self, at: TestedFit, undecided: Vec<Undecided>) -> SearchResult {
        let [fitted, held_out] = self.gaps(&at);
        let TestedFit { fit, own, off, left, .. } = at;
        SearchResult {
            fit,
            rounds: Vec::new(),
            train: vec![fitted],
            heldout: vec![held_out],
            steps: vec![NOTHING_ADDED.to_owned()],
            own,
            off,
            left,
            undecided,
        }
    }
}

/// What the held-out set says of a further effect, or of another value of a number.
pub(super) struct Evidence {
    /// Its deviance without the effect and with it.
    pub before: f64,
    pub after: f64,
    /// Its squared distance from the base model.
    pub whole: f64,
    /// Effects and numbers that are there already.
    pub others: usize,
}

impl Evidence {
    /// By how much the deviance falls further than by chance and by what any name takes.
    pub(super) fn beyond(&self) -> f64 {
        let share = 0.02 * self.before.clamp(0.0, 1e4) / (1.0 + self.others as f64);
        self.before - self.after - MIN_HELD_OUT_GAIN - share
    }

    /// Whether that is more than a remainder of what is there already; `left` tells whether anything is left of the fitted set. The
    /// other one may show more: `supply_droop` beside `adaptation` took its deviance from 5,741 to 1,152, left nothing of the fitted
    /// set, and one statistic at 6.5 deviations there.
    fn suffices(&self, left: bool) -> bool {
        self.beyond() > REMAINDER_SHARE * self.whole || self.after < COMPLETE_REMAINDER * self.before || !left
    }
}

impl Search<'_> {
    /// Adds effects as long as something is left and held-out recordings confirm them, then eliminates unnecessary effects.
    pub(crate) fn add_effects(&self, progress: ProgressCallback<'_>) -> Result<SearchResult> {
        let mut at = self.base()?;
        let (mut train, mut heldout, mut steps) = (Vec::new(), Vec::new(), Vec::new());
        let mut gap = |step: String, at: &TestedFit| {
            let [fitted, held_out] = self.gaps(at);
            train.push(fitted);
            heldout.push(held_out);
            steps.push(step);
        };
        gap(NOTHING_ADDED.to_owned(), &at);
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
            gap(format!("with {}", round.winner), &next);
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
                // What is there is something else; more names would be more likenesses.
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
                gap("after removal and swaps".to_owned(), &at);
            }
        }
        let TestedFit { fit, own, off, left, .. } = at;
        Ok(SearchResult { fit, rounds, train, heldout, steps, own, off, left, undecided })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_remainder_is_asked_of_a_name_that_leaves_much() {
        // Adaptation and noise of the comparator, adaptation and what takes a part, a clamp and a dark tail.
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
