//! The record of a finished sequence. It lists every file with its digest.

use std::fs;
use std::path::Path;

use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::fingerprint::file_digest;
use spikelane::error::{Error, ErrorKind, Result, Setting};
use spikelane::unstable::Count;
use spikelane::unstable::inputs::{Access, InnerPath, PlainName, deserialize_digest, read_bytes, utf8_bytes};
use spikelane_io::storage::{self, Digest};

/// File name of the record in the sequence's folder.
pub(super) const FILE_NAME: &str = "record.json";

/// Maximum size of a record in bytes. This size is sufficient for a sequence with two million images.
pub(super) const MAX_RECORD_BYTES: u64 = 256 << 20;

/// A file of a sequence.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[non_exhaustive]
pub struct RecordedFile {
    /// Path relative to the folder of the sequence.
    pub path: InnerPath,
    /// Length of the file in bytes.
    pub bytes: u64,
    /// Digest of all bytes of the file, as `blake3:<hex>`.
    #[serde(deserialize_with = "deserialize_digest")]
    pub digest: String,
}

/// A description of a sequence, and a list of its files.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[non_exhaustive]
pub struct SequenceRecord {
    /// Name of the sequence.
    pub id: PlainName,
    /// Description of the sequence. It contains the seeds, the light, and the readouts of images and labels.
    pub facts: Value,
    /// All files of the sequence except this record, in order of their paths.
    pub files: Vec<RecordedFile>,
}

impl SequenceRecord {
    /// Computes the digests of all files in `folder`. Returns the record with these digests.
    pub(super) fn from_folder(id: &PlainName, facts: Value, folder: &Path) -> Result<Self> {
        let mut paths = Vec::new();
        list_files(folder, None, &mut paths)?;
        // The comparison uses path components. The content of a folder then precedes files whose names start with the
        // folder's name.
        paths.sort_by(|a, b| Path::new(a.as_str()).cmp(Path::new(b.as_str())));
        let files = paths.into_iter().map(|path| recorded_file(folder, path)).collect::<Result<_>>()?;
        Ok(Self { id: id.clone(), facts, files })
    }

    /// Writes the record to `folder` and returns its digest.
    pub(super) fn write(&self, folder: &Path) -> Result<String> {
        let path = folder.join(FILE_NAME);
        let text = serde_json::to_vec_pretty(self)
            .map_err(|e| Error::new(ErrorKind::Config, path.display()).found(e))?;
        storage::write_small(&path, &text, false)?;
        Ok(Digest::hash_bytes(&text))
    }

    /// Returns the total size of all files in bytes.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        self.files.iter().fold(0, |sum, f| sum.saturating_add(f.bytes))
    }

    /// Reads the record in `folder`. The files that the record lists are not verified. Links to files outside the
    /// folder are rejected.
    ///
    /// # Errors
    /// [`ErrorKind::Io`] if there is no record, [`ErrorKind::Config`] if it is invalid.
    pub fn read(folder: &Path, access: Access) -> Result<Self> {
        let path = InnerPath::from(FILE_NAME).resolve_in(folder, access)?;
        Self::parse(&path, &read_bytes(&path, "a record", MAX_RECORD_BYTES)?)
    }

    pub(super) fn parse(path: &Path, text: &[u8]) -> Result<Self> {
        serde_json::from_slice(&utf8_bytes(text)).map_err(|e| {
            Error::new(ErrorKind::Config, path.display())
                .found(e)
                .expected("a record written by this version")
                .remedy("use the version of spikelane that wrote the record, or generate the sequence again")
        })
    }

    /// Reads the record in `folder`, compares its digest with `digest`, and verifies every file that the record lists.
    ///
    /// Links to files outside the folder are rejected.
    ///
    /// # Errors
    /// * [`ErrorKind::Corrupt`] if a file was changed. The error names the first changed file.
    /// * [`ErrorKind::Io`] if a file is missing or unreadable.
    /// * [`ErrorKind::Input`] for a link that leaves the folder.
    /// * Errors of `stop`.
    pub fn verify(
        folder: &Path,
        digest: &str,
        access: Access,
        stop: &mut dyn FnMut() -> Result<()>,
    ) -> Result<Self> {
        let path = InnerPath::from(FILE_NAME).resolve_in(folder, access)?;
        let text = read_bytes(&path, "a record", MAX_RECORD_BYTES).map_err(corrupt_error)?;
        let actual = Digest::hash_bytes(&text);
        if actual != digest {
            return Err(digest_error(&path, &actual, digest));
        }
        let record = Self::parse(&path, &text)?;
        for file in &record.files {
            let path = file.path.resolve_in(folder, access)?;
            let bytes = fs::metadata(&path).map_err(|e| Error::io(path.display(), e))?.len();
            if bytes != file.bytes {
                let expected = Count(file.bytes, "byte").to_string();
                return Err(digest_error(&path, &Count(bytes, "byte").to_string(), &expected));
            }
            let actual = file_digest(&path, stop).map_err(corrupt_error)?;
            if actual != file.digest {
                return Err(digest_error(&path, &actual, &file.digest));
            }
        }
        Ok(record)
    }
}

/// Returns `None` if the error is about missing, unreadable or changed files. Such files can be generated again.
///
/// # Errors
/// All errors that are not about missing, unreadable or changed files. Examples are a link to a file outside the
/// folder, and a request to stop.
pub(super) fn intact_or_none<T>(result: Result<T>) -> Result<Option<T>> {
    match result {
        Ok(value) => Ok(Some(value)),
        Err(e) if matches!(e.kind(), ErrorKind::Corrupt | ErrorKind::Config | ErrorKind::Io) => Ok(None),
        Err(e) => Err(e),
    }
}

/// Converts [`ErrorKind::Input`] to [`ErrorKind::Corrupt`].
///
/// If a file of a sequence is not a regular file or is too short, the file is damaged. Damaged files can be generated
/// again.
fn corrupt_error(error: Error) -> Error {
    if error.kind() != ErrorKind::Input {
        return error;
    }
    let parts = error.parts();
    Error::new(ErrorKind::Corrupt, parts.subject)
        .found(parts.found)
        .expected(parts.expected)
        .remedy(format_args!("set {} to generate the sequence again", Setting("resume")))
}

fn digest_error(path: &Path, found: &str, expected: &str) -> Error {
    Error::new(ErrorKind::Corrupt, path.display())
        .found(found)
        .expected(expected)
        .remedy(format_args!("set {} to generate the sequence again", Setting("resume")))
}

fn recorded_file(folder: &Path, path: InnerPath) -> Result<RecordedFile> {
    let full_path = path.resolve_in(folder, Access::Read)?;
    let bytes = fs::metadata(&full_path).map_err(|e| Error::io(full_path.display(), e))?.len();
    let digest = file_digest(&full_path, &mut || Ok(()))?;
    Ok(RecordedFile { path, bytes, digest })
}

/// Lists the files in `root` and its subfolders. If `below` is given, lists only the files in this folder and its
/// subfolders.
fn list_files(root: &Path, below: Option<&InnerPath>, into: &mut Vec<InnerPath>) -> Result<()> {
    let folder = match below {
        Some(below) => below.resolve_in(root, Access::Read)?,
        None => root.to_owned(),
    };
    let io = |e| Error::io(folder.display(), e);
    for entry in fs::read_dir(&folder).map_err(io)? {
        let entry = entry.map_err(io)?;
        let name =
            PlainName::parse(ErrorKind::Input, folder.display(), &entry.file_name().to_string_lossy())?;
        let path = below.map_or_else(|| InnerPath::from(&name), |below| below.join(&name));
        if entry.file_type().map_err(io)?.is_dir() {
            list_files(root, Some(&path), into)?;
        } else {
            into.push(path);
        }
    }
    Ok(())
}
