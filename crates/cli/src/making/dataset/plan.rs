//! `spikelane dataset plan`.

use indicatif::DecimalBytes;
use serde_json::json;

use super::description::Description;
use super::said::say_skipped;
use crate::shared::output::Out;
use spikelane::{Error, Result};
use spikelane_dataset::Work;
use spikelane_dataset::shards::Plan;

/// Plan a dataset in shards, which any machine makes in any order
///
/// Of given inputs paths, sizes and times are listed and nothing is read. A plan is never changed.
#[derive(clap::Args, Clone, Debug)]
pub(crate) struct Args {
    #[command(flatten)]
    description: Description,
    /// Sequences of a shard: work of minutes to an hour
    #[arg(long, value_name = "P", value_parser = clap::value_parser!(u64).range(1..))]
    per_shard: u64,
    /// Make each finished shard one tar, in webdataset's naming
    #[arg(long)]
    pack: bool,
}

/// Runs the command.
///
/// # Errors
/// As [`Plan::make`].
pub(crate) fn run(args: &Args, out: &Out) -> Result<()> {
    let mut options = args.description.options(out)?;
    if let Work::Inputs(inputs) = &options.work {
        say_skipped(inputs, &options, out)?;
    }
    if let Work::Inputs(inputs) = &mut options.work {
        // A shard runs anywhere: its paths are whole.
        for path in std::iter::once(&mut inputs.folder).chain(&mut inputs.list) {
            *path = std::path::absolute(&*path).map_err(|e| Error::io(path.display(), e))?;
        }
    }
    let (plan, kept) = Plan::make(&options, args.per_shard, args.pack)?;
    let last = plan.shards().saturating_sub(1);
    let bytes = plan.estimated_bytes()?;
    let size = bytes.map_or(String::new(), |bytes| format!(", about {}", DecimalBytes(bytes)));
    let text = format!(
        "{}: {} sequences in {} shards{size}{}\nrun them: --array=0-{last} with 'spikelane dataset run {} --shard K'\n",
        plan.folder.display(),
        plan.sequences,
        plan.shards(),
        if kept { "; this plan was there and stays as it is" } else { "" },
        plan.folder.display(),
    );
    let event = json!({
        "event": "planned", "output": plan.folder.display().to_string(), "sequences": plan.sequences,
        "shards": plan.shards(), "per_shard": plan.per_shard, "pack": plan.pack, "kept": kept,
        "array": format!("0-{last}"),
    });
    out.result(&event, &text)
}
