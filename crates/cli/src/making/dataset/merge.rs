//! `spikelane dataset merge`.

use std::path::PathBuf;
use std::sync::atomic::Ordering;

use serde_json::json;

use super::said::{say_apart, say_copied, say_inputs};
use crate::shared::output::Out;
use crate::shared::progress::{Files, stop_flag};
use spikelane::{Error, Kind, Result};
use spikelane_dataset::shards::{self, Merging, Plan};

/// Verify all shards and make the dataset of them
///
/// Prints one digest, which is the same however the work was cut and which plain 'dataset' prints as well.
#[derive(clap::Args, Clone, Debug)]
pub(crate) struct Args {
    /// Folder of the plan
    #[arg(value_name = "DIR")]
    folder: PathBuf,
    /// Trust sizes and times; else every digest is verified
    #[arg(long)]
    quick: bool,
    /// Make no folders of loaders: their links are most of the work for the file system
    #[arg(long)]
    no_links: bool,
    /// Take no lock, where the file system has none and nobody else merges
    #[arg(long)]
    no_lock: bool,
    /// Read files through links that leave the folder; without it they are refused
    #[arg(long)]
    follow_links: bool,
}

/// Runs the command.
///
/// # Errors
/// As [`shards::merge`]; [`Kind::Input`] at the end when sequences were set aside.
pub(crate) fn run(args: &Args, out: &Out) -> Result<()> {
    let plan = Plan::read_with(&args.folder, args.follow_links)?;
    say_inputs(&plan, out);
    let stop = stop_flag()?;
    let mut bar = Files::new(out);
    let how = Merging { quick: args.quick, links: !args.no_links, lock: !args.no_lock };
    let merged = shards::merge(&plan, &how, &mut |shard, of| {
        if stop.load(Ordering::Relaxed) {
            return Err(Error::new(Kind::Requeue, "stopped on request").remedy("give the same command again"));
        }
        bar.step(plan.shard_name(shard).as_str(), shard as f64 / of.max(1) as f64);
        Ok(())
    });
    drop(bar);
    let merged = merged?;
    let place = plan.folder.display();
    let text = format!(
        "{place}: {} sequences, {} set aside\ndigest {}\n",
        merged.sequences,
        merged.set_aside.len(),
        merged.digest
    );
    let set_aside: Vec<_> =
        merged.set_aside.iter().map(|(input, why)| json!({"input": input, "reason": why})).collect();
    let event = json!({
        "event": "merged", "output": place.to_string(), "sequences": merged.sequences, "set_aside": set_aside,
        "digest": merged.digest, "copied": merged.copied,
    });
    out.result(&event, &text)?;
    say_apart(&merged.set_aside, &[], out);
    say_copied(merged.copied, out);
    if merged.set_aside.is_empty() {
        return Ok(());
    }
    Err(Error::new(Kind::Input, plan.folder.join("manifest.jsonl").display())
        .found(format_args!("{} sequences set aside", merged.set_aside.len()))
        .expected("none")
        .remedy("the manifest says why; the others are merged"))
}
