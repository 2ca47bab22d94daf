//! Whole readouts that are dropped or repeated.

use crate::effects::Model;
use crate::pixel::Op;
use crate::plan::rounded_law::probability;

/// Probabilities of faults that affect whole readouts, in units of 2^-32.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ReadoutFaults {
    /// Probability that a readout is dropped.
    pub drop_probability: u32,
    /// Probability that a readout is replaced by the previous readout.
    pub repeat_probability: u32,
}

impl ReadoutFaults {
    #[rustfmt::skip]
    pub(super) fn from_model(model: &Model) -> Self {
        let mut losses = Self::default();
        for op in &model.ops {
            match *op {
                Op::DropReadouts { probability: p } => losses.drop_probability = probability(p),
                Op::RepeatReadouts { probability: p } => losses.repeat_probability = probability(p),
                // These operations apply to pixels. `Model::law` and `Model::start_phases` handle them.
                Op::LightQuanta { .. } | Op::DarkQuanta { .. } | Op::CorrelatedQuanta { .. }
                | Op::ThresholdNoise { .. } | Op::FirstIncrement { .. } | Op::Remainder { .. }
                | Op::Ceiling { .. } | Op::Flip { .. } | Op::Response { .. } | Op::Flicker { .. }
                | Op::Drift { .. } | Op::Leak { .. } | Op::ComparatorNoise { .. } | Op::ReadoutJitter { .. }
                | Op::RowNoise { .. } | Op::SlowThresholdNoise { .. } | Op::Adaptation { .. }
                | Op::Telegraph { .. } | Op::Lag { .. } | Op::Crosstalk { .. } | Op::SpikeCoupling { .. }
                | Op::SupplyDroop { .. } | Op::Phase { .. } => {}
            }
        }
        losses
    }

    /// Returns whether any readout can be dropped or repeated.
    #[must_use]
    pub fn any(&self) -> bool {
        *self != Self::default()
    }
}
