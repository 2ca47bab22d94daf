//! Identifies inputs and files by size and modification time, or by digest.

use std::fs;
use std::path::Path;
use std::time::UNIX_EPOCH;

use serde::{Deserialize, Serialize};

use spikelane::error::{Error, Result};
use spikelane::unstable::inputs::InputFile;
use spikelane_io::light::image_files;
use spikelane_io::storage::Digest;

/// Returns the fingerprint of an input. The fingerprint of a folder contains the total size and the latest
/// modification time of its images.
pub(super) fn input_fingerprint(path: &Path, follow_links: bool) -> Result<Fingerprint> {
    let metadata = fs::metadata(path).map_err(|e| Error::io(path.display(), e))?;
    if !metadata.is_dir() {
        return Ok(Fingerprint::from_metadata(&metadata));
    }
    image_files(path, follow_links)?.iter().try_fold(Fingerprint::default(), |sum, image| {
        let one =
            Fingerprint::from_metadata(&fs::metadata(image).map_err(|e| Error::io(image.display(), e))?);
        Ok(Fingerprint {
            bytes: sum.bytes.saturating_add(one.bytes),
            mtime_ns: sum.mtime_ns.max(one.mtime_ns),
        })
    })
}

/// Returns the fingerprint of a file.
pub(super) fn file_fingerprint(path: &Path) -> Result<Fingerprint> {
    fs::metadata(path)
        .map(|metadata| Fingerprint::from_metadata(&metadata))
        .map_err(|e| Error::io(path.display(), e))
}

/// Size and modification time of a file. If the fingerprint of a file has not changed, the content is assumed to be
/// unchanged.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Eq, Serialize)]
pub struct Fingerprint {
    /// Length in bytes.
    pub bytes: u64,
    /// Time of the last modification, in nanoseconds since the start of 1970.
    pub mtime_ns: i64,
}

impl Fingerprint {
    /// Returns the fingerprint of a file.
    #[must_use]
    pub fn from_metadata(metadata: &fs::Metadata) -> Self {
        // Every supported system provides the modification time. A time before 1970 is negative.
        let nanoseconds = |d: std::time::Duration| i64::try_from(d.as_nanos()).unwrap_or(i64::MAX);
        let time_ns = match metadata.modified().map(|time| time.duration_since(UNIX_EPOCH)) {
            Ok(Ok(after)) => nanoseconds(after),
            Ok(Err(before)) => -nanoseconds(before.duration()),
            Err(_) => 0,
        };
        Self { bytes: metadata.len(), mtime_ns: time_ns }
    }
}

/// Number of bytes that are read between two calls of `stop`.
const READ_CHUNK_BYTES: usize = 1 << 20;

/// Returns the digest of the bytes of a file. If `stop` returns an error, the computation ends immediately.
pub(super) fn file_digest(path: &Path, stop: &mut dyn FnMut() -> Result<()>) -> Result<String> {
    let file = InputFile::open(path)?;
    let mut bytes =
        vec![0; usize::try_from(file.len()).map_or(READ_CHUNK_BYTES, |len| len.min(READ_CHUNK_BYTES))];
    let (mut digest, mut at) = (Digest::new(), 0);
    while at < file.len() {
        stop()?;
        let len =
            usize::try_from(file.len() - at).map_or(READ_CHUNK_BYTES, |left| left.min(READ_CHUNK_BYTES));
        file.read_at(at, &mut bytes[..len])?;
        digest.update(&bytes[..len]);
        at += len as u64;
    }
    Ok(digest.to_text())
}

/// Returns the digest of an input. For a file, it is the digest of the bytes. For a folder, it is the digest of the
/// names and digests of the images.
///
/// # Errors
/// [`ErrorKind::Io`](spikelane::ErrorKind::Io) if the input cannot be read. Also the errors of `stop`.
pub(super) fn input_digest(
    path: &Path,
    follow_links: bool,
    stop: &mut dyn FnMut() -> Result<()>,
) -> Result<String> {
    if !path.is_dir() {
        return file_digest(path, stop);
    }
    let mut lines = Vec::new();
    for image in image_files(path, follow_links)? {
        let name = image.file_name().unwrap_or_default().to_string_lossy().into_owned();
        lines.push(format!("{name} {}\n", file_digest(&image, stop)?));
    }
    lines.sort();
    Ok(Digest::hash_bytes(lines.concat().as_bytes()))
}

/// Returns whether there is a file or folder at `path`.
///
/// # Errors
/// If the system cannot find out.
pub(crate) fn exists(path: &Path) -> Result<bool> {
    path.try_exists().map_err(|e| Error::io(path.display(), e))
}
