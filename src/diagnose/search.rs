//! The loop: is anything left, what explains it best, does it hold on other recordings.

use nalgebra::DVector;

use super::fit::Fit;
use super::metric::Metric;
use super::own::Own;
use super::reference::{Progress, Reference, Signature};
use super::setup::Setup;
use super::tournament::{Round, SOME};
use crate::error::Result;

/// Most effects that are added.
const ROUNDS: usize = 4;

/// Most names that the held-out set may turn down.
const VETOES: usize = 2;

/// Times that an accepted model is fitted again with its own noise.
const REFITS: usize = 2;

/// Fall of the held-out deviance below which a name is not kept: three deviations of one number.
const BETTER: f64 = 9.0;

/// Share of the excess below which the best name explains too little for another one to be tried:
/// of three effects of equal strength the first explains a third.
const LIKENESS: f64 = 0.2;

/// Share of the first excess that a further effect must explain: an approximate signature of a strong
/// effect leaves that much. Three times as much kept a droop from being named beside strong row noise.
pub(super) const REMAINDER: f64 = 0.0003;

/// The search's end.
pub(super) struct Found {
    pub fit: Fit,
    pub rounds: Vec<Round>,
    /// Gap on both sets after each accepted effect, the first without any.
    pub train: Vec<f64>,
    pub heldout: Vec<f64>,
    pub own: Own,
    /// Whether anything is left above its limit.
    pub left: bool,
}

/// The set that judges: another take, or the second half of the first one, which the model must be
/// simulated up to.
pub(super) struct Judge<'a> {
    pub data: &'a DVector<f64>,
    /// The protocol, where it is not that of the fitted set.
    pub setup: Option<&'a Setup>,
    /// Whether it is other data than what was fitted.
    pub held_out: bool,
}

impl Judge<'_> {
    /// What `fit` promises of this set.
    fn mean(&self, reference: &Reference, fit: &Fit) -> Result<DVector<f64>> {
        match self.setup {
            Some(setup) => reference.mean_under(setup, &fit.model, &fit.u),
            None => Ok(fit.mean.clone()),
        }
    }

    pub fn off(&self, reference: &Reference, fit: &Fit) -> Result<DVector<f64>> {
        Ok(self.data - self.mean(reference, fit)?)
    }
}

pub(super) fn search(
    reference: &Reference,
    signatures: &[Signature],
    data: &DVector<f64>,
    judge: &Judge<'_>,
    progress: Progress<'_>,
) -> Result<Found> {
    let mut fit = Fit::base(reference, data);
    let mut off = judge.off(reference, &fit)?;
    let (mut train, mut heldout) = (vec![fit.misfit], vec![reference.metric.square(&off)]);
    let mut own = reference.own_of_base();
    let mut left = reference.alarm(&fit, &own, &(data - &own.mean), signatures);
    let mut rounds: Vec<Round> = Vec::new();
    let mut turned_down: Vec<&'static str> = Vec::new();
    let left_over = |fit: &Fit, own: &Own, off: &DVector<f64>| {
        reference.alarm(fit, own, &(data - &own.mean), signatures)
            || reference.alarm(fit, own, off, signatures)
    };
    while left && fit.effects.len() < ROUNDS && turned_down.len() < VETOES {
        progress("tournament", (fit.effects.len() + turned_down.len()) as f64 / ROUNDS as f64);
        let open: Vec<&Signature> =
            signatures.iter().filter(|s| !turned_down.contains(&s.candidate.name)).collect();
        let Some((next, round)) = reference.tournament(&fit, &own, &open, data)? else { break };
        progress(round.winner, (fit.effects.len() + turned_down.len()) as f64 / ROUNDS as f64);
        let after = judge.off(reference, &next)?;
        let (b, a) = (fit.deviance_of(&off), next.deviance_of(&after));
        let whole = fit.length_of(&(judge.data - &reference.mean));
        let worth = BETTER + 0.02 * b.clamp(0.0, 1e4) / (1.0 + fit.effects.len() as f64) + REMAINDER * whole;
        // What was fitted is also made likelier by a model that strays more, of which it need not come nearer.
        let accepted = b - a > worth && (judge.held_out || next.misfit < fit.misfit);
        if !accepted {
            turned_down.push(round.winner);
        }
        rounds.push(Round { accepted, ..round });
        if !accepted {
            continue;
        }
        fit = next;
        own = reference.converged(&mut fit, data)?;
        off = judge.off(reference, &fit)?;
        train.push(fit.misfit);
        heldout.push(reference.metric.square(&off));
        left = left_over(&fit, &own, &off);
        if rounds.last().is_some_and(|r| r.share < LIKENESS) {
            // What is there is something else; more names would be more likenesses.
            break;
        }
    }
    if fit.effects.len() > 1 {
        let kept = fit.effects.clone();
        reference.eliminate(&mut fit, &mut own, &mut rounds, data)?;
        progress("swaps", 0.9);
        reference.swap(&mut fit, &mut own, &mut rounds, signatures, data, judge)?;
        if fit.effects != kept {
            off = judge.off(reference, &fit)?;
            train.push(fit.misfit);
            heldout.push(reference.metric.square(&off));
        }
        left = left_over(&fit, &own, &off);
    }
    Ok(Found { fit, rounds, train, heldout, own, left })
}

impl Reference {
    /// Whether anything about what is `off` the mean of `fit` is beyond what its own sensors show.
    fn alarm(&self, fit: &Fit, own: &Own, off: &DVector<f64>, signatures: &[Signature]) -> bool {
        let open: Vec<&Signature> = signatures.iter().filter(|s| fit.lacks(s)).collect();
        let [misfit, deviation, score] = self.strays_by(&own.metric, off, &open);
        misfit > own.limits.misfit || deviation > own.limits.deviation || score > own.limits.score
    }

    /// The fitted model judged by itself, again as long as its own noise asks for other numbers.
    pub(super) fn converged(&self, fit: &mut Fit, data: &DVector<f64>) -> Result<Own> {
        let mut own = self.own(fit, data)?;
        for _ in 0..REFITS {
            let moved = own.metric.bounded(&(data - &own.mean), &fit.bounds());
            let base = self.model.knobs.len();
            let far = (base..fit.u.len()).any(|j| moved[j].abs() > own.deviations[j]);
            if !far {
                break;
            }
            let mut next = self.refine(fit.moved(&moved), data, 2, 2 * SOME)?;
            if next.cost > fit.cost {
                break;
            }
            own = self.own(&mut next, data)?;
            *fit = next;
        }
        Ok(own)
    }

    /// Total misfit, largest deviation, largest score.
    pub(super) fn strays_by(
        &self,
        metric: &Metric,
        off: &DVector<f64>,
        signatures: &[&Signature],
    ) -> [f64; 3] {
        let dual = metric.dual(off);
        let score = |s: &Signature| {
            let length = metric.square(&s.mean).sqrt();
            if length > 0.0 { (s.mean.dot(&dual) / length).abs() } else { 0.0 }
        };
        let largest = |m: f64, x: f64| m.max(x.abs());
        [
            off.dot(&dual),
            metric.scores(off).into_iter().fold(0.0, largest),
            signatures.iter().map(|s| score(s)).fold(0.0, largest),
        ]
    }
}
