//! Means and other statistics of simulated vectors.

use crate::thresholds::{MIN_CHANGE_SDS, NORMAL_SQUARE_MEDIAN};
use nalgebra::{DMatrix, DVector};
use spikelane::unstable::draws::pattern_rng::PatternRng;
use spikelane::unstable::draws::{RandomStream, Seeds};

/// Returns the mean of vectors.
pub(crate) fn average(vectors: &[DVector<f64>]) -> DVector<f64> {
    let mut sum = vectors[0].clone();
    vectors[1..].iter().for_each(|v| sum += v);
    sum / vectors.len() as f64
}

/// Returns, for each entry, the mean of its squares over all vectors.
pub(crate) fn mean_squares(vectors: &[DVector<f64>]) -> DVector<f64> {
    let square = |j: usize| vectors.iter().map(|v| v[j] * v[j]).sum::<f64>() / vectors.len() as f64;
    DVector::from_fn(vectors.first().map_or(0, |v| v.len()), |j, _| square(j))
}

/// Returns, for each entry, the standard deviation between the vectors.
pub(crate) fn spread(vectors: &[DVector<f64>]) -> Vec<f64> {
    let mean = average(vectors);
    let square = |j: usize| vectors.iter().map(|v| (v[j] - mean[j]).powi(2)).sum::<f64>();
    (0..mean.len()).map(|j| (square(j) / (vectors.len() - 1) as f64).sqrt()).collect()
}

/// Returns the difference of each pair of vectors from `a` and `b`.
pub(crate) fn differences(a: &[DVector<f64>], b: &[DVector<f64>]) -> Vec<DVector<f64>> {
    a.iter().zip(b).map(|(a, b)| a - b).collect()
}

/// Returns a matrix with these columns, which have `rows` entries.
pub(crate) fn matrix(columns: &[DVector<f64>], rows: usize) -> DMatrix<f64> {
    if columns.is_empty() { DMatrix::zeros(rows, 0) } else { DMatrix::from_columns(columns) }
}

/// Returns the columns of `a` and then those of `b`.
pub(crate) fn beside(a: &DMatrix<f64>, b: &DMatrix<f64>) -> DMatrix<f64> {
    let mut all = a.clone().resize_horizontally(a.ncols() + b.ncols(), 0.0);
    all.columns_mut(a.ncols(), b.ncols()).copy_from(b);
    all
}

/// Returns a function that draws vectors of standard normal numbers. `name` identifies the stream of the numbers.
pub(crate) fn normal_vectors(seed: u64, name: &str) -> impl FnMut(usize) -> DVector<f64> + use<> {
    let seeds = Seeds { camera: seed, shot: 0, sequence: 0 };
    let mut normals = PatternRng::new(seeds, RandomStream::from_name(name)).normals();
    move |count| DVector::from_fn(count, |_, _| normals.next().unwrap_or(0.0))
}

/// Returns `change` without the statistics that only noise changed. `change` is the mean of `count` pairs of
/// simulations. `sd` contains the standard deviation of each statistic.
///
/// A set has about 250 statistics. The sum of their noise can be longer than the change itself. A fit along such a
/// derivative finds only a part of every change. Measured: the interval of `row_pattern` was two to three times too
/// narrow.
///
/// Most statistics are changed by noise alone. Their median change therefore shows the noise of a pair, which is at
/// most the noise of two independent sensors.
pub(crate) fn shrink(mut change: DVector<f64>, sd: &[f64], count: usize) -> DVector<f64> {
    let square = |(c, sd): (&f64, &f64)| if *sd > 0.0 { (c / sd).powi(2) } else { 0.0 };
    let mut squares: Vec<f64> = change.iter().zip(sd).map(square).collect();
    let usual = spikelane_measure::median(&mut squares) / NORMAL_SQUARE_MEDIAN;
    let noise = MIN_CHANGE_SDS * MIN_CHANGE_SDS * usual.min(2.0 / count.max(1) as f64);
    for (c, sd) in change.iter_mut().zip(sd) {
        // Statistics far below the noise limit become zero, and those far above it stay. The transition is
        // continuous.
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
        // 200 statistics with normal noise of 0.3 standard deviations, and two statistics with a significant
        // change.
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
