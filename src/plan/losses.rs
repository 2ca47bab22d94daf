//! Whole readouts that are lost or repeated.

use crate::effects::Model;
use crate::pixel::Op;
use crate::plan::steps::probability;

/// Whole readouts that go wrong; probabilities in units of 2^-32.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Losses {
    /// Of losing a readout.
    pub dropped: u32,
    /// Of reporting the readout before in its place.
    pub repeated: u32,
}

impl Losses {
    pub(super) fn of(model: &Model) -> Self {
        let mut losses = Self::default();
        for op in &model.ops {
            match *op {
                Op::DropReadouts { probability: p } => losses.dropped = probability(p),
                Op::RepeatReadouts { probability: p } => losses.repeated = probability(p),
                // These happen to pixels: `Model::law` and `Model::phases` have them.
                Op::LightQuanta { .. }
                | Op::DarkQuanta { .. }
                | Op::QuantaSettle { .. }
                | Op::ThresholdNoise { .. }
                | Op::FirstIncrement { .. }
                | Op::Remainder { .. }
                | Op::Ceiling { .. }
                | Op::Flip { .. }
                | Op::Response { .. }
                | Op::Flicker { .. }
                | Op::Drift { .. }
                | Op::Leak { .. }
                | Op::ComparatorNoise { .. }
                | Op::Undecided { .. }
                | Op::RowNoise { .. }
                | Op::SlowThresholdNoise { .. }
                | Op::Adaptation { .. }
                | Op::Telegraph { .. }
                | Op::Lag { .. }
                | Op::Crosstalk { .. }
                | Op::SpikeCoupling { .. }
                | Op::SupplyDroop { .. }
                | Op::Phase { .. } => {}
            }
        }
        losses
    }

    /// Whether any readout can go wrong.
    #[must_use]
    pub fn any(&self) -> bool {
        *self != Self::default()
    }
}
