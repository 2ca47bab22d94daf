//! The record of a finished sequence: every file with its digest.

use std::fs;
use std::path::Path;

use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::stamp::digest_of_file;
use spikelane::error::{Error, Kind, Result};
use spikelane::unstable::inputs::{Access, InnerPath, PlainName, read_bytes};
use spikelane_io::storage::{self, Digest};

/// The record's name in the sequence's folder.
pub(super) const NAME: &str = "record.json";

/// The most that a record may hold, in bytes: that of a sequence with two million images.
pub(super) const MAX_BYTES: u64 = 256 << 20;

/// One file.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Kept {
    /// Path below the sequence's folder.
    pub path: InnerPath,
    /// Length.
    pub bytes: u64,
    /// `blake3:<hex>`.
    pub digest: String,
}

/// What a sequence holds.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Record {
    /// Name of the sequence.
    pub id: PlainName,
    /// What it is: seeds, light, readouts of images and labels.
    pub about: Value,
    /// All files but this record, in order of their paths.
    pub files: Vec<Kept>,
}

impl Record {
    /// Takes the digests of everything in `folder`.
    pub(super) fn of(id: &PlainName, about: Value, folder: &Path) -> Result<Self> {
        let mut paths = Vec::new();
        walk(folder, None, &mut paths)?;
        // As paths, so that what is in a folder comes before files whose names begin with the folder's.
        paths.sort_by(|a, b| Path::new(a.as_str()).cmp(Path::new(b.as_str())));
        let files = paths.into_iter().map(|path| kept(folder, path)).collect::<Result<_>>()?;
        Ok(Self { id: id.clone(), about, files })
    }

    /// Writes it into `folder` and returns its own digest.
    pub(super) fn write(&self, folder: &Path) -> Result<String> {
        let path = folder.join(NAME);
        let text =
            serde_json::to_vec_pretty(self).map_err(|e| Error::new(Kind::Config, path.display()).found(e))?;
        storage::write_small(&path, &text, false)?;
        Ok(Digest::of(&text))
    }

    /// Bytes of all files.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        self.files.iter().fold(0, |sum, f| sum.saturating_add(f.bytes))
    }

    /// Reads the record in `folder`, unverified. Links may not leave the folder.
    ///
    /// # Errors
    /// [`Kind::Io`] when there is none, [`Kind::Config`] when it is none.
    pub fn read(folder: &Path) -> Result<Self> {
        Self::read_below(folder, Access::Read)
    }

    /// Reads the record in `folder`; `access` says whether it may be a link that leaves the folder.
    ///
    /// # Errors
    /// As [`Record::read`].
    pub fn read_below(folder: &Path, access: Access) -> Result<Self> {
        let path = InnerPath::from(NAME).below(folder, access)?;
        Self::parse(&path, &read_bytes(&path, "a record", MAX_BYTES)?)
    }

    pub(super) fn parse(path: &Path, text: &[u8]) -> Result<Self> {
        serde_json::from_slice(text).map_err(|e| Error::new(Kind::Config, path.display()).found(e))
    }

    /// Reads the record in `folder` if its digest is `digest`, and verifies every file it lists. Links may not leave the
    /// folder.
    ///
    /// # Errors
    /// [`Kind::Corrupt`] with the first file that is missing or changed; [`Kind::Io`].
    pub fn verify(folder: &Path, digest: &str) -> Result<Self> {
        Self::verify_below(folder, digest, Access::Read, &mut || Ok(()))
    }

    /// The same, where `access` says whether links may leave the folder; an error of `stop` ends it at once.
    ///
    /// # Errors
    /// As [`Record::verify`], and [`Kind::Input`] for a link that leaves the folder.
    pub(super) fn verify_below(
        folder: &Path,
        digest: &str,
        access: Access,
        stop: &mut dyn FnMut() -> Result<()>,
    ) -> Result<Self> {
        let path = InnerPath::from(NAME).below(folder, access)?;
        let text = read_bytes(&path, "a record", MAX_BYTES).map_err(damaged)?;
        let found = Digest::of(&text);
        if found != digest {
            return Err(changed(&path, &found, digest));
        }
        let record = Self::parse(&path, &text)?;
        for file in &record.files {
            let path = file.path.below(folder, access)?;
            let bytes = fs::metadata(&path).map_err(|e| Error::io(path.display(), e))?.len();
            if bytes != file.bytes {
                let expected = format!("{} bytes", file.bytes);
                return Err(changed(&path, &format!("{bytes} bytes"), &expected));
            }
            let found = digest_of_file(&path, stop).map_err(damaged)?;
            if found != file.digest {
                return Err(changed(&path, &found, &file.digest));
            }
        }
        Ok(record)
    }
}

/// Returns `None` in place of an error that files are missing, unreadable or changed, so that they can be made again.
///
/// # Errors
/// All others: a link that leaves the folder, or a request to stop.
pub(super) fn if_intact<T>(found: Result<T>) -> Result<Option<T>> {
    match found {
        Ok(value) => Ok(Some(value)),
        Err(e) if matches!(e.kind(), Kind::Corrupt | Kind::Config | Kind::Io) => Ok(None),
        Err(e) => Err(e),
    }
}

/// A file of a sequence that is no regular file, or ends early, is damaged and can be made again.
fn damaged(error: Error) -> Error {
    if error.kind() != Kind::Input {
        return error;
    }
    let parts = error.parts();
    Error::new(Kind::Corrupt, parts.subject)
        .found(parts.found)
        .expected(parts.expected)
        .remedy("make it again with --resume")
}

fn changed(path: &Path, found: &str, expected: &str) -> Error {
    Error::new(Kind::Corrupt, path.display())
        .found(found)
        .expected(expected)
        .remedy("make it again with --resume")
}

fn kept(folder: &Path, path: InnerPath) -> Result<Kept> {
    let whole = path.below(folder, Access::Read)?;
    let bytes = fs::metadata(&whole).map_err(|e| Error::io(whole.display(), e))?.len();
    let digest = digest_of_file(&whole, &mut || Ok(()))?;
    Ok(Kept { path, bytes, digest })
}

/// Lists the files in `root`, or in the folder `below` it.
fn walk(root: &Path, below: Option<&InnerPath>, into: &mut Vec<InnerPath>) -> Result<()> {
    let folder = match below {
        Some(below) => below.below(root, Access::Read)?,
        None => root.to_owned(),
    };
    let io = |e| Error::io(folder.display(), e);
    for entry in fs::read_dir(&folder).map_err(io)? {
        let entry = entry.map_err(io)?;
        let name = PlainName::parse(Kind::Input, folder.display(), &entry.file_name().to_string_lossy())?;
        let path = below.map_or_else(|| InnerPath::from(&name), |below| below.join(&name));
        if entry.file_type().map_err(io)?.is_dir() {
            walk(root, Some(&path), into)?;
        } else {
            into.push(path);
        }
    }
    Ok(())
}
