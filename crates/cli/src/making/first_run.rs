//! The program without arguments: a driving scene into ./out.

use std::path::{Path, PathBuf};

use clap::Parser as _;
use spikelane::{Error, Kind, Result};
use spikelane_io::simulate::{Sidecar, StreamFacts};
use spikelane_io::storage;

use super::names::Names;
use super::simulate::{Args, run as simulate};
use crate::command::{Cli, Command};
use crate::shared::output::Out;
use crate::shared::stem::Stem;

const FOLDER: &str = "out";

/// The names that are tried before giving up.
const MOST: usize = 1000;

pub(crate) fn run(out: &Out) -> Result<()> {
    let (stem, again) = stem()?;
    let args = Args { force: again, ..arguments(&stem)? };
    out.say(format_args!(
        "Drawing a driving scene and simulating it with the camera 'physical' (400x250, 20 kHz), noisy and clean."
    ));
    simulate(&args, out)?;
    out.say("Next: 'spikelane --help', or docs/guides/first-video.md");
    Ok(())
}

/// What a user would type for the same thing.
fn arguments(stem: &Path) -> Result<Args> {
    let stem = stem.display().to_string();
    let typed = ["spikelane", "simulate", "--clean", "-o", &stem];
    match Cli::try_parse_from(typed).map(|cli| cli.command) {
        Ok(Some(Command::Simulate(args))) => Ok(*args),
        _ => Err(Error::new(Kind::Usage, "the main job").found("arguments that do not parse")),
    }
}

/// `out/drive`, or the next free name; and whether its files may be replaced.
///
/// They may when they are this very job's: made without arguments, and not changed since. The same
/// version then writes the same bytes, so nothing is lost.
fn stem() -> Result<(PathBuf, bool)> {
    for i in 1..=MOST {
        let stem = Path::new(FOLDER).join(if i == 1 { "drive".into() } else { format!("drive-{i}") });
        let names = Names::new(&Stem::new(&stem, None, "drive")?);
        let taken = names.files(true).into_iter().any(|path| path.symlink_metadata().is_ok());
        if !taken {
            return Ok((stem, false));
        }
        if is_ours(&names) {
            return Ok((stem, true));
        }
    }
    Err(Error::new(Kind::Exists, FOLDER)
        .found(format_args!("{MOST} drives"))
        .expected("a free name")
        .remedy("clear the folder"))
}

fn is_ours(names: &Names) -> bool {
    let Ok(sidecar) = Sidecar::read(&names.sidecar) else { return false };
    let plain = sidecar.command.len() == 1 && sidecar.version == env!("CARGO_PKG_VERSION");
    let unchanged = |path: &Path, facts: &StreamFacts| {
        storage::Digest::of_file(path).is_ok_and(|digest| digest == facts.digest)
    };
    let clean = sidecar.clean.as_ref().is_some_and(|facts| unchanged(&names.clean, facts));
    plain && clean && unchanged(&names.noisy, &sidecar.stream)
}
