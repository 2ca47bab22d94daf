//! The digest that identifies the bytes of a file.

use std::path::Path;

use spikelane::error::Result;
use spikelane::unstable::inputs::{self, InputFile};

/// Number of bytes per read of a file.
pub(crate) const READ_BYTES: usize = 512 << 10;

/// An incremental BLAKE3 digest. Its text is `blake3:` and 64 hex digits.
///
/// # Examples
/// ```
/// use spikelane_io::storage::Digest;
/// let mut digest = Digest::new();
/// digest.update(b"spike");
/// digest.update(b"lane");
/// assert_eq!(digest.to_text(), Digest::hash_bytes(b"spikelane"));
/// // The BLAKE3 digest of zero bytes.
/// assert!(Digest::new().to_text().starts_with("blake3:af1349b9f5f9a1a6"));
/// ```
#[derive(Clone, Debug, Default)]
pub struct Digest(blake3::Hasher);

impl Digest {
    /// Creates the digest of zero bytes.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Appends `bytes` to the hashed data. If `bytes` contains at least 16 KiB, BLAKE3 uses all SIMD lanes.
    pub fn update(&mut self, bytes: &[u8]) {
        self.0.update(bytes);
    }

    /// Returns the digest of all bytes appended so far, as `blake3:<hex>`.
    #[must_use]
    pub fn to_text(&self) -> String {
        format!("blake3:{}", self.0.finalize().to_hex())
    }

    /// Returns the digest of `bytes`, as `blake3:<hex>`.
    #[must_use]
    pub fn hash_bytes(bytes: &[u8]) -> String {
        let mut digest = Self::new();
        digest.update(bytes);
        digest.to_text()
    }

    /// Returns the digest of a file, as `blake3:<hex>`. Memory use does not depend on the length of the file.
    ///
    /// # Errors
    /// Returns an error if the file is not a regular file, cannot be read, or is truncated during the read.
    pub fn hash_file(path: &Path) -> Result<String> {
        let file = InputFile::open(path)?;
        let mut digest = Self::new();
        let mut block = inputs::zeroed_vec(path.display(), file.len().min(READ_BYTES as u64) as usize)?;
        let mut at = 0;
        while at < file.len() {
            let piece = &mut block[..(file.len() - at).min(READ_BYTES as u64) as usize];
            file.read_at(at, piece)?;
            digest.update(piece);
            at += piece.len() as u64;
        }
        Ok(digest.to_text())
    }
}
