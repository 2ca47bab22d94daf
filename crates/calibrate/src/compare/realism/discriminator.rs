//! A discriminator between real and simulated windows.
//!
//! The discriminator is a logistic regression on standardized values, with a ridge penalty. Newton's method fits its
//! weights. A place is the area of the sensor that a window covers. The regression is fitted on five sixths of the
//! places and tested on the remaining sixth. The fit and the test are repeated for each sixth.
//!
//! The area under the ROC curve (AUC) is the probability that a real window has a higher score than a simulated window.
//! An AUC of 0.5 means that real and simulated windows cannot be distinguished.

use nalgebra::{DMatrix, DVector};
use rand_pcg::Pcg64Mcg;
use rand_pcg::rand_core::{Rng, SeedableRng};
use serde::Serialize;

/// Number of folds. The places are divided into this many parts, and each part is excluded from one fit.
const FOLD_COUNT: usize = 6;

/// Ridge penalty. The unit is the weight of one window.
const RIDGE: f64 = 1.0;

/// Maximum number of Newton steps.
const MAX_NEWTON_STEPS: usize = 30;
/// Newton's method ends when no weight changes by more than this value.
const NEWTON_TOLERANCE: f64 = 1e-7;

/// Number of bootstrap samples for the 95 % interval of the AUC. Each sample draws places with replacement.
const BOOTSTRAP_SAMPLES: usize = 400;

/// Input of the discriminator: one window.
#[derive(Clone, Debug)]
pub(super) struct LabeledWindow {
    pub(super) place: usize,
    pub(super) is_real: bool,
    pub(super) values: Vec<f64>,
}

/// The area under a ROC curve, with its 95 % interval. It is the probability that a window of one kind has a higher score
/// than a window of the other kind. The interval covers the scatter between places.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Auc {
    /// The probability. It is 0.5 if the two kinds cannot be distinguished.
    pub value: f64,
    /// Lower end of the interval.
    pub low: f64,
    /// Upper end of the interval.
    pub high: f64,
}

/// Returns a score for each window. The regression that computes the score was fitted only to windows at other places.
pub(super) fn out_of_fold_scores(all: &[LabeledWindow]) -> Vec<f64> {
    let mut scores = vec![0.0; all.len()];
    for fold in 0..FOLD_COUNT {
        let learned: Vec<&LabeledWindow> = all.iter().filter(|s| s.place % FOLD_COUNT != fold).collect();
        let model = LogisticModel::fit(&learned);
        for (score, s) in scores.iter_mut().zip(all).filter(|(_, s)| s.place % FOLD_COUNT == fold) {
            *score = model.score(&s.values);
        }
    }
    scores
}

/// Returns the AUC of `scores` and its 95 % interval. The bootstrap for this interval draws places with replacement.
pub(super) fn auc_with_interval(all: &[LabeledWindow], scores: &[f64]) -> Auc {
    let value = auc_value(all, scores);
    let places = 1 + all.iter().map(|s| s.place).max().unwrap_or(0);
    let mut random = Pcg64Mcg::seed_from_u64(1);
    let mut resampled: Vec<f64> = (0..BOOTSTRAP_SAMPLES)
        .filter_map(|_| {
            let mut times = vec![0.0; places];
            (0..places).for_each(|_| times[(random.next_u64() % places as u64) as usize] += 1.0);
            let auc = mann_whitney_auc(all.iter().zip(scores).map(|(s, x)| (s.is_real, *x, times[s.place])));
            Some(auc).filter(|a| a.is_finite())
        })
        .collect();
    resampled.sort_by(f64::total_cmp);
    let at = |share: f64| resampled.get((share * resampled.len() as f64) as usize).copied().unwrap_or(value);
    Auc { value, low: at(0.025), high: at(0.975) }
}

/// Returns the AUC of `scores` without an interval.
pub(super) fn auc_value(all: &[LabeledWindow], scores: &[f64]) -> f64 {
    mann_whitney_auc(all.iter().zip(scores).map(|(s, x)| (s.is_real, *x, 1.0)))
}

/// Returns the AUC of weighted scores (Mann-Whitney statistic). A tie counts as half a win. The tuples are (is real,
/// score, weight).
fn mann_whitney_auc(all: impl Iterator<Item = (bool, f64, f64)>) -> f64 {
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

struct LogisticModel {
    mean: Vec<f64>,
    standard_deviation: Vec<f64>,
    /// Weights of the values. The last weight belongs to the constant term.
    weights: DVector<f64>,
}

impl LogisticModel {
    fn fit(learned: &[&LabeledWindow]) -> Self {
        let d = learned.first().map_or(0, |s| s.values.len());
        let n = learned.len() as f64;
        let mean: Vec<f64> = (0..d).map(|i| learned.iter().map(|s| s.values[i]).sum::<f64>() / n).collect();
        let square = |i: usize| learned.iter().map(|s| (s.values[i] - mean[i]).powi(2)).sum::<f64>() / n;
        let sd: Vec<f64> = (0..d).map(|i| square(i).sqrt().max(1e-12)).collect();
        let mut model = Self { mean, standard_deviation: sd, weights: DVector::zeros(d + 1) };
        let rows: Vec<DVector<f64>> = learned.iter().map(|s| model.design_row(&s.values)).collect();
        // Real and simulated windows have the same total weight, even if their numbers differ.
        let real = learned.iter().filter(|s| s.is_real).count() as f64;
        let weight = |is: bool| if is { 1.0 } else { real / (n - real).max(1.0) };
        for _ in 0..MAX_NEWTON_STEPS {
            let mut h = DMatrix::<f64>::identity(d + 1, d + 1) * RIDGE;
            h[(d, d)] = 1e-9;
            let mut g = -&model.weights * RIDGE;
            g[d] = 0.0;
            for (row, s) in rows.iter().zip(learned) {
                let p = 1.0 / (1.0 + (-model.weights.dot(row)).exp());
                let w = weight(s.is_real);
                let target = if s.is_real { 1.0 } else { 0.0 };
                g.axpy(w * (target - p), row, 1.0);
                h.ger(w * p * (1.0 - p), row, row, 1.0);
            }
            let Some(step) = h.cholesky().map(|c| c.solve(&g)) else { break };
            model.weights += &step;
            if step.amax() < NEWTON_TOLERANCE {
                break;
            }
        }
        model
    }

    fn design_row(&self, values: &[f64]) -> DVector<f64> {
        let d = values.len();
        DVector::from_fn(d + 1, |i, _| {
            if i == d { 1.0 } else { (values[i] - self.mean[i]) / self.standard_deviation[i] }
        })
    }

    fn score(&self, values: &[f64]) -> f64 {
        self.weights.dot(&self.design_row(values))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Creates windows of two kinds, each with two values. The means of the first value differ between the kinds by
    /// `separation` standard deviations. The second value is noise.
    fn windows(separation: f64) -> Vec<LabeledWindow> {
        let mut random = Pcg64Mcg::seed_from_u64(7);
        let mut normal = || (0..12).map(|_| random.next_u64() as f64 / u64::MAX as f64).sum::<f64>() - 6.0;
        (0..1200)
            .map(|i| {
                let real = i % 4 == 0;
                LabeledWindow {
                    place: i / 12,
                    is_real: real,
                    values: vec![normal() + if real { separation } else { 0.0 }, normal()],
                }
            })
            .collect()
    }

    #[test]
    fn auc_of_two_shifted_normals_matches_theory() {
        let all = windows(1.0);
        let auc = auc_with_interval(&all, &out_of_fold_scores(&all));
        // For two normal distributions whose means differ by one standard deviation, AUC = Phi(sqrt(1/2)) = 0.760. Phi is the
        // normal distribution function.
        assert!((auc.value - 0.760).abs() < 0.03, "{auc:?}");
        assert!(auc.low < 0.760 && 0.760 < auc.high, "{auc:?}");
    }

    #[test]
    fn auc_of_identical_kinds_is_one_half() {
        let all = windows(0.0);
        let auc = auc_with_interval(&all, &out_of_fold_scores(&all));
        assert!(auc.low < 0.5 && auc.high > 0.5, "{auc:?}");
    }

    #[test]
    fn ties_count_half() {
        assert_eq!(mann_whitney_auc([(true, 1.0, 1.0), (false, 1.0, 1.0)].into_iter()), 0.5);
        assert_eq!(mann_whitney_auc([(true, 2.0, 1.0), (false, 1.0, 3.0)].into_iter()), 1.0);
    }
}
