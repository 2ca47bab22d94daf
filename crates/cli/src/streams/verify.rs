//! Implements `spikelane verify`.

use std::path::{Path, PathBuf};

use serde_json::json;
use spikelane::unstable::Count;
use spikelane::unstable::inputs::Access;
use spikelane::{Error, ErrorKind, Geometry, Result};
use spikelane_io::formats::{EVENTS_LAYOUT, Layout, StreamReader};
use spikelane_io::simulate::{Sidecar, StreamFacts};
use spikelane_io::storage;

use crate::common::{Console, count_spikes, file_name};

/// Verify streams against their sidecars
///
/// The command compares the digest of each file with the sidecar, then reads every frame. If a file differs from its
/// sidecar, the exit code is 9. If you name a sidecar, its streams and its reference images are verified.
#[derive(clap::Args, Debug)]
pub(crate) struct Args {
    /// Verify these streams, or all files of sidecars (.json)
    #[arg(required = true)]
    files: Vec<PathBuf>,
    /// Follow links to files outside the folder
    ///
    /// By default, a link to a file outside the folder is an error.
    #[arg(long)]
    follow_links: bool,
}

pub(crate) fn run(args: &Args, out: &Console) -> Result<()> {
    let mut failed = None;
    for path in &args.files {
        for checked in check(path, Access::for_reading(args.follow_links)) {
            match checked {
                Ok((file, facts)) => out.print_result(
                    &json!({"file": file.display().to_string(), "ok": true, "digest": facts.digest}),
                    &format!("{}: good, {}\n", file.display(), facts.digest),
                )?,
                Err(error) => {
                    out.print_event(&json!({"file": path.display().to_string(), "ok": false}))?;
                    // All files are verified, even after an error. The first error determines the exit code.
                    if failed.is_some() {
                        out.print_message(format_args!("spikelane: {error}"));
                    }
                    failed = failed.or(Some(error));
                }
            }
        }
    }
    failed.map_or(Ok(()), Err)
}

type CheckResult = Result<(PathBuf, StreamFacts)>;

fn check(path: &Path, access: Access) -> Vec<CheckResult> {
    if path.extension().is_some_and(|e| e == "json") {
        return match Sidecar::read(path) {
            Err(e) => vec![Err(e)],
            Ok(sidecar) => {
                let streams = [Some(&sidecar.stream), sidecar.clean.as_ref()];
                let check = |facts: &StreamFacts| {
                    compare_with_sidecar(&facts.path_beside(path, access)?, &sidecar, facts)
                };
                let mut checked: Vec<CheckResult> = streams.into_iter().flatten().map(check).collect();
                checked.extend(verify_images(path, &sidecar, access).err().map(Err));
                checked
            }
        };
    }
    vec![check_sidecar(path)]
}

/// Verifies the digests of the reference images that the sidecar lists.
fn verify_images(path: &Path, sidecar: &Sidecar, access: Access) -> Result<()> {
    for (file, expected) in sidecar.image_paths(path, access)? {
        let digest = storage::Digest::hash_file(&file)?;
        if digest != expected {
            return Err(Error::new(ErrorKind::Corrupt, file.display())
                .found(digest)
                .expected(format_args!("{expected}, as in the sidecar"))
                .remedy("the image was changed or truncated; copy or simulate the image again"));
        }
    }
    Ok(())
}

fn check_sidecar(path: &Path) -> CheckResult {
    std::fs::metadata(path).map_err(|e| Error::io(path.display(), e))?;
    let Some((_, sidecar)) = Sidecar::read_beside(path)? else {
        return Err(Error::new(ErrorKind::Usage, path.display())
            .found("no sidecar beside the stream")
            .expected("the .json file that was written with the stream")
            .remedy("'spikelane inspect --digest' prints the digest of any stream"));
    };
    let facts = sidecar.stream_facts(&file_name(path)).clone();
    compare_with_sidecar(path, &sidecar, &facts)
}

fn compare_with_sidecar(path: &Path, sidecar: &Sidecar, facts: &StreamFacts) -> CheckResult {
    let digest = storage::Digest::hash_file(path)?;
    if digest != facts.digest {
        let bytes = std::fs::metadata(path).map_or(0, |m| m.len());
        return Err(Error::new(ErrorKind::Corrupt, path.display())
            .found(format_args!("{} with {digest}", Count(bytes, "byte")))
            .expected(format_args!("{} with {}, as in the sidecar", Count(facts.bytes, "byte"), facts.digest))
            .remedy("the file was changed or truncated; copy or simulate the stream again"));
    }
    if sidecar.layout == EVENTS_LAYOUT {
        // A list of events contains no frames, so the checks below do not apply.
        return Ok((path.to_path_buf(), facts.clone()));
    }
    let layout = Layout::parse(&sidecar.layout)?;
    let geometry = Geometry::new(sidecar.width, sidecar.height)?;
    let reader = StreamReader::open(path, Some(layout), Some(geometry))?;
    let count = count_spikes(&reader, 0..reader.readouts())?;
    if (reader.readouts() as u64, count) != (sidecar.readouts, facts.spikes) {
        return Err(Error::new(ErrorKind::Corrupt, path.display())
            .found(format_args!("{} with {}", Count(reader.readouts(), "readout"), Count(count, "spike")))
            .expected(format_args!("{} with {}, as in the sidecar", sidecar.readouts, facts.spikes))
            .remedy("the sidecar belongs to another stream"));
    }
    Ok((path.to_path_buf(), facts.clone()))
}
