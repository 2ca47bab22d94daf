//! Mappings of files that another process may shorten.

use std::fs::File;
use std::io;
use std::path::Path;

use memmap2::{MmapOptions, MmapRaw};

use super::mapping_guard::MappingGuard;
use spikelane::error::{Error, Result, error};
use spikelane::unstable::Count;

/// A shared, writable mapping of a part of a file.
///
/// If another process shortens the file, accesses continue on private memory; see [`GuardedMap::is_truncated`].
#[derive(Debug)]
pub(super) struct GuardedMap {
    // The guard must be dropped before the mapping.
    guard: MappingGuard,
    map: MmapRaw,
}

impl GuardedMap {
    /// Maps `len` bytes that start at `offset`. `offset` must be a multiple of the page size.
    pub(super) fn new(file: &File, offset: u64, len: usize) -> io::Result<Self> {
        let map = MmapOptions::new().offset(offset).len(len).map_raw(file)?;
        let guard = MappingGuard::new(map.as_mut_ptr(), map.len())?;
        Ok(Self { guard, map })
    }

    /// Returns the address of the first byte. The address is the start of a page.
    pub(super) fn as_mut_ptr(&self) -> *mut u8 {
        self.map.as_mut_ptr()
    }

    /// Returns the number of mapped bytes.
    pub(super) fn len(&self) -> usize {
        self.map.len()
    }

    /// Returns whether an access found the file shortened. The mapping then no longer contains the bytes of the file.
    pub(super) fn is_truncated(&self) -> bool {
        self.guard.is_truncated()
    }
}

/// Checks that `file` still has `bytes` bytes, and that no access to `map` found the file shortened. Errors name `path`.
///
/// # Errors
/// [`ErrorKind::Io`](spikelane::ErrorKind::Io) if another process shortened the file.
pub(super) fn check_length(file: &File, map: Option<&GuardedMap>, bytes: u64, path: &Path) -> Result<()> {
    let now = file.metadata().map_err(|e| Error::io(path.display(), e))?.len();
    if now >= bytes && !map.is_some_and(GuardedMap::is_truncated) {
        return Ok(());
    }
    Err(error!(Io, "{}", path.display();
        found "{}, {bytes} before: another process shortened the file", Count(now, "byte");
        expected "a file that no other process shortens";
        remedy "find the process that writes to this file, or choose another name"))
}
