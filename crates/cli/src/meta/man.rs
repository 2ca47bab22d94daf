//! Implements `spikelane man`.

use std::path::PathBuf;

use clap_mangen::Man;
use spikelane::{Error, Result};
use spikelane_io::storage;

use crate::common::console::Console;
use crate::common::output_claims;

/// Print the manual page
#[derive(clap::Args, Debug)]
pub(crate) struct Args {
    /// Write a page per command to this folder
    #[arg(long, value_name = "DIR")]
    output: Option<PathBuf>,
    /// Overwrite existing files
    #[arg(long, requires = "output")]
    force: bool,
}

pub(crate) fn run(args: &Args, mut command: clap::Command, out: &Console) -> Result<()> {
    command.build();
    let Some(folder) = &args.output else { return out.print_bytes(&manual_page(command)?) };
    let _claim = output_claims::claim_folder(folder)?;
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
