//! Compares the deviations of recordings with the limits of sensors that follow the model.

use crate::fit::fit::Fit;
use crate::fit::self_consistency::SelfConsistency;
use crate::null_model::limits::strays_by;
use crate::null_model::signature::Signature;
use nalgebra::DVector;

/// Returns the total deviation, the largest deviation of a statistic and the largest score of an effect that the model
/// lacks, each with its limit. `off` is the deviation of the statistics from the mean of `fit`.
pub(crate) fn values_and_limits(
    fit: &Fit,
    own: &SelfConsistency,
    off: &DVector<f64>,
    signatures: &[Signature],
) -> [(f64, f64); 3] {
    let open: Vec<&Signature> = signatures.iter().filter(|s| fit.lacks(s)).collect();
    let [misfit, deviation, score] = strays_by(&own.metric, off, &open);
    let limits = own.limits;
    [(misfit, limits.misfit), (deviation, limits.deviation), (score, limits.score)]
}

/// Returns whether a value exceeds its limit.
pub(crate) fn alarm(fit: &Fit, own: &SelfConsistency, off: &DVector<f64>, signatures: &[Signature]) -> bool {
    values_and_limits(fit, own, off, signatures).iter().any(|(value, limit)| value > limit)
}
