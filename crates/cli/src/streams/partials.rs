//! `spikelane partials`.

use std::path::PathBuf;

use indicatif::DecimalBytes;
use serde_json::json;
use spikelane::{Error, Result};
use spikelane_io::storage::unfinished::{Unfinished, remove, unfinished};

use crate::shared::output::Out;

/// List unfinished files that killed processes left in a folder
///
/// Looks for the hidden files and folders of this program (.NAME.PID-N.partial, .NAME.partial, .NAME.lock) in DIR and in
/// all folders below. Nothing is deleted without --delete, and never what a running process writes.
#[derive(clap::Args, Debug)]
pub(crate) struct Args {
    /// Folder to look through
    #[arg(value_name = "DIR", default_value = ".")]
    folder: PathBuf,
    /// Delete those whose process has ended
    #[arg(long)]
    delete: bool,
}

pub(crate) fn run(args: &Args, out: &Out) -> Result<()> {
    if !std::fs::metadata(&args.folder).map_err(|e| Error::io(args.folder.display(), e))?.is_dir() {
        return Err(Error::new(spikelane::Kind::Usage, args.folder.display())
            .found("a file")
            .expected("a folder, whose unfinished files are listed"));
    }
    let (mut deleted, mut bytes) = (0_u64, 0);
    let found = unfinished(&args.folder)?;
    for one in &found {
        let gone = args.delete && one.running == Some(false) && remove(one)?;
        deleted += u64::from(gone);
        bytes += one.bytes;
        let event = json!({
            "event": "partial", "file": one.path.display().to_string(), "bytes": one.bytes,
            "process": one.process, "running": one.running, "deleted": gone,
        });
        let state = if gone { "deleted" } else { state(one) };
        let process = one.process.map_or(String::new(), |id| format!("process {id}, "));
        out.result(
            &event,
            &format!("{}: {process}{state}, {}\n", one.path.display(), DecimalBytes(one.bytes)),
        )?;
    }
    let left = match (found.len(), args.delete) {
        (0, _) => "no unfinished files".to_owned(),
        (n, false) => {
            format!("{n} unfinished, {}; --delete removes those whose process has ended", DecimalBytes(bytes))
        }
        (n, true) => format!("{deleted} of {n} deleted"),
    };
    out.say(format_args!("{}: {left}", args.folder.display()));
    out.event(&json!({"event": "done", "partials": found.len(), "deleted": deleted}))
}

/// Whether somebody works on it.
fn state(one: &Unfinished) -> &'static str {
    match one.running {
        Some(true) => "running",
        Some(false) => "ended",
        None => "unknown, since this file system has no locks",
    }
}
