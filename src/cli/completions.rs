//! `spikelane completions`.

use clap::CommandFactory as _;
use clap_complete::{Shell, generate};
use spikelane::Result;

use super::Cli;
use super::output::Out;

/// Print completions for a shell
#[derive(clap::Args, Debug)]
pub struct Args {
    shell: Shell,
}

pub fn run(args: &Args, out: &Out) -> Result<()> {
    let mut text = Vec::new();
    generate(args.shell, &mut Cli::command(), "spikelane", &mut text);
    out.bytes(&text)
}
