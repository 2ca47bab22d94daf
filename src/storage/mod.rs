//! Bytes at rest: files that appear whole or not at all.
//!
//! A file is written under a hidden name beside its final one, its blocks
//! reserved before the first byte, synced, and only then renamed; whatever
//! interrupts that leaves the user's files as they were. Large files are
//! mapped a window at a time, so that memory does not grow with their length.

mod digest;
mod group;
#[cfg(feature = "scene")]
mod lock;
#[cfg(feature = "scene")]
mod outputs;
mod partial;
mod shared;
mod shortened;
pub(crate) mod steps;
#[cfg(feature = "scene")]
pub(crate) mod trees;
#[cfg(feature = "cli")]
pub(crate) mod unfinished;
mod words;
mod writer;

pub use digest::Digest;
pub(crate) use group::FileGroup;
#[cfg(feature = "scene")]
pub use outputs::OutputSet;
#[cfg(feature = "cli")]
pub(crate) use partial::Partial;
pub use shared::Shared;
pub(crate) use words::Words;
pub use writer::{Finished, Writer};

use std::io::Write as _;
use std::path::Path;

use crate::error::{Error, Result};

/// Writes a small file (a sidecar, a picture) in one piece.
///
/// Readers see the old file or the whole new one, never a part.
///
/// # Errors
/// [`Kind::Exists`](crate::Kind::Exists) when `path` exists and `force` is
/// false, [`Kind::Space`](crate::Kind::Space) when the disk is full, and what
/// the operating system refuses.
pub fn write_small(path: &Path, bytes: &[u8], force: bool) -> Result<()> {
    let partial = partial::Partial::create(path, force)?;
    partial.file().write_all(bytes).map_err(|e| Error::io(path.display(), e))?;
    partial.commit().map(drop)
}

/// Writes, or replaces, a small file that can be made again, such as one of thousands of intermediate results.
///
/// Readers see the old file or the whole new one, as long as the machine runs. It is not synced, which would take ten times as long
/// as writing it: after a power failure it may be short or hold zeros, so that its reader has to check it.
pub(crate) fn write_renewable(path: &Path, bytes: &[u8]) -> Result<()> {
    let partial = partial::Partial::create(path, true)?;
    partial.file().write_all(bytes).map_err(|e| Error::io(path.display(), e))?;
    partial.commit_unsynced()
}

/// Whether `names` in `folder` may be written: asked before hours of work, not after.
///
/// # Errors
/// [`Kind::Exists`](crate::Kind::Exists) when one exists and `force` is false, or when it is no plain file.
#[cfg(feature = "cli")]
pub(crate) fn refuse_existing(folder: &Path, names: &[&str], force: bool) -> Result<()> {
    names.iter().try_for_each(|name| partial::refuse_existing(&folder.join(name), force))
}

/// Removes a file that new ones replace or make untrue, if it is there.
pub(crate) fn remove_old(path: &Path) -> Result<()> {
    partial::remove_old(path)
}

/// Bytes that an ordinary user may still write to the disk that holds (or will hold) `path`.
///
/// # Errors
/// When neither the directory of `path` nor one above it can be asked.
pub fn free_space(path: &Path) -> Result<u64> {
    let mut at = path;
    loop {
        match writer::free_bytes(at) {
            Ok(free) => return Ok(free),
            Err(e) => match at.parent() {
                Some(parent) if !parent.as_os_str().is_empty() => at = parent,
                _ => return Err(Error::io(path.display(), e)),
            },
        }
    }
}
