//! Weights that suppress outliers.
//!
//! [`regular_weights`] is for estimates of a variance. Defects only add variance: a false spike, a blinking pixel or a
//! drift makes an estimate too large. [`biweights`] is for residuals with outliers on both sides.

use spikelane_measure::{median, median_and_spread};

/// Limits of the groups in which estimates are counted, in standard deviations above the mean.
const GROUP_LIMITS: [f64; 8] = [3.0, 4.0, 5.0, 6.0, 8.0, 10.0, 13.0, 17.0];

/// Number of iterations. The standard deviation changes by less than a thousandth after ten.
const SCALE_ITERATIONS: usize = 20;

/// Tuning constant of Tukey's biweight, in standard deviations. The efficiency for normal residuals is 95 %.
const BIWEIGHT_REACH: f64 = 4.685;

/// Returns the largest share of the regular estimates that are more than `z` standard deviations above the mean.
///
/// The estimated growth of a variance is a quadratic form of normal variables, with few large eigenvalues if a pixel has
/// few intervals. Its tail is exponential. For 4 to 400 intervals and all sets of lags, the simulated share is between a
/// quarter and nine tenths of this bound.
fn regular_share_above(z: f64) -> f64 {
    (-0.9 * z).exp() / 3.0
}

/// Returns, for each estimate of a variance, the probability that the estimate is regular. `precisions` are proportional
/// to the inverse variances of the estimates. An estimate that is not finite has the weight 0.
///
/// The estimates more than three standard deviations above the mean are counted in groups. The weight of a group is the
/// largest expected number of regular estimates, divided by the counted number, and at most 1. Without outliers all weights
/// are therefore 1, so a clean mean does not change. Outliers far from the mean have the weight 0.
pub(crate) fn regular_weights(values: &[f64], precisions: &[f64]) -> Vec<f64> {
    let used: Vec<usize> =
        (0..values.len()).filter(|p| values[*p].is_finite() && precisions[*p] > 0.0).collect();
    let mut weights = vec![0.0; values.len()];
    used.iter().for_each(|p| weights[*p] = 1.0);
    let mut mean = median(&mut used.iter().map(|p| values[*p]).collect::<Vec<_>>());
    let scaled = |p: usize, mean: f64| (values[p] - mean) * precisions[p].sqrt();
    let mut sd = median_and_spread(&mut used.iter().map(|p| scaled(*p, mean)).collect::<Vec<_>>()).1;
    for _ in 0..SCALE_ITERATIONS {
        if sd.is_nan() || sd <= 0.0 {
            break;
        }
        let group = |p: usize| GROUP_LIMITS.partition_point(|limit| *limit <= scaled(p, mean) / sd);
        let mut counts = [0.0; GROUP_LIMITS.len() + 1];
        used.iter().for_each(|p| counts[group(*p)] += 1.0);
        let regular: f64 = used.iter().map(|p| weights[*p]).sum();
        let group_weight = |g: usize| {
            let above = |limit: Option<&f64>| limit.map_or(0.0, |z| regular_share_above(*z));
            match g.checked_sub(1) {
                None => 1.0,
                Some(i) => {
                    let share = above(GROUP_LIMITS.get(i)) - above(GROUP_LIMITS.get(g));
                    (regular * share / counts[g]).min(1.0)
                }
            }
        };
        let group_weights: Vec<f64> = (0..counts.len()).map(group_weight).collect();
        used.iter().for_each(|p| weights[*p] = group_weights[group(*p)]);
        let sum = |term: &dyn Fn(usize) -> f64| used.iter().map(|p| weights[*p] * term(*p)).sum::<f64>();
        let squares = sum(&|p| scaled(p, mean).powi(2));
        let total = sum(&|_| 1.0);
        mean = sum(&|p| precisions[p] * values[p]) / sum(&|p| precisions[p]);
        sd = (squares / total).sqrt();
    }
    weights
}

/// Returns the robust standard deviation of residuals, and the weight of each residual by Tukey's biweight.
pub(crate) fn biweights(residuals: &[f64]) -> (f64, Vec<f64>) {
    let mut absolute: Vec<f64> = residuals.iter().map(|r| r.abs()).collect();
    let sd = 1.4826 * median(&mut absolute);
    let weight = |r: &f64| {
        let u = r / (BIWEIGHT_REACH * sd);
        if u.abs() < 1.0 { (1.0 - u * u).powi(2) } else { 0.0 }
    };
    (sd, if sd > 0.0 { residuals.iter().map(weight).collect() } else { vec![1.0; residuals.len()] })
}

#[cfg(test)]
mod tests {
    use super::*;
    use spikelane::unstable::draws::hash::mix64;

    /// Returns estimates of the variance 1, each from `squares` squared normal draws.
    fn estimates(count: u64, squares: u64) -> Vec<f64> {
        let uniform = |i: u64| (mix64(i) >> 11) as f64 / 9_007_199_254_740_992.0;
        let normal = |i: u64| {
            (-2.0 * (1.0 - uniform(2 * i)).ln()).sqrt()
                * (2.0 * std::f64::consts::PI * uniform(2 * i + 1)).cos()
        };
        let one =
            |i: u64| (0..squares).map(|k| normal(i * squares + k).powi(2)).sum::<f64>() / squares as f64;
        (0..count).map(one).collect()
    }

    fn weighted_mean(values: &[f64]) -> f64 {
        let weights = regular_weights(values, &vec![1.0; values.len()]);
        let sum: f64 = weights.iter().zip(values).map(|(w, v)| w * v).sum();
        sum / weights.iter().sum::<f64>()
    }

    /// An estimate from one or two squares has the longest tail. The error of the mean of 10,000 such estimates is 1 %.
    /// The weights may change the mean by a fifth of this error.
    #[test]
    fn weights_do_not_change_a_clean_mean() {
        for squares in [2, 4, 20] {
            let values = estimates(10_000, squares);
            let plain = values.iter().sum::<f64>() / 1e4;
            let robust = weighted_mean(&values);
            assert!((robust / plain - 1.0).abs() < 2e-3, "{squares}: {robust} {plain}");
        }
    }

    /// A plain mean would be 2 to 3,000. The tolerance is three standard errors of the clean mean.
    #[test]
    fn outliers_do_not_change_the_mean() {
        for (share, factor) in [(0.01, 100.0), (0.2, 1e4), (0.4, 1e4), (0.05, 30.0)] {
            let mut values = estimates(10_000, 4);
            let count = (share * 1e4) as usize;
            values[..count].iter_mut().for_each(|v| *v *= factor);
            let robust = weighted_mean(&values);
            assert!((robust - 1.0).abs() < 0.021 + 0.1 * share, "{share} {factor}: {robust}");
        }
    }
}
