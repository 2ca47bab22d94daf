//! The flags of the sandbox of a method.

use std::path::PathBuf;

use serde_json::json;

use crate::common::console::Console;
use spikelane::Result;
use spikelane_benchmark::run::{RunOptions, SandboxOptions, SandboxState};

#[derive(clap::Args, Debug)]
pub(super) struct SandboxArgs {
    /// Let the method read only system folders and this folder (repeatable)
    ///
    /// Without this flag, the method can read all files except those of the suite and of the run.
    #[arg(long, value_name = "DIR", conflicts_with = "no_sandbox")]
    allow_read: Vec<PathBuf>,
    /// Also let the method write to this folder, such as a cache (repeatable)
    #[arg(long, value_name = "DIR", conflicts_with = "no_sandbox")]
    allow_write: Vec<PathBuf>,
    /// Run a method that you trust without a sandbox
    #[arg(long)]
    no_sandbox: bool,
}

impl SandboxArgs {
    /// Returns whether a flag is set.
    pub(super) fn is_set(&self) -> bool {
        self.no_sandbox || !self.allow_read.is_empty() || !self.allow_write.is_empty()
    }

    pub(super) fn options(&self) -> SandboxOptions {
        SandboxOptions {
            is_enabled: !self.no_sandbox,
            allow_read: self.allow_read.clone(),
            allow_write: self.allow_write.clone(),
        }
    }
}

/// Prints whether the processes of the method are restricted.
///
/// # Errors
/// Those of [`SandboxOptions::state`].
pub(super) fn print_state(options: &RunOptions, out: &Console) -> Result<()> {
    let Some(state) = options.sandbox.state(&options.method)? else { return Ok(()) };
    out.print_message(match state {
        SandboxState::Active => "sandbox active: the method cannot read the suite and the run",
        SandboxState::Off => "sandbox off: the method can read and change all files of this user",
        _ => {
            "sandbox absent: the method can read and change all files of this user; \
             a sandbox needs Linux 5.13 with Landlock"
        }
    });
    out.print_event(&json!({"event": "sandbox", "state": state}))
}
