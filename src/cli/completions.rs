//! `spikelane completions`.

use crate::Result;
use clap_complete::{Shell, generate};

use super::output::Out;
use super::words;

/// Print completions for a shell
#[derive(clap::Args, Debug)]
pub struct Args {
    shell: Shell,
}

pub fn run(args: &Args, out: &Out) -> Result<()> {
    let mut text = Vec::new();
    generate(args.shell, &mut words::command(), "spikelane", &mut text);
    out.bytes(&text)
}
