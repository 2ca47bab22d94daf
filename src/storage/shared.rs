//! Memory that several processes see, as words that none of them tears.
#![allow(unsafe_code, reason = "mapping a file is unsafe by its nature")]

use std::fs::{File, OpenOptions};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

use memmap2::{MmapOptions, MmapRaw};

use crate::error::{Error, Kind, Result};
use crate::storage::writer::{reserve, reserve_error};

/// Bytes of a word.
const WORD: usize = 8;

/// A mapped file of 64-bit words that other processes may map, read and write meanwhile.
///
/// The file must not be shortened by anyone while it is mapped: the operating system answers an access beyond
/// the new end with a fatal signal.
#[derive(Debug)]
pub struct Shared {
    map: MmapRaw,
    path: PathBuf,
}

impl Shared {
    /// Makes the file `path` of `words` zero words, its blocks reserved, and maps it.
    ///
    /// # Errors
    /// [`Kind::Exists`] when it is there already, [`Kind::Space`] when there is no room, and what the operating system refuses.
    pub fn create(path: &Path, words: usize) -> Result<Self> {
        let io = |e| Error::io(path.display(), e);
        let file = OpenOptions::new().read(true).write(true).create_new(true).open(path).map_err(io)?;
        let bytes = (words * WORD) as u64;
        let reserved = reserve(&file, 0, bytes).map_err(|e| reserve_error(path, bytes, e));
        reserved.and_then(|()| Self::map(&file, path)).inspect_err(|_| {
            // Half a file would look like one to wait for.
            let _ = std::fs::remove_file(path);
        })
    }

    /// Maps a file that another process has made.
    ///
    /// # Errors
    /// [`Kind::Io`] when it cannot be opened, [`Kind::Input`] when it holds no whole words.
    pub fn open(path: &Path) -> Result<Self> {
        let io = |e| Error::io(path.display(), e);
        let file = OpenOptions::new().read(true).write(true).open(path).map_err(io)?;
        Self::map(&file, path)
    }

    fn map(file: &File, path: &Path) -> Result<Self> {
        let io = |e| Error::io(path.display(), e);
        let bytes = file.metadata().map_err(io)?.len();
        if bytes == 0 || bytes % WORD as u64 != 0 {
            return Err(Error::new(Kind::Input, path.display())
                .found(format_args!("{bytes} bytes"))
                .expected("whole words of 8 bytes"));
        }
        let map = MmapOptions::new().map_raw(file).map_err(io)?;
        Ok(Self { map, path: path.to_path_buf() })
    }

    /// The path of the file.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// All words.
    #[must_use]
    pub fn words(&self) -> &[AtomicU64] {
        let words = self.map.len() / WORD;
        // SAFETY: the mapping is writable, starts at a page and lives as long as `self`; all accesses from here are
        // atomic, as those of other processes are asked to be, and any bits are a word.
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
