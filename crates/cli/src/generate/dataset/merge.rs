//! Implements `spikelane dataset merge`.

use std::path::PathBuf;
use std::sync::atomic::Ordering;

use super::messages::{print_copied_files, print_failures, print_outside_inputs};
use crate::common::{Console, FileProgress, event, stop_flag};
use spikelane::unstable::Count;
use spikelane::{Error, ErrorKind, Result};
use spikelane_dataset::Access;
use spikelane_dataset::shards::{self, MergeOptions, ShardPlan};

/// Verify all shards and merge them into the dataset
///
/// The command prints one digest of the dataset. The digest does not depend on the division into shards, and equals the
/// digest that 'spikelane dataset' prints for the same options.
#[derive(clap::Args, Clone, Debug)]
pub(crate) struct Args {
    /// Use the plan in this folder
    #[arg(value_name = "DIR")]
    folder: PathBuf,
    /// Compare the sizes and times of files, not the digests
    #[arg(long)]
    no_verify: bool,
    /// Do not create the folders for data loaders
    ///
    /// Creating links in these folders is most of the file system's work in a merge.
    #[arg(long)]
    no_links: bool,
    /// Do not lock the folder of the plan
    ///
    /// Use --no-lock if the file system has no locks and no other process merges this plan.
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
/// Those of [`shards::merge`]. After merging, [`ErrorKind::Input`] if sequences failed.
pub(crate) fn run(args: &Args, out: &Console) -> Result<()> {
    let plan = ShardPlan::open(&args.folder, Access::for_reading(args.follow_links))?;
    print_outside_inputs(&plan, out);
    let stop = stop_flag()?;
    let mut bar = FileProgress::new(out);
    let options = MergeOptions {
        verify_digests: !args.no_verify,
        create_links: !args.no_links,
        take_lock: !args.no_lock,
    };
    let merged = shards::merge(&plan, &options, &mut |shard, count| {
        if stop.load(Ordering::Relaxed) {
            return Err(
                Error::new(ErrorKind::Requeue, "stopped on request").remedy("run the same command again")
            );
        }
        bar.update(plan.shard_name(shard).as_str(), shard as f64 / count.max(1) as f64);
        Ok(())
    });
    drop(bar);
    let merged = merged?;
    let place = plan.folder.display();
    let text = format!(
        "{place}: {}, {} failed\ndigest {}\n",
        Count(merged.sequences, "sequence"),
        merged.failures.len(),
        merged.digest
    );
    let mut event = event("merged", &merged)?;
    event["output"] = place.to_string().into();
    out.print_result(&event, &text)?;
    print_failures(&merged.failures, &[], out);
    print_copied_files(merged.copied_files, out);
    if merged.failures.is_empty() {
        return Ok(());
    }
    Err(Error::new(ErrorKind::Input, plan.folder.join("manifest.jsonl").display())
        .found(Count(merged.failures.len(), "failed sequence"))
        .expected("none")
        .remedy("see the manifest for the reasons; the other sequences are merged"))
}
