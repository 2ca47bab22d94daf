//! The charge of the pixels when the recording starts.

use crate::effects::definition::{Definition, Moments, OperatingPoint, Param, Values};
use crate::pixel::Op;
use crate::sensor::Sensor;
use crate::units::Unit;

/// The effect `start_phase`.
pub static EFFECT: Definition = Definition::new(
    "start_phase",
    "Every pixel starts at a random phase of its cycle. Without this effect a uniform scene fires in synchronized bursts.",
    "uniform in real recordings; U[0,1) fC in the published code of SCSim",
    &[
        Param::number(
            "share",
            Unit::Dimensionless,
            (0.0, 1.0),
            0.0,
            1.0,
            "the start charge is uniform from 0 to this share of the pixel's threshold",
        ),
        Param::number(
            "charge",
            Unit::Femtocoulomb,
            (0.0, 1e3),
            0.0,
            0.0,
            "a second uniform start charge, from 0 to this value, which is added to the first; 0 disables it",
        ),
    ],
)
.with_ops(ops)
.with_moments(moments);

fn ops(v: Values<'_>, _: &Sensor) -> Vec<Op> {
    vec![Op::Phase { share: v[0], charge_fc: v[1] }]
}

fn moments(v: Values<'_>, _: &OperatingPoint) -> Option<Moments> {
    let _ = v;
    Some(Moments::default())
}
