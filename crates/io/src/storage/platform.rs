//! What each operating system does in its own way for files that are written: space, pre-allocation, places, write-back.
//!
//! On Linux each function is one call of the system. Elsewhere the same promises hold by other calls; where a system has
//! none, the comment of the function says what is lost.

use std::fs::{File, Metadata, OpenOptions};
use std::io;
use std::path::Path;

use spikelane::error::{Error, Kind, Result};

/// Makes a file of `from` bytes `to` bytes long, with every block reserved, so that a full disk fails here.
pub(super) fn reserve(file: &File, from: u64, to: u64) -> io::Result<()> {
    if to == from {
        return Ok(());
    }
    #[cfg(unix)]
    loop {
        use rustix::fs::{FallocateFlags, fallocate};
        use rustix::io::Errno;
        match fallocate(file, FallocateFlags::empty(), from, to - from) {
            Err(Errno::INTR) => {}
            // macOS reserves without making the file longer.
            Ok(()) if cfg!(target_vendor = "apple") => return file.set_len(to),
            Err(Errno::OPNOTSUPP | Errno::NOSYS | Errno::INVAL) => return reserve_by_writing(file, from, to),
            other => return Ok(other?),
        }
    }
    // NTFS takes the blocks of a longer file at once; only compressed and sparse files are an exception.
    #[cfg(not(unix))]
    file.set_len(to)
}

/// Reserves blocks where the file system cannot: it writes zeros. A sparse file (`set_len`) is cheaper, but then a full
/// disk is a fatal signal in the middle of a store.
#[cfg(unix)]
fn reserve_by_writing(file: &File, from: u64, to: u64) -> io::Result<()> {
    let zeros = vec![0; 1 << 20];
    let mut at = from;
    while at < to {
        let piece = (to - at).min(zeros.len() as u64);
        write_all_at(file, &zeros[..piece as usize], at)?;
        at += piece;
    }
    Ok(())
}

/// Writes all of `bytes` at `offset`, whatever the file's own position is.
#[cfg(unix)]
pub(super) fn write_all_at(file: &File, bytes: &[u8], offset: u64) -> io::Result<()> {
    std::os::unix::fs::FileExt::write_all_at(file, bytes, offset)
}

/// Writes all of `bytes` at `offset`. The file's own position moves, which no caller uses.
#[cfg(windows)]
pub(super) fn write_all_at(file: &File, mut bytes: &[u8], mut offset: u64) -> io::Result<()> {
    use std::os::windows::fs::FileExt as _;
    while !bytes.is_empty() {
        match file.seek_write(bytes, offset) {
            Ok(0) => return Err(io::ErrorKind::WriteZero.into()),
            Ok(n) => {
                bytes = &bytes[n..];
                offset += n as u64;
            }
            Err(e) if e.kind() == io::ErrorKind::Interrupted => {}
            Err(e) => return Err(e),
        }
    }
    Ok(())
}

/// Starts to bring `len` bytes from `start` on to the disk, without waiting, and lets memory drop those already there.
///
/// `msync(MS_ASYNC)` does nothing on Linux; `posix_fadvise` begins to write dirty pages. For 1.9 GB it brought the final
/// sync from 490 ms to 20 ms and took nothing from the writing. Other systems write on their own time.
pub(super) fn write_back(file: &File, start: u64, len: u64) {
    #[cfg(any(target_os = "linux", target_os = "android"))]
    if let Some(len) = std::num::NonZeroU64::new(len) {
        // Advice only: nothing depends on it.
        let _ = rustix::fs::fadvise(file, start, Some(len), rustix::fs::Advice::DontNeed);
    }
    #[cfg(not(any(target_os = "linux", target_os = "android")))]
    let _ = (file, start, len);
}

/// Returns whether a file lies in memory, where to reserve a page is to clear it: of 1 GB that is a quarter of a second,
/// before the first byte is read, for pages that are then written whole. Known on Linux alone.
pub(super) fn is_in_memory(file: &File) -> bool {
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

/// Returns the bytes that are free for this user on the disk of `folder`; none where the system cannot tell (Windows),
/// so that the reservation itself finds a full disk.
pub(super) fn free_bytes(folder: &Path) -> io::Result<Option<u64>> {
    #[cfg(unix)]
    {
        let disk = rustix::fs::statvfs(folder)?;
        Ok(Some(disk.f_bavail.saturating_mul(disk.f_frsize)))
    }
    #[cfg(not(unix))]
    {
        folder.metadata().map(|_| None)
    }
}

/// Returns whether two entries are names of one file; none where the system cannot tell (Windows).
#[must_use]
pub fn same_file(one: &Metadata, other: &Metadata) -> Option<bool> {
    #[cfg(unix)]
    {
        use std::os::unix::fs::MetadataExt as _;
        Some((one.dev(), one.ino()) == (other.dev(), other.ino()))
    }
    #[cfg(not(unix))]
    {
        let _ = (one, other);
        None
    }
}

/// Lets `options` open no symbolic link, and wait for no pipe; of no effect on Windows.
pub(super) fn without_links(options: &mut OpenOptions) -> &mut OpenOptions {
    #[cfg(unix)]
    {
        use rustix::fs::OFlags;
        use std::os::unix::fs::OpenOptionsExt as _;
        let flags = OFlags::NOFOLLOW | OFlags::NONBLOCK | OFlags::NOCTTY;
        options.custom_flags(flags.bits().cast_signed());
    }
    options
}

/// Opens a file of the program's own without following a link and without waiting for a pipe.
///
/// # Errors
/// [`Kind::Input`] for a link, and for what is no regular file; what the operating system refuses.
pub fn open_own(options: &mut OpenOptions, path: &Path) -> Result<File> {
    let refused = |found: &str| {
        Error::new(Kind::Input, path.display())
            .found(found)
            .expected("a regular file that this program made")
            .remedy("remove it; what it leads to is left as it is")
    };
    #[cfg(unix)]
    let opened = {
        use rustix::io::Errno;
        without_links(options).open(path).map_err(|e| {
            match e.raw_os_error().map(Errno::from_raw_os_error) {
                Some(Errno::LOOP) => refused("a symbolic link"),
                // A pipe without a reader, or a socket.
                Some(Errno::NXIO) => refused("a pipe or socket"),
                _ => Error::io(path.display(), e),
            }
        })
    };
    // Another process that puts a link here between the look and the opening is not noticed.
    #[cfg(not(unix))]
    let opened = match std::fs::symlink_metadata(path) {
        Ok(found) if found.is_symlink() => Err(refused("a symbolic link")),
        _ => options.open(path).map_err(|e| Error::io(path.display(), e)),
    };
    let file = opened?;
    let found = file.metadata().map_err(|e| Error::io(path.display(), e))?;
    if found.is_file() { Ok(file) } else { Err(refused("a folder, pipe or device")) }
}

/// Returns whether a file has names besides the one that it was opened by; false where the system cannot tell (Windows).
#[must_use]
pub fn has_other_names(found: &Metadata) -> bool {
    #[cfg(unix)]
    {
        std::os::unix::fs::MetadataExt::nlink(found) > 1
    }
    #[cfg(not(unix))]
    {
        let _ = found;
        false
    }
}

/// Returns the name of this machine.
#[must_use]
pub fn host() -> String {
    #[cfg(unix)]
    {
        rustix::system::uname().nodename().to_string_lossy().into_owned()
    }
    #[cfg(not(unix))]
    {
        std::env::var("COMPUTERNAME").unwrap_or_else(|_| "this machine".to_owned())
    }
}

#[cfg(all(test, unix))]
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

    #[cfg(target_os = "linux")]
    #[test]
    fn a_file_of_the_memory_is_known() {
        let Ok(file) = tempfile::tempfile_in("/dev/shm") else {
            println!("skipped: no /dev/shm to write to");
            return;
        };
        assert!(is_in_memory(&file));
    }
}
