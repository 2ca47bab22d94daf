//! `spikelane dataset run`.

use std::path::PathBuf;

use serde_json::json;

use super::said::{say_apart, say_inputs};
use super::watcher::Watcher;
use crate::shared::output::Out;
use crate::shared::threads::ThreadArgs;
use spikelane::{Error, Kind, Result};
use spikelane_dataset::shards::{self, Plan, Running, numbers};

/// Make what is missing of a shard; the same command, given again, goes on
///
/// Ends with code 75 when it is asked to end (SIGTERM, SIGINT): queue it again. Code 10: another process
/// is at the shard.
#[derive(clap::Args, Clone, Debug)]
pub(crate) struct Args {
    /// Folder of the plan
    #[arg(value_name = "DIR")]
    folder: PathBuf,
    /// Numbers of shards, from 0: K, a list such as 3,7-9, or all
    #[arg(long, value_name = "K")]
    shard: String,
    #[command(flatten)]
    threads: ThreadArgs,
    /// Check the digest of every file that is there, not its size and time alone
    #[arg(long)]
    verify: bool,
    /// Try sequences again that were set aside
    #[arg(long)]
    retry: bool,
    /// Take no lock, where the file system has none and the scheduler starts each shard once
    #[arg(long)]
    no_lock: bool,
    /// Read files through links that leave the folder; without it they are refused
    #[arg(long)]
    follow_links: bool,
}

/// Runs the command.
///
/// # Errors
/// As [`shards::run`]; [`Kind::Requeue`] for a request to end.
pub(crate) fn run(args: &Args, out: &Out) -> Result<()> {
    let plan = Plan::read_with(&args.folder, args.follow_links)?;
    say_inputs(&plan, out);
    let how = Running {
        threads: args.threads.number(out),
        verify: args.verify,
        retry: args.retry,
        lock: !args.no_lock,
    };
    // One for all shards: a request to end that comes between two of them is heard by the next.
    let mut watcher = Watcher::new(out)?;
    let mut busy = None;
    for shard in numbers::parse(&args.shard, plan.shards())? {
        match one(&plan, shard, &how, &mut watcher, out) {
            Err(e) if e.kind() == Kind::Busy => {
                // The others need not wait for it.
                out.say(format_args!("spikelane: {e}"));
                busy = Some(e);
            }
            other => other?,
        }
    }
    busy.map_or(Ok(()), Err)
}

fn one(plan: &Plan, shard: u64, how: &Running, watcher: &mut Watcher, out: &Out) -> Result<()> {
    let made = watcher.go_on().and_then(|()| shards::run(plan, shard, how, &mut |p| watcher.step(p)));
    watcher.bar.finish_and_clear();
    watcher.bar.reset();
    let report = made.map_err(|e| match e.kind() {
        Kind::Interrupted => Error::new(Kind::Requeue, "stopped on request")
            .remedy("finished sequences are kept; queue the same command again"),
        _ => e,
    })?;
    let name = plan.shard_name(shard);
    let text = format!(
        "shard {name}: {} made, {} kept, {} set aside\n",
        report.made,
        report.kept,
        report.set_aside.len()
    );
    let set_aside: Vec<_> =
        report.set_aside.iter().map(|(input, why)| json!({"input": input, "reason": why})).collect();
    let event = json!({
        "event": "shard", "shard": shard, "made": report.made, "kept": report.kept, "set_aside": set_aside,
    });
    out.result(&event, &text)?;
    say_apart(&report.set_aside, &report.notes, out);
    Ok(())
}
