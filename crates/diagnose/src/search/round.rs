//! The rounds of a search, and questions that the time limit left open.

use nalgebra::DVector;
use serde::Serialize;

/// The outcome of an effect that won a round.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum EliminationReason {
    /// The effect is part of the model.
    Retained,
    /// The model with the effect did not approach recordings that were not fitted.
    RejectedByHoldout,
    /// The data did not require the effect any more after later effects were added.
    Eliminated,
}

/// A candidate that was fitted beside the winner.
#[derive(Clone, Debug)]
pub(crate) struct Entrant {
    pub name: &'static str,
    pub misfit: f64,
    /// Whether it is equally likely within the noise.
    pub tied: bool,
    /// Distance of its fitted model from that of the winner, in standard deviations of a set.
    pub apart: f64,
    /// Fitted mean.
    pub mean: DVector<f64>,
}

/// Squared distances of the fitted and of the held-out set before and after a step, without the directions that
/// calibration fits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Step {
    pub(crate) before: [f64; 2],
    pub(crate) after: [f64; 2],
}

impl Step {
    /// Returns the description that studies record.
    pub(crate) fn words(&self) -> String {
        let [[train, heldout], [train_after, heldout_after]] = [self.before, self.after];
        format!(
            "the discrepancy goes from {train:.0} to {train_after:.0} ({heldout:.0} held out: {heldout_after:.0})"
        )
    }

    /// Returns the description as evidence for the effect. An effect that adds noise makes recordings more likely
    /// without bringing the model nearer, so the squared distance may grow.
    pub(crate) fn nearer(&self, floor: f64) -> String {
        let [from, to] = [self.before[1], self.after[1]].map(f64::round);
        // If nothing was held out, both values are of the same recordings.
        let held_out = self.before[0] != self.before[1] || self.after[0] != self.after[1];
        if to < from {
            let gap = if held_out { "held-out discrepancy" } else { "discrepancy" };
            format!("the {gap} falls from {from:.0} to {to:.0}, with a noise floor of {floor:.0}")
        } else {
            let recordings = if held_out { "held-out recordings" } else { "recordings" };
            format!(
                "the {recordings} become more likely, because simulated sensors with the effect differ more from each other"
            )
        }
    }
}

/// One round of a search.
#[derive(Clone, Debug)]
pub(crate) struct Round {
    pub winner: &'static str,
    pub entrants: Vec<Entrant>,
    pub fate: EliminationReason,
    /// Share of the excess that the winner's signature explains.
    pub share: f64,
    /// The winner's fitted mean.
    pub mean: DVector<f64>,
    /// Whether the winner is weaker than the smallest detectable strength.
    pub faint: bool,
    /// Description of the evidence for the winner; empty if it was rejected.
    pub evidence: String,
    /// The step that `evidence` describes.
    pub step: Option<Step>,
}

impl Round {
    pub(crate) fn is_kept(&self) -> bool {
        self.fate == EliminationReason::Retained
    }

    /// Adds the tied `rivals`, which are in the order of their scores.
    pub(crate) fn ties_with(&mut self, rivals: Vec<Entrant>) {
        for rival in rivals.into_iter().rev().filter(|r| r.tied) {
            self.entrants.retain(|e| e.name != rival.name);
            self.entrants.insert(0, rival);
        }
    }
}

/// Returns the round in which `name` was retained.
pub(crate) fn kept<'a>(rounds: &'a [Round], name: &str) -> Option<&'a Round> {
    rounds.iter().find(|r| r.is_kept() && r.winner == name)
}

/// Returns the round in which `name` was retained, for changes.
pub(crate) fn kept_mut<'a>(rounds: &'a mut [Round], name: &str) -> Option<&'a mut Round> {
    rounds.iter_mut().find(|r| r.is_kept() && r.winner == name)
}

/// Returns up to two effects that are tied with the winner.
pub(crate) fn tied(round: &Round) -> Vec<&Entrant> {
    round.entrants.iter().filter(|e| e.tied && e.name != round.winner).take(2).collect()
}

/// A question that the time limit left open.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Undecided {
    /// Whether the recordings agree with the model. The deviations resemble these effects.
    Agreement(Vec<&'static str>),
    /// Whether these effects or others are missing in the final model.
    FurtherEffects(Vec<&'static str>),
    /// Whether each named effect is necessary beside the others.
    NecessityOfEffects,
    /// The base parameters beside the effects.
    BaseNumbers,
}

impl Undecided {
    /// Returns the question as a sentence.
    pub(crate) fn sentence(&self) -> String {
        match self {
            Self::Agreement(names) => {
                format!("whether the recordings agree with the model{}", resemblance(names))
            }
            Self::FurtherEffects(names) => {
                format!("which effects explain the remaining deviations{}", resemblance(names))
            }
            Self::NecessityOfEffects => {
                "whether each effect is necessary beside the others; their names are therefore tentative"
                    .to_owned()
            }
            Self::BaseNumbers => "the base parameters beside the effects".to_owned(),
        }
    }
}

fn resemblance(names: &[&str]) -> String {
    if names.is_empty() { String::new() } else { format!("; most similar: {}", names.join(", ")) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gap_that_grows_is_no_evidence() {
        let fell = Step { before: [900.0, 950.0], after: [210.0, 200.0] };
        assert_eq!(fell.words(), "the discrepancy goes from 900 to 210 (950 held out: 200)");
        assert_eq!(
            fell.nearer(190.0),
            "the held-out discrepancy falls from 950 to 200, with a noise floor of 190"
        );
        let alone = Step { before: [45.0, 45.0], after: [14.0, 14.0] };
        assert_eq!(alone.nearer(11.0), "the discrepancy falls from 45 to 14, with a noise floor of 11");
        let grew = Step { before: [2403.0, 2400.0], after: [4702.0, 4600.0] }.nearer(900.0);
        assert!(!grew.contains("4702") && !grew.contains("4600"), "{grew}");
    }

    #[test]
    fn open_questions_list_similar_effects() {
        assert_eq!(
            Undecided::Agreement(vec!["leak", "dead_time"]).sentence(),
            "whether the recordings agree with the model; most similar: leak, dead_time"
        );
        assert!(Undecided::FurtherEffects(Vec::new()).sentence().ends_with("remaining deviations"));
    }
}
