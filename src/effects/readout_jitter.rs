//! Readout jitter: a random decision whether a pixel fires if its charge is close to the threshold at a readout.

use super::prelude::*;

/// A spread in pixels that is so large that all rows have practically equal jitter.
const UNIFORM_SPREAD_PX: f64 = 1e6;

/// Half the width of the band of rows with jitter, in units of `spread`. The kernels skip the jitter in all other rows.
const BAND_HALF_WIDTH_SIGMAS: f64 = 3.0;

/// The effect `readout_jitter`.
///
/// A diagnosis observes the distribution of the jitter widths, but not the positions of the rows with jitter. The
/// fitted band is therefore centered at the top row. A band at another position has equal statistics if it has equally
/// many rows of each width.
#[rustfmt::skip]
pub static EFFECT: Definition = Definition::new(
    "readout_jitter",
    "If the charge of a pixel is close to its threshold at a readout, the pixel reports the spike at random in this readout or the next one. The effect applies to a band of rows.",
    "metastability of a latch whose input changes while it is read; a static recording of a 400x250 camera shows it around row 207",
    &[
        Param::number("width", Unit::Dimensionless, (0.0, 0.05), 0.0, 0.008, "largest distance of the charge from the threshold at which the report is random, relative to the threshold, in the center row of the band")
            .with_search(SearchSpec::amplitude((0.0, 0.05), &[0.003, 0.01])),
        Param::number("row", Unit::Pixel, (0.0, 1e6), 0.0, 0.0, "center of the band, in rows from the top"),
        Param::number("spread", Unit::Pixel, (0.5, UNIFORM_SPREAD_PX), UNIFORM_SPREAD_PX, 8.0, "standard deviation of the Gaussian by which `width` decreases with the distance from the center row; rows beyond 3 standard deviations have no jitter, and 1000000 px covers all rows")
            .with_search(SearchSpec::shape((4.0, 2000.0), &[30.0, 120.0])),
    ],
)
.with_edit(edit)
.with_ops(|v, _| vec![Op::ReadoutJitter { width: v[0] }])
// No moments: jitter adds charge just below the threshold and removes charge just above the threshold. The added and removed
// charges cancel on average if the increment exceeds the width of the jitter. Otherwise the pixel gains charge, and
// the gain has no closed form here.
.with_caveat("the rows with the effect are not identified: a band around another row has nearly the same statistics, with half the spread if rows lie on both sides");

fn edit(v: Values<'_>, _: &Sensor, circuit: &mut Circuit, _: &mut PatternRng) {
    if v[0] == 0.0 {
        return;
    }
    let width = circuit.geometry.width();
    let share = |p: usize| {
        let away = ((p / width) as f64 - v[1]) / v[2];
        if away.abs() <= BAND_HALF_WIDTH_SIGMAS { libm::exp(-0.5 * away * away) } else { 0.0 }
    };
    circuit.jitter_share = (0..circuit.pixels()).map(share).collect();
}
