//! What happened in the loop, round by round.

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
    /// Whether its lead or lag is within noise.
    pub tied: bool,
    /// Deviations by which a set tells its fitted model from the winner's.
    pub apart: f64,
    /// Its fitted mean.
    pub mean: DVector<f64>,
}

/// What a step from one model to another did to the fitted and to the held-out set: their squared distances, with what
/// calibration fits taken out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Step {
    pub(crate) before: [f64; 2],
    pub(crate) after: [f64; 2],
}

impl Step {
    /// The step as a study records it.
    pub(crate) fn words(&self) -> String {
        let [[train, heldout], [train_after, heldout_after]] = [self.before, self.after];
        format!(
            "the discrepancy goes from {train:.0} to {train_after:.0} ({heldout:.0} held out: {heldout_after:.0})"
        )
    }

    /// As far as it speaks for the name. A name whose sensors differ more among themselves makes recordings likelier without
    /// bringing the model nearer, and its squared distance may grow.
    pub(crate) fn nearer(&self, floor: f64) -> String {
        let [from, to] = [self.before[1], self.after[1]].map(f64::round);
        // Where nothing was held out, both are of the same recordings.
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

/// One round of the loop.
#[derive(Clone, Debug)]
pub(crate) struct Round {
    pub winner: &'static str,
    pub entrants: Vec<Entrant>,
    pub fate: EliminationReason,
    /// Share of the excess that the winner's signature explains.
    pub share: f64,
    /// The winner's fitted mean.
    pub mean: DVector<f64>,
    /// Whether the winner is weaker than what the set can name.
    pub faint: bool,
    /// What speaks for the winner, in words; nothing where it was turned down.
    pub evidence: String,
    /// The step of which that tells.
    pub step: Option<Step>,
}

impl Round {
    pub(crate) fn is_kept(&self) -> bool {
        self.fate == EliminationReason::Retained
    }

    /// Notes the names that are as likely, of `rivals` in the order of their prices.
    pub(crate) fn ties_with(&mut self, rivals: Vec<Entrant>) {
        for rival in rivals.into_iter().rev().filter(|r| r.tied) {
            self.entrants.retain(|e| e.name != rival.name);
            self.entrants.insert(0, rival);
        }
    }
}

/// The round that `name` was kept in.
pub(crate) fn kept<'a>(rounds: &'a [Round], name: &str) -> Option<&'a Round> {
    rounds.iter().find(|r| r.is_kept() && r.winner == name)
}

/// The same, to be changed.
pub(crate) fn kept_mut<'a>(rounds: &'a mut [Round], name: &str) -> Option<&'a mut Round> {
    rounds.iter_mut().find(|r| r.is_kept() && r.winner == name)
}

/// The names beside the winner that are as likely, two at most.
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
    /// The numbers of the base model beside the effects.
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
