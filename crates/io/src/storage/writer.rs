//! Large files, written through a mapping that moves along.
#![allow(unsafe_code, reason = "mapping a file is unsafe by its nature")]

use std::path::{Path, PathBuf};
use std::time::Duration;

use memmap2::{MmapMut, MmapOptions};

use crate::storage::partial::{Partial, directory};
use crate::storage::platform::{free_bytes, is_in_memory, reserve, write_all_at, write_back};
use spikelane::error::{Error, Kind, Result};

/// Bytes mapped at once. Large, so that the cost of moving on vanishes; small
/// beside any memory, since this is all a writer keeps of a file of any length.
const WINDOW: usize = 64 << 20;

/// Windows start at multiples of this: the largest page of the CPUs in use
/// (arm64 with 64 KiB pages), and so a multiple of every smaller page.
const ALIGN: u64 = 64 << 10;

/// A new file of known length, reserved on the disk and written through mapped windows.
///
/// Dropping it without [`finish`](Self::finish) removes everything.
#[derive(Debug)]
pub struct Writer {
    // Declared first: the mapping goes before the file does.
    window: Option<Window>,
    partial: Partial,
    bytes: u64,
    position: u64,
    /// Whether blocks are reserved window by window, as each is mapped, and not where none is.
    by_window: bool,
}

#[derive(Debug)]
struct Window {
    map: MmapMut,
    offset: u64,
}

/// A file that has its final name and is safe on the disk.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Finished {
    /// The final path.
    pub path: PathBuf,
    /// Its length.
    pub bytes: u64,
    /// How long it took to bring the last bytes and the name to the disk.
    pub sync: Duration,
}

impl Writer {
    /// Begins a file of `bytes` bytes, all zero, that will be called `path`.
    ///
    /// # Errors
    /// [`Kind::Exists`] when `path` exists and `force` is false, [`Kind::Space`]
    /// when the disk cannot hold the file (blocks are reserved here, so a full
    /// disk cannot strike later; in memory they are only counted, since there to reserve a page is
    /// to clear it), and what the operating system refuses.
    pub fn create(path: &Path, bytes: u64, force: bool) -> Result<Self> {
        let partial = Partial::create(path, force)?;
        let by_window = is_in_memory(partial.file());
        let mut writer = Self { window: None, partial, bytes: 0, position: 0, by_window };
        writer.lengthen(bytes)?;
        Ok(writer)
    }

    fn lengthen(&mut self, bytes: u64) -> Result<()> {
        let (path, more) = (self.path(), bytes - self.bytes);
        check_space(path, more)?;
        if self.by_window {
            self.partial.file().set_len(bytes).map_err(|e| Error::io(path.display(), e))?;
        } else {
            let reserved = reserve(self.partial.file(), self.bytes, bytes);
            reserved.map_err(|e| reserve_error(path, more, e))?;
        }
        self.bytes = bytes;
        Ok(())
    }

    /// Makes the file longer (with zeros, reserved as at the start) or cuts it.
    ///
    /// # Errors
    /// [`Kind::Space`] when the disk cannot hold it; what the operating system refuses.
    pub fn resize(&mut self, bytes: u64) -> Result<()> {
        // Nothing may be mapped where the file will end.
        self.window = None;
        if bytes > self.bytes {
            return self.lengthen(bytes);
        }
        self.partial.file().set_len(bytes).map_err(|e| Error::io(self.path().display(), e))?;
        self.bytes = bytes;
        Ok(())
    }

    /// The length of the file.
    #[must_use]
    pub const fn bytes(&self) -> u64 {
        self.bytes
    }

    /// The final path.
    #[must_use]
    pub fn path(&self) -> &Path {
        self.partial.path()
    }

    /// The `len` bytes from `offset` on, to be written (or read back).
    ///
    /// Cheap while requests move forward: one mapping serves 64 MiB. When the
    /// window moves, the bytes behind start on their way to the disk.
    ///
    /// # Errors
    /// [`Kind::Usage`] beyond the end; what the operating system refuses.
    pub fn window(&mut self, offset: u64, len: usize) -> Result<&mut [u8]> {
        self.check(offset, len)?;
        if len == 0 {
            return Ok(&mut []);
        }
        let held = self.window.take().filter(|w| w.holds(offset, len));
        let window = match held {
            Some(window) => window,
            None => self.map(offset, len)?,
        };
        let window = self.window.insert(window);
        // Within the mapping, hence within usize.
        let start = (offset - window.offset) as usize;
        Ok(&mut window.map[start..start + len])
    }

    fn check(&self, offset: u64, len: usize) -> Result<()> {
        if offset.checked_add(len as u64).is_none_or(|end| end > self.bytes) {
            return Err(Error::new(Kind::Usage, self.path().display())
                .found(format_args!("{len} bytes at {offset}"))
                .expected(format_args!("a place within {} bytes", self.bytes)));
        }
        Ok(())
    }

    /// Writes bytes that were made elsewhere. A mapping would take each page by a fault of its own, which is dearer than
    /// the system's copy. Where such writes move forward, the bytes behind start on their way to the disk.
    ///
    /// # Errors
    /// As [`window`](Self::window).
    pub(crate) fn write_at(&mut self, offset: u64, bytes: &[u8]) -> Result<()> {
        self.check(offset, bytes.len())?;
        let windows = |bytes: u64| bytes / WINDOW as u64;
        if windows(offset + bytes.len() as u64) > windows(offset) {
            self.write_back_before(offset);
        }
        let written = write_all_at(self.partial.file(), bytes, offset);
        written.map_err(|e| Error::io(self.path().display(), e))
    }

    /// Writes `bytes` behind those of the previous call.
    ///
    /// # Errors
    /// As [`window`](Self::window).
    pub fn write_all(&mut self, bytes: &[u8]) -> Result<()> {
        self.write_at(self.position, bytes)?;
        self.position += bytes.len() as u64;
        Ok(())
    }

    /// Brings everything to the disk and gives the file its name.
    ///
    /// # Errors
    /// [`Kind::Exists`] when a file of that name appeared meanwhile (unless
    /// forced; it stays, and this one is removed); what the operating system refuses.
    pub fn finish(self) -> Result<Finished> {
        self.finish_replacing(&[])
    }

    /// As [`finish`](Self::finish); removes the files in `stale`, which the new one makes untrue, before it gets its name.
    pub(crate) fn finish_replacing(mut self, stale: &[&Path]) -> Result<Finished> {
        self.window = None;
        let path = self.path().to_path_buf();
        let sync = self.partial.commit_replacing(stale)?;
        Ok(Finished { path, bytes: self.bytes, sync })
    }

    /// Maps a window that holds the request. Its pages come one by one as they are
    /// written; asking for all at once (`MAP_POPULATE`) cost the same.
    fn map(&mut self, offset: u64, len: usize) -> Result<Window> {
        self.write_back_before(offset);
        let start = offset - offset % ALIGN;
        let lead = (offset - start) as usize;
        let wanted = (lead + len).max(WINDOW);
        let size = usize::try_from(self.bytes - start).map_or(wanted, |left| left.min(wanted));
        if self.by_window {
            // What has been written there stays.
            let reserved = reserve(self.partial.file(), start, start + size as u64);
            reserved.map_err(|e| reserve_error(self.path(), size as u64, e))?;
        }
        // SAFETY: the file is ours alone: created under a fresh hidden name, never shared,
        // not shortened while mapped, with every block of the window reserved (no fault on a full disk).
        // Somebody who opens and cuts a hidden partial file breaks this; no API prevents that.
        let map = unsafe { MmapOptions::new().offset(start).len(size).map_mut(self.partial.file()) };
        let map = map.map_err(|e| Error::io(self.path().display(), e))?;
        Ok(Window { map, offset: start })
    }

    /// Starts write-back of the window before `offset`. One window only: reaching further back would drop from memory
    /// what was just written, which is read next.
    fn write_back_before(&self, offset: u64) {
        let start = offset.saturating_sub(WINDOW as u64);
        write_back(self.partial.file(), start, offset - start);
    }
}

impl Window {
    fn holds(&self, offset: u64, len: usize) -> bool {
        offset >= self.offset && offset + len as u64 <= self.offset + self.map.len() as u64
    }
}

fn space(path: &Path, needed: u64, free: u64) -> Error {
    Error::new(Kind::Space, path.display())
        .found(format_args!("{free} bytes free on the disk"))
        .expected(format_args!("{needed} bytes for this file"))
        .remedy("free some space, choose another directory, or write fewer readouts")
}

fn check_space(path: &Path, needed: u64) -> Result<()> {
    match free_bytes(directory(path)).map_err(|e| Error::io(path.display(), e))? {
        Some(free) if needed > free => Err(space(path, needed, free)),
        _ => Ok(()),
    }
}

pub(super) fn reserve_error(path: &Path, needed: u64, e: std::io::Error) -> Error {
    let error = Error::io(path.display(), e);
    match (error.kind(), free_bytes(directory(path))) {
        (Kind::Space, Ok(Some(free))) if needed > free => space(path, needed, free),
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
        let mut writer = Writer::create(&path, 10, false).unwrap();
        writer.window(0, 10).unwrap().fill(1);
        writer.resize(WINDOW as u64 + 30).unwrap();
        writer.window(WINDOW as u64 + 10, 10).unwrap().fill(2);
        writer.resize(WINDOW as u64 + 20).unwrap();
        assert!(writer.window(WINDOW as u64 + 20, 1).is_err());
        writer.finish().unwrap();
        let found = std::fs::read(&path).unwrap();
        assert_eq!(found.len(), WINDOW + 20);
        assert!(found[..10].iter().all(|&b| b == 1) && found[WINDOW + 10..].iter().all(|&b| b == 2));
        assert!(found[10..WINDOW + 10].iter().all(|&b| b == 0));
    }

    #[test]
    fn what_is_written_beside_windows_is_seen_in_them() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("beside");
        let mut writer = Writer::create(&path, WINDOW as u64 + 30, false).unwrap();
        writer.window(WINDOW as u64 - 10, 40).unwrap().fill(1);
        writer.write_at(WINDOW as u64 - 5, &[2; 20]).unwrap();
        writer.window(WINDOW as u64, 5).unwrap().fill(3);
        assert_eq!(writer.write_at(WINDOW as u64 + 11, &[4; 20]).unwrap_err().kind(), Kind::Usage);
        writer.finish().unwrap();
        let found = std::fs::read(&path).unwrap();
        let expected = [[1; 5], [2; 5], [3; 5], [2; 5], [2; 5], [1; 5], [1; 5], [1; 5]];
        assert_eq!(found[WINDOW - 10..], expected.concat());
    }

    /// As in memory, on whatever lies here: blocks beyond the window that is mapped are not taken.
    #[cfg(unix)]
    #[test]
    fn a_file_that_is_reserved_by_window_holds_what_was_written_and_no_more() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("by-window");
        let bytes = 2 * WINDOW as u64 + 30;
        let partial = Partial::create(&path, false).unwrap();
        let mut writer = Writer { window: None, partial, bytes: 0, position: 0, by_window: true };
        writer.lengthen(bytes).unwrap();
        writer.write_at(5, &[1; 20]).unwrap();
        writer.window(10, 10).unwrap()[..5].fill(2);
        let found = writer.partial.file().metadata().unwrap();
        let taken = 512 * std::os::unix::fs::MetadataExt::blocks(&found);
        assert!((WINDOW as u64..bytes).contains(&taken), "{taken} bytes taken");
        writer.write_at(bytes - 5, &[3; 5]).unwrap();
        writer.finish().unwrap();
        let found = std::fs::read(&path).unwrap();
        assert_eq!(found.len() as u64, bytes);
        let expected = [vec![0; 5], vec![1; 5], vec![2; 5], vec![1; 10], vec![0; 5]].concat();
        assert!(found[..30] == expected && found[bytes as usize - 6..] == [0, 3, 3, 3, 3, 3]);
        assert!(found[30..bytes as usize - 5].iter().all(|b| *b == 0));
    }

    #[test]
    fn windows_join_without_seam() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("long");
        let bytes = WINDOW as u64 * 2 + 12_345;
        let mut writer = Writer::create(&path, bytes, false).unwrap();
        // A step that divides neither page nor window, so that requests cross its end.
        let (step, mut at) = (1_000_003u64, 0u64);
        while at < bytes {
            let len = step.min(bytes - at) as usize;
            writer.window(at, len).unwrap().fill((at / step) as u8);
            at += len as u64;
        }
        writer.finish().unwrap();
        let found = std::fs::read(&path).unwrap();
        assert_eq!(found.len() as u64, bytes);
        for (i, piece) in found.chunks(step as usize).enumerate() {
            assert!(piece.iter().all(|&b| b == i as u8), "piece {i}");
        }
    }
}
