//! Writes large files through a mapped window that moves along the file.
#![allow(unsafe_code, reason = "mapping a file is unsafe by its nature")]

use std::path::{Path, PathBuf};
use std::time::Duration;

use crate::storage::guarded_map::{GuardedMap, check_length};
use crate::storage::partial_file::{PartialFile, parent_folder};
use crate::storage::platform::{free_bytes, is_in_memory, reserve, write_all_at, write_back};
use spikelane::error::{Error, ErrorKind, Result, Setting, bail, error};
use spikelane::unstable::Count;

/// Number of bytes of the mapped window. With this size, moving the window takes little of the total time, and the
/// window is small compared with main memory.
const WINDOW_BYTES: usize = 64 << 20;

/// Windows start at multiples of this number of bytes. This is the largest page size of current CPUs (64 KiB on
/// arm64), and therefore a multiple of every smaller page size.
const WINDOW_ALIGN_BYTES: u64 = 64 << 10;

/// A new file of known length. Its blocks are reserved on the disk, and its content is written through mapped windows.
///
/// If the writer is dropped before [`finish`](Self::finish), the file is removed.
///
/// # Examples
/// ```
/// use spikelane_io::storage::FileWriter;
/// # let folder = tempfile::tempdir().map_err(|e| spikelane::Error::io("a folder", e))?;
/// let path = folder.path().join("data.bin");
/// let mut writer = FileWriter::create(&path, 5, false)?;
/// writer.write_all(&[1, 2, 3])?;
/// writer.write_all(&[4, 5])?;
/// assert!(!path.exists());
/// assert_eq!(writer.finish()?.bytes, 5);
/// assert!(path.exists());
/// # Ok::<(), spikelane::Error>(())
/// ```
#[derive(Debug)]
pub struct FileWriter {
    // Fields are dropped in the order of declaration, and the mapping must be dropped before the file.
    window: Option<Window>,
    partial: PartialFile,
    bytes: u64,
    position: u64,
    /// Whether the blocks of each window are reserved when the window is mapped. If false, the blocks of the whole
    /// file are reserved when the file is created.
    reserves_by_window: bool,
}

#[derive(Debug)]
struct Window {
    map: GuardedMap,
    offset: u64,
}

/// A finished file. The file is synced to the disk and has its final name.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FileSummary {
    /// The final path.
    pub path: PathBuf,
    /// Length of the file in bytes.
    pub bytes: u64,
    /// Duration of the final sync and rename.
    pub sync_time: Duration,
}

impl FileWriter {
    /// Creates a file of `bytes` zero bytes. The final path of the file is `path`.
    ///
    /// All blocks are reserved, so that a full disk cannot cause an error later. On a file system in memory, only the
    /// amount of free space is checked, because a reservation would clear every page.
    ///
    /// # Errors
    /// * [`ErrorKind::Exists`] if `path` exists and `force` is false.
    /// * [`ErrorKind::Space`] if the disk does not have enough free space.
    /// * Other errors of the operating system.
    pub fn create(path: &Path, bytes: u64, force: bool) -> Result<Self> {
        let partial = PartialFile::create(path, force)?;
        let by_window = is_in_memory(partial.file());
        let mut writer = Self { window: None, partial, bytes: 0, position: 0, reserves_by_window: by_window };
        writer.lengthen(bytes)?;
        Ok(writer)
    }

    fn lengthen(&mut self, bytes: u64) -> Result<()> {
        let (path, more) = (self.path(), bytes - self.bytes);
        check_space(path, more)?;
        if self.reserves_by_window {
            self.partial.file().set_len(bytes).map_err(|e| Error::io(path.display(), e))?;
        } else {
            let reserved = reserve(self.partial.file(), self.bytes, bytes);
            reserved.map_err(|e| reserve_error(path, more, e))?;
        }
        self.bytes = bytes;
        Ok(())
    }

    /// Extends the file with zeros, or truncates the file. New blocks are reserved as in [`create`](Self::create).
    ///
    /// # Errors
    /// [`ErrorKind::Space`] if the disk does not have enough free space. Also other errors of the operating system.
    pub fn resize(&mut self, bytes: u64) -> Result<()> {
        // A window must not be mapped beyond the new end of the file.
        self.unmap()?;
        if bytes > self.bytes {
            return self.lengthen(bytes);
        }
        self.partial.file().set_len(bytes).map_err(|e| Error::io(self.path().display(), e))?;
        self.bytes = bytes;
        Ok(())
    }

    /// Returns the length of the file.
    #[must_use]
    pub const fn bytes(&self) -> u64 {
        self.bytes
    }

    /// Returns the final path.
    #[must_use]
    pub fn path(&self) -> &Path {
        self.partial.path()
    }

    /// Returns the `len` bytes that start at `offset`, for writing or reading.
    ///
    /// Sequential calls are fast, because one mapping contains 64 MiB. When the window moves, the operating system
    /// starts writing the bytes of the previous window to the disk.
    ///
    /// # Errors
    /// * [`ErrorKind::Usage`] if the range exceeds the file.
    /// * [`ErrorKind::Io`] if another process shortened the file. Also other errors of the operating system.
    pub fn window(&mut self, offset: u64, len: usize) -> Result<&mut [u8]> {
        self.check(offset, len)?;
        if len == 0 {
            return Ok(&mut []);
        }
        if self.window.as_ref().is_some_and(|w| w.contains(offset, len)) {
            self.check_length()?;
        } else {
            self.unmap()?;
        }
        let window = match self.window.take() {
            Some(window) => window,
            None => self.map(offset, len)?,
        };
        Ok(self.window.insert(window).bytes(offset, len))
    }

    /// Checks that no other process has shortened the file.
    fn check_length(&self) -> Result<()> {
        check_length(self.partial.file(), self.window.as_ref().map(|w| &w.map), self.bytes, self.path())
    }

    /// Removes the mapping of the window. The content of the window is lost if another process shortened the file.
    fn unmap(&mut self) -> Result<()> {
        self.check_length()?;
        self.window = None;
        Ok(())
    }

    fn check(&self, offset: u64, len: usize) -> Result<()> {
        if offset.checked_add(len as u64).is_none_or(|end| end > self.bytes) {
            bail!(Usage, "{}", self.path().display(); found "{} at {offset}", Count(len, "byte");
                expected "a range within {}", Count(self.bytes, "byte"));
        }
        Ok(())
    }

    /// Writes bytes from another buffer with a system call. A system call is faster than a copy to a mapping, because
    /// the copy causes one page fault per page.
    ///
    /// When sequential writes cross a window boundary, the operating system starts writing the bytes before the
    /// boundary to the disk.
    ///
    /// # Errors
    /// As [`window`](Self::window).
    pub(crate) fn write_at(&mut self, offset: u64, bytes: &[u8]) -> Result<()> {
        self.check(offset, bytes.len())?;
        self.check_length()?;
        let windows = |bytes: u64| bytes / WINDOW_BYTES as u64;
        if windows(offset + bytes.len() as u64) > windows(offset) {
            self.write_back_before(offset);
        }
        let written = write_all_at(self.partial.file(), bytes, offset);
        written.map_err(|e| Error::io(self.path().display(), e))
    }

    /// Writes `bytes` directly after the bytes of the previous call.
    ///
    /// # Errors
    /// As [`window`](Self::window).
    pub fn write_all(&mut self, bytes: &[u8]) -> Result<()> {
        self.write_at(self.position, bytes)?;
        self.position += bytes.len() as u64;
        Ok(())
    }

    /// Syncs the file and renames it to its final name.
    ///
    /// # Errors
    /// * [`ErrorKind::Exists`] if another process has created a file at this path and `force` is false. The file of the
    ///   other process is unchanged, and the file of this writer is removed.
    /// * [`ErrorKind::Io`] if another process shortened the file. The file is removed.
    /// * Other errors of the operating system.
    pub fn finish(self) -> Result<FileSummary> {
        self.finish_replacing(&[])
    }

    /// Finishes the file as [`finish`](Self::finish) does, but removes the files in `stale` before the rename. The new
    /// file invalidates the files in `stale`.
    pub(crate) fn finish_replacing(mut self, stale: &[&Path]) -> Result<FileSummary> {
        self.unmap()?;
        let path = self.path().to_path_buf();
        let sync = self.partial.commit_replacing(stale)?;
        Ok(FileSummary { path, bytes: self.bytes, sync_time: sync })
    }

    /// Maps a window that contains `len` bytes at `offset`. The pages are allocated when they are first written. With
    /// `MAP_POPULATE`, the mapping would not be faster.
    fn map(&mut self, offset: u64, len: usize) -> Result<Window> {
        self.write_back_before(offset);
        let start = offset - offset % WINDOW_ALIGN_BYTES;
        let lead = (offset - start) as usize;
        let wanted = (lead + len).max(WINDOW_BYTES);
        let size = usize::try_from(self.bytes - start).map_or(wanted, |left| left.min(wanted));
        if self.reserves_by_window {
            // A reservation does not change bytes that are already written, so an overlap with the previous window is
            // harmless.
            let reserved = reserve(self.partial.file(), start, start + size as u64);
            reserved.map_err(|e| reserve_error(self.path(), size as u64, e))?;
        }
        let map = GuardedMap::new(self.partial.file(), start, size);
        let map = map.map_err(|e| Error::io(self.path().display(), e))?;
        Ok(Window { map, offset: start })
    }

    /// Starts writing the bytes of one window before `offset` to the disk. A larger range would also remove pages from
    /// the cache that were written recently and are soon read.
    fn write_back_before(&self, offset: u64) {
        let start = offset.saturating_sub(WINDOW_BYTES as u64);
        write_back(self.partial.file(), start, offset - start);
    }
}

impl Window {
    /// Returns the `len` bytes of the file that start at `offset`. The range must be inside the window.
    fn bytes(&mut self, offset: u64, len: usize) -> &mut [u8] {
        // The offset is inside the mapping, so the difference fits in `usize`.
        let start = (offset - self.offset) as usize;
        // SAFETY: the mapping is writable and lives as long as `self`, whose borrow is exclusive. Every block of the
        // window is reserved, so a full disk causes no fault. The file has a new hidden name, so no other process is
        // expected to use it. If another process shortens the file, the guard of the mapping replaces the bytes with
        // zeros, which are valid values, and `check_length` rejects the file before it gets its final name.
        let mapped = unsafe { std::slice::from_raw_parts_mut(self.map.as_mut_ptr(), self.map.len()) };
        &mut mapped[start..start + len]
    }

    fn contains(&self, offset: u64, len: usize) -> bool {
        offset >= self.offset && offset + len as u64 <= self.offset + self.map.len() as u64
    }
}

fn space_error(path: &Path, needed: u64, free: u64) -> Error {
    error!(Space, "{}", path.display(); found "{} free on the disk", Count(free, "byte");
        expected "{} for this file", Count(needed, "byte");
        remedy "free some space, choose another disk, or reduce {}", Setting("readouts"))
}

fn check_space(path: &Path, needed: u64) -> Result<()> {
    match free_bytes(parent_folder(path)).map_err(|e| Error::io(path.display(), e))? {
        Some(free) if needed > free => Err(space_error(path, needed, free)),
        _ => Ok(()),
    }
}

pub(super) fn reserve_error(path: &Path, needed: u64, e: std::io::Error) -> Error {
    let error = Error::io(path.display(), e);
    match (error.kind(), free_bytes(parent_folder(path))) {
        (ErrorKind::Space, Ok(Some(free))) if needed > free => space_error(path, needed, free),
        _ => error,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_grows_and_is_cut_without_losing_what_it_holds() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("grown");
        let mut writer = FileWriter::create(&path, 10, false).unwrap();
        writer.window(0, 10).unwrap().fill(1);
        writer.resize(WINDOW_BYTES as u64 + 30).unwrap();
        writer.window(WINDOW_BYTES as u64 + 10, 10).unwrap().fill(2);
        writer.resize(WINDOW_BYTES as u64 + 20).unwrap();
        assert!(writer.window(WINDOW_BYTES as u64 + 20, 1).is_err());
        writer.finish().unwrap();
        let content = std::fs::read(&path).unwrap();
        assert_eq!(content.len(), WINDOW_BYTES + 20);
        assert!(
            content[..10].iter().all(|&b| b == 1) && content[WINDOW_BYTES + 10..].iter().all(|&b| b == 2)
        );
        assert!(content[10..WINDOW_BYTES + 10].iter().all(|&b| b == 0));
    }

    #[test]
    fn direct_writes_are_visible_in_windows() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("beside");
        let mut writer = FileWriter::create(&path, WINDOW_BYTES as u64 + 30, false).unwrap();
        writer.window(WINDOW_BYTES as u64 - 10, 40).unwrap().fill(1);
        writer.write_at(WINDOW_BYTES as u64 - 5, &[2; 20]).unwrap();
        writer.window(WINDOW_BYTES as u64, 5).unwrap().fill(3);
        assert_eq!(writer.write_at(WINDOW_BYTES as u64 + 11, &[4; 20]).unwrap_err().kind(), ErrorKind::Usage);
        writer.finish().unwrap();
        let content = std::fs::read(&path).unwrap();
        let expected = [[1; 5], [2; 5], [3; 5], [2; 5], [2; 5], [1; 5], [1; 5], [1; 5]];
        assert_eq!(content[WINDOW_BYTES - 10..], expected.concat());
    }

    /// Tests reservation by window on any file system. Blocks beyond the mapped window must not be allocated.
    #[cfg(unix)]
    #[test]
    fn a_file_that_is_reserved_by_window_holds_what_was_written_and_no_more() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("by-window");
        let bytes = 2 * WINDOW_BYTES as u64 + 30;
        let partial = PartialFile::create(&path, false).unwrap();
        let mut writer =
            FileWriter { window: None, partial, bytes: 0, position: 0, reserves_by_window: true };
        writer.lengthen(bytes).unwrap();
        writer.write_at(5, &[1; 20]).unwrap();
        writer.window(10, 10).unwrap()[..5].fill(2);
        let metadata = writer.partial.file().metadata().unwrap();
        let allocated = 512 * std::os::unix::fs::MetadataExt::blocks(&metadata);
        assert!((WINDOW_BYTES as u64..bytes).contains(&allocated), "{allocated} bytes taken");
        writer.write_at(bytes - 5, &[3; 5]).unwrap();
        writer.finish().unwrap();
        let content = std::fs::read(&path).unwrap();
        assert_eq!(content.len() as u64, bytes);
        let expected = [vec![0; 5], vec![1; 5], vec![2; 5], vec![1; 10], vec![0; 5]].concat();
        assert!(content[..30] == expected && content[bytes as usize - 6..] == [0, 3, 3, 3, 3, 3]);
        assert!(content[30..bytes as usize - 5].iter().all(|b| *b == 0));
    }

    #[test]
    fn windows_join_without_seam() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("long");
        let bytes = WINDOW_BYTES as u64 * 2 + 12_345;
        let mut writer = FileWriter::create(&path, bytes, false).unwrap();
        // The step is not a divisor of the page size or of the window size, so some requests cross a page or window
        // boundary.
        let (step, mut at) = (1_000_003u64, 0u64);
        while at < bytes {
            let len = step.min(bytes - at) as usize;
            writer.window(at, len).unwrap().fill((at / step) as u8);
            at += len as u64;
        }
        writer.finish().unwrap();
        let content = std::fs::read(&path).unwrap();
        assert_eq!(content.len() as u64, bytes);
        for (i, piece) in content.chunks(step as usize).enumerate() {
            assert!(piece.iter().all(|&b| b == i as u8), "piece {i}");
        }
    }
}
