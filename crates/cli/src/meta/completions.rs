//! Implements `spikelane completions`.

use clap_complete::{Shell, generate};
use spikelane::Result;

use crate::common::console::Console;

/// Print the completion script for a shell
#[derive(clap::Args, Debug)]
pub(crate) struct Args {
    /// Print the script for this shell
    shell: Shell,
}

pub(crate) fn run(args: &Args, mut command: clap::Command, out: &Console) -> Result<()> {
    let mut text = Vec::new();
    generate(args.shell, &mut command, "spikelane", &mut text);
    out.print_bytes(&text)
}
