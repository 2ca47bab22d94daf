//! One round of a search. It fits the candidates with the largest promise, and the most likely fit wins. The
//! promise of a candidate is the decrease of the squared distance that a linear fit predicts.

use crate::fits::fit::Fit;
use crate::fits::fitter::{Fitter, metric_allowing_events};
use crate::fits::scored_fit::ScoredFit;
use crate::fits::self_consistency::SelfConsistency;
use crate::light::offsets::likely_deviations;
use crate::null_model::metric::Metric;
use crate::null_model::signature::{Signature, reach};
use crate::search::round::{EliminationReason, Entrant, Round};
use crate::search::state::Search;
use crate::thresholds::{
    MAX_CANDIDATES, MAX_FINALISTS, MAX_SCORE_DEVIATION, MAX_SIGNATURE_SCALE, MAX_SIMULATION_COST,
    MIN_PROMISE, MIN_PROMISE_SHARE, MIN_SECOND_DRAW_SHARE, MOST_SIMULATIONS, STEPS_OF_FIRST_EFFECT,
    STEPS_OF_FURTHER_EFFECT,
};
use nalgebra::DVector;
use spikelane::error::Result;
use spikelane::unstable::threads;

impl Search<'_> {
    /// Returns the fit of the winner together with all accepted effects, and the round. Returns `None` if no
    /// candidate promises enough.
    pub(crate) fn tournament(
        &self,
        fit: &Fit,
        own: &SelfConsistency,
        signatures: &[&Signature],
    ) -> Result<Option<(Fit, Round)>> {
        let Fitter { reference, data } = &self.fitter;
        let starts = self.starts(fit, &own.metric, signatures)?;
        if starts.is_empty() {
            return Ok(None);
        }
        let [few, some] = fit.draws();
        let rounds = if fit.effects.is_empty() { STEPS_OF_FIRST_EFFECT } else { STEPS_OF_FURTHER_EFFECT };
        // Only the fits show which start is better. If the base parameters have absorbed a part of the candidate,
        // their present values have a lower cost at first.
        let enter = |(_, from): &(&str, Vec<Fit>)| {
            let refined = threads::try_map(from, |f| self.fitter.refined(f.clone(), rounds[0], few))?;
            Ok(refined.into_iter().min_by(cheaper))
        };
        let fits: Vec<Option<ScoredFit>> = threads::try_map(&starts, enter)?;
        let mut fits: Vec<ScoredFit> = fits.into_iter().flatten().collect();
        fits.sort_by(cheaper);
        // The best candidates are refined again, with more simulations and less noise.
        let front = fits[0].price + 0.15 * (fit.price() - fits[0].price).max(0.0) + MAX_SIMULATION_COST;
        let near = fits.iter().take(MAX_FINALISTS).take_while(|f| f.price < front).count();
        let far = fits.split_off(near);
        let again = threads::try_map(fits, |f| self.fitter.refined(f.fit, rounds[1], some))?;
        let mut fits = self.finish(again)?;
        let ScoredFit { fit: best, .. } = fits[0].clone();
        fits.extend(far);
        let entrants = fits.iter().map(|f| self.entrant(&fits[0], f)).collect();
        let before = metric_allowing_events(reference, &fit.events)?.square(&(data - &fit.mean));
        let after = metric_allowing_events(reference, &best.events)?.square(&(data - &best.mean));
        let share = ((before - after) / (before - own.allowed_floor).max(1.0)).clamp(0.0, 1.0);
        let round = Round {
            winner: last(&best),
            entrants,
            fate: EliminationReason::RejectedByHoldout,
            share,
            mean: best.mean.clone(),
            faint: false,
            evidence: String::new(),
            step: None,
        };
        Ok(Some((best, round)))
    }

    /// Sorts the best candidates. If the noise of the simulations could change their order, more simulations are
    /// made first.
    fn finish(&self, mut front: Vec<ScoredFit>) -> Result<Vec<ScoredFit>> {
        front.sort_by(cheaper);
        let unsure =
            |f: &ScoredFit| self.entrant(&front[0], f).tied && drawn(&front[0], f) > MAX_SCORE_DEVIATION;
        let mut open: Vec<bool> = front.iter().map(unsure).collect();
        open[0] = open[1..].contains(&true);
        let more = |(f, open): (ScoredFit, bool)| {
            if !open {
                return Ok(f);
            }
            let mut fit = f.fit;
            self.fitter.evaluate(&mut fit, MOST_SIMULATIONS)?;
            Ok(self.fitter.priced(fit))
        };
        let both: Vec<_> = front.into_iter().zip(open).collect();
        let mut front = threads::try_map(both, more)?;
        front.sort_by(cheaper);
        Ok(front)
    }

    /// Compares the fit `f` with the best fit. In both fits, the last effect is the new one.
    pub(crate) fn entrant(&self, best: &ScoredFit, f: &ScoredFit) -> Entrant {
        // The standard deviation of the difference of both costs is twice the distance between both models.
        let apart = best.apart(f, &self.fitter.reference.metric);
        let tied = f.price - best.price < 4.0 + 2.0 * apart.min(12.0) + drawn(best, f);
        Entrant { name: last(&f.fit), misfit: f.fit.misfit, tied, apart, mean: f.fit.mean.clone() }
    }

    /// Returns the candidates with the largest promise. Each has one or more starts, with the fitted or with the
    /// calibrated base parameters. The fitted base parameters may have absorbed what a candidate explains. The
    /// promise of this candidate is then too small.
    fn starts(
        &self,
        fit: &Fit,
        metric: &Metric,
        signatures: &[&Signature],
    ) -> Result<Vec<(&'static str, Vec<Fit>)>> {
        let of = |fit: &Fit| -> Result<Vec<(&'static str, Vec<Fit>)>> {
            let off = &self.fitter.data - &fit.mean;
            let start = |(scale, s): (f64, Signature)| {
                let plain = fit.with(&s.candidate, scale);
                // The found light has absorbed the change of the rates by the effect.
                let left = metric.rest(&(&off - &s.mean * scale));
                let slopes = &self.fitter.reference.lamp_slopes;
                let lamps = likely_deviations(&plain.model.lamps, slopes, &metric.noise, &left);
                let mut lit = plain.clone();
                lit.model.lit_by(&lamps);
                let is_other = lit.model.lamps != plain.model.lamps;
                (s.candidate.effect.name, if is_other { vec![plain, lit] } else { vec![plain] })
            };
            let entrants = self.entrants(fit, metric, &off, signatures)?;
            Ok(entrants.into_iter().map(start).collect())
        };
        let mut starts = of(fit)?;
        for s in signatures.iter().filter(|s| fit.lacks(s) && fit.located.demand(s.candidate.effect)) {
            if starts.iter().all(|start| start.0 != s.candidate.effect.name) {
                starts.push((s.candidate.effect.name, vec![fit.with(&s.candidate, 1.0)]));
            }
        }
        if fit.effects.is_empty() {
            return Ok(starts);
        }
        let mut calibrated = fit.with_calibrated_base();
        self.fitter.evaluate(&mut calibrated, fit.draws()[0])?;
        for (place, (name, fits)) in of(&calibrated)?.into_iter().enumerate() {
            match starts.iter_mut().find(|s| s.0 == name) {
                Some(start) => start.1.extend(fits),
                None if place < 2 => starts.push((name, fits)),
                None => {}
            }
        }
        Ok(starts)
    }
}

impl Search<'_> {
    /// Returns the candidates with the largest promise. Each effect appears once, with its best shape and
    /// amplitude. If the promises are similar, the signatures have two simulations each.
    pub(crate) fn entrants(
        &self,
        fit: &Fit,
        metric: &Metric,
        off: &DVector<f64>,
        signatures: &[&Signature],
    ) -> Result<Vec<(f64, Signature)>> {
        let mut ranked = ranked(fit, metric, off, signatures);
        let best = ranked.first().map_or(0.0, |r| r.0);
        let near = ranked.iter().take_while(|r| r.0 > MIN_SECOND_DRAW_SHARE * best).count();
        let far = ranked.split_off(near);
        let again = |(_, _, s): (f64, f64, &Signature)| self.fitter.reference.with_second_draw(s);
        let mut candidates = threads::try_map(ranked, again)?;
        candidates.extend(far.into_iter().map(|(_, _, s)| s.clone()));
        let candidates: Vec<&Signature> = candidates.iter().collect();
        Ok(entrants(fit, metric, off, &candidates).into_iter().map(|(scale, s)| (scale, s.clone())).collect())
    }
}

/// Returns the possible candidates with their promise and their scale, the largest promise first.
fn ranked<'a>(
    fit: &Fit,
    metric: &Metric,
    off: &DVector<f64>,
    signatures: &[&'a Signature],
) -> Vec<(f64, f64, &'a Signature)> {
    let possible: Vec<_> = signatures.iter().filter(|s| fit.lacks(s) && fit.allows(s)).collect();
    let mut ranked: Vec<(f64, f64, &Signature)> = threads::map(possible, |s| promise(metric, off, s));
    ranked.sort_by(|a, b| b.0.total_cmp(&a.0));
    ranked
}

/// Returns the candidates with the largest promise. Each effect appears once, with its best shape and the scale of
/// its amplitude.
pub(crate) fn entrants<'a>(
    fit: &Fit,
    metric: &Metric,
    off: &DVector<f64>,
    signatures: &[&'a Signature],
) -> Vec<(f64, &'a Signature)> {
    let ranked = ranked(fit, metric, off, signatures);
    let best = ranked.first().map_or(0.0, |r| r.0);
    let mut entrants: Vec<(f64, &Signature)> = Vec::new();
    if best < MIN_PROMISE {
        return entrants;
    }
    for (gain, scale, signature) in ranked {
        let known = entrants.iter().any(|e| e.1.candidate.effect.name == signature.candidate.effect.name);
        if gain > MIN_PROMISE_SHARE * best && !known && entrants.len() < MAX_CANDIDATES {
            entrants.push((scale, signature));
        }
    }
    entrants
}

pub(crate) fn cheaper(a: &ScoredFit, b: &ScoredFit) -> std::cmp::Ordering {
    a.price.total_cmp(&b.price)
}

/// Returns the standard deviation of the difference of two scores due to the draws of the simulations.
fn drawn(a: &ScoredFit, b: &ScoredFit) -> f64 {
    a.deviation.hypot(b.deviation)
}

/// Returns the name of the effect that was added last.
pub(crate) fn last(fit: &Fit) -> &'static str {
    fit.effects.last().map_or("", |e| e.0.name)
}

/// Returns the promise of a signature and the scale at which it is reached. The promise is the decrease of the
/// squared length of `off` at the best scale of the signature. The scale is limited to the range of the effect and
/// to [`MAX_SIGNATURE_SCALE`].
fn promise<'a>(metric: &Metric, off: &DVector<f64>, signature: &'a Signature) -> (f64, f64, &'a Signature) {
    let dual = metric.dual(&signature.mean);
    let (along, square) = (dual.dot(off), dual.dot(&signature.mean));
    if square <= 0.0 || along <= 0.0 {
        return (0.0, 0.0, signature);
    }
    let scale = (along / square).min(reach(signature)).min(MAX_SIGNATURE_SCALE);
    (2.0 * scale * along - scale * scale * square, scale, signature)
}
