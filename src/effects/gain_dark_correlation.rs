//! Correlation between the gain and the dark current of a pixel.

use super::prelude::*;

/// The effect `gain_dark_correlation`.
#[rustfmt::skip]
pub static EFFECT: Definition = Definition::new(
    "gain_dark_correlation",
    "Pixels with a high gain have a high dark current, or a low dark current if the correlation is negative. The standard deviations of gain and dark current do not change.",
    "a larger diode collects more light and leaks more",
    &[Param::number("correlation", Unit::Dimensionless, (-1.0, 1.0), 0.0, 0.4, "correlation of gain and dark current over the pixels")
        .with_search(SearchSpec::amplitude((-1.0, 1.0), &[0.3, -0.3]))],
)
.with_edit(edit)
// No moments: the added spatial variance is proportional to the product of the spreads of gain and dark current, and
// `OperatingPoint` does not contain these spreads.
.scene_like()
.with_coupled_spreads();

fn edit(v: Values<'_>, _: &Sensor, circuit: &mut Circuit, _: &mut PatternRng) {
    let (gain, dark) = (Spread::from_values(&circuit.gain), Spread::from_values(&circuit.dark_pa));
    if v[0] == 0.0 || gain.deviation == 0.0 || dark.deviation == 0.0 {
        return;
    }
    let independent = (1.0 - v[0] * v[0]).sqrt();
    for (current, g) in circuit.dark_pa.iter_mut().zip(&circuit.gain) {
        let z = v[0] * (g - gain.mean) / gain.deviation + independent * (*current - dark.mean) / dark.deviation;
        // If all original currents were nonnegative, the lower bound is 0. The correlation therefore makes no current
        // negative.
        *current = (dark.mean + dark.deviation * z).max(dark.min.min(0.0));
    }
}

struct Spread {
    mean: f64,
    deviation: f64,
    min: f64,
}

impl Spread {
    fn from_values(values: &[f64]) -> Self {
        let n = values.len() as f64;
        let mean = values.iter().sum::<f64>() / n;
        let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n;
        let minimum = values.iter().copied().fold(f64::INFINITY, f64::min);
        // Rounding errors give equal values a small nonzero deviation. Such a deviation is replaced by zero.
        let alike = variance.sqrt() <= 1e-12 * mean.abs();
        Self { mean, deviation: if alike { 0.0 } else { variance.sqrt() }, min: minimum }
    }
}
