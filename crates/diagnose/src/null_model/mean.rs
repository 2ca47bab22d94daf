//! Means of simulated vectors.

use crate::thresholds::{MIN_CHANGE_SDS, NORMAL_SQUARE_MEDIAN};
use nalgebra::DVector;

/// Returns the mean of lists of equal length.
pub(crate) fn average_of(lists: &[Vec<f64>]) -> Vec<f64> {
    let n = lists.len() as f64;
    (0..lists[0].len()).map(|i| lists.iter().map(|l| l[i]).sum::<f64>() / n).collect()
}

/// Returns the mean of vectors.
pub(crate) fn average(vectors: &[DVector<f64>]) -> DVector<f64> {
    let mut sum = vectors[0].clone();
    vectors[1..].iter().for_each(|v| sum += v);
    sum / vectors.len() as f64
}

/// Returns the mean change of `count` pairs of simulations without the statistics that only noise changed. `sd` has the standard
/// deviation of each statistic.
///
/// A set has about 250 statistics, and their noise together can be longer than the change. A fit along such a derivative finds only
/// a part of every change: an interval of `row_pattern` was two to three times too narrow. The changes themselves show the noise of
/// a pair, because noise alone moves most statistics. It is at most that of two sensors.
pub(crate) fn shrink(mut change: DVector<f64>, sd: &[f64], count: usize) -> DVector<f64> {
    let square = |(c, sd): (&f64, &f64)| if *sd > 0.0 { (c / sd).powi(2) } else { 0.0 };
    let mut squares: Vec<f64> = change.iter().zip(sd).map(square).collect();
    let usual = spikelane_measure::median(&mut squares) / NORMAL_SQUARE_MEDIAN;
    let noise = MIN_CHANGE_SDS * MIN_CHANGE_SDS * usual.min(2.0 / count.max(1) as f64);
    for (c, sd) in change.iter_mut().zip(sd) {
        // Nearly all or nothing, but without a step.
        let share = 1.0 - (noise * sd * sd / (*c * *c).max(1e-300)).powi(2);
        *c *= share.max(0.0);
    }
    change
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_change_moves_plainly_stays_and_noise_goes() {
        // Noise of 0.3 of a deviation: 200 statistics in the order of a normal law, and two that are plainly moved.
        let normal = |i: usize| 0.3 * (((i * 37) % 200) as f64 - 99.5) / 57.7;
        let mut change = DVector::from_fn(202, |i, _| normal(i));
        (change[7], change[90]) = (5.0, -2.0);
        let sd = vec![1.0; 202];
        let left = shrink(change.clone(), &sd, 2);
        assert!((left[7] - 5.0).abs() < 0.01 && (left[90] + 2.0).abs() < 0.15, "{} {}", left[7], left[90]);
        let noise = |v: &DVector<f64>| v.iter().filter(|c| c.abs() < 1.0).map(|c| c * c).sum::<f64>();
        assert!(noise(&left) < 0.01 * noise(&change), "{} of {}", noise(&left), noise(&change));
    }

    #[test]
    fn a_change_of_every_statistic_stays() {
        let left = shrink(DVector::from_element(50, -20.0), &[1.0; 50], 2);
        assert!(left.iter().all(|c| (c + 20.0).abs() < 0.01), "{left}");
    }
}
