//! The law of one pixel in `f64`, and the closed list of operations.
//!
//! This is the physics oracle: it follows Algorithm 1 of the SCSim paper
//! (arXiv 2405.16790) line by line, with the choices that the paper leaves
//! open as explicit data. It shares no code with the kernels, which compute
//! in integers; tests compare the two by statistics.

mod law;

pub use law::{Law, Noise, State};

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
/// new kind of arithmetic is a variant here, and the compiler then names the
/// places in the law, the plan, the reference and the lanes.
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
    /// The charge at the first readout.
    Phase {
        /// Uniform over this share of the pixel's own threshold.
        share: f64,
        /// Uniform over this charge in femtocoulombs, added to the former.
        charge_fc: f64,
    },
}
