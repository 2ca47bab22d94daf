//! Counts and transposes bits, and finds the positions of set bits. `measure` and `diagnose` read streams with these
//! functions.
//!
//! This module does not run plans. It uses the instruction sets of the kernels, but no other code of the kernels.

#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;
mod bit_ops;
mod bit_planes;
mod counters;
mod dispatch;
mod first_spikes;
mod i16_lanes;
mod tally;

pub use bit_ops::{BLOCK_WORDS, BitOps, MAX_SPIKES, OVERRUN, Positions};
pub use bit_planes::ROW_WORDS;
pub use counters::{Counters, MAX_GROUPS, load_row};
pub use dispatch::{Task, dispatch, dispatch_f64_task, dispatch_task};
pub use first_spikes::{SearchOrder, first_spikes};
pub use i16_lanes::{AnyCpu, I16_LANES, I16Lanes};
pub use tally::{SpikeTimes, Tally};
