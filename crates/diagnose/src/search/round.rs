//! The rounds of a search, and the questions that a time limit leaves open.

use nalgebra::DVector;
use serde::Serialize;

/// What happened to an effect that won a round.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum EliminationReason {
    /// The effect is part of the final model.
    Retained,
    /// The model with the effect did not agree better with recordings that were not fitted.
    RejectedByHoldout,
    /// The effect was added, but after later additions the data did not require it.
    Eliminated,
}

/// A candidate that was compared with the winner of a round.
#[derive(Clone, Debug)]
pub(crate) struct Entrant {
    pub name: &'static str,
    pub misfit: f64,
    /// Whether the candidate is as likely as the winner within the noise.
    pub tied: bool,
    /// Distance between the fitted models of this candidate and of the winner. The unit is the standard deviation of
    /// the statistics of one recording set.
    pub apart: f64,
    /// Mean of the fitted model with the candidate.
    pub mean: DVector<f64>,
}

/// Discrepancies of the fitted set and of the held-out set before and after a step of the search. A discrepancy is
/// a squared distance, without the directions that calibration fits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Step {
    pub(crate) before: [f64; 2],
    pub(crate) after: [f64; 2],
}

impl Step {
    /// Describes the step with all four discrepancies. Studies record this text.
    pub(crate) fn words(&self) -> String {
        let [[train, heldout], [train_after, heldout_after]] = [self.before, self.after];
        format!(
            "the discrepancy goes from {train:.0} to {train_after:.0} ({heldout:.0} held out: {heldout_after:.0})"
        )
    }

    /// Describes the step as evidence for the effect. `floor` is the noise floor of the model.
    ///
    /// An effect that adds noise can make the recordings more likely without bringing the mean of the model closer
    /// to them. The discrepancy may then grow, and the text does not contain it.
    pub(crate) fn nearer(&self, floor: f64) -> String {
        let [from, to] = [self.before[1], self.after[1]].map(f64::round);
        // If nothing was held out, both elements describe the same recordings.
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

/// One round of a search: the candidates and the winner.
#[derive(Clone, Debug)]
pub(crate) struct Round {
    pub winner: &'static str,
    pub entrants: Vec<Entrant>,
    pub fate: EliminationReason,
    /// Share of the excess that the fit of the winner explains. The excess is the discrepancy above the noise
    /// floor.
    pub share: f64,
    /// Mean of the fitted model with the winner.
    pub mean: DVector<f64>,
    /// Whether the winner is weaker than the smallest strength at which the set can detect it.
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

    /// Adds the tied `rivals` before the other entrants. `rivals` are sorted by their scores.
    pub(crate) fn ties_with(&mut self, rivals: Vec<Entrant>) {
        for rival in rivals.into_iter().rev().filter(|r| r.tied) {
            self.entrants.retain(|e| e.name != rival.name);
            self.entrants.insert(0, rival);
        }
    }
}

/// Returns the round that the effect `name` won, if the effect is still in the model.
pub(crate) fn kept<'a>(rounds: &'a [Round], name: &str) -> Option<&'a Round> {
    rounds.iter().find(|r| r.is_kept() && r.winner == name)
}

/// Returns the round that the effect `name` won, if the effect is still in the model. The round can be changed.
pub(crate) fn kept_mut<'a>(rounds: &'a mut [Round], name: &str) -> Option<&'a mut Round> {
    rounds.iter_mut().find(|r| r.is_kept() && r.winner == name)
}

/// Returns up to two effects that are as likely as the winner within the noise.
pub(crate) fn tied(round: &Round) -> Vec<&Entrant> {
    round.entrants.iter().filter(|e| e.tied && e.name != round.winner).take(2).collect()
}

/// A question that the time limit left open.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Undecided {
    /// Whether the recordings agree with the model. The deviations resemble the listed effects.
    Agreement(Vec<&'static str>),
    /// Which further effects are missing in the final model. The remaining deviations resemble the listed effects.
    FurtherEffects(Vec<&'static str>),
    /// Whether each added effect is necessary in a model with the others.
    NecessityOfEffects,
    /// The values of the base parameters in the model with effects.
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
