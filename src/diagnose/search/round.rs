//! What happened in the loop, round by round.

use nalgebra::DVector;

use serde::Serialize;

/// What became of a name that won a round.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Fate {
    /// It is part of the model.
    Kept,
    /// Recordings that were not fitted did not come nearer.
    TurnedDown,
    /// Once later names were known, the data did without it.
    Dropped,
}

/// A candidate that was fitted beside the winner.
#[derive(Clone, Debug)]
pub(in crate::diagnose) struct Entrant {
    pub name: &'static str,
    pub misfit: f64,
    /// Whether its lead or lag is within noise.
    pub tied: bool,
    /// Deviations by which a set tells its fitted model from the winner's.
    pub apart: f64,
    /// Its fitted mean.
    pub mean: DVector<f64>,
}

/// One round of the loop.
#[derive(Clone, Debug)]
pub(in crate::diagnose) struct Round {
    pub winner: &'static str,
    pub entrants: Vec<Entrant>,
    pub fate: Fate,
    /// Share of the excess that the winner's signature explains.
    pub share: f64,
    /// The winner's fitted mean.
    pub mean: DVector<f64>,
    /// Whether the winner is weaker than what the set can name.
    pub faint: bool,
    /// What speaks for the winner, in words; nothing where it was turned down.
    pub evidence: String,
}

impl Round {
    pub(in crate::diagnose) fn is_kept(&self) -> bool {
        self.fate == Fate::Kept
    }

    /// Notes the names that are as likely, of `rivals` in the order of their prices.
    pub(in crate::diagnose) fn ties_with(&mut self, rivals: Vec<Entrant>) {
        for rival in rivals.into_iter().rev().filter(|r| r.tied) {
            self.entrants.retain(|e| e.name != rival.name);
            self.entrants.insert(0, rival);
        }
    }
}

/// The round that `name` was kept in.
pub(in crate::diagnose) fn kept<'a>(rounds: &'a [Round], name: &str) -> Option<&'a Round> {
    rounds.iter().find(|r| r.is_kept() && r.winner == name)
}

/// The same, to be changed.
pub(in crate::diagnose) fn kept_mut<'a>(rounds: &'a mut [Round], name: &str) -> Option<&'a mut Round> {
    rounds.iter_mut().find(|r| r.is_kept() && r.winner == name)
}

/// The names beside the winner that are as likely, two at most.
pub(in crate::diagnose) fn tied(round: &Round) -> Vec<&Entrant> {
    round.entrants.iter().filter(|e| e.tied && e.name != round.winner).take(2).collect()
}
