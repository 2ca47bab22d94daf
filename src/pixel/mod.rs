//! The law of one pixel in `f64`, and the closed list of operations.
//!
//! This is the physics oracle: it follows Algorithm 1 of the SCSim paper
//! (arXiv 2405.16790) line by line, with the choices that the paper leaves
//! open as explicit data. It shares no code with the kernels, which compute
//! in integers; tests compare the two by statistics.

mod frame;
mod law;
mod parts;

pub use frame::Frame;
pub use law::{Law, Noise, State};
pub use parts::{Adaptation, Lag, Schedule, SlowNoise, Surround, Telegraph};

/// When threshold noise takes a new value.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Redraw {
    /// At every readout, as Algorithm 1 of the paper has it. A pixel then fires at its luckily low
    /// draws, so noise of zero mean raises the rate of dim pixels.
    EveryReadout,
    /// At every reset, and frozen until the next: what kTC noise does.
    EveryReset,
}

/// What the shot noise of the light counts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Quanta {
    /// Electrons, after the pixel's gain: as many per threshold as the nominal circuit holds.
    Electrons,
    /// Photons, before the pixel's gain: this many in a nominal threshold of light.
    Photons(f64),
}

/// One operation that a pixel carries out at readouts. The list is closed: a
/// new kind of arithmetic is a variant here. The compiler then names the places
/// in the law, the plan, the reference and the lanes, which all take it apart
/// without `..`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Op {
    /// The light arrives in quanta; the variance is scaled by `strength`.
    LightQuanta {
        /// What is counted.
        quanta: Quanta,
        /// Factor on the variance, 1 for the physics.
        strength: f64,
    },
    /// The dark current arrives in electrons; the variance is scaled by `strength`.
    DarkQuanta {
        /// Factor on the variance, 1 for the physics.
        strength: f64,
    },
    /// What the quanta stray by waits in front of the pixel's store and flows into it over some readouts.
    QuantaSettle {
        /// Readouts after which 1/e of it is still to come.
        time_constant: f64,
    },
    /// The threshold voltage carries noise, compared with and subtracted.
    ThresholdNoise {
        /// Standard deviation in volts.
        sigma_v: f64,
        /// When a new value is drawn.
        redraw: Redraw,
    },
    /// The first increment after a spike loses this share.
    FirstIncrement {
        /// Lost share, 0 to 1.
        lost: f64,
    },
    /// The charge that remains after a spike loses this share.
    Remainder {
        /// Lost share; 0 is a soft reset, 1 a hard one.
        lost: f64,
    },
    /// Stored charge is bounded.
    Ceiling {
        /// Largest charge in the pixel's own thresholds.
        thresholds: f64,
    },
    /// Bits flip on their way out; the charge knows nothing of it.
    Flip {
        /// Probability that a spike is not reported.
        missed: f64,
        /// Probability that a silent readout reports a spike.
        spurious: f64,
    },
    /// Light acts as `light (1 + quadratic light)`.
    Response {
        /// Relative change at full scale.
        quadratic: f64,
    },
    /// The light swings with the readouts.
    Flicker {
        /// Amplitude relative to the light.
        depth: f64,
        /// Swings per second.
        frequency_hz: f64,
        /// Phase at the first readout, in turns.
        phase_turns: f64,
    },
    /// The gain of the light changes steadily.
    Drift {
        /// Relative change when it is over.
        change: f64,
        /// Readouts that it takes.
        readouts: f64,
    },
    /// Stored charge loses a share at every readout.
    Leak {
        /// Lost share.
        fraction: f64,
    },
    /// Noise that is compared with, and not subtracted.
    ComparatorNoise {
        /// Standard deviation in the pixel's own thresholds.
        sigma: f64,
    },
    /// A pixel close to its threshold at a readout is drawn to it, and fires by chance; the circuit says which do.
    Undecided {
        /// How close, in the pixel's own thresholds, where the circuit's share is one.
        width: f64,
    },
    /// Noise of the threshold that the pixels of a row share.
    RowNoise {
        /// Standard deviation in the pixel's own thresholds.
        sigma: f64,
    },
    /// The threshold wanders: an Ornstein-Uhlenbeck process.
    SlowThresholdNoise {
        /// Standard deviation in the pixel's own thresholds.
        sigma: f64,
        /// Readouts after which the correlation has fallen to 1/e.
        time_constant: f64,
    },
    /// A spike raises the threshold, which then falls back.
    Adaptation {
        /// Rise per spike in the pixel's own thresholds.
        rise: f64,
        /// Share of the rise that a readout leaves.
        decay: f64,
    },
    /// The dark current of the pixels that the circuit marks switches between two values.
    Telegraph {
        /// Probability of switching per readout.
        rate: f64,
    },
    /// Part of the light arrives late.
    Lag {
        /// Late share.
        fraction: f64,
        /// Readouts after which 1/e of it is still to come.
        time_constant: f64,
    },
    /// Light is shared with the four neighbours.
    Crosstalk {
        /// Share given away, to the four together.
        share: f64,
    },
    /// A spike adds charge to its four neighbours at the next readout.
    SpikeCoupling {
        /// Charge in the neighbour's own thresholds.
        charge: f64,
    },
    /// Thresholds fall with the spikes of the previous readout.
    SupplyDroop {
        /// Fall when every pixel fired, in the pixel's own thresholds.
        depth: f64,
    },
    /// Whole readouts are lost.
    DropReadouts {
        /// Probability per readout.
        probability: f64,
    },
    /// Whole readouts are reported with the bits of the one before.
    RepeatReadouts {
        /// Probability per readout.
        probability: f64,
    },
    /// The charge at the first readout.
    Phase {
        /// Uniform over this share of the pixel's own threshold.
        share: f64,
        /// Uniform over this charge in femtocoulombs, added to the former.
        charge_fc: f64,
    },
}
