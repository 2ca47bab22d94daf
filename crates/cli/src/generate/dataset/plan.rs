//! Implements `spikelane dataset plan`.

use indicatif::DecimalBytes;
use serde_json::json;

use super::messages::print_skipped_files;
use super::spec::DatasetSpec;
use crate::common::Console;
use spikelane::unstable::Count;
use spikelane::{Error, Result};
use spikelane_dataset::Content;
use spikelane_dataset::shards::ShardPlan;

/// Plan a dataset in shards that any machine generates in any order
///
/// For videos and images, the plan lists paths, sizes and times without reading the files. An existing plan is never
/// changed.
#[derive(clap::Args, Clone, Debug)]
pub(crate) struct Args {
    #[command(flatten)]
    description: DatasetSpec,
    /// Set the number of sequences per shard
    ///
    /// Choose a number of sequences that one process can generate in minutes to an hour.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    sequences_per_shard: u64,
    /// Pack each finished shard into a tar file for webdataset
    #[arg(long)]
    pack: bool,
}

/// Runs the command.
///
/// # Errors
/// Those of [`ShardPlan::create`].
pub(crate) fn run(args: &Args, out: &Console) -> Result<()> {
    let mut options = args.description.options(out)?;
    if let Content::Inputs(inputs) = &options.content {
        print_skipped_files(inputs, &options, out)?;
    }
    if let Content::Inputs(inputs) = &mut options.content {
        // A shard can be generated in any working directory, so the paths in the plan must be absolute.
        for path in std::iter::once(&mut inputs.folder).chain(&mut inputs.list) {
            *path = std::path::absolute(&*path).map_err(|e| Error::io(path.display(), e))?;
        }
    }
    let (plan, is_existing) = ShardPlan::create(&options, args.sequences_per_shard, args.pack)?;
    let last = plan.shards().saturating_sub(1);
    let bytes = plan.estimated_bytes()?;
    let size = bytes.map_or(String::new(), |bytes| format!(", about {}", DecimalBytes(bytes)));
    let text = format!(
        "{}: {} in {}{size}{}\nrun the shards: --array=0-{last} with 'spikelane dataset run {} --shards K'\n",
        plan.folder.display(),
        Count(plan.sequences, "sequence"),
        Count(plan.shards(), "shard"),
        if is_existing { "; the existing plan was not changed" } else { "" },
        plan.folder.display(),
    );
    let event = json!({
        "event": "planned", "output": plan.folder.display().to_string(), "sequences": plan.sequences,
        "shards": plan.shards(), "sequences_per_shard": plan.sequences_per_shard, "pack_shards": plan.pack_shards, "already_planned": is_existing,
        "shard_array": format!("0-{last}"),
    });
    out.print_result(&event, &text)
}
