//! Weights that suppress outliers.
//!
//! [`regular_weights`] is for estimates of a variance. Defects only add variance: a false spike, a blinking pixel or a
//! drift makes an estimate too large. [`biweights`] is for residuals with outliers on both sides.

use spikelane_measure::{median, median_and_spread};

/// Limits of the groups in which estimates are counted, in standard deviations above the mean.
const GROUP_LIMITS: [f64; 7] = [5.0, 6.0, 7.0, 8.0, 10.0, 13.0, 17.0];

/// Number of standard deviations by which a count exceeds its expectation before the weights of the group decrease. One
/// regular group in a thousand exceeds it.
const COUNT_Z_THRESHOLD: f64 = 3.0;

/// Estimates farther from the mean, in standard deviations, are not used for the standard deviation. Of 4,000 regular
/// estimates, at most one is farther.
const MAX_SCALE_Z: f64 = 8.0;

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

/// Returns estimates with equal errors in standard deviations from their mean. Outliers change neither the mean nor the
/// standard deviation.
pub(crate) fn standardize(values: &[f64]) -> Vec<f64> {
    let (mut mean, mut sd) = median_and_spread(&mut values.to_vec());
    for _ in 0..SCALE_ITERATIONS {
        let used = || values.iter().filter(|v| (**v - mean).abs() <= MAX_SCALE_Z * sd);
        let count = used().count() as f64;
        let next = used().sum::<f64>() / count;
        sd = (used().map(|v| (v - next).powi(2)).sum::<f64>() / count).sqrt();
        mean = next;
    }
    // If all values are equal, none is an outlier.
    values.iter().map(|v| if sd > 0.0 { (v - mean) / sd } else { 0.0 }).collect()
}

/// Returns, for each standardized estimate of a variance, the probability that the estimate is regular.
///
/// The estimates more than five standard deviations above the mean are counted in groups. If a group contains significantly
/// more estimates than the largest expected number of regular estimates, the weight is the ratio of both numbers. A clean
/// mean therefore does not change. Outliers far from the mean have the weight 0.
pub(crate) fn regular_weights(standardized: &[f64]) -> Vec<f64> {
    let group = |z: &f64| GROUP_LIMITS.partition_point(|limit| limit <= z);
    let mut counts = [0.0; GROUP_LIMITS.len() + 1];
    standardized.iter().for_each(|z| counts[group(z)] += 1.0);
    let share_above = |i: usize| GROUP_LIMITS.get(i).map_or(0.0, |z| regular_share_above(*z));
    let weight = |g: usize| {
        let Some(below) = g.checked_sub(1) else { return 1.0 };
        let expected = counts[0] * (share_above(below) - share_above(g));
        let is_excess = counts[g] > expected + COUNT_Z_THRESHOLD * expected.sqrt();
        if is_excess { (expected / counts[g]).min(1.0) } else { 1.0 }
    };
    let weights: Vec<f64> = (0..counts.len()).map(weight).collect();
    standardized.iter().map(|z| weights[group(z)]).collect()
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
        let weights = regular_weights(&standardize(values));
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
