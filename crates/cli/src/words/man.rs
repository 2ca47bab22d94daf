//! `spikelane man`.

use std::path::PathBuf;

use clap_mangen::Man;
use spikelane::{Error, Result};
use spikelane_io::storage;

use crate::shared::output::Out;
use crate::shared::outputs;

/// Print the manual page
#[derive(clap::Args, Debug)]
pub(crate) struct Args {
    /// Write spikelane.1 and a page for each command into this folder instead
    #[arg(long, value_name = "DIR")]
    dir: Option<PathBuf>,
    /// Overwrite pages of the same name
    #[arg(long, requires = "dir")]
    force: bool,
}

pub(crate) fn run(args: &Args, mut command: clap::Command, out: &Out) -> Result<()> {
    command.build();
    let Some(folder) = &args.dir else { return out.bytes(&page(command)?) };
    let _claim = outputs::claim_folder(folder)?;
    for sub in command.get_subcommands().filter(|c| c.get_name() != "help") {
        let name = format!("spikelane-{}", sub.get_name());
        storage::write_small(&folder.join(format!("{name}.1")), &page(sub.clone())?, args.force)?;
    }
    storage::write_small(&folder.join("spikelane.1"), &page(command)?, args.force)
}

fn page(command: clap::Command) -> Result<Vec<u8>> {
    let mut text = Vec::new();
    Man::new(command).render(&mut text).map_err(|e| Error::io("manual page", e))?;
    Ok(text)
}
