//! The loop: is anything left, what explains it best, does it hold on other recordings.

use nalgebra::DVector;
use rayon::prelude::*;

use super::fit::Fit;
use super::metric::Metric;
use super::nameable::reach;
use super::own::Own;
use super::reference::{Progress, Reference, Signature};
use super::setup::Setup;
use crate::error::Result;

/// Most effects that are added.
const ROUNDS: usize = 4;

/// Most names that the held-out set may turn down.
const VETOES: usize = 2;

/// Furthest that a signature is stretched: beyond, another one of the same effect is nearer.
const FURTHEST: f64 = 8.0;

/// Candidates of a tournament, and of its second leg.
const TOURNAMENT: usize = 5;
const FINAL: usize = 3;

/// Gauss-Newton rounds of its first leg: an effect with three numbers needs as many to come near.
const ROUNDS_OF_ENTRANTS: usize = 4;

/// Share of the best promise from which on a candidate is tried.
const PROMISING: f64 = 0.45;

/// What the best candidate must promise: four and a half deviations. That something is there is known by then, and the
/// held-out set judges what it is.
const ENTERING: f64 = 20.0;

/// Simulations of a mean: in the tournament, and in its second leg.
const FEW: usize = 2;
pub(super) const SOME: usize = 6;

/// Times that an accepted model is fitted again with its own noise.
const REFITS: usize = 2;

/// Fall of the held-out deviance below which a name is not kept: three deviations of one number.
const BETTER: f64 = 9.0;

/// Share of the excess below which the best name explains too little for another one to be tried:
/// of three effects of equal strength the first explains a third.
const LIKENESS: f64 = 0.2;

/// Share of the first excess that a further effect must explain: an approximate signature of a strong
/// effect leaves that much.
const REMAINDER: f64 = 0.001;

/// A candidate that was fitted beside the winner.
#[derive(Clone, Debug)]
pub(super) struct Entrant {
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
pub(super) struct Round {
    pub winner: &'static str,
    pub entrants: Vec<Entrant>,
    pub accepted: bool,
    /// Share of the excess that the winner's signature explains.
    pub share: f64,
    /// The winner's fitted mean.
    pub mean: DVector<f64>,
}

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
}

impl Judge<'_> {
    /// What `fit` promises of this set.
    fn mean(&self, reference: &Reference, fit: &Fit) -> Result<DVector<f64>> {
        match self.setup {
            Some(setup) => reference.mean_under(setup, &fit.model, &fit.u),
            None => Ok(fit.mean.clone()),
        }
    }

    fn off(&self, reference: &Reference, fit: &Fit) -> Result<DVector<f64>> {
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
    let mut left = reference.alarm(data, signatures);
    let mut rounds: Vec<Round> = Vec::new();
    let mut turned_down: Vec<&'static str> = Vec::new();
    while left && fit.effects.len() < ROUNDS && turned_down.len() < VETOES {
        progress("tournament", (fit.effects.len() + turned_down.len()) as f64 / ROUNDS as f64);
        let open: Vec<&Signature> =
            signatures.iter().filter(|s| !turned_down.contains(&s.candidate.name)).collect();
        let Some((next, round)) = reference.tournament(&fit, &own, &open, data)? else { break };
        progress(round.winner, (fit.effects.len() + turned_down.len()) as f64 / ROUNDS as f64);
        let after = judge.off(reference, &next)?;
        let (b, a) = (fit.deviance_of(&off), next.deviance_of(&after));
        let whole = fit.length_of(&(judge.data - &reference.mean));
        let accepted =
            b - a > BETTER + 0.02 * b.clamp(0.0, 1e4) / (1.0 + fit.effects.len() as f64) + REMAINDER * whole;
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
        left = own.alarm(&(data - &own.mean)) || own.alarm(&off);
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
        left = own.alarm(&(data - &own.mean)) || own.alarm(&off);
    }
    Ok(Found { fit, rounds, train, heldout, own, left })
}

impl Reference {
    /// Whether anything about `data` is beyond what clean sensors show.
    pub(super) fn alarm(&self, data: &DVector<f64>, signatures: &[Signature]) -> bool {
        let off = data - &self.mean;
        let [misfit, deviation, score] = self.strays_by(&self.metric, &off, signatures);
        misfit > self.limits.misfit || deviation > self.limits.deviation || score > self.limits.score
    }

    /// The best candidate for what is left, fitted together with everything accepted before.
    fn tournament(
        &self,
        fit: &Fit,
        own: &Own,
        signatures: &[&Signature],
        data: &DVector<f64>,
    ) -> Result<Option<(Fit, Round)>> {
        let starts = self.starts(fit, &own.metric, signatures, data)?;
        if starts.is_empty() {
            return Ok(None);
        }
        // Which start is nearer shows at the end: where base numbers took in what is added now, that place costs less at first.
        let enter = |(_, from): &(&str, Vec<Fit>)| {
            let refined = from.par_iter().map(|f| self.refine(f.clone(), data, ROUNDS_OF_ENTRANTS, FEW));
            let refined = refined.collect::<Result<Vec<_>>>()?;
            Ok(refined.into_iter().min_by(|a, b| a.price().total_cmp(&b.price())))
        };
        let fits = starts.par_iter().map(enter).collect::<Result<Vec<Option<Fit>>>>()?;
        let mut fits: Vec<Fit> = fits.into_iter().flatten().collect();
        fits.sort_by(|a, b| a.price().total_cmp(&b.price()));
        // Near the front, once more and with less noise.
        let front = fits[0].price() + 0.15 * (fit.price() - fits[0].price()).max(0.0) + 40.0;
        let near = fits.iter().take(FINAL).take_while(|f| f.price() < front).count();
        let far = fits.split_off(near);
        let again = fits.into_par_iter().map(|f| self.refine(f, data, 3, SOME));
        let mut fits = again.collect::<Result<Vec<_>>>()?;
        fits.sort_by(|a, b| a.price().total_cmp(&b.price()));
        let best = fits.swap_remove(0);
        fits.extend(far);
        let name = |f: &Fit| f.effects.last().map_or("", |e| e.0);
        let entrant = |f: &Fit| {
            // Twice the distance of two models is the deviation of the difference of their costs.
            let apart = self.metric.square(&(&f.mean - &best.mean)).sqrt();
            let tied = f.price() - best.price() < 4.0 + 2.0 * apart.min(12.0);
            Entrant { name: name(f), misfit: f.misfit, tied, apart, mean: f.mean.clone() }
        };
        let before = self.allowing(&fit.events)?.square(&(data - &fit.mean));
        let after = self.allowing(&best.events)?.square(&(data - &best.mean));
        let share = ((before - after) / (before - own.allowed_floor).max(1.0)).clamp(0.0, 1.0);
        let entrants = std::iter::once(&best).chain(&fits).map(entrant).collect();
        let round = Round { winner: name(&best), entrants, accepted: false, share, mean: best.mean.clone() };
        Ok(Some((best, round)))
    }

    /// The candidates that promise most, each with one or two places to begin: the base model's numbers as fitted before, or
    /// as calibrated. They may have moved to take in what a candidate explains, which then promises little from there.
    fn starts(
        &self,
        fit: &Fit,
        metric: &Metric,
        signatures: &[&Signature],
        data: &DVector<f64>,
    ) -> Result<Vec<(&'static str, Vec<Fit>)>> {
        let of = |fit: &Fit| -> Vec<(&'static str, Fit)> {
            let entrants = self.entrants(fit, metric, &(data - &fit.mean), signatures);
            entrants.into_iter().map(|(scale, s)| (s.candidate.name, fit.with(&s.candidate, scale))).collect()
        };
        let mut starts: Vec<(&'static str, Vec<Fit>)> =
            of(fit).into_iter().map(|(name, fit)| (name, vec![fit])).collect();
        if fit.effects.is_empty() {
            return Ok(starts);
        }
        let mut calibrated = fit.with_calibrated_base();
        self.evaluate(&mut calibrated, data, FEW)?;
        for (place, (name, fit)) in of(&calibrated).into_iter().enumerate() {
            match starts.iter_mut().find(|s| s.0 == name) {
                Some(start) => start.1.push(fit),
                None if place < 2 => starts.push((name, vec![fit])),
                None => {}
            }
        }
        Ok(starts)
    }

    /// The candidates that promise most, each name once with its best shape and scale.
    fn entrants<'a>(
        &self,
        fit: &Fit,
        metric: &Metric,
        off: &DVector<f64>,
        signatures: &[&'a Signature],
    ) -> Vec<(f64, &'a Signature)> {
        let mut ranked: Vec<(f64, f64, &Signature)> = signatures
            .par_iter()
            .filter(|s| fit.effects.iter().all(|e| e.0 != s.candidate.name))
            .map(|s| promise(metric, off, s))
            .collect();
        ranked.sort_by(|a, b| b.0.total_cmp(&a.0));
        let best = ranked.first().map_or(0.0, |r| r.0);
        let mut entrants: Vec<(f64, &Signature)> = Vec::new();
        if best < ENTERING {
            return entrants;
        }
        for (gain, scale, signature) in ranked {
            let known = entrants.iter().any(|e| e.1.candidate.name == signature.candidate.name);
            if gain > PROMISING * best && !known && entrants.len() < TOURNAMENT {
                entrants.push((scale, signature));
            }
        }
        entrants
    }

    /// The fitted model judged by itself, again as long as its own noise asks for other numbers.
    fn converged(&self, fit: &mut Fit, data: &DVector<f64>) -> Result<Own> {
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

    /// Drops effects whose amplitude is within three deviations of none.
    fn eliminate(
        &self,
        fit: &mut Fit,
        own: &mut Own,
        rounds: &mut Vec<Round>,
        data: &DVector<f64>,
    ) -> Result<()> {
        let strength = |fit: &Fit, own: &Own, e: usize| {
            let j = fit.knobs_of(e).start;
            fit.u[j].abs() / own.deviations[j]
        };
        for _ in 1..fit.effects.len() {
            let weakest =
                (0..fit.effects.len()).map(|e| (strength(fit, own, e), e)).min_by(|a, b| a.0.total_cmp(&b.0));
            let Some((deviations, weak)) = weakest.filter(|w| w.0 < 3.0) else { break };
            let name = fit.effects[weak].0;
            let mut without = self.refine(fit.without(weak), data, 2, SOME)?;
            // An interval that holds zero is no evidence, whatever the misfit gains.
            if deviations > 2.0 && without.cost > fit.cost + 12.0 {
                break;
            }
            *own = self.own(&mut without, data)?;
            rounds.retain(|r| r.winner != name);
            *fit = without;
        }
        Ok(())
    }

    /// Tries another name in the place of each accepted one, now that the others are known.
    fn swap(
        &self,
        fit: &mut Fit,
        own: &mut Own,
        rounds: &mut [Round],
        signatures: &[Signature],
        data: &DVector<f64>,
        judge: &Judge<'_>,
    ) -> Result<()> {
        let all: Vec<&Signature> = signatures.iter().collect();
        for place in 0..fit.effects.len() {
            let name = fit.effects[place].0;
            let without = self.refine(fit.without(place), data, 1, FEW)?;
            let others = self.entrants(&without, &own.metric, &(data - &without.mean), &all);
            let others: Vec<_> = others.into_iter().filter(|e| e.1.candidate.name != name).take(2).collect();
            let enter = |(scale, s): &(f64, &Signature)| {
                self.refine(without.with(&s.candidate, *scale), data, 3, FEW)
            };
            let fits = others.par_iter().map(enter).collect::<Result<Vec<_>>>()?;
            let Some(best) = fits.into_iter().min_by(|a, b| a.price().total_cmp(&b.price())) else {
                continue;
            };
            if best.price() > fit.price() {
                continue;
            }
            let mut best = self.refine(best, data, 2, SOME)?;
            let held = |f: &Fit| Ok::<f64, crate::error::Error>(f.deviance_of(&judge.off(self, f)?));
            if best.price() + 4.0 > fit.price() || held(&best)? > held(fit)? {
                continue;
            }
            *own = self.converged(&mut best, data)?;
            let new = best.effects.last().map_or(name, |e| e.0);
            if let Some(round) = rounds.iter_mut().find(|r| r.accepted && r.winner == name) {
                (round.winner, round.mean) = (new, best.mean.clone());
                round.entrants.clear();
            }
            *fit = best;
            break;
        }
        Ok(())
    }

    /// Total misfit, largest deviation, largest score.
    pub(super) fn strays_by(
        &self,
        metric: &Metric,
        off: &DVector<f64>,
        signatures: &[Signature],
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
            signatures.iter().map(score).fold(0.0, largest),
        ]
    }
}

/// How much of `off` a signature takes away at its best scale, within the effect's range.
fn promise<'a>(metric: &Metric, off: &DVector<f64>, signature: &'a Signature) -> (f64, f64, &'a Signature) {
    let dual = metric.dual(&signature.mean);
    let (along, square) = (dual.dot(off), dual.dot(&signature.mean));
    if square <= 0.0 || along <= 0.0 {
        return (0.0, 0.0, signature);
    }
    let scale = (along / square).min(reach(signature)).min(FURTHEST);
    (2.0 * scale * along - scale * scale * square, scale, signature)
}
