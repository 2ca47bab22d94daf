//! Implements `spikelane dataset status`.

use std::path::PathBuf;
use std::sync::atomic::Ordering;

use serde_json::json;

use crate::common::{Console, stop_flag};
use spikelane::unstable::Count;
use spikelane::{Error, ErrorKind, Result};
use spikelane_dataset::Access;
use spikelane_dataset::shards::{self, PlanStatus, ShardPlan, shard_numbers};
use spikelane_measure::report::insert_present;

/// List finished, running and missing shards
#[derive(clap::Args, Clone, Debug)]
pub(crate) struct Args {
    /// Use the plan in this folder
    #[arg(value_name = "DIR")]
    folder: PathBuf,
    /// Follow links to files outside the folder
    ///
    /// By default, a link to a file outside the folder is an error.
    #[arg(long)]
    follow_links: bool,
}

/// Runs the command.
///
/// # Errors
/// Those of [`shards::plan_status`].
pub(crate) fn run(args: &Args, out: &Console) -> Result<()> {
    let plan = ShardPlan::open(&args.folder, Access::for_reading(args.follow_links))?;
    let stop = stop_flag()?;
    let standing = shards::plan_status(&plan, &mut |_| {
        if stop.load(Ordering::Relaxed) {
            return Err(Error::new(ErrorKind::Interrupted, "stopped on request"));
        }
        Ok(())
    })?;
    let event = json!({
        "event": "status", "shards": standing.shards, "sequences": standing.sequences, "done_shards": standing.done_shards,
        "running_shards": standing.running_shards, "missing_shards": standing.missing_shards.len(), "failed_sequences": standing.failed_sequences,
    });
    let array = (!standing.missing_shards.is_empty())
        .then(|| shard_numbers::format_shards(&standing.missing_shards).into());
    let more = [
        ("shard_array", array),
        ("seconds_per_shard", standing.seconds_per_shard.map(Into::into)),
        ("seconds_left", standing.seconds_left().map(Into::into)),
    ];
    out.print_result(&insert_present(event, more), &status_text(&standing))
}

fn status_text(standing: &PlanStatus) -> String {
    let mut text = format!(
        "done       {} of {}\nfailed     {}\n",
        standing.done_shards,
        Count(standing.shards, "shard"),
        Count(standing.failed_sequences, "sequence"),
    );
    for at in &standing.running_shards {
        text += &format!(
            "running    shard {}: {}, {} processed\n",
            at.shard,
            at.holder,
            Count(at.processed, "sequence"),
        );
    }
    if !standing.missing_shards.is_empty() {
        text += &format!("missing    --array={}\n", shard_numbers::format_shards(&standing.missing_shards));
    }
    if let (Some(each), Some(left)) = (standing.seconds_per_shard, standing.seconds_left()) {
        text +=
            &format!("time       {each:.1} s per shard (median), {left:.0} s remaining for one process\n");
    }
    text
}
