//! A different gain of the pixels at the border of the sensor.

use super::prelude::*;

/// The effect `edge_columns`.
#[rustfmt::skip]
pub static EFFECT: Definition = Definition::new(
    "edge_columns",
    "The pixels of the first and last rows and columns have a different gain, because these pixels lose no light across the border.",
    "calibration maps of a 400x250 camera: the first column differs",
    &[
        Param::number("factor", Unit::Dimensionless, (0.0, 4.0), 1.0, 1.1, "gain of the border pixels, relative to the gain of the other pixels")
            .with_search(SearchSpec::amplitude((0.3, 3.0), &[1.02, 1.1, 1.4, 0.9])),
        Param::choice("border", &["all", "first-column"], 0, "border pixels: all four sides, or only the first column")
            .omit_if_neutral(),
    ],
)
.with_edit(edit)
// No moments: the share of border pixels depends on the sensor's size, which `OperatingPoint` does not contain.
.scene_like()
.with_ambiguity_groups(&[AmbiguityGroup::SpatialPattern]);

fn edit(v: Values<'_>, _: &Sensor, circuit: &mut Circuit, _: &mut PatternRng) {
    let (width, height) = (circuit.geometry.width(), circuit.geometry.height());
    for (p, gain) in circuit.gain.iter_mut().enumerate() {
        let (row, col) = (p / width, p % width);
        let others = v[1] == 0.0 && (row == 0 || row + 1 == height || col + 1 == width);
        if col == 0 || others {
            *gain *= v[0];
        }
    }
}
