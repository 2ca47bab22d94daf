//! The mean of simulated vectors.

use nalgebra::DVector;

/// The mean of lists of equal length.
pub(crate) fn average_of(lists: &[Vec<f64>]) -> Vec<f64> {
    let n = lists.len() as f64;
    (0..lists[0].len()).map(|i| lists.iter().map(|l| l[i]).sum::<f64>() / n).collect()
}

pub(crate) fn average(vectors: &[DVector<f64>]) -> DVector<f64> {
    let mut sum = vectors[0].clone();
    vectors[1..].iter().for_each(|v| sum += v);
    sum / vectors.len() as f64
}
