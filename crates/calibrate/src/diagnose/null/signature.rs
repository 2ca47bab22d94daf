//! How a candidate shows.

use crate::diagnose::protocol::recorded_set::Setup;
use crate::diagnose::sensors::catalog::Candidate;
use crate::diagnose::sensors::model::Model;
use crate::diagnose::sensors::simulate;
use nalgebra::DVector;
use spikelane::effects::definition::SearchScale;
use spikelane::error::Result;

/// How a candidate shows at one position.
#[derive(Clone, Debug)]
pub(in crate::diagnose) struct Signature {
    pub candidate: Candidate,
    /// Change of the vector, mean and of each simulation.
    pub mean: DVector<f64>,
    pub each: Vec<DVector<f64>>,
}

/// How much further than tried the amplitude can go.
pub(in crate::diagnose) fn reach(s: &Signature) -> f64 {
    let (knob, u) = (s.candidate.knobs[0], s.candidate.at[0]);
    let most = knob.position(if u * knob.unit < 0.0 && knob.scale == SearchScale::Linear {
        knob.range.0
    } else {
        knob.range.1
    });
    (most / u).abs().max(1.0)
}

/// What `candidate` changes in the base sensor with draws number `i`, of which `baseline` has the vectors.
pub(super) fn changed_by(
    candidate: &Candidate,
    setup: &Setup,
    base: &Model,
    seed: u64,
    baseline: &[DVector<f64>],
    i: usize,
) -> Result<DVector<f64>> {
    let mut model = base.clone();
    let zero = vec![0.0; model.knobs.len()];
    model.knobs.extend(candidate.knobs.iter().copied());
    let u = [zero.as_slice(), &candidate.at].concat();
    let sample = model.sample(&u, &[], setup.recordings.len())?;
    let values = simulate::values(setup, &sample, seed + i as u64)?;
    Ok(DVector::from_vec(values) - &baseline[i])
}
