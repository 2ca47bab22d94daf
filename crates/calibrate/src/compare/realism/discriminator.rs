//! How well windows of two kinds are told apart.
//!
//! A logistic regression with a ridge on standardised values, fitted by Newton's steps on five sixths of the places and tried on the last,
//! in turns. The area under its curve is the chance that a real window scores higher than a simulated one: 0.5 says that nothing is told.

use nalgebra::{DMatrix, DVector};
use rand_pcg::Pcg64Mcg;
use rand_pcg::rand_core::{Rng, SeedableRng};
use serde::Serialize;

/// Parts of the places that are left out in turn.
const FOLDS: usize = 6;

/// The ridge, in units of one window.
const RIDGE: f64 = 1.0;

/// Newton's steps at most, and the change at which they end.
const STEPS: usize = 30;
const SETTLED: f64 = 1e-7;

/// Samples of places of which the interval is made.
const RESAMPLED: usize = 400;

/// A window as the discriminator sees it.
#[derive(Clone, Debug)]
pub(super) struct Seen {
    pub(super) place: usize,
    pub(super) real: bool,
    pub(super) values: Vec<f64>,
}

/// Chance that a window of one kind scores above one of the other, with an interval of 95 % over places.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Auc {
    /// The chance, 0.5 where nothing is told.
    pub value: f64,
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

/// Scores of windows by regressions that have not seen their places.
pub(super) fn scores(all: &[Seen]) -> Vec<f64> {
    let mut scores = vec![0.0; all.len()];
    for fold in 0..FOLDS {
        let learnt: Vec<&Seen> = all.iter().filter(|s| s.place % FOLDS != fold).collect();
        let model = Model::fit(&learnt);
        for (score, s) in scores.iter_mut().zip(all).filter(|(_, s)| s.place % FOLDS == fold) {
            *score = model.score(&s.values);
        }
    }
    scores
}

/// The area under the curve of `scores`, and its interval: places are drawn with replacement.
pub(super) fn auc(all: &[Seen], scores: &[f64]) -> Auc {
    let value = plain(all, scores);
    let places = 1 + all.iter().map(|s| s.place).max().unwrap_or(0);
    let mut random = Pcg64Mcg::seed_from_u64(1);
    let mut drawn: Vec<f64> = (0..RESAMPLED)
        .filter_map(|_| {
            let mut times = vec![0.0; places];
            (0..places).for_each(|_| times[(random.next_u64() % places as u64) as usize] += 1.0);
            let found = area(all.iter().zip(scores).map(|(s, x)| (s.real, *x, times[s.place])));
            Some(found).filter(|a| a.is_finite())
        })
        .collect();
    drawn.sort_by(f64::total_cmp);
    let at = |share: f64| drawn.get((share * drawn.len() as f64) as usize).copied().unwrap_or(value);
    Auc { value, low: at(0.025), high: at(0.975) }
}

/// The area alone.
pub(super) fn plain(all: &[Seen], scores: &[f64]) -> f64 {
    area(all.iter().zip(scores).map(|(s, x)| (s.real, *x, 1.0)))
}

/// Weighted Mann-Whitney: ties count half.
fn area(all: impl Iterator<Item = (bool, f64, f64)>) -> f64 {
    let mut sorted: Vec<(bool, f64, f64)> = all.filter(|(_, _, weight)| *weight > 0.0).collect();
    sorted.sort_by(|a, b| a.1.total_cmp(&b.1));
    let (mut below, mut won, mut real) = (0.0, 0.0, 0.0);
    let mut at = 0;
    while at < sorted.len() {
        let end = at + sorted[at..].iter().take_while(|s| s.1 == sorted[at].1).count();
        let sum = |kind: bool| sorted[at..end].iter().filter(|s| s.0 == kind).map(|s| s.2).sum::<f64>();
        let (here, simulated) = (sum(true), sum(false));
        won += here * (below + simulated / 2.0);
        below += simulated;
        real += here;
        at = end;
    }
    won / (real * below)
}

struct Model {
    mean: Vec<f64>,
    sd: Vec<f64>,
    /// The constant last.
    weights: DVector<f64>,
}

impl Model {
    fn fit(learnt: &[&Seen]) -> Self {
        let d = learnt.first().map_or(0, |s| s.values.len());
        let n = learnt.len() as f64;
        let mean: Vec<f64> = (0..d).map(|i| learnt.iter().map(|s| s.values[i]).sum::<f64>() / n).collect();
        let square = |i: usize| learnt.iter().map(|s| (s.values[i] - mean[i]).powi(2)).sum::<f64>() / n;
        let sd: Vec<f64> = (0..d).map(|i| square(i).sqrt().max(1e-12)).collect();
        let mut model = Self { mean, sd, weights: DVector::zeros(d + 1) };
        let rows: Vec<DVector<f64>> = learnt.iter().map(|s| model.row(&s.values)).collect();
        // Both kinds count alike, however many windows there are of each.
        let real = learnt.iter().filter(|s| s.real).count() as f64;
        let weight = |is: bool| if is { 1.0 } else { real / (n - real).max(1.0) };
        for _ in 0..STEPS {
            let mut h = DMatrix::<f64>::identity(d + 1, d + 1) * RIDGE;
            h[(d, d)] = 1e-9;
            let mut g = -&model.weights * RIDGE;
            g[d] = 0.0;
            for (row, s) in rows.iter().zip(learnt) {
                let p = 1.0 / (1.0 + (-model.weights.dot(row)).exp());
                let w = weight(s.real);
                let target = if s.real { 1.0 } else { 0.0 };
                g.axpy(w * (target - p), row, 1.0);
                h.ger(w * p * (1.0 - p), row, row, 1.0);
            }
            let Some(step) = h.cholesky().map(|c| c.solve(&g)) else { break };
            model.weights += &step;
            if step.amax() < SETTLED {
                break;
            }
        }
        model
    }

    fn row(&self, values: &[f64]) -> DVector<f64> {
        let d = values.len();
        DVector::from_fn(d + 1, |i, _| if i == d { 1.0 } else { (values[i] - self.mean[i]) / self.sd[i] })
    }

    fn score(&self, values: &[f64]) -> f64 {
        self.weights.dot(&self.row(values))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Windows whose first value differs by so much between the kinds, in its deviations; the second is noise.
    fn windows(apart: f64) -> Vec<Seen> {
        let mut random = Pcg64Mcg::seed_from_u64(7);
        let mut normal = || (0..12).map(|_| random.next_u64() as f64 / u64::MAX as f64).sum::<f64>() - 6.0;
        (0..1200)
            .map(|i| {
                let real = i % 4 == 0;
                Seen {
                    place: i / 12,
                    real,
                    values: vec![normal() + if real { apart } else { 0.0 }, normal()],
                }
            })
            .collect()
    }

    #[test]
    fn a_deviation_between_the_kinds_is_told_as_often_as_theory_says() {
        let all = windows(1.0);
        let found = auc(&all, &scores(&all));
        // Of two normal laws one deviation apart: the normal law at the root of a half, 0.760.
        assert!((found.value - 0.760).abs() < 0.03, "{found:?}");
        assert!(found.low < 0.760 && 0.760 < found.high, "{found:?}");
    }

    #[test]
    fn two_kinds_that_are_one_are_not_told_apart() {
        let all = windows(0.0);
        let found = auc(&all, &scores(&all));
        assert!(found.low < 0.5 && found.high > 0.5, "{found:?}");
    }

    #[test]
    fn ties_count_half() {
        assert_eq!(area([(true, 1.0, 1.0), (false, 1.0, 1.0)].into_iter()), 0.5);
        assert_eq!(area([(true, 2.0, 1.0), (false, 1.0, 3.0)].into_iter()), 1.0);
    }
}
