//! Memory that processes share. The memory consists of 64-bit words with atomic access.
#![allow(unsafe_code, reason = "mapping a file is unsafe by its nature")]

use std::fs::{File, OpenOptions};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

use crate::storage::guarded_map::{GuardedMap, check_length};
use crate::storage::platform::{is_same_file, reserve, set_private};
use crate::storage::writer::reserve_error;
use spikelane::error::{Error, Result, bail};
use spikelane::unstable::Count;

/// Number of bytes per word.
const WORD_BYTES: usize = 8;

/// A mapped file of 64-bit words. Other processes may map, read and write the file at the same time.
///
/// If another process truncates the file, accesses by this process continue on private memory; see
/// [`SharedMemory::check`].
#[derive(Debug)]
pub struct SharedMemory {
    map: GuardedMap,
    file: File,
    path: PathBuf,
}

impl SharedMemory {
    /// Creates the file `path` with `words` zero words, reserves the blocks of the file and maps the file. Other users
    /// have no permission to open the file.
    ///
    /// # Errors
    /// * [`ErrorKind::Exists`](spikelane::ErrorKind::Exists) if the file exists.
    /// * [`ErrorKind::Space`](spikelane::ErrorKind::Space) if the disk is full.
    /// * Other errors of the operating system.
    pub fn create(path: &Path, words: usize) -> Result<Self> {
        let io = |e| Error::io(path.display(), e);
        let file =
            set_private(OpenOptions::new().read(true).write(true).create_new(true)).open(path).map_err(io)?;
        let bytes = (words * WORD_BYTES) as u64;
        let reserved = reserve(&file, 0, bytes).map_err(|e| reserve_error(path, bytes, e));
        reserved.and_then(|()| Self::map(file, path)).inspect_err(|_| {
            // An incomplete file is removed, because other processes would wait until the file is ready.
            let _ = std::fs::remove_file(path);
        })
    }

    /// Maps a file that another process created.
    ///
    /// # Errors
    /// * [`ErrorKind::Io`](spikelane::ErrorKind::Io) if the file cannot be opened.
    /// * [`ErrorKind::Input`](spikelane::ErrorKind::Input) if the file is not a regular file or its length is not a whole number of words.
    pub fn open(path: &Path) -> Result<Self> {
        let io = |e| Error::io(path.display(), e);
        let file = OpenOptions::new().read(true).write(true).open(path).map_err(io)?;
        Self::map(file, path)
    }

    fn map(file: File, path: &Path) -> Result<Self> {
        let io = |e| Error::io(path.display(), e);
        let metadata = file.metadata().map_err(io)?;
        let bytes = metadata.len();
        if !metadata.is_file() || bytes == 0 || bytes % WORD_BYTES as u64 != 0 {
            bail!(Input, "{}", path.display(); found "{}", Count(bytes, "byte");
                expected "a regular file whose size is a multiple of 8 bytes");
        }
        let len = usize::try_from(bytes).map_err(|_| io(std::io::ErrorKind::OutOfMemory.into()))?;
        let map = GuardedMap::new(&file, 0, len).map_err(io)?;
        Ok(Self { map, file, path: path.to_path_buf() })
    }

    /// Checks that the file still has the length with which it was mapped.
    ///
    /// # Errors
    /// [`ErrorKind::Io`](spikelane::ErrorKind::Io) if another process truncated the file. Words that this process wrote after the truncation may
    /// be invisible to other processes.
    pub fn check(&self) -> Result<()> {
        check_length(&self.file, Some(&self.map), self.map.len() as u64, &self.path)
    }

    /// Removes the file. If the path now refers to another file, nothing is removed.
    pub fn remove(&self) {
        let (Ok(named), Ok(opened)) = (std::fs::symlink_metadata(&self.path), self.file.metadata()) else {
            return;
        };
        if is_same_file(&named, &opened) == Some(false) {
            return;
        }
        // The error is ignored, because another process may already have removed the file.
        let _ = std::fs::remove_file(&self.path);
    }

    /// Returns all words.
    #[must_use]
    pub fn words(&self) -> &[AtomicU64] {
        let words = self.map.len() / WORD_BYTES;
        // SAFETY: the mapping is writable, starts at a page boundary and lives as long as `self`. It stays accessible
        // if the file is truncated. All accesses through this slice are atomic, and other processes must use atomic
        // accesses as well. Every bit pattern is a valid word.
        unsafe { std::slice::from_raw_parts(self.map.as_mut_ptr().cast::<AtomicU64>(), words) }
    }

    /// Copies `bytes` to the words that start with word `first`. If `bytes` fills only a part of the last word, zeros
    /// fill the rest of the word.
    ///
    /// # Panics
    /// If the bytes exceed the end of the mapping.
    pub fn write(&self, first: usize, bytes: &[u8]) {
        let (full_words, tail) = bytes.as_chunks::<WORD_BYTES>();
        let words = &self.words()[first..first + bytes.len().div_ceil(WORD_BYTES)];
        for (word, bytes) in words.iter().zip(full_words) {
            word.store(u64::from_ne_bytes(*bytes), Ordering::Relaxed);
        }
        if let (Some(word), false) = (words.last(), tail.is_empty()) {
            let mut last = [0; WORD_BYTES];
            last[..tail.len()].copy_from_slice(tail);
            word.store(u64::from_ne_bytes(last), Ordering::Relaxed);
        }
    }

    /// Copies the content of the words that start with word `first` to `bytes`.
    ///
    /// # Panics
    /// If the bytes exceed the end of the mapping.
    pub fn read(&self, first: usize, bytes: &mut [u8]) {
        let words = &self.words()[first..first + bytes.len().div_ceil(WORD_BYTES)];
        for (bytes, word) in bytes.chunks_mut(WORD_BYTES).zip(words) {
            bytes.copy_from_slice(&word.load(Ordering::Relaxed).to_ne_bytes()[..bytes.len()]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use spikelane::ErrorKind;

    #[test]
    fn two_mappings_of_a_file_see_the_same_bytes() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("ring");
        let one = SharedMemory::create(&path, 4).unwrap();
        let two = SharedMemory::open(&path).unwrap();
        one.write(1, b"elevenbytes");
        let mut read = [0; 11];
        two.read(1, &mut read);
        assert_eq!(&read, b"elevenbytes");
        assert_eq!(two.words()[3].load(Ordering::Relaxed), 0);
        assert_eq!(SharedMemory::create(&path, 4).unwrap_err().kind(), ErrorKind::Exists);
    }

    #[cfg(unix)]
    #[test]
    fn a_file_that_is_shortened_is_an_error_and_no_signal() {
        let folder = tempfile::tempdir().unwrap();
        let full = SharedMemory::create(&folder.path().join("whole"), 4).unwrap();
        let path = folder.path().join("ring");
        let words = 3 << 20;
        let ring = SharedMemory::create(&path, words).unwrap();
        ring.check().unwrap();
        for len in [4096, 0] {
            std::fs::OpenOptions::new().write(true).open(&path).unwrap().set_len(len).unwrap();
            ring.write(words - 1, b"shortend");
            ring.write(0, b"shortend");
            assert_eq!(ring.check().unwrap_err().kind(), ErrorKind::Io, "{len}");
        }
        std::fs::OpenOptions::new().write(true).open(&path).unwrap().set_len(8 * words as u64).unwrap();
        assert!(ring.check().is_err(), "what was written in between reached nobody");
        full.write(0, b"whole");
        full.check().unwrap();
    }

    #[cfg(unix)]
    #[test]
    fn other_users_may_not_open_it_and_only_its_own_name_is_removed() {
        use std::os::unix::fs::PermissionsExt as _;
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("ring");
        let ring = SharedMemory::create(&path, 4).unwrap();
        assert_eq!(std::fs::metadata(&path).unwrap().permissions().mode() & 0o777, 0o600);
        std::fs::remove_file(&path).unwrap();
        std::fs::write(&path, "of somebody else").unwrap();
        ring.remove();
        assert!(path.exists());
        std::fs::remove_file(&path).unwrap();
        let ring = SharedMemory::create(&path, 4).unwrap();
        ring.remove();
        assert!(!path.exists());
    }

    #[test]
    fn a_file_that_holds_no_whole_words_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("text");
        for text in ["", "seven b"] {
            std::fs::write(&path, text).unwrap();
            assert_eq!(SharedMemory::open(&path).unwrap_err().kind(), ErrorKind::Input, "{text:?}");
        }
    }
}
