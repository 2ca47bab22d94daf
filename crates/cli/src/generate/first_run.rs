//! Runs the program without arguments: simulates a driving scene into ./out.

use std::path::{Path, PathBuf};

use clap::Parser as _;
use spikelane::{Error, ErrorKind, Result};
use spikelane_io::simulate::{Sidecar, StreamFacts};
use spikelane_io::storage;

use super::simulate::{Args, run as simulate};
use crate::command::{Cli, Command};
use crate::common::{Console, OutputNames, OutputStem};

const OUTPUT_FOLDER: &str = "out";

/// Largest number of output names that are tried.
const MAX_NAMES: usize = 1000;

pub(crate) fn run(out: &Console) -> Result<()> {
    let (stem, again) = free_stem()?;
    let args = Args { force: again, ..equivalent_arguments(&stem)? };
    out.print_message(format_args!(
        "Drawing a driving scene, and simulating a noisy and a clean stream with the camera 'physical' (400x250, 20 kHz)."
    ));
    simulate(&args, out)?;
    out.print_message("Next: 'spikelane --help', or docs/guides/first-video.md");
    Ok(())
}

/// Returns the arguments of `simulate` that lead to the same result.
fn equivalent_arguments(stem: &Path) -> Result<Args> {
    let stem = stem.display().to_string();
    let typed = ["spikelane", "simulate", "--clean", "-o", &stem];
    match Cli::try_parse_from(typed).map(|cli| cli.command) {
        Ok(Some(Command::Simulate(args))) => Ok(*args),
        _ => Err(Error::new(ErrorKind::Usage, "the main job").found("arguments that do not parse")),
    }
}

/// Returns `out/drive` or the next free name, and whether existing files of this name can be replaced.
///
/// The files can be replaced if this command wrote them and if they have not changed since. The same version of the
/// program then writes the same bytes, so no data are lost.
fn free_stem() -> Result<(PathBuf, bool)> {
    for i in 1..=MAX_NAMES {
        let stem = Path::new(OUTPUT_FOLDER).join(if i == 1 { "drive".into() } else { format!("drive-{i}") });
        let names = OutputNames::new(&OutputStem::new(&stem, None, "drive")?);
        let is_taken = names.files(true).into_iter().any(|path| path.symlink_metadata().is_ok());
        if !is_taken {
            return Ok((stem, false));
        }
        if is_own_output(&names) {
            return Ok((stem, true));
        }
    }
    Err(Error::new(ErrorKind::Exists, OUTPUT_FOLDER)
        .found(format_args!("{MAX_NAMES} outputs named drive"))
        .expected("a free number for the name of the output")
        .remedy("delete old outputs from this folder"))
}

fn is_own_output(names: &OutputNames) -> bool {
    let Ok(sidecar) = Sidecar::read(&names.sidecar) else { return false };
    let is_default_command = sidecar.command.len() == 1 && sidecar.version == env!("CARGO_PKG_VERSION");
    let unchanged = |path: &Path, facts: &StreamFacts| {
        storage::Digest::hash_file(path).is_ok_and(|digest| digest == facts.digest)
    };
    let clean = sidecar.clean.as_ref().is_some_and(|facts| unchanged(&names.clean_stream, facts));
    is_default_command && clean && unchanged(&names.stream, &sidecar.stream)
}
