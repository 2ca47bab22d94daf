//! Pixels whose dark current is far above the others'.

use crate::draws::pattern::Pattern;
use crate::effects::circuit::Circuit;
use crate::effects::definition::{Definition, Events, Moments, Operating, Param, Tried, Values};
use crate::sensor::Sensor;
use crate::units::Unit;

/// The effect `hot_pixels`.
pub static EFFECT: Definition = Definition::new(
    "hot_pixels",
    "A share of the pixels has many times the mean dark current.",
    "calibration maps: 0.69 % of the pixels above five robust deviations",
    &[
        Param::number("fraction", Unit::One, (0.0, 1.0), 0.0, 0.007, "share of the pixels")
            .tried(Tried::amplitude((0.0, 0.05), &[0.004])),
        Param::number("factor", Unit::One, (0.0, 1e4), 1.0, 8.0, "their dark current over the mean")
            .tried(Tried::shape((1.5, 60.0), &[5.0, 12.0])),
        Param::number(
            "tail",
            Unit::One,
            (0.0, 1.0),
            0.0,
            0.0,
            "the hottest share q of them has q^-tail times that factor or more (a Pareto law)",
        )
        .coming_later(),
    ],
)
.with_edit(edit)
.with_moments(moments)
.part_of_a_scene()
.with_events(Events::Pixels);

fn edit(v: Values<'_>, _: &Sensor, circuit: &mut Circuit, pattern: &mut Pattern) {
    if v[0] == 0.0 {
        return;
    }
    let mean = circuit.dark_pa.iter().sum::<f64>() / circuit.dark_pa.len() as f64;
    for (dark, u) in circuit.dark_pa.iter_mut().zip(pattern.uniforms()) {
        if u < v[0] {
            // What is left of the draw is uniform again.
            let factor = if v[2] == 0.0 { v[1] } else { v[1] * libm::pow((u / v[0]).max(1e-6), -v[2]) };
            *dark += (factor - 1.0) * mean;
        }
    }
}

fn moments(v: Values<'_>, at: &Operating) -> Option<Moments> {
    if v[2] > 0.0 {
        // From a tail of a half on the law has no variance, and a few pixels decide.
        return None;
    }
    let extra = (v[1] - 1.0) * at.from_dark / at.increment();
    Some(Moments {
        rate: v[0] * (v[1] - 1.0) * at.from_dark,
        phase_variance: 0.0,
        spatial_variance: v[0] * (1.0 - v[0]) * extra * extra,
    })
}
