//! The mean of simulated vectors.

use nalgebra::DVector;

pub(in crate::diagnose) fn average(vectors: &[DVector<f64>]) -> DVector<f64> {
    let mut sum = vectors[0].clone();
    vectors[1..].iter().for_each(|v| sum += v);
    sum / vectors.len() as f64
}
