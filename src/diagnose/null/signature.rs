//! How a candidate shows.

use crate::diagnose::sensors::catalogue::Candidate;
use crate::effects::definition::Scale;
use nalgebra::DVector;

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
    let most = knob.position(if u * knob.unit < 0.0 && knob.scale == Scale::Linear {
        knob.range.0
    } else {
        knob.range.1
    });
    (most / u).abs().max(1.0)
}
