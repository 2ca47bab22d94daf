//! The digest by which a file's bytes are known.

use std::path::Path;

use spikelane::error::Result;
use spikelane::unstable::inputs::{self, InputFile};

/// Bytes that are read and hashed in one piece.
const BLOCK: usize = 512 << 10;

/// An incremental BLAKE3 digest, written as `blake3:` and 64 hex digits.
#[derive(Clone, Debug, Default)]
pub struct Digest(blake3::Hasher);

impl Digest {
    /// The digest of nothing yet.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Appends bytes. Pieces of 16 KiB or more keep the lanes of BLAKE3 busy.
    pub fn update(&mut self, bytes: &[u8]) {
        self.0.update(bytes);
    }

    /// The digest of all bytes so far, as `blake3:<hex>`.
    #[must_use]
    pub fn text(&self) -> String {
        format!("blake3:{}", self.0.finalize().to_hex())
    }

    /// The digest of `bytes`, as `blake3:<hex>`.
    #[must_use]
    pub fn of(bytes: &[u8]) -> String {
        let mut digest = Self::new();
        digest.update(bytes);
        digest.text()
    }

    /// The digest of a file, in constant memory.
    ///
    /// # Errors
    /// When it is no regular file, cannot be read, or is shortened meanwhile.
    pub fn of_file(path: &Path) -> Result<String> {
        let file = InputFile::open(path)?;
        let mut digest = Self::new();
        let mut block = inputs::zeroed(path.display(), file.len().min(BLOCK as u64) as usize)?;
        let mut at = 0;
        while at < file.len() {
            let piece = &mut block[..(file.len() - at).min(BLOCK as u64) as usize];
            file.read_at(at, piece)?;
            digest.update(piece);
            at += piece.len() as u64;
        }
        Ok(digest.text())
    }
}
