//! Decrease of the light towards the corners.

use super::prelude::*;

/// The effect `vignetting`.
pub static EFFECT: Definition = Definition::new(
    "vignetting",
    "The gain decreases with the square of the distance from the center of the sensor. Recordings do not distinguish vignetting from uneven light.",
    "calibration maps: 15 % from the center to a corner",
    &[Param::number("strength", Unit::Dimensionless, (0.0, 1.0), 0.0, 0.15, "lost share of the light at the corners")
        .with_search(SearchSpec::amplitude((0.0, 0.5), &[0.04, 0.2]))],
)
.with_edit(edit)
.with_moments(moments)
.scene_like()
.with_ambiguity_groups(&[AmbiguityGroup::SpatialPattern])
.with_caveat("light that decreases towards the corners has the same statistics");

fn edit(v: Values<'_>, _: &Sensor, circuit: &mut Circuit, _: &mut PatternRng) {
    let (width, height) = (circuit.geometry.width(), circuit.geometry.height());
    let center = |n: usize| (n as f64 - 1.0) / 2.0;
    let corner = (center(width).powi(2) + center(height).powi(2)).max(0.25);
    for (p, gain) in circuit.gain.iter_mut().enumerate() {
        let (row, col) = ((p / width) as f64, (p % width) as f64);
        let radius = (row - center(height)).powi(2) + (col - center(width)).powi(2);
        *gain *= 1.0 - v[0] * radius / corner;
    }
}

fn moments(v: Values<'_>, at: &OperatingPoint) -> Option<Moments> {
    // Let r be the distance from the center of a rectangle with sides w and h. The mean of r^2 / r_corner^2 over the
    // area is 1/3.
    // The variance over the area is 4/45 (w^4 + h^4)/(w^2 + h^2)^2, computed here for a sensor of 400x250 pixels.
    let share = at.from_light / at.increment();
    let (w, h) = (400.0f64.powi(2), 250.0f64.powi(2));
    let variance = 4.0 / 45.0 * (w * w + h * h) / ((w + h) * (w + h));
    Some(Moments {
        rate: -v[0] * at.from_light / 3.0,
        phase_variance: 0.0,
        spatial_variance: share * share * v[0] * v[0] * variance / (1.0 - v[0] * share / 3.0).powi(2),
    })
}
