//! Gain and dark current share a factor.

use crate::draws::pattern::Pattern;
use crate::effects::circuit::Circuit;
use crate::effects::definition::{Definition, Moments, Operating, Param, Tried, Values};
use crate::sensor::Sensor;
use crate::units::Unit;

/// The effect `gain_dark_correlation`.
pub static EFFECT: Definition = Definition::new(
    "gain_dark_correlation",
    "Pixels of high gain have a high dark current (or a low one); both spreads stay \
     what they are.",
    "a larger diode gathers more light and leaks more",
    &[Param::number(
        "correlation",
        Unit::One,
        (-1.0, 1.0),
        0.0,
        0.4,
        "correlation of gain and dark current over the pixels",
    )
    .tried(Tried::amplitude((-1.0, 1.0), &[0.3, -0.3]))],
)
.with_edit(edit)
.with_moments(moments)
.part_of_a_scene()
.coupling_the_spreads();

fn edit(v: Values<'_>, _: &Sensor, circuit: &mut Circuit, _: &mut Pattern) {
    let (gain, dark) = (Spread::of(&circuit.gain), Spread::of(&circuit.dark_pa));
    if v[0] == 0.0 || gain.deviation == 0.0 || dark.deviation == 0.0 {
        return;
    }
    let own = (1.0 - v[0] * v[0]).sqrt();
    for (current, g) in circuit.dark_pa.iter_mut().zip(&circuit.gain) {
        let z = v[0] * (g - gain.mean) / gain.deviation + own * (*current - dark.mean) / dark.deviation;
        // What had no negative currents keeps having none.
        *current = (dark.mean + dark.deviation * z).max(dark.least.min(0.0));
    }
}

struct Spread {
    mean: f64,
    deviation: f64,
    least: f64,
}

impl Spread {
    fn of(values: &[f64]) -> Self {
        let n = values.len() as f64;
        let mean = values.iter().sum::<f64>() / n;
        let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n;
        let least = values.iter().copied().fold(f64::INFINITY, f64::min);
        // What rounding leaves of pixels that are all alike is no spread.
        let alike = variance.sqrt() <= 1e-12 * mean.abs();
        Self { mean, deviation: if alike { 0.0 } else { variance.sqrt() }, least }
    }
}

fn moments(_: Values<'_>, _: &Operating) -> Option<Moments> {
    // Twice the product of both spreads, which an operating point does not hold.
    None
}
