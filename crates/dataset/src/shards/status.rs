//! How far the work of a plan is.

use super::journal;
use super::lock;
use super::plan::Plan;
use spikelane::error::Result;
use spikelane_measure::upper_median;

/// A shard that somebody is at.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AtWork {
    /// Its number.
    pub shard: u64,
    /// Host and process.
    pub holder: String,
    /// Its sequences that are settled.
    pub settled: u64,
}

/// How far the shards of a plan are.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Standing {
    /// All shards.
    pub shards: u64,
    /// All sequences.
    pub sequences: u64,
    /// Shards that are done.
    pub done: u64,
    /// Shards that somebody is at.
    pub running: Vec<AtWork>,
    /// Shards that are neither done nor somebody's.
    pub missing: Vec<u64>,
    /// Sequences set aside, of shards that are done.
    pub set_aside: u64,
    /// Median seconds of the shards that are done.
    pub seconds_per_shard: Option<f64>,
}

impl Standing {
    /// Seconds that one process would still take, by the median.
    #[must_use]
    pub fn seconds_left(&self) -> Option<f64> {
        let left = self.shards - self.done;
        if left == 0 { Some(0.0) } else { self.seconds_per_shard.map(|s| s * left as f64) }
    }
}

/// Looks at every shard: one file of those that are done, the lock of the others. `watch` hears of every shard, and its
/// error ends it.
///
/// # Errors
/// When a shard's manifest is damaged or cannot be read.
pub fn status(plan: &Plan, watch: &mut dyn FnMut(u64) -> Result<()>) -> Result<Standing> {
    let access = plan.options.access();
    let mut standing = Standing { shards: plan.shards(), sequences: plan.sequences, ..Standing::default() };
    let mut seconds = Vec::new();
    for shard in 0..plan.shards() {
        watch(shard)?;
        let folder = plan.shard_folder(shard, access)?;
        if let Some(head) = journal::read_head(&folder, access)? {
            standing.done += 1;
            standing.set_aside = standing.set_aside.saturating_add(head.failed);
            seconds.push(head.seconds);
        } else if let Some(holder) = lock::holder(&lock::place(&folder)) {
            let settled = journal::Journal::of(&folder, access)?.read()?.len() as u64;
            standing.running.push(AtWork { shard, holder, settled });
        } else {
            standing.missing.push(shard);
        }
    }
    standing.seconds_per_shard = (!seconds.is_empty()).then(|| upper_median(&mut seconds));
    Ok(standing)
}
