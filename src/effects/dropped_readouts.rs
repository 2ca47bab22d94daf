//! Readouts that are lost between the camera and the disk.

use super::prelude::*;

/// The effect `dropped_readouts`.
pub static EFFECT: Definition = Definition::new(
    "dropped_readouts",
    "A readout is lost with all its spikes and is missing in the file. The scene continues, and the file still contains the requested number of frames.",
    "a full buffer or a lost packet between camera and disk",
    &[Param::number("probability", Unit::Dimensionless, (0.0, 0.5), 0.0, 1e-3, "probability that a readout is lost")
        .with_search(SearchSpec::amplitude((0.0, 0.2), &[0.001, 0.01]))],
)
.with_ops(|v, _| vec![Op::DropReadouts { probability: v[0] }])
// Let x be the increment and p the drop probability. A dropped readout advances the charge by x and removes one
// spike with probability x. The number of removed spikes has the variance x (1 - x). On average, p/x readouts are
// dropped per interval.
.with_moments(|v, at| Some(Moments { phase_variance: v[0] * (1.0 - at.increment().min(1.0)), ..Moments::default() }))
.with_event_kind(EventKind::DroppedReadouts)
.with_ambiguity_groups(&[AmbiguityGroup::SingleReadouts]);
