//! `spikelane completions`.

use clap_complete::{Shell, generate};
use spikelane::Result;

use crate::shared::output::Out;

/// Print completions for a shell
#[derive(clap::Args, Debug)]
pub(crate) struct Args {
    shell: Shell,
}

pub(crate) fn run(args: &Args, mut command: clap::Command, out: &Out) -> Result<()> {
    let mut text = Vec::new();
    generate(args.shell, &mut command, "spikelane", &mut text);
    out.bytes(&text)
}
