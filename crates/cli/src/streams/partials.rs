//! Implements `spikelane partials`.

use std::path::PathBuf;

use indicatif::DecimalBytes;
use serde_json::json;
use spikelane::{Error, Result};
use spikelane_io::storage::unfinished::{UnfinishedOutput, find_unfinished, remove};

use crate::common::Console;

/// List unfinished files that killed processes left in a folder
///
/// The command searches DIR and all folders inside DIR for hidden files and folders of this program:
/// .NAME.PID-N.spikelane.partial, .NAME.spikelane.partial and .NAME.lock. Without --delete, nothing is deleted. Files of a running process are never deleted.
#[derive(clap::Args, Debug)]
pub(crate) struct Args {
    /// Search this folder
    #[arg(value_name = "DIR", default_value = ".")]
    folder: PathBuf,
    /// Delete the unfinished files whose process has ended
    #[arg(long)]
    delete: bool,
}

pub(crate) fn run(args: &Args, out: &Console) -> Result<()> {
    if !std::fs::metadata(&args.folder).map_err(|e| Error::io(args.folder.display(), e))?.is_dir() {
        return Err(Error::new(spikelane::ErrorKind::Usage, args.folder.display())
            .found("a file")
            .expected("a folder, in which unfinished files are listed"));
    }
    let (mut deleted, mut bytes) = (0_u64, 0);
    let unfinished = find_unfinished(&args.folder)?;
    for one in &unfinished {
        let gone = args.delete && one.is_running == Some(false) && remove(one)?;
        deleted += u64::from(gone);
        bytes += one.bytes;
        let event = json!({
            "event": "partial", "file": one.path.display().to_string(), "bytes": one.bytes,
            "process": one.process, "running": one.is_running, "deleted": gone,
        });
        let state = if gone { "deleted" } else { process_state(one) };
        let process = one.process.map_or(String::new(), |id| format!("process {id}, "));
        out.print_result(
            &event,
            &format!("{}: {process}{state}, {}\n", one.path.display(), DecimalBytes(one.bytes)),
        )?;
    }
    let left = match (unfinished.len(), args.delete) {
        (0, _) => "no unfinished files".to_owned(),
        (n, false) => {
            format!(
                "{n} unfinished, {}; --delete deletes the files whose process has ended",
                DecimalBytes(bytes)
            )
        }
        (n, true) => format!("{deleted} of {n} deleted"),
    };
    out.print_message(format_args!("{}: {left}", args.folder.display()));
    out.print_event(&json!({"event": "done", "partials": unfinished.len(), "deleted": deleted}))
}

/// Returns whether the process that writes the file is still running, as text.
fn process_state(one: &UnfinishedOutput) -> &'static str {
    match one.is_running {
        Some(true) => "running",
        Some(false) => "ended",
        None => "unknown, because this file system has no locks",
    }
}
