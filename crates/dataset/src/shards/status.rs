//! The progress of a plan.

use serde::Serialize;

use super::journal;
use super::lock;
use super::plan::ShardPlan;
use spikelane::error::Result;
use spikelane_measure::upper_median;

/// A shard that a process is generating.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct RunningShard {
    /// Number of the shard.
    pub shard: u64,
    /// Host and process that have the lock.
    pub holder: String,
    /// Number of sequences of the shard that are processed.
    pub processed: u64,
}

/// Progress of the shards of a plan.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PlanStatus {
    /// Number of shards.
    pub shards: u64,
    /// Number of sequences.
    pub sequences: u64,
    /// Number of finished shards.
    pub done_shards: u64,
    /// Shards that a process is generating.
    pub running_shards: Vec<RunningShard>,
    /// Shards that are neither finished nor running.
    pub missing_shards: Vec<u64>,
    /// Number of failed sequences in finished shards.
    pub failed_sequences: u64,
    /// Median processing time of the finished shards in seconds.
    pub seconds_per_shard: Option<f64>,
}

impl PlanStatus {
    /// Returns the number of seconds that one process needs for the remaining shards. The estimate uses the median
    /// time per shard.
    #[must_use]
    pub fn seconds_left(&self) -> Option<f64> {
        let left = self.shards - self.done_shards;
        if left == 0 { Some(0.0) } else { self.seconds_per_shard.map(|s| s * left as f64) }
    }
}

/// Reads the progress of every shard. For a finished shard, the manifest is read. For any other shard, the lock is
/// tested.
///
/// `progress` receives the number of every shard. If `progress` returns an error, the function ends.
///
/// # Errors
/// [`ErrorKind::Corrupt`](spikelane::ErrorKind::Corrupt) if the manifest of a shard is damaged. Also errors of
/// reading.
pub fn plan_status(plan: &ShardPlan, progress: &mut dyn FnMut(u64) -> Result<()>) -> Result<PlanStatus> {
    let access = plan.options.access();
    let mut standing =
        PlanStatus { shards: plan.shards(), sequences: plan.sequences, ..PlanStatus::default() };
    let mut seconds = Vec::new();
    for shard in 0..plan.shards() {
        progress(shard)?;
        let folder = plan.shard_folder(shard, access)?;
        if let Some(head) = journal::read_head(&folder, access)? {
            standing.done_shards += 1;
            standing.failed_sequences = standing.failed_sequences.saturating_add(head.failed_sequences);
            seconds.push(head.seconds);
        } else if let Some(holder) = lock::holder(&lock::lock_path(&folder)) {
            let settled = journal::Journal::open(&folder, access)?.read()?.len() as u64;
            standing.running_shards.push(RunningShard { shard, holder, processed: settled });
        } else {
            standing.missing_shards.push(shard);
        }
    }
    standing.seconds_per_shard = (!seconds.is_empty()).then(|| upper_median(&mut seconds));
    Ok(standing)
}
