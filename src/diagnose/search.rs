//! The loop: is anything left, what explains it best, does it hold on other recordings.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::fit::Fit;
use super::metric::{Metric, Noise};
use super::model::LAMP;
use super::nameable::reach;
use super::reference::{Progress, Reference, Signature, gamma_limit};
use crate::draws::pattern::Pattern;
use crate::draws::{Seeds, Stream};
use crate::error::Result;

/// Most effects that are added.
const ROUNDS: usize = 4;

/// Furthest that a signature is stretched: beyond, another one of the same effect is nearer.
const FURTHEST: f64 = 8.0;

/// Candidates of a tournament.
const TOURNAMENT: usize = 3;

/// Simulations of a mean: in the tournament, in its last comparison, and of the final model.
const FEW: usize = 3;
const SOME: usize = 8;
const MANY: usize = 30;

/// A candidate that was fitted beside the winner.
#[derive(Clone, Debug)]
pub(super) struct Entrant {
    pub name: &'static str,
    pub misfit: f64,
    /// Whether its lead or lag is within noise.
    pub tied: bool,
}

/// One round of the loop.
#[derive(Clone, Debug)]
pub(super) struct Round {
    pub winner: &'static str,
    pub entrants: Vec<Entrant>,
    pub accepted: bool,
    /// Share of the excess that the winner's signature explains.
    pub share: f64,
}

/// What simulations of the fitted model itself look like.
pub(super) struct Own {
    pub metric: Metric,
    /// Limit and median of the total misfit in the first round's metric.
    pub floor: f64,
    pub floor_sd: f64,
    pub misfit_limit: f64,
    pub deviation_limit: f64,
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

pub(super) fn search(
    reference: &Reference,
    signatures: &[Signature],
    data: &DVector<f64>,
    other: &DVector<f64>,
    progress: Progress<'_>,
) -> Result<Found> {
    let mut fit = Fit::base(reference, data);
    let gap = |mean: &DVector<f64>, set: &DVector<f64>| reference.metric.square(&(set - mean));
    let (mut train, mut heldout) = (vec![fit.misfit], vec![gap(&fit.mean, other)]);
    let mut own = reference.own_of_base();
    let mut left = reference.alarm(data, signatures);
    let mut rounds = Vec::new();
    while left && rounds.len() < ROUNDS {
        progress("tournament", rounds.len() as f64 / ROUNDS as f64);
        let Some((next, round)) = reference.tournament(&fit, &own, signatures, data)? else { break };
        let next = reference.refine(next, data, 2, SOME)?;
        let (before, after) = (*heldout.last().unwrap_or(&0.0), gap(&next.mean, other));
        let better = before - after > 9.0 + 0.02 * before.min(1e4) / (1.0 + fit.effects.len() as f64);
        rounds.push(Round { accepted: better, ..round });
        if !better {
            break;
        }
        fit = next;
        own = reference.own(&mut fit, data)?;
        train.push(gap(&own.mean, data));
        heldout.push(gap(&own.mean, other));
        left = [data, other].iter().any(|set| own.alarm(&(*set - &own.mean)));
    }
    if fit.effects.len() > 1 {
        reference.eliminate(&mut fit, &mut own, &mut rounds, data)?;
        left = [data, other].iter().any(|set| own.alarm(&(*set - &own.mean)));
    }
    Ok(Found { fit, rounds, train, heldout, own, left })
}

impl Own {
    pub fn alarm(&self, off: &DVector<f64>) -> bool {
        let largest = self.metric.scores(off).into_iter().fold(0.0_f64, |m, z| m.max(z.abs()));
        self.metric.square(off) > self.misfit_limit || largest > self.deviation_limit
    }
}

impl Reference {
    /// Whether anything about `data` is beyond what clean sensors show.
    pub(super) fn alarm(&self, data: &DVector<f64>, signatures: &[Signature]) -> bool {
        let off = data - &self.mean;
        let [misfit, deviation, score] = self.strays_by(&self.metric, &off, signatures);
        misfit > self.limits.misfit || deviation > self.limits.deviation || score > self.limits.score
    }

    fn own_of_base(&self) -> Own {
        let lengths: Vec<f64> = self.baseline.iter().map(|b| self.metric.square(&(b - &self.mean))).collect();
        let (floor, floor_sd) = centre(&lengths);
        Own {
            metric: self.metric.clone(),
            floor,
            floor_sd,
            misfit_limit: self.limits.misfit,
            deviation_limit: self.limits.deviation,
            mean: self.mean.clone(),
        }
    }

    /// The best candidate for what is left, fitted together with everything accepted before.
    fn tournament(
        &self,
        fit: &Fit,
        own: &Own,
        signatures: &[Signature],
        data: &DVector<f64>,
    ) -> Result<Option<(Fit, Round)>> {
        let off = data - &own.mean;
        let excess = own.metric.square(&off) - own.floor;
        let mut ranked: Vec<(f64, f64, &Signature)> = signatures
            .iter()
            .filter(|s| fit.effects.iter().all(|e| e.0 != s.candidate.name))
            .map(|s| promise(&own.metric, &off, s))
            .collect();
        ranked.sort_by(|a, b| b.0.total_cmp(&a.0));
        let Some(best) = ranked.first().map(|r| r.0) else { return Ok(None) };
        if best < self.limits.score.powi(2) {
            return Ok(None);
        }
        let mut entrants: Vec<(f64, &Signature)> = Vec::new();
        for (gain, scale, signature) in &ranked {
            let known = entrants.iter().any(|e| e.1.candidate.name == signature.candidate.name);
            if *gain > 0.55 * best && !known && entrants.len() < TOURNAMENT {
                entrants.push((*scale, *signature));
            }
        }
        let enter =
            |(scale, s): &(f64, &Signature)| self.refine(fit.with(&s.candidate, *scale), data, 3, FEW);
        let mut fits = entrants.par_iter().map(enter).collect::<Result<Vec<_>>>()?;
        let cost = |f: &Fit| f.misfit + 2.0 * f.u.len() as f64;
        fits.sort_by(|a, b| cost(a).total_cmp(&cost(b)));
        // Near the front, once more and with less noise.
        let front = cost(&fits[0]) + 0.03 * (fit.misfit - cost(&fits[0])).max(0.0) + 40.0;
        let close: Vec<Fit> = fits.iter().filter(|f| cost(f) < front).take(3).cloned().collect();
        if close.len() > 1 {
            let again = close.into_par_iter().map(|f| self.refine(f, data, 2, SOME));
            fits = again.collect::<Result<Vec<_>>>()?;
            fits.sort_by(|a, b| cost(a).total_cmp(&cost(b)));
        }
        let best = &fits[0];
        let name = |f: &Fit| f.effects.last().map_or("", |e| e.0);
        let tied = |f: &Fit| {
            // Twice the distance of two models is the deviation of the difference of their misfits.
            let apart = self.metric.square(&(&f.mean - &best.mean)).sqrt();
            cost(f) - cost(best) < 4.0 + 2.0 * apart.min(12.0)
        };
        let entrant = |f: &Fit| Entrant { name: name(f), misfit: f.misfit, tied: tied(f) };
        let share = ((fit.misfit - best.misfit) / excess.max(1.0)).clamp(0.0, 1.0);
        let entrants = fits.iter().map(entrant).collect();
        let round = Round { winner: name(best), entrants, accepted: false, share };
        Ok(Some((fits.swap_remove(0), round)))
    }

    /// The fitted model judged by itself: its numbers redrawn from their posterior.
    pub(super) fn own(&self, fit: &mut Fit, data: &DVector<f64>) -> Result<Own> {
        self.evaluate(fit, data, MANY / 2)?;
        self.derive(fit, SOME)?;
        let lamps = self.model.lamps.len();
        let rough = Metric::new(&self.noise, fit.directions(self));
        let n = fit.u.len();
        let root = rough.covariance().cholesky().map_or_else(|| DMatrix::zeros(n, n), |c| c.l());
        let one = |i: usize| -> Result<DVector<f64>> {
            let seed = self.seed + 50_000 + i as u64;
            let mut normals =
                Pattern::new(Seeds { camera: seed, shot: 0, sequence: 0 }, Stream::named("own")).normals();
            let mut draw = |count: usize| DVector::from_fn(count, |_, _| normals.next().unwrap_or(0.0));
            let moved = &root * draw(n);
            let off = draw(lamps) * LAMP;
            let u: Vec<f64> = (0..n).map(|j| fit.model.knobs[j].clamped(fit.u[j] + moved[j])).collect();
            let sample = fit.model.sample(&u, off.as_slice(), self.setup.scenes.len())?;
            Ok(DVector::from_vec(self.setup.values(&sample, seed)?))
        };
        let each: Vec<DVector<f64>> = (0..MANY).into_par_iter().map(one).collect::<Result<_>>()?;
        let mean = fit.mean.clone();
        let noise = self.rescaled(&each, &mean)?;
        let metric = Metric::new(&noise, fit.directions(self));
        let squares: Vec<f64> = each.iter().map(|s| metric.square(&(s - &mean))).collect();
        let largest =
            |s: &DVector<f64>| metric.scores(&(s - &mean)).into_iter().fold(0.0_f64, |m, z| m.max(z.abs()));
        let mut deviations: Vec<f64> = each.iter().map(largest).collect();
        deviations.sort_by(f64::total_cmp);
        let lengths: Vec<f64> = each.iter().map(|s| self.metric.square(&(s - &mean))).collect();
        let (floor, floor_sd) = centre(&lengths);
        Ok(Own {
            floor,
            floor_sd,
            // The mean itself is known to a part of the noise only.
            misfit_limit: (1.1 * gamma_limit(&squares)).max(self.limits.misfit),
            deviation_limit: (1.15 * deviations[MANY - 1]).max(self.limits.deviation),
            metric,
            mean,
        })
    }

    /// The null's noise with each statistic's variance as the fitted model has it.
    fn rescaled(&self, each: &[DVector<f64>], mean: &DVector<f64>) -> Result<Noise> {
        let n = each.len() as f64;
        let factor = |j: usize| {
            let own = each.iter().map(|s| (s[j] - mean[j]).powi(2)).sum::<f64>();
            let null = self.noise.covariance[(j, j)];
            ((own + 10.0 * null) / (n + 10.0) / null).max(1.0).sqrt()
        };
        let factors: Vec<f64> = (0..mean.len()).map(factor).collect();
        self.noise.scaled(&factors)
    }

    /// Drops effects whose amplitude is within three deviations of none.
    fn eliminate(
        &self,
        fit: &mut Fit,
        own: &mut Own,
        rounds: &mut Vec<Round>,
        data: &DVector<f64>,
    ) -> Result<()> {
        let covariance = own.metric.covariance();
        let weak = (0..fit.effects.len()).find(|e| {
            let j = fit.knobs_of(*e).start;
            fit.u[j].abs() < 3.0 * covariance[(j, j)].sqrt()
        });
        let Some(weak) = weak else { return Ok(()) };
        let name = fit.effects[weak].0;
        let mut without = self.refine(fit.without(weak), data, 2, SOME)?;
        let next = self.own(&mut without, data)?;
        if without.misfit < fit.misfit + 12.0 {
            rounds.retain(|r| r.winner != name);
            *fit = without;
            *own = next;
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

fn centre(values: &[f64]) -> (f64, f64) {
    let median = crate::measure::median(&mut values.to_vec());
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    (median, (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n).sqrt())
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
