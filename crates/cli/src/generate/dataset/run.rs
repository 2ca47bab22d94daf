//! Implements `spikelane dataset run`.

use std::path::PathBuf;

use super::messages::{print_failures, print_outside_inputs};
use super::progress::DatasetProgress;
use crate::common::{Console, ThreadArgs, event};
use spikelane::{Error, ErrorKind, Result};
use spikelane_dataset::Access;
use spikelane_dataset::shards::{self, ShardOptions, ShardPlan, shard_numbers};

/// Generate the missing sequences of a shard; rerun to resume
///
/// After SIGTERM or SIGINT, the exit code is 75: queue the command again. If another process works on the shard, the
/// exit code is 10.
#[derive(clap::Args, Clone, Debug)]
pub(crate) struct Args {
    /// Use the plan in this folder
    #[arg(value_name = "DIR")]
    folder: PathBuf,
    /// Select shards, such as 0, 3,7-9 or all
    ///
    /// The first shard has the number 0.
    #[arg(long, value_name = "SHARDS")]
    shards: String,
    #[command(flatten)]
    threads: ThreadArgs,
    /// Also compare the digests of existing files
    #[arg(long)]
    verify: bool,
    /// Generate failed sequences again
    #[arg(long)]
    retry_failed: bool,
    /// Do not lock the shard
    ///
    /// Use --no-lock if the file system has no locks and the scheduler starts each shard only once.
    #[arg(long)]
    no_lock: bool,
    /// Follow links to files outside the folder
    ///
    /// By default, a link to a file outside the folder is an error.
    #[arg(long)]
    follow_links: bool,
}

/// Runs the command.
///
/// # Errors
/// Those of [`shards::generate_shard`]. [`ErrorKind::Requeue`] after a request to stop.
pub(crate) fn run(args: &Args, out: &Console) -> Result<()> {
    let plan = ShardPlan::open(&args.folder, Access::for_reading(args.follow_links))?;
    print_outside_inputs(&plan, out);
    let shard_options = ShardOptions {
        threads: args.threads.thread_count(out),
        verify_digests: args.verify,
        retry_failed: args.retry_failed,
        take_lock: !args.no_lock,
    };
    // All shards share one progress display, so a stop request between two shards is not lost.
    let mut watcher = DatasetProgress::new(out)?;
    let mut busy = None;
    for shard in shard_numbers::parse_shards(&args.shards, plan.shards())? {
        match run_shard(&plan, shard, &shard_options, &mut watcher, out) {
            Err(e) if e.kind() == ErrorKind::Busy => {
                // The other shards do not depend on the shard that another process is generating, so the loop
                // continues.
                out.print_message(format_args!("spikelane: {e}"));
                busy = Some(e);
            }
            other => other?,
        }
    }
    busy.map_or(Ok(()), Err)
}

fn run_shard(
    plan: &ShardPlan,
    shard: u64,
    shard_options: &ShardOptions,
    watcher: &mut DatasetProgress,
    out: &Console,
) -> Result<()> {
    let result = watcher
        .check_stop()
        .and_then(|()| shards::generate_shard(plan, shard, shard_options, &mut |p| watcher.update(p)));
    watcher.bar.clear();
    let report = result.map_err(|e| match e.kind() {
        ErrorKind::Interrupted => Error::new(ErrorKind::Requeue, "stopped on request")
            .remedy("finished sequences are kept; run the same command again"),
        _ => e,
    })?;
    let name = plan.shard_name(shard);
    let text = format!(
        "shard {name}: {} generated, {} kept, {} failed\n",
        report.generated,
        report.reused,
        report.failures.len()
    );
    let mut event = event("shard", &report)?;
    event["shard"] = shard.into();
    out.print_result(&event, &text)?;
    print_failures(&report.failures, &report.notes, out);
    Ok(())
}
