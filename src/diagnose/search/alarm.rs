//! Whether anything is off beyond what a model's own sensors show.

use nalgebra::DVector;

use crate::diagnose::fit::by_itself::{Own, roots};
use crate::diagnose::fit::fit::Fit;
use crate::diagnose::null::known::CALIBRATED;
use crate::diagnose::null::metric::Metric;
use crate::diagnose::null::reference::Reference;
use crate::diagnose::null::signature::Signature;

impl Reference {
    /// What sensors of the base model show.
    pub(in crate::diagnose) fn own_of_base(&self) -> Own {
        let known = vec![CALIBRATED; self.model.knobs.len()];
        let deviations = roots(&self.metric.clone().knowing(&known).covariance());
        Own {
            additive: deviations.clone(),
            deviations,
            metric: self.metric.clone(),
            floor: self.clean.floor,
            floor_sd: self.clean.floor_sd,
            allowed_floor: self.clean.floor,
            limits: self.clean.limits,
            mean: self.mean.clone(),
        }
    }

    /// Whether anything about what is `off` the mean of `fit` is beyond what its own sensors show.
    pub(in crate::diagnose) fn alarm(
        &self,
        fit: &Fit,
        own: &Own,
        off: &DVector<f64>,
        signatures: &[Signature],
    ) -> bool {
        let open: Vec<&Signature> = signatures.iter().filter(|s| fit.lacks(s)).collect();
        let [misfit, deviation, score] = self.strays_by(&own.metric, off, &open);
        misfit > own.limits.misfit || deviation > own.limits.deviation || score > own.limits.score
    }

    /// Total misfit, largest deviation, largest score.
    pub(in crate::diagnose) fn strays_by(
        &self,
        metric: &Metric,
        off: &DVector<f64>,
        signatures: &[&Signature],
    ) -> [f64; 3] {
        let dual = metric.dual(off);
        let score = |s: &Signature| {
            let length = metric.square(&s.mean).sqrt();
            if length > 0.0 { (s.mean.dot(&dual) / length).abs() } else { 0.0 }
        };
        let largest = |m: f64, x: f64| m.max(x.abs());
        [
            off.dot(&dual),
            metric.scores(off).into_iter().fold(0.0, largest),
            signatures.iter().map(|s| score(s)).fold(0.0, largest),
        ]
    }
}
