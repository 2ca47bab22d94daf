//! The border of the sensor is brighter than the rest.

use crate::draws::pattern::Pattern;
use crate::effects::circuit::Circuit;
use crate::effects::definition::{Definition, Moments, Operating, Param, Tried, Values};
use crate::sensor::Sensor;
use crate::units::Unit;

/// The effect `edge_columns`.
pub static EFFECT: Definition = Definition::new(
    "edge_columns",
    "Pixels of the first and last column and row have another gain, since no \
     neighbour shares their light.",
    "calibration maps of a 400x250 camera: the first column differs",
    &[
        Param::number(
            "factor",
            Unit::One,
            (0.0, 4.0),
            1.0,
            1.1,
            "gain of the border over that of the other pixels",
        )
        .tried(Tried::amplitude((0.3, 3.0), &[1.02, 1.1, 1.4, 0.9])),
        Param::choice("border", &["all", "first-column"], 0, "all four sides, or the first column alone")
            .coming_later(),
    ],
)
.with_edit(edit)
.with_moments(moments)
.part_of_a_scene();

fn edit(v: Values<'_>, _: &Sensor, circuit: &mut Circuit, _: &mut Pattern) {
    let (width, height) = (circuit.geometry.width(), circuit.geometry.height());
    for (p, gain) in circuit.gain.iter_mut().enumerate() {
        let (row, col) = (p / width, p % width);
        let others = v[1] == 0.0 && (row == 0 || row + 1 == height || col + 1 == width);
        if col == 0 || others {
            *gain *= v[0];
        }
    }
}

fn moments(_: Values<'_>, _: &Operating) -> Option<Moments> {
    // The share of the pixels that are border depends on the sensor's size.
    None
}
