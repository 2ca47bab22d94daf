//! `spikelane verify`.

use std::path::{Path, PathBuf};

use serde_json::json;
use spikelane::unstable::inputs::Access;
use spikelane::{Error, Geometry, Kind, Result};
use spikelane_io::formats::{EVENTS, Layout, Reader};
use spikelane_io::simulate::{Sidecar, StreamFacts};
use spikelane_io::storage;

use crate::shared::output::Out;
use crate::shared::stream::{file_name, spikes_in};

/// Check streams against their sidecars
///
/// Compares the digest of every byte, then reads every frame. Exit code 9 when a file is not what
/// its sidecar says. A sidecar may be named in place of its streams; its clear images are then checked too.
#[derive(clap::Args, Debug)]
pub(crate) struct Args {
    /// Stream files, or sidecars (.json)
    #[arg(required = true)]
    files: Vec<PathBuf>,
    /// Read the files of a sidecar through links that leave its folder; without it they are refused
    #[arg(long)]
    follow_links: bool,
}

pub(crate) fn run(args: &Args, out: &Out) -> Result<()> {
    let mut failed = None;
    for path in &args.files {
        for checked in check(path, Access::reading(args.follow_links)) {
            match checked {
                Ok((file, facts)) => out.result(
                    &json!({"file": file.display().to_string(), "ok": true, "digest": facts.digest}),
                    &format!("{}: good, {}\n", file.display(), facts.digest),
                )?,
                Err(error) => {
                    out.event(&json!({"file": path.display().to_string(), "ok": false}))?;
                    // All files are looked at; the first error is the exit code.
                    if failed.is_some() {
                        out.say(format_args!("spikelane: {error}"));
                    }
                    failed = failed.or(Some(error));
                }
            }
        }
    }
    failed.map_or(Ok(()), Err)
}

type Checked = Result<(PathBuf, StreamFacts)>;

fn check(path: &Path, access: Access) -> Vec<Checked> {
    if path.extension().is_some_and(|e| e == "json") {
        return match Sidecar::read(path) {
            Err(e) => vec![Err(e)],
            Ok(sidecar) => {
                let streams = [Some(&sidecar.stream), sidecar.clean.as_ref()];
                let check = |facts: &StreamFacts| compare(&facts.beside(path, access)?, &sidecar, facts);
                let mut checked: Vec<Checked> = streams.into_iter().flatten().map(check).collect();
                checked.extend(pictures(path, &sidecar, access).err().map(Err));
                checked
            }
        };
    }
    vec![beside(path)]
}

/// Compares the clear images that the sidecar lists.
fn pictures(path: &Path, sidecar: &Sidecar, access: Access) -> Result<()> {
    for (file, expected) in sidecar.images_beside(path, access)? {
        let digest = storage::Digest::of_file(&file)?;
        if digest != expected {
            return Err(Error::new(Kind::Corrupt, file.display())
                .found(digest)
                .expected(format_args!("{expected}, as the sidecar says"))
                .remedy("the image was changed or cut; copy or simulate it again"));
        }
    }
    Ok(())
}

fn beside(path: &Path) -> Checked {
    std::fs::metadata(path).map_err(|e| Error::io(path.display(), e))?;
    let Some((_, sidecar)) = Sidecar::beside(path)? else {
        return Err(Error::new(Kind::Usage, path.display())
            .found("no sidecar beside it")
            .expected("the .json file that was written with the stream")
            .remedy("'spikelane inspect --digest' shows the digest of any stream"));
    };
    let facts = sidecar.facts(&file_name(path)).clone();
    compare(path, &sidecar, &facts)
}

fn compare(path: &Path, sidecar: &Sidecar, facts: &StreamFacts) -> Checked {
    let digest = storage::Digest::of_file(path)?;
    if digest != facts.digest {
        let bytes = std::fs::metadata(path).map_or(0, |m| m.len());
        return Err(Error::new(Kind::Corrupt, path.display())
            .found(format_args!("{bytes} bytes with {digest}"))
            .expected(format_args!("{} bytes with {}, as its sidecar says", facts.bytes, facts.digest))
            .remedy("the file was changed or cut; copy or simulate it again"));
    }
    if sidecar.layout == EVENTS {
        // A list has no frames to be read.
        return Ok((path.to_path_buf(), facts.clone()));
    }
    let layout = Layout::parse(&sidecar.layout)?;
    let geometry = Geometry::new(sidecar.width, sidecar.height)?;
    let reader = Reader::open(path, Some(layout), Some(geometry))?;
    let count = spikes_in(&reader, 0..reader.readouts())?;
    if (reader.readouts() as u64, count) != (sidecar.readouts, facts.spikes) {
        return Err(Error::new(Kind::Corrupt, path.display())
            .found(format_args!("{} readouts with {count} spikes", reader.readouts()))
            .expected(format_args!("{} with {}, as its sidecar says", sidecar.readouts, facts.spikes))
            .remedy("the sidecar belongs to another stream"));
    }
    Ok((path.to_path_buf(), facts.clone()))
}
