//! The charge that pixels hold when the recording starts.

use crate::effects::definition::{Definition, Moments, Operating, Param, Values};
use crate::pixel::Op;
use crate::sensor::Sensor;
use crate::units::Unit;

/// The effect `start_phase`.
pub static EFFECT: Definition = Definition::new(
    "start_phase",
    "Every pixel starts at a random phase of its cycle; without it a flat scene fires \
     in synchronised bursts.",
    "uniform in real recordings; U[0,1) fC in the published code of SCSim",
    &[
        Param::number(
            "share",
            Unit::One,
            (0.0, 1.0),
            0.0,
            1.0,
            "uniform over this share of the pixel's own threshold",
        ),
        Param::number(
            "charge",
            Unit::Femtocoulomb,
            (0.0, 1e3),
            0.0,
            0.0,
            "uniform over this charge, added to the former; set it to 0 for a share alone",
        ),
    ],
)
.with_ops(ops)
.with_moments(moments);

fn ops(v: Values<'_>, _: &Sensor) -> Vec<Op> {
    vec![Op::Phase { share: v[0], charge_fc: v[1] }]
}

fn moments(v: Values<'_>, _: &Operating) -> Option<Moments> {
    let _ = v;
    Some(Moments::default())
}
