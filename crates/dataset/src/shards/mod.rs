//! Datasets that outgrow one machine: a plan, shards that run anywhere and in any order, and their merging.
//!
//! A [`Plan`] fixes what each shard makes. [`run`] makes what is missing of one, under a lock, and may be killed at any
//! moment. [`status`] says what is left, and [`merge`] verifies all and makes the dataset. A sequence's
//! name, seeds and bytes do not depend on how the work is cut.

mod journal;
mod list;
mod lock;
mod merge;
pub mod numbers;
mod pack;
mod packed;
mod plan;
mod run;
mod status;

#[cfg(test)]
mod order;

/// Returns how many whole lines the journal in `folder` has; for fuzzing.
///
/// # Errors
/// When the journal cannot be read.
pub fn journal_lines(folder: &std::path::Path) -> spikelane::Result<usize> {
    Ok(journal::Journal::of(folder, spikelane::unstable::inputs::Access::Read)?.read()?.len())
}

pub use merge::{Merged, Merging, merge};
pub use plan::Plan;
pub use run::{Running, ShardReport, run};
pub use status::{AtWork, Standing, status};
