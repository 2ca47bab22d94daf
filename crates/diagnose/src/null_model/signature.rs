//! Signatures: the changes of the statistics that candidates cause.

use crate::null_model::metric::Metric;
use crate::null_model::vectors::{average, shrink};
use crate::recordings::setup::Setup;
use crate::sensors::catalog::Candidate;
use crate::sensors::model::{Model, Sample};
use crate::sensors::simulate;
use crate::thresholds::MIN_SIGNATURE_SQUARE;
use nalgebra::DVector;
use spikelane::effects::definition::SearchScale;
use spikelane::error::Result;

/// The change of the statistics that a candidate causes at one position of its parameters.
#[derive(Clone, Debug)]
pub(crate) struct Signature {
    pub candidate: Candidate,
    /// Mean change of the statistics vector. `each` contains one change for each simulation.
    pub mean: DVector<f64>,
    pub each: Vec<DVector<f64>>,
    /// Standard deviation of the score in clean sensors. It exceeds 1 if the noise comes from few simulations,
    /// which do not show all correlations.
    pub score_sd: f64,
}

impl Signature {
    /// Creates a signature. `each` contains one change of the statistics vector for each simulation. `spread`
    /// contains the standard deviation of each statistic.
    pub(super) fn new(candidate: Candidate, each: Vec<DVector<f64>>, spread: &[f64]) -> Self {
        // The noise of a single simulation can be as long as a weak signature, so insignificant changes are set to
        // zero.
        let mean = match each.as_slice() {
            [only] => shrink(only.clone(), spread, 1),
            _ => average(&each),
        };
        Self { candidate, mean, each, score_sd: 1.0 }
    }

    /// Estimates the amplitude of the effect in a deviation, in units of the tried amplitude. `dual` is the dual
    /// vector of the deviation in `metric`. Returns `None` if the noise hides the signature.
    pub(crate) fn amplitude(&self, metric: &Metric, dual: &DVector<f64>) -> Option<AmplitudeEstimate> {
        let [first, second] = self.two_estimates();
        let square = metric.dual(first).dot(second);
        (square > MIN_SIGNATURE_SQUARE).then(|| AmplitudeEstimate {
            value: self.mean.dot(dual) / square,
            sd: self.score_sd * metric.square(&self.mean).sqrt() / square,
        })
    }

    /// Returns two estimates of the change. If two simulations exist, the noise of both is independent.
    pub(super) fn two_estimates(&self) -> [&DVector<f64>; 2] {
        match self.each.as_slice() {
            [first, second, ..] => [first, second],
            _ => [&self.mean, &self.mean],
        }
    }
}

/// An amplitude with its standard deviation.
#[derive(Clone, Copy, Debug)]
pub(crate) struct AmplitudeEstimate {
    pub value: f64,
    pub sd: f64,
}

/// Returns whether `a` and `b` are the same effect with opposite signs.
pub(super) fn is_mirrored(a: &Candidate, b: &Candidate) -> bool {
    let is_linear = a.knobs.first().is_some_and(|knob| knob.scale == SearchScale::Linear);
    let opposite = |a: f64, b: f64| (a + b).abs() < 1e-9 * a.abs();
    is_linear && a.effect == b.effect && opposite(a.at[0], b.at[0]) && a.at[1..] == b.at[1..]
}

/// Returns the largest allowed amplitude of the effect, divided by the tried amplitude.
pub(crate) fn reach(s: &Signature) -> f64 {
    let (knob, u) = (s.candidate.knobs[0], s.candidate.at[0]);
    let most = knob.position(if u * knob.unit < 0.0 && knob.scale == SearchScale::Linear {
        knob.range.0
    } else {
        knob.range.1
    });
    (most / u).abs().max(1.0)
}

impl Candidate {
    /// Returns the base model with this candidate as a sample.
    pub(super) fn sample(&self, base: &Model) -> Result<Sample> {
        let mut model = base.clone();
        let zero = vec![0.0; model.knobs.len()];
        model.knobs.extend(self.knobs.iter().copied());
        model.sample(&[zero.as_slice(), &self.at].concat(), &[])
    }
}

/// Returns the change that `candidate` causes in the base model with the draws of number `i`. `baseline` contains
/// the vectors of the base model.
pub(super) fn changed_by(
    candidate: &Candidate,
    setup: &Setup,
    base: &Model,
    seed: u64,
    baseline: &[DVector<f64>],
    i: usize,
) -> Result<DVector<f64>> {
    Ok(simulate::values(setup, &candidate.sample(base)?, seed + i as u64)? - &baseline[i])
}
