//! Light falls off towards the corners.

use crate::draws::pattern::Pattern;
use crate::effects::circuit::Circuit;
use crate::effects::definition::{Definition, Moments, Operating, Param, Tried, Values};
use crate::sensor::Sensor;
use crate::units::Unit;

/// The effect `vignetting`.
pub static EFFECT: Definition = Definition::new(
    "vignetting",
    "The gain falls with the square of the distance from the centre; not separable \
     from uneven light.",
    "calibration maps: 15 % from centre to corner",
    &[Param::number("strength", Unit::One, (0.0, 1.0), 0.0, 0.15, "lost share of the light at the corners")
        .tried(Tried::amplitude((0.0, 0.5), &[0.04, 0.2]))],
)
.with_edit(edit)
.with_moments(moments)
.part_of_a_scene();

fn edit(v: Values<'_>, _: &Sensor, circuit: &mut Circuit, _: &mut Pattern) {
    let (width, height) = (circuit.geometry.width(), circuit.geometry.height());
    let centre = |n: usize| (n as f64 - 1.0) / 2.0;
    let corner = (centre(width).powi(2) + centre(height).powi(2)).max(0.25);
    for (p, gain) in circuit.gain.iter_mut().enumerate() {
        let (row, col) = ((p / width) as f64, (p % width) as f64);
        let radius = (row - centre(height)).powi(2) + (col - centre(width)).powi(2);
        *gain *= 1.0 - v[0] * radius / corner;
    }
}

fn moments(v: Values<'_>, at: &Operating) -> Option<Moments> {
    // Over a rectangle of sides w, h the mean of r^2 over the corner's is 1/3; its
    // variance, 4/45 (w^4 + h^4)/(w^2 + h^2)^2, is given for 400x250.
    let share = at.from_light / at.increment();
    let (w, h) = (400.0f64.powi(2), 250.0f64.powi(2));
    let variance = 4.0 / 45.0 * (w * w + h * h) / ((w + h) * (w + h));
    Some(Moments {
        rate: -v[0] * at.from_light / 3.0,
        phase_variance: 0.0,
        spatial_variance: share * share * v[0] * v[0] * variance / (1.0 - v[0] * share / 3.0).powi(2),
    })
}
