//! The kernels, written once over [`Lanes`](super::isa::lanes::Lanes).
//!
//! For every vector of pixels of the tile: load its constants and state into
//! registers, step through the readouts of a pass, store the state. What
//! changes with the light is computed once for every stretch of equal light
//! ([`increment::Increment`]), also when that stretch is a single readout.
//!
//! A pass is the whole batch when frames are held. When they change faster, it
//! ends after [`pass::FRAMES`] frames, so that the frames are read side by side as
//! few long streams, and each pass asks for the next one's lines; a hundred
//! frames at once, one cache line from each, ran at a quarter of the speed.
//!
//! Const parameters make the common cases free of tests: the `NOISE` of the
//! threshold ([`NONE`], [`READOUT`], [`RESET`]), how charge is stored (`STORE`:
//! [`FREE`], [`CLAMPED`], [`SURPLUS`]), `WHOLE` for increments without a
//! fraction. With `ANY` the plan is asked at run time instead, and any of its rules
//! apply; with `EXTRA` it is asked so only where two vectors cannot run
//! together, and of those rules there are a dead time and flipped bits. What
//! moves has a body of its own, [`moving`]. The table of all is in [`case`].

mod any_rules;
mod arriving;
mod case;
mod fresh;
mod increment;
mod lingering;
mod moving;
mod noiseless;
mod noisy;
mod pair;
mod pass;
mod pixels;
mod step;
mod way;

#[cfg(target_arch = "x86_64")]
pub(super) use case::by_general_case;
pub(super) use case::{Entry, by_case, run};

/// No threshold noise.
const NONE: u8 = 0;
/// Threshold noise in whole steps, drawn at every readout.
const READOUT: u8 = 1;
/// Threshold noise in whole steps, drawn at every reset.
const RESET: u8 = 2;

/// Added to the kind of threshold noise: what quanta stray by waits, or pixels are undecided. Which of both is asked at run time.
const LATE: u8 = 4;

/// The kind of threshold noise alone.
const fn kind(noise: u8) -> u8 {
    noise & !LATE
}

/// Charge cannot pass two thresholds: nothing to watch.
const FREE: u8 = 0;
/// Charge is bounded.
const CLAMPED: u8 = 1;
/// Charge beyond a threshold is counted in whole thresholds.
const SURPLUS: u8 = 2;
