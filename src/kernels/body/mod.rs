//! The kernels. Their source is generic over [`Lanes`](super::isa::lanes::Lanes) and serves every vector instruction set.
//!
//! A kernel visits the vectors of a tile. For each vector, the kernel loads constants and state into registers, runs the
//! readouts of a pass, and stores the state. Values that depend on the light are computed once for every period of
//! constant light ([`increment::Increment`]), even if the period is a single readout.
//!
//! A frame that is held for [`pass::MIN_HELD_READOUTS`] or more readouts is a separate pass. Other segments are grouped
//! into passes of at most [`pass::MAX_PASS_FRAMES`] segments. A pass thus reads a few frames in parallel, each as a long
//! stream, and prefetches the cache lines of the next pass. A pass of a hundred frames would read one cache line of each
//! frame at a time and would have a quarter of the speed.
//!
//! Const parameters remove conditional branches from the common cases:
//! * `NOISE` is the kind of threshold noise: [`NOISE_NONE`], [`NOISE_READOUT`] or [`NOISE_RESET`], with or without the
//!   flag [`CORRELATED`].
//! * `STORE` is the storage of charge: [`STORE_FREE`], [`STORE_CLAMPED`] or [`STORE_SURPLUS`].
//! * `WHOLE` is set if increments have no fraction.
//! * `ANY` is set if the kernel reads the plan's rules at run time. Any rule may then apply.
//! * `EXTRA` is set only if `ANY` is set. It permits the kernel for two vectors, which supports a dead time and flipped
//!   bits, but no other extra rule. The kernel for one vector reads the rules at run time.
//!
//! Plans with dynamics have a separate kernel in [`dynamics`]. [`case`] contains the table of all cases.

mod case;
mod dynamics;
mod general;
mod incident_light;
mod increment;
mod interpolated;
mod noiseless;
mod noisy;
mod pair;
mod pass;
mod per_readout;
mod pixels;
mod slow_state;
mod step;

#[cfg(target_arch = "x86_64")]
pub(super) use case::by_general_case;
pub(super) use case::{Entry, by_case, run};

/// No threshold noise.
const NOISE_NONE: u8 = 0;
/// Threshold noise in whole steps, drawn at every readout.
const NOISE_READOUT: u8 = 1;
/// Threshold noise in whole steps, drawn at every reset.
const NOISE_RESET: u8 = 2;

/// Flag that is added to the kind of threshold noise if noise of the quanta can be pending or pixels have jitter.
///
/// Kernels read at run time which of the two applies.
const CORRELATED: u8 = 4;

/// Returns the kind of threshold noise without [`CORRELATED`].
const fn noise_kind(noise: u8) -> u8 {
    noise & !CORRELATED
}

/// The charge is always below two thresholds, so the kernel neither clamps the charge nor counts surplus.
const STORE_FREE: u8 = 0;
/// Charge is clamped.
const STORE_CLAMPED: u8 = 1;
/// Charge above one threshold is counted in whole thresholds as surplus.
const STORE_SURPLUS: u8 = 2;
