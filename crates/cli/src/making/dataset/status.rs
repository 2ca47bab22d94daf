//! `spikelane dataset status`.

use std::path::PathBuf;
use std::sync::atomic::Ordering;

use serde_json::json;

use crate::shared::output::Out;
use crate::shared::progress::stop_flag;
use spikelane::{Error, Kind, Result};
use spikelane_dataset::shards::{self, Plan, Standing, numbers};
use spikelane_measure::report::with_known;

/// Say which shards are done, at work and missing
#[derive(clap::Args, Clone, Debug)]
pub(crate) struct Args {
    /// Folder of the plan
    #[arg(value_name = "DIR")]
    folder: PathBuf,
    /// Read files through links that leave the folder; without it they are refused
    #[arg(long)]
    follow_links: bool,
}

/// Runs the command.
///
/// # Errors
/// As [`shards::status`].
pub(crate) fn run(args: &Args, out: &Out) -> Result<()> {
    let plan = Plan::read_with(&args.folder, args.follow_links)?;
    let stop = stop_flag()?;
    let standing = shards::status(&plan, &mut |_| {
        if stop.load(Ordering::Relaxed) {
            return Err(Error::new(Kind::Interrupted, "stopped on request"));
        }
        Ok(())
    })?;
    let running: Vec<_> = standing
        .running
        .iter()
        .map(|at| json!({"shard": at.shard, "holder": at.holder, "settled": at.settled}))
        .collect();
    let about = json!({
        "event": "status", "shards": standing.shards, "sequences": standing.sequences, "done": standing.done,
        "running": running, "missing": standing.missing.len(), "set_aside": standing.set_aside,
    });
    let array = (!standing.missing.is_empty()).then(|| numbers::text(&standing.missing).into());
    let more = [
        ("array", array),
        ("seconds_per_shard", standing.seconds_per_shard.map(Into::into)),
        ("seconds_left", standing.seconds_left().map(Into::into)),
    ];
    out.result(&with_known(about, more), &text(&standing))
}

fn text(standing: &Standing) -> String {
    let mut text = format!(
        "done       {} of {} shards\nset aside  {} sequences\n",
        standing.done, standing.shards, standing.set_aside
    );
    for at in &standing.running {
        text += &format!("running    shard {}: {}, {} sequences settled\n", at.shard, at.holder, at.settled);
    }
    if !standing.missing.is_empty() {
        text += &format!("missing    --array={}\n", numbers::text(&standing.missing));
    }
    if let (Some(each), Some(left)) = (standing.seconds_per_shard, standing.seconds_left()) {
        text += &format!("time       {each:.1} s a shard (median), {left:.0} s left for one process\n");
    }
    text
}
