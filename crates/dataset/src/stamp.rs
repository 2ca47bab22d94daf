//! How an input or a file is known again: by size and time, or by its digest.

use std::fs;
use std::path::{Path, PathBuf};
use std::time::UNIX_EPOCH;

use serde::{Deserialize, Serialize};

use spikelane::error::{Error, Result};
use spikelane::unstable::inputs::InputFile;
use spikelane_io::light::picture;
use spikelane_io::storage::Digest;

/// The images of a folder.
pub(super) fn pictures_in(folder: &Path) -> Result<Vec<PathBuf>> {
    let mut all = Vec::new();
    for entry in fs::read_dir(folder).map_err(|e| Error::io(folder.display(), e))? {
        let image = entry.map_err(|e| Error::io(folder.display(), e))?.path();
        if image.is_file() && picture::is_picture(&image) {
            all.push(image);
        }
    }
    Ok(all)
}

/// Size and time of an input: of a folder the sum of its images' sizes and the latest of their times.
pub(super) fn of(path: &Path) -> Result<Stamp> {
    let found = fs::metadata(path).map_err(|e| Error::io(path.display(), e))?;
    if !found.is_dir() {
        return Ok(Stamp::of(&found));
    }
    pictures_in(path)?.iter().try_fold(Stamp::default(), |sum, image| {
        let one = Stamp::of(&fs::metadata(image).map_err(|e| Error::io(image.display(), e))?);
        Ok(Stamp { bytes: sum.bytes.saturating_add(one.bytes), time_ns: sum.time_ns.max(one.time_ns) })
    })
}

/// Size and time of a file.
pub(super) fn at(path: &Path) -> Result<Stamp> {
    fs::metadata(path).map(|found| Stamp::of(&found)).map_err(|e| Error::io(path.display(), e))
}

/// By what a file is taken to be unchanged, without reading it.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Eq, Serialize)]
pub struct Stamp {
    /// Length.
    pub bytes: u64,
    /// Time of the last change of its bytes, in nanoseconds since 1970.
    pub time_ns: i64,
}

impl Stamp {
    /// The stamp of a file.
    #[must_use]
    pub fn of(found: &fs::Metadata) -> Self {
        // Every system that the library builds for has the time; a file from before 1970 counts backwards.
        let nanoseconds = |d: std::time::Duration| i64::try_from(d.as_nanos()).unwrap_or(i64::MAX);
        let time_ns = match found.modified().map(|time| time.duration_since(UNIX_EPOCH)) {
            Ok(Ok(after)) => nanoseconds(after),
            Ok(Err(before)) => -nanoseconds(before.duration()),
            Err(_) => 0,
        };
        Self { bytes: found.len(), time_ns }
    }
}

/// Bytes read between two looks at whether to stop.
const STEP: usize = 1 << 20;

/// Digest of a file's bytes; an error of `stop` ends it at once.
pub(super) fn digest_of_file(path: &Path, stop: &mut dyn FnMut() -> Result<()>) -> Result<String> {
    let file = InputFile::open(path)?;
    let mut bytes = vec![0; usize::try_from(file.len()).map_or(STEP, |len| len.min(STEP))];
    let (mut digest, mut at) = (Digest::new(), 0);
    while at < file.len() {
        stop()?;
        let len = usize::try_from(file.len() - at).map_or(STEP, |left| left.min(STEP));
        file.read_at(at, &mut bytes[..len])?;
        digest.update(&bytes[..len]);
        at += len as u64;
    }
    Ok(digest.text())
}

/// Digest of an input: of a file its bytes, of a folder the names and digests of its images.
///
/// # Errors
/// [`Kind::Io`] when it cannot be read.
pub(super) fn digest(path: &Path, stop: &mut dyn FnMut() -> Result<()>) -> Result<String> {
    if !path.is_dir() {
        return digest_of_file(path, stop);
    }
    let mut lines = Vec::new();
    for image in pictures_in(path)? {
        let name = image.file_name().unwrap_or_default().to_string_lossy().into_owned();
        lines.push(format!("{name} {}\n", digest_of_file(&image, stop)?));
    }
    lines.sort();
    Ok(Digest::of(lines.concat().as_bytes()))
}
