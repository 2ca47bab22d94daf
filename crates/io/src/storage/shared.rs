//! Memory that several processes see, as words that none of them tears.
#![allow(unsafe_code, reason = "mapping a file is unsafe by its nature")]

use std::fs::{File, OpenOptions};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

use memmap2::{MmapOptions, MmapRaw};

use crate::storage::platform::{reserve, same_file};
use crate::storage::shortened::Watched;
use crate::storage::writer::reserve_error;
use spikelane::error::{Error, Kind, Result};

/// Bytes of a word.
const WORD: usize = 8;

/// A mapped file of 64-bit words that other processes may map, read and write meanwhile.
///
/// Where another process shortens the file, accesses go on in empty memory that nobody else sees: see [`Shared::check`].
#[derive(Debug)]
pub struct Shared {
    // Dropped before the mapping.
    watched: Watched,
    map: MmapRaw,
    file: File,
    path: PathBuf,
}

impl Shared {
    /// Makes the file `path` of `words` zero words, its blocks reserved, and maps it. Other users may not open it.
    ///
    /// # Errors
    /// [`Kind::Exists`] when it is there already, [`Kind::Space`] when the disk is full, and what the operating system refuses.
    pub fn create(path: &Path, words: usize) -> Result<Self> {
        let io = |e| Error::io(path.display(), e);
        let mut options = OpenOptions::new();
        options.read(true).write(true).create_new(true);
        #[cfg(unix)]
        std::os::unix::fs::OpenOptionsExt::mode(&mut options, 0o600);
        let file = options.open(path).map_err(io)?;
        let bytes = (words * WORD) as u64;
        let reserved = reserve(&file, 0, bytes).map_err(|e| reserve_error(path, bytes, e));
        reserved.and_then(|()| Self::map(file, path)).inspect_err(|_| {
            // Half a file would look like one to wait for.
            let _ = std::fs::remove_file(path);
        })
    }

    /// Maps a file that another process has made.
    ///
    /// # Errors
    /// [`Kind::Io`] when it cannot be opened, [`Kind::Input`] when it is no regular file or holds no whole words.
    pub fn open(path: &Path) -> Result<Self> {
        let io = |e| Error::io(path.display(), e);
        let file = OpenOptions::new().read(true).write(true).open(path).map_err(io)?;
        Self::map(file, path)
    }

    fn map(file: File, path: &Path) -> Result<Self> {
        let io = |e| Error::io(path.display(), e);
        let about = file.metadata().map_err(io)?;
        let bytes = about.len();
        if !about.is_file() || bytes == 0 || bytes % WORD as u64 != 0 {
            return Err(Error::new(Kind::Input, path.display())
                .found(format_args!("{bytes} bytes"))
                .expected("a regular file of whole words of 8 bytes"));
        }
        let map = MmapOptions::new().map_raw(&file).map_err(io)?;
        let watched = Watched::new(map.as_mut_ptr(), map.len()).map_err(io)?;
        Ok(Self { watched, map, file, path: path.to_path_buf() })
    }

    /// Checks that the file still has the length that it was mapped with.
    ///
    /// # Errors
    /// [`Kind::Io`] when another process shortened it: what was written since may have reached nobody.
    pub fn check(&self) -> Result<()> {
        let now = self.file.metadata().map_err(|e| Error::io(self.path.display(), e))?.len();
        if now >= self.map.len() as u64 && !self.watched.is_shortened() {
            return Ok(());
        }
        Err(Error::new(Kind::Io, self.path.display())
            .found(format_args!("{now} bytes where it had {}: another process shortened it", self.map.len()))
            .expected("a file that only grows or is removed while it is shared")
            .remedy("find the process that writes to this name, or choose another name"))
    }

    /// Removes the name of the file, unless it is that of another file meanwhile.
    pub fn remove(&self) {
        let (Ok(named), Ok(own)) = (std::fs::symlink_metadata(&self.path), self.file.metadata()) else {
            return;
        };
        if same_file(&named, &own) == Some(false) {
            return;
        }
        // Somebody else may have removed it already.
        let _ = std::fs::remove_file(&self.path);
    }

    /// All words.
    #[must_use]
    pub fn words(&self) -> &[AtomicU64] {
        let words = self.map.len() / WORD;
        // SAFETY: the mapping is writable, starts at a page and lives as long as `self`; `watched` keeps it accessible where the
        // file is shortened. All accesses from here are atomic, as those of other processes are asked to be, and any bits
        // are a word.
        unsafe { std::slice::from_raw_parts(self.map.as_ptr().cast::<AtomicU64>(), words) }
    }

    /// Copies `bytes` to word `first` on; a last word that they do not fill ends in zeros.
    ///
    /// # Panics
    /// When they reach beyond the end.
    pub fn write(&self, first: usize, bytes: &[u8]) {
        let (whole, tail) = bytes.as_chunks::<WORD>();
        let words = &self.words()[first..first + bytes.len().div_ceil(WORD)];
        for (word, bytes) in words.iter().zip(whole) {
            word.store(u64::from_ne_bytes(*bytes), Ordering::Relaxed);
        }
        if let (Some(word), false) = (words.last(), tail.is_empty()) {
            let mut last = [0; WORD];
            last[..tail.len()].copy_from_slice(tail);
            word.store(u64::from_ne_bytes(last), Ordering::Relaxed);
        }
    }

    /// Copies the bytes from word `first` on.
    ///
    /// # Panics
    /// When they reach beyond the end.
    pub fn read(&self, first: usize, bytes: &mut [u8]) {
        let words = &self.words()[first..first + bytes.len().div_ceil(WORD)];
        for (bytes, word) in bytes.chunks_mut(WORD).zip(words) {
            bytes.copy_from_slice(&word.load(Ordering::Relaxed).to_ne_bytes()[..bytes.len()]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_mappings_of_a_file_see_the_same_bytes() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("ring");
        let one = Shared::create(&path, 4).unwrap();
        let two = Shared::open(&path).unwrap();
        one.write(1, b"elevenbytes");
        let mut read = [0; 11];
        two.read(1, &mut read);
        assert_eq!(&read, b"elevenbytes");
        assert_eq!(two.words()[3].load(Ordering::Relaxed), 0);
        assert_eq!(Shared::create(&path, 4).unwrap_err().kind(), Kind::Exists);
    }

    #[cfg(unix)]
    #[test]
    fn a_file_that_is_shortened_is_an_error_and_no_signal() {
        let folder = tempfile::tempdir().unwrap();
        let whole = Shared::create(&folder.path().join("whole"), 4).unwrap();
        let path = folder.path().join("ring");
        let words = 3 << 20;
        let ring = Shared::create(&path, words).unwrap();
        ring.check().unwrap();
        for len in [4096, 0] {
            std::fs::OpenOptions::new().write(true).open(&path).unwrap().set_len(len).unwrap();
            ring.write(words - 1, b"shortend");
            ring.write(0, b"shortend");
            assert_eq!(ring.check().unwrap_err().kind(), Kind::Io, "{len}");
        }
        std::fs::OpenOptions::new().write(true).open(&path).unwrap().set_len(8 * words as u64).unwrap();
        assert!(ring.check().is_err(), "what was written in between reached nobody");
        whole.write(0, b"whole");
        whole.check().unwrap();
    }

    #[cfg(unix)]
    #[test]
    fn other_users_may_not_open_it_and_only_its_own_name_is_removed() {
        use std::os::unix::fs::PermissionsExt as _;
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("ring");
        let ring = Shared::create(&path, 4).unwrap();
        assert_eq!(std::fs::metadata(&path).unwrap().permissions().mode() & 0o777, 0o600);
        std::fs::remove_file(&path).unwrap();
        std::fs::write(&path, "of somebody else").unwrap();
        ring.remove();
        assert!(path.exists());
        std::fs::remove_file(&path).unwrap();
        let ring = Shared::create(&path, 4).unwrap();
        ring.remove();
        assert!(!path.exists());
    }

    #[test]
    fn a_file_that_holds_no_whole_words_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("text");
        for text in ["", "seven b"] {
            std::fs::write(&path, text).unwrap();
            assert_eq!(Shared::open(&path).unwrap_err().kind(), Kind::Input, "{text:?}");
        }
    }
}
