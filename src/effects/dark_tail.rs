//! A log-normal dark current: what calibration maps of real cameras show instead of a Gaussian.

use crate::draws::pattern::Pattern;
use crate::effects::circuit::Circuit;
use crate::effects::definition::{Definition, Moments, Operating, Param, Tried, Values};
use crate::sensor::Sensor;
use crate::units::Unit;

/// The effect `dark_tail`.
pub static EFFECT: Definition = Definition::new(
    "dark_tail",
    "The dark current is multiplied by a log-normal factor of mean one, which gives \
     it a hot tail and no negatives.",
    "calibration maps of a 400x250 camera: sigma of the logarithm 0.43, none negative",
    &[Param::number("log_sigma", Unit::One, (0.0, 3.0), 0.0, 0.43, "standard deviation of the logarithm")
        .tried(Tried::deviation((0.0, 1.5), &[0.2, 0.5]))],
)
.with_edit(edit)
.with_moments(moments)
.part_of_a_scene();

fn edit(v: Values<'_>, _: &Sensor, circuit: &mut Circuit, pattern: &mut Pattern) {
    if v[0] == 0.0 {
        return;
    }
    for (dark, z) in circuit.dark_pa.iter_mut().zip(pattern.normals()) {
        *dark *= libm::exp(v[0] * z - 0.5 * v[0] * v[0]);
    }
}

fn moments(v: Values<'_>, at: &Operating) -> Option<Moments> {
    // The variance of a log-normal factor of mean one is exp(sigma^2) - 1.
    let share = at.from_dark / at.increment();
    Some(Moments { spatial_variance: share * share * libm::expm1(v[0] * v[0]), ..Moments::default() })
}
