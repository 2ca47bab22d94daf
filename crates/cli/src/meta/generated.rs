//! Implements `spikelane completions` and `spikelane man`, which print files that follow from the command line definition.

use std::path::PathBuf;

use clap_complete::{Shell, generate};
use clap_mangen::Man;
use spikelane::{Error, Result};
use spikelane_io::storage;

use crate::common::{Console, claim_folder};

/// Print the completion script for a shell
#[derive(clap::Args, Debug)]
pub(crate) struct CompletionsArgs {
    /// Print the script for this shell
    shell: Shell,
}

pub(crate) fn print_completions(
    args: &CompletionsArgs,
    mut command: clap::Command,
    out: &Console,
) -> Result<()> {
    let mut text = Vec::new();
    generate(args.shell, &mut command, "spikelane", &mut text);
    out.print_bytes(&text)
}

/// Print the manual page
#[derive(clap::Args, Debug)]
pub(crate) struct ManArgs {
    /// Write a page per command to this folder
    #[arg(long, value_name = "DIR")]
    output: Option<PathBuf>,
    /// Overwrite existing files
    #[arg(long, requires = "output")]
    force: bool,
}

pub(crate) fn print_manual(args: &ManArgs, mut command: clap::Command, out: &Console) -> Result<()> {
    command.build();
    let Some(folder) = &args.output else { return out.print_bytes(&manual_page(command)?) };
    let _claim = claim_folder(folder)?;
    for sub in command.get_subcommands().filter(|c| c.get_name() != "help") {
        let name = format!("spikelane-{}", sub.get_name());
        storage::write_small(&folder.join(format!("{name}.1")), &manual_page(sub.clone())?, args.force)?;
    }
    storage::write_small(&folder.join("spikelane.1"), &manual_page(command)?, args.force)
}

fn manual_page(command: clap::Command) -> Result<Vec<u8>> {
    let mut text = Vec::new();
    Man::new(command).render(&mut text).map_err(|e| Error::io("manual page", e))?;
    Ok(text)
}
