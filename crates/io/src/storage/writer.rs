//! Large files, written through a mapping that moves along.
#![allow(unsafe_code, reason = "mapping a file is unsafe by its nature")]

use std::fs::File;
use std::num::NonZeroU64;
use std::os::unix::fs::FileExt as _;
use std::path::{Path, PathBuf};
use std::time::Duration;

use memmap2::{MmapMut, MmapOptions};
use rustix::fs::{Advice, FallocateFlags};
use rustix::io::Errno;

use spikelane::error::{Error, Kind, Result};
use crate::storage::partial::{Partial, directory};

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
        let written = self.partial.file().write_all_at(bytes, offset);
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

    /// Starts write-back of the window before `offset`, without waiting for it.
    ///
    /// `msync(MS_ASYNC)`, which `flush_async` calls, does nothing on Linux; this advice
    /// begins to write dirty pages and drops those already clean. One window only: reaching
    /// further back would drop what was just written, which is read next. For 1.9 GB it
    /// brought the final sync from 490 ms to 20 ms and took nothing from the writing.
    fn write_back_before(&self, offset: u64) {
        let start = offset.saturating_sub(WINDOW as u64);
        if let Some(len) = NonZeroU64::new(offset - start) {
            // Advice only: without it the kernel writes back on its own time.
            let _ = rustix::fs::fadvise(self.partial.file(), start, Some(len), Advice::DontNeed);
        }
    }
}

impl Window {
    fn holds(&self, offset: u64, len: usize) -> bool {
        offset >= self.offset && offset + len as u64 <= self.offset + self.map.len() as u64
    }
}

/// Whether a file lies in memory, where to reserve a page is to clear it: of 1 GB that is a quarter of a second, before the first byte is
/// read, for pages that are then written whole.
fn is_in_memory(file: &File) -> bool {
    #[cfg(target_os = "linux")]
    {
        // From linux/magic.h; the type of `f_type` is another on each architecture.
        const TMPFS: i128 = 0x0102_1994;
        rustix::fs::fstatfs(file).is_ok_and(|disk| i128::from(disk.f_type) == TMPFS)
    }
    #[cfg(not(target_os = "linux"))]
    {
        let _ = file;
        false
    }
}

pub(super) fn free_bytes(path: &Path) -> std::io::Result<u64> {
    let disk = rustix::fs::statvfs(directory(path))?;
    Ok(disk.f_bavail.saturating_mul(disk.f_frsize))
}

fn space(path: &Path, needed: u64, free: u64) -> Error {
    Error::new(Kind::Space, path.display())
        .found(format_args!("{free} bytes free on the disk"))
        .expected(format_args!("{needed} bytes for this file"))
        .remedy("free some space, choose another directory, or write fewer readouts")
}

fn check_space(path: &Path, needed: u64) -> Result<()> {
    let free = free_bytes(path).map_err(|e| Error::io(path.display(), e))?;
    if needed > free {
        return Err(space(path, needed, free));
    }
    Ok(())
}

pub(super) fn reserve_error(path: &Path, needed: u64, e: std::io::Error) -> Error {
    let error = Error::io(path.display(), e);
    match error.kind() {
        Kind::Space if needed > free_bytes(path).unwrap_or(0) => {
            space(path, needed, free_bytes(path).unwrap_or(0))
        }
        _ => error,
    }
}

/// Makes a file of `from` bytes `to` bytes long, with every block reserved.
pub(super) fn reserve(file: &File, from: u64, to: u64) -> std::io::Result<()> {
    if to == from {
        return Ok(());
    }
    loop {
        match rustix::fs::fallocate(file, FallocateFlags::empty(), from, to - from) {
            Err(Errno::INTR) => {}
            Err(Errno::OPNOTSUPP | Errno::NOSYS | Errno::INVAL) => {
                return reserve_by_writing(file, from, to);
            }
            other => return Ok(other?),
        }
    }
}

/// For file systems without `fallocate`. A sparse file (`set_len`) is cheaper, but then
/// a full disk would show as a fatal signal in the middle of a store.
fn reserve_by_writing(file: &File, from: u64, to: u64) -> std::io::Result<()> {
    let zeros = vec![0; 1 << 20];
    let mut at = from;
    while at < to {
        let piece = (to - at).min(zeros.len() as u64);
        file.write_all_at(&zeros[..piece as usize], at)?;
        at += piece;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::fs::MetadataExt as _;

    #[test]
    fn reserving_by_writing_takes_every_block() {
        let file = tempfile::tempfile().unwrap();
        let bytes = (3 << 20) + 5;
        reserve_by_writing(&file, 0, bytes).unwrap();
        file.sync_all().unwrap();
        let found = file.metadata().unwrap();
        assert_eq!(found.len(), bytes);
        // Blocks of 512 bytes: a sparse file would hold none.
        assert!(found.blocks() * 512 >= bytes, "{} blocks", found.blocks());
    }

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
        let taken = 512 * writer.partial.file().metadata().unwrap().blocks();
        assert!((WINDOW as u64..bytes).contains(&taken), "{taken} bytes taken");
        writer.write_at(bytes - 5, &[3; 5]).unwrap();
        writer.finish().unwrap();
        let found = std::fs::read(&path).unwrap();
        assert_eq!(found.len() as u64, bytes);
        let expected = [vec![0; 5], vec![1; 5], vec![2; 5], vec![1; 10], vec![0; 5]].concat();
        assert!(found[..30] == expected && found[bytes as usize - 6..] == [0, 3, 3, 3, 3, 3]);
        assert!(found[30..bytes as usize - 5].iter().all(|b| *b == 0));
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_file_of_the_memory_is_known() {
        let Ok(file) = tempfile::tempfile_in("/dev/shm") else {
            println!("skipped: no /dev/shm to write to");
            return;
        };
        assert!(is_in_memory(&file));
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
