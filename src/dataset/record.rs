//! The record of a finished sequence: every file with its digest.

use std::fs;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::error::{Error, Kind, Result};
use crate::storage::{self, Digest};

/// The record's name in the sequence's folder.
pub(super) const NAME: &str = "record.json";

/// One file.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Kept {
    /// Path below the sequence's folder, with forward slashes.
    pub path: String,
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
    pub id: String,
    /// What it is: seeds, light, readouts of images and labels.
    pub about: Value,
    /// All files but this record, in order of their paths.
    pub files: Vec<Kept>,
}

impl Record {
    /// Takes the digests of everything in `folder`.
    pub(super) fn of(id: &str, about: Value, folder: &Path) -> Result<Self> {
        let mut paths = Vec::new();
        walk(folder, folder, &mut paths)?;
        paths.sort();
        let files = paths.into_iter().map(|path| kept(folder, path)).collect::<Result<_>>()?;
        Ok(Self { id: id.to_owned(), about, files })
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
        self.files.iter().map(|f| f.bytes).sum()
    }

    /// Reads the record in `folder`, unverified.
    ///
    /// # Errors
    /// [`Kind::Io`] when there is none, [`Kind::Config`] when it is none.
    pub fn read(folder: &Path) -> Result<Self> {
        let path = folder.join(NAME);
        let text = fs::read(&path).map_err(|e| Error::io(path.display(), e))?;
        serde_json::from_slice(&text).map_err(|e| Error::new(Kind::Config, path.display()).found(e))
    }

    /// Reads the record in `folder` if its digest is `digest`, and verifies every file it lists.
    ///
    /// # Errors
    /// [`Kind::Corrupt`] with the first file that is missing or changed; [`Kind::Io`].
    pub fn verify(folder: &Path, digest: &str) -> Result<Self> {
        let path = folder.join(NAME);
        let text = fs::read(&path).map_err(|e| Error::io(path.display(), e))?;
        let found = Digest::of(&text);
        if found != digest {
            return Err(changed(&path, &found, digest));
        }
        let record: Self =
            serde_json::from_slice(&text).map_err(|e| Error::new(Kind::Config, path.display()).found(e))?;
        for file in &record.files {
            let path = folder.join(&file.path);
            let bytes = fs::metadata(&path).map_err(|e| Error::io(path.display(), e))?.len();
            if bytes != file.bytes {
                let expected = format!("{} bytes", file.bytes);
                return Err(changed(&path, &format!("{bytes} bytes"), &expected));
            }
            let found = digest_of(&path, bytes)?;
            if found != file.digest {
                return Err(changed(&path, &found, &file.digest));
            }
        }
        Ok(record)
    }
}

fn changed(path: &Path, found: &str, expected: &str) -> Error {
    Error::new(Kind::Corrupt, path.display())
        .found(found)
        .expected(expected)
        .remedy("make it again with --resume")
}

/// Small files are read, since mapping hundreds of pictures costs more.
fn digest_of(path: &Path, bytes: u64) -> Result<String> {
    if bytes > 16 << 20 {
        return Digest::of_file(path);
    }
    Ok(Digest::of(&fs::read(path).map_err(|e| Error::io(path.display(), e))?))
}

fn kept(folder: &Path, path: PathBuf) -> Result<Kept> {
    let whole = folder.join(&path);
    let bytes = fs::metadata(&whole).map_err(|e| Error::io(whole.display(), e))?.len();
    let digest = digest_of(&whole, bytes)?;
    Ok(Kept { path: path.to_string_lossy().replace('\\', "/"), bytes, digest })
}

fn walk(root: &Path, folder: &Path, into: &mut Vec<PathBuf>) -> Result<()> {
    for entry in fs::read_dir(folder).map_err(|e| Error::io(folder.display(), e))? {
        let path = entry.map_err(|e| Error::io(folder.display(), e))?.path();
        if path.is_dir() {
            walk(root, &path, into)?;
        } else if let Ok(below) = path.strip_prefix(root) {
            into.push(below.to_owned());
        }
    }
    Ok(())
}
