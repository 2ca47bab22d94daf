//! Kernels that simulate a tile of pixels for many readouts.
//!
//! The source of the kernels is generic, and every vector backend uses it. [`reference`](mod@reference) computes the same
//! integers in plain scalar loops. All backends return equal bits.
//!
//! A tile is a range of neighboring pixels. A kernel keeps one vector of the tile in registers for all readouts of a
//! batch, because the order of memory accesses determines the speed. A kernel that runs all vectors of a frame before the
//! next frame is 1.7 times slower with the same instructions.

mod backend;
mod batch;
pub mod bits;
mod body;
mod entry;
mod isa;
mod modulation;
pub mod reference;
mod start;

pub use crate::light::samples::Samples;
pub use backend::Backend;
pub use batch::{Batch, Job, NoiseRoundKeys, RoundKeys, Segment, SegmentLight};
pub use bits::{
    AnyCpu, BLOCK_WORDS, BitOps, Counters, I16_LANES, I16Lanes, MAX_GROUPS, MAX_SPIKES, OVERRUN, Positions,
    ROW_WORDS, SearchOrder, SpikeTimes, Tally, Task, dispatch, dispatch_task, first_spikes, load_row,
};
pub use modulation::{Modulation, SpikeFeedback};
pub(crate) use start::initial_state;

use crate::plan::StateTile;

/// Runs `job` on `backend`, updates the state of the tile and writes the reported bits of the tile.
///
/// `out` contains `job.tile_bytes()` bytes for every readout of the batch.
///
/// # Panics
/// Panics if the size of `out` or of the state differs from the size that the job requires. Also panics if the CPU
/// cannot run the backend ([`Backend::is_available`]).
pub fn run(backend: Backend, job: &Job<'_>, state: &mut StateTile<'_>, out: &mut [u8]) {
    assert_eq!(out.len(), job.batch.readouts() * job.tile_bytes(), "output size");
    assert_eq!(state.charge.len(), job.pixels(), "state size");
    match backend {
        Backend::Reference => reference::run(job, state, out),
        Backend::Portable => entry::portable(job, state, out),
        #[cfg(target_arch = "x86_64")]
        Backend::Sse41 => entry::sse41(job, state, out),
        #[cfg(target_arch = "x86_64")]
        Backend::Avx2 => entry::avx2(job, state, out),
        #[cfg(target_arch = "x86_64")]
        Backend::Avx512 => entry::avx512(job, state, out),
        #[cfg(not(target_arch = "x86_64"))]
        _ => panic!("backend {backend} is not built for this CPU"),
    }
}
