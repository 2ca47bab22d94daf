//! Gain variations that are smooth across the sensor.

use super::prelude::*;

/// The effect `smooth_prnu`.
#[rustfmt::skip]
pub static EFFECT: Definition = Definition::new(
    "smooth_prnu",
    "The gain varies smoothly over the sensor. The map of the gain is Gaussian-blurred white noise, scaled to the standard deviation `sigma`.",
    "doping and thickness gradients of a wafer; low-frequency PRNU of EMVA 1288",
    &[
        Param::number("sigma", Unit::Dimensionless, (0.0, 0.1), 0.0, 0.01, "standard deviation of the gain over the pixels")
            .with_search(SearchSpec::deviation((0.0, 0.1), &[0.02])),
        Param::number("length", Unit::Pixel, (0.5, 64.0), 3.0, 3.0, "standard deviation of the Gaussian blur; the correlation of the gain is 1/e at twice this distance")
            .with_search(SearchSpec::shape((0.5, 20.0), &[1.0, 2.0, 4.5])),
    ],
)
.with_edit(edit)
.with_moments(|v, at| {
    let share = at.from_light / at.increment();
    Some(Moments { spatial_variance: (share * v[0]).powi(2), ..Moments::default() })
})
.scene_like()
.with_ambiguity_groups(&[AmbiguityGroup::Neighbors, AmbiguityGroup::SpatialPattern]);

fn edit(v: Values<'_>, _: &Sensor, circuit: &mut Circuit, pattern: &mut PatternRng) {
    if v[0] == 0.0 {
        return;
    }
    let (width, height) = (circuit.geometry.width(), circuit.geometry.height());
    let white: Vec<f64> = pattern.normals().take(width * height).collect();
    let along = gaussian_blur(&white, width, 1, v[1]);
    let field = gaussian_blur(&along, height, width, v[1]);
    Circuit::apply_spread(&mut circuit.gain, v[0], &field);
}

/// Blurs white noise along one axis. The axis has `count` values, and successive values are `step` elements apart.
///
/// The Gaussian weights are cut at three standard deviations and at the border. The weights of each result are scaled
/// so that their squares sum to one. The variance is therefore equal everywhere.
fn gaussian_blur(values: &[f64], count: usize, step: usize, sigma: f64) -> Vec<f64> {
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
