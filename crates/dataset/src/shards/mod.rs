//! Datasets that are too large for one machine. Such a dataset is planned, generated in shards and merged.
//!
//! A [`ShardPlan`] defines the sequences of each shard. [`generate_shard`] generates the missing sequences of one
//! shard while the shard is locked. The process may be killed at any moment and started again. Shards can be generated
//! on any machine and in any order. [`plan_status`] reports the remaining work. [`merge()`] verifies all shards and
//! completes the dataset. The names, seeds and bytes of a sequence do not depend on the division into shards.

mod finished;
mod input_list;
mod journal;
mod lock;
mod merge;
mod pack;
mod plan;
mod run;
pub mod shard_numbers;
mod status;
mod tar_file;

#[cfg(test)]
mod write_order_tests;

/// Returns the number of complete lines of the journal in `folder`. Fuzz tests use this function.
///
/// # Errors
/// [`ErrorKind::Io`](spikelane::ErrorKind::Io) if the journal cannot be read.
pub fn count_journal_lines(folder: &std::path::Path) -> spikelane::Result<usize> {
    Ok(journal::Journal::open(folder, spikelane::unstable::inputs::Access::Read)?.read()?.len())
}

pub(super) use finished::{read_plan_entries, read_shard_entries};
pub use merge::{MergeOptions, MergeReport, merge};
pub use plan::ShardPlan;
pub use run::{ShardOptions, ShardReport, generate_shard};
pub use status::{PlanStatus, RunningShard, plan_status};
