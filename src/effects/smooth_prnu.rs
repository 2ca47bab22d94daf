//! A gain that neighbours share.

use crate::draws::pattern::Pattern;
use crate::effects::circuit::Circuit;
use crate::effects::definition::{Definition, Moments, Operating, Param, Tried, Values};
use crate::sensor::Sensor;
use crate::units::Unit;

/// The effect `smooth_prnu`.
pub static EFFECT: Definition = Definition::new(
    "smooth_prnu",
    "The gain varies smoothly over the sensor: white noise blurred by a Gaussian, of \
     variance one before the spread.",
    "doping and thickness gradients of a wafer; low-frequency PRNU of EMVA 1288",
    &[
        Param::number("sigma", Unit::One, (0.0, 0.1), 0.0, 0.01, "spread of the gain")
            .tried(Tried::deviation((0.0, 0.1), &[0.02])),
        Param::number(
            "length",
            Unit::Pixel,
            (0.5, 64.0),
            3.0,
            3.0,
            "standard deviation of the blur; the correlation falls to 1/e at twice this \
     distance",
        )
        .tried(Tried::shape((0.5, 20.0), &[1.0, 2.0, 4.5])),
    ],
)
.with_edit(edit)
.with_moments(moments)
.part_of_a_scene();

fn edit(v: Values<'_>, _: &Sensor, circuit: &mut Circuit, pattern: &mut Pattern) {
    if v[0] == 0.0 {
        return;
    }
    let (width, height) = (circuit.geometry.width(), circuit.geometry.height());
    let white: Vec<f64> = pattern.normals().take(width * height).collect();
    let along = blurred(&white, width, 1, v[1]);
    let field = blurred(&along, height, width, v[1]);
    Circuit::spread(&mut circuit.gain, v[0], &field);
}

/// Blurs along an axis of `count` values that lie `step` apart. Weights end at three deviations and
/// at the border, and their squares sum to one, so that the variance stays the same everywhere.
fn blurred(values: &[f64], count: usize, step: usize, sigma: f64) -> Vec<f64> {
    let reach = (3.0 * sigma) as usize + 1;
    let weight: Vec<f64> = (0..=reach).map(|d| libm::exp(-0.5 * (d as f64 / sigma).powi(2))).collect();
    let mut result = vec![0.0; values.len()];
    for (i, slot) in result.iter_mut().enumerate() {
        let place = i / step % count;
        let line = i - place * step;
        let (mut sum, mut squares) = (0.0, 0.0);
        for other in place.saturating_sub(reach)..=(place + reach).min(count - 1) {
            let w = weight[place.abs_diff(other)];
            sum += w * values[line + other * step];
            squares += w * w;
        }
        *slot = sum / squares.sqrt();
    }
    result
}

fn moments(v: Values<'_>, at: &Operating) -> Option<Moments> {
    let share = at.from_light / at.increment();
    Some(Moments { spatial_variance: (share * v[0]).powi(2), ..Moments::default() })
}
