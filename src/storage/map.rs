//! Files read through a mapping.
#![allow(unsafe_code, reason = "mapping a file is unsafe by its nature")]

use std::fs::File;
use std::ops::{Deref, Range};
use std::path::{Path, PathBuf};

use memmap2::{Advice, Mmap, UncheckedAdvice};

use crate::error::{Error, Kind, Result};

/// See `writer`: a multiple of every page size in use.
const ALIGN: usize = 64 << 10;

/// The bytes of a file, read where they lie. Empty files map to an empty slice.
///
/// The file must not be shortened by anyone while it is mapped: the operating
/// system answers a read beyond the new end with a fatal signal.
#[derive(Debug)]
pub struct Map {
    // None for an empty file, which cannot be mapped.
    map: Option<Mmap>,
    path: PathBuf,
}

impl Map {
    /// Maps the file at `path`.
    ///
    /// # Errors
    /// [`Kind::Io`] when it cannot be opened, [`Kind::Input`] when it is no regular file.
    pub fn open(path: &Path) -> Result<Self> {
        let io = |e| Error::io(path.display(), e);
        // A pipe would block in `open`, so its kind is asked first.
        let metadata = std::fs::metadata(path).map_err(io)?;
        if !metadata.is_file() {
            let found = if metadata.is_dir() { "a directory" } else { "a pipe or device" };
            return Err(Error::new(Kind::Input, path.display()).found(found).expected("a regular file"));
        }
        let file = File::open(path).map_err(io)?;
        let map = if file.metadata().map_err(io)?.len() == 0 {
            None
        } else {
            // SAFETY: the mapping is read-only and the type's documentation passes on the one
            // obligation that no API can meet: that nobody shortens the file meanwhile.
            Some(unsafe { Mmap::map(&file) }.map_err(io)?)
        };
        if let Some(map) = &map {
            // Advice: readahead doubles; nothing depends on it.
            let _ = map.advise(Advice::Sequential);
        }
        Ok(Self { map, path: path.to_path_buf() })
    }

    /// The path it was opened by.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Lets go of the memory behind `range` (of bytes); a later read fetches it
    /// again. A reader that releases what it has passed stays small.
    pub fn release(&self, range: Range<usize>) {
        let Some(map) = &self.map else { return };
        let end = range.end.min(map.len());
        // Inwards to whole pages: neighbours may still be in use.
        let start = range.start.next_multiple_of(ALIGN);
        let stop = if end == map.len() { end } else { end - end % ALIGN };
        if start >= stop {
            return;
        }
        // SAFETY: `DontNeed` invalidates anonymous or private pages; this mapping is shared
        // and read-only, so its pages come back from the file with the same bytes.
        let _ = unsafe { map.unchecked_advise_range(UncheckedAdvice::DontNeed, start, stop - start) };
    }
}

impl Deref for Map {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        self.map.as_deref().unwrap_or_default()
    }
}
