//! The charge of the pixels when the recording starts.

use crate::effects::definition::{Definition, Moments, OperatingPoint, Param, Values};
use crate::pixel::Op;
use crate::sensor::Sensor;
use crate::units::Unit;

/// The effect `start_phase`.
pub static EFFECT: Definition = Definition::new(
    "start_phase",
    "Every pixel has a random charge before the first readout. Without this effect, all pixels of a uniform scene fire at the same readouts.",
    "uniform in real recordings; U[0,1) fC in the published code of SCSim",
    &[
        Param::number(
            "share",
            Unit::Dimensionless,
            (0.0, 1.0),
            0.0,
            1.0,
            "the start charge is drawn uniformly from 0 to this share of the threshold of the pixel",
        ),
        Param::number(
            "charge",
            Unit::Femtocoulomb,
            (0.0, 1e3),
            0.0,
            0.0,
            "a second start charge is drawn uniformly from 0 to this value. The pixel starts with the sum of both start charges",
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
