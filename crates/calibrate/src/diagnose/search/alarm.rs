//! Whether anything is off beyond what a model's own sensors show.

use crate::diagnose::fit::by_itself::Own;
use crate::diagnose::fit::fit::Fit;
use crate::diagnose::null::limits::strays_by;
use crate::diagnose::null::signature::Signature;
use nalgebra::DVector;

/// Whether anything about what is `off` the mean of `fit` is beyond what its own sensors show.
pub(in crate::diagnose) fn alarm(fit: &Fit, own: &Own, off: &DVector<f64>, signatures: &[Signature]) -> bool {
    let open: Vec<&Signature> = signatures.iter().filter(|s| fit.lacks(s)).collect();
    let [misfit, deviation, score] = strays_by(&own.metric, off, &open);
    misfit > own.limits.misfit || deviation > own.limits.deviation || score > own.limits.score
}
