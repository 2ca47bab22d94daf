//! Pixels that cannot decide at a readout whether they have fired.

use crate::draws::pattern::Pattern;
use crate::effects::circuit::Circuit;
use crate::effects::definition::{Definition, Moments, Operating, Param, Tried, Values};
use crate::pixel::Op;
use crate::sensor::Sensor;
use crate::units::Unit;

/// All rows alike.
const EVERYWHERE: f64 = 1e6;

/// Rows further from the centre than this many spreads have none, so that they run at full speed.
const REACH: f64 = 3.0;

/// The effect `readout_jitter`. A diagnosis sees how unequally rows have it, and not which of them: it fits a band that begins at the top row. The
/// same widths in the same number of rows elsewhere show as well.
pub static EFFECT: Definition = Definition::new(
    "readout_jitter",
    "A pixel whose charge is within a width of its threshold at a readout is drawn to it and reports its spike then or at the \
     next readout, as chance has it. It happens to a band of rows.",
    "metastability of a latch whose input changes as it is read; a static recording of a 400x250 camera has it about row 207",
    &[
        Param::number(
            "width",
            Unit::One,
            (0.0, 0.05),
            0.0,
            0.008,
            "distance from the threshold within which a pixel is undecided, relative to it, in the row of the centre",
        )
        .tried(Tried::amplitude((0.0, 0.05), &[0.003, 0.01])),
        Param::number("row", Unit::Pixel, (0.0, 1e6), 0.0, 0.0, "centre of the band, rows from the top"),
        Param::number(
            "spread",
            Unit::Pixel,
            (0.5, EVERYWHERE),
            EVERYWHERE,
            8.0,
            "standard deviation of the Gaussian with which the width falls off, cut at three; 1000000 px is all rows",
        )
        .tried(Tried::shape((4.0, 2000.0), &[30.0, 120.0])),
    ],
)
.with_edit(edit)
.with_ops(ops)
.with_moments(moments);

fn edit(v: Values<'_>, _: &Sensor, circuit: &mut Circuit, _: &mut Pattern) {
    if v[0] == 0.0 {
        return;
    }
    let width = circuit.geometry.width();
    let share = |p: usize| {
        let away = ((p / width) as f64 - v[1]) / v[2];
        if away.abs() <= REACH { libm::exp(-0.5 * away * away) } else { 0.0 }
    };
    circuit.undecided = (0..circuit.pixels()).map(share).collect();
}

fn ops(v: Values<'_>, _: &Sensor) -> Vec<Op> {
    vec![Op::Undecided { width: v[0] }]
}

fn moments(_: Values<'_>, _: &Operating) -> Option<Moments> {
    // Charge that is gained below the threshold is lost above it, where an increment is larger than the width; dimmer pixels gain.
    None
}
