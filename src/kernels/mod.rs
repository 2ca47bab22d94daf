//! Runs a plan over (tile, many readouts).
//!
//! One generic body serves every vector backend; [`reference`](mod@reference)
//! does the same integers in plain scalar loops. All give the same bits.
//!
//! A tile is a run of neighbouring pixels. Within it the body keeps one vector
//! of pixels in registers over all readouts of a batch, because the order of
//! memory decides the speed: stepping whole frames is 1.7 times slower with
//! the same instructions.

mod backend;
mod batch;
pub mod bits;
mod body;
mod entry;
mod isa;
mod modulation;
pub mod reference;
mod start;

pub use backend::Backend;
pub use batch::{Batch, Job, Light, NoiseRound, Rounds, Samples, Segment};
pub use bits::AnyCpu;
pub use bits::{
    Bits, Counters, GROUPS, Places, ROOM, SHORTS, SLACK, Shorts, TILE, Tally, Times, WORDS, Work, counting,
    counting_with, load,
};
pub use modulation::{Around, Modulation};
pub(crate) use start::start;

use crate::plan::StateParts;

/// Runs `job` on `backend`, editing the tile's state and writing its bits:
/// `out` holds `job.tile_bytes()` bytes for every readout of the batch.
///
/// # Panics
/// When `out` or the state has another size than the job says, or the CPU
/// lacks the backend ([`Backend::available`] tells).
pub fn run(backend: Backend, job: &Job<'_>, state: &mut StateParts<'_>, out: &mut [u8]) {
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
