//! The bytes of a stream, and where its frames lie in them.

use std::borrow::Cow;
use std::io::{BufReader, Cursor, Read, Seek};
use std::ops::Range;
use std::path::Path;
use std::sync::{Mutex, PoisonError};

use spikelane::error::{Error, Kind, Result};
use spikelane::unstable::inputs::{self, InputFile};

/// Bytes that are read from a file in one piece: enough for the system, few enough to stay in a core's cache until they are
/// decoded.
pub(super) const BLOCK: usize = 512 << 10;

/// Bytes at the start of a file that are compared with the marks of other formats. The header of a `.npy` is shorter.
const HEAD: usize = 16 << 10;

/// Where frames lie.
#[derive(Debug)]
pub(super) enum Place {
    /// One behind the other from this byte on.
    Even(usize),
    /// Each at a byte of its own; `None` for a lost one.
    Each(Vec<Option<usize>>),
}

/// A file, or bytes in memory.
#[derive(Debug)]
pub(super) enum Source {
    File { file: InputFile, len: usize },
    Memory(Vec<u8>),
}

impl Source {
    /// Opens a file.
    ///
    /// # Errors
    /// As [`InputFile::open`]; [`Kind::Input`] when this machine cannot address all of it.
    pub(super) fn open(path: &Path) -> Result<Self> {
        let file = InputFile::open(path)?;
        let len = usize::try_from(file.len()).map_err(|_| {
            Error::new(Kind::Input, path.display())
                .found(format_args!("{} bytes", file.len()))
                .expected(format_args!("at most {}", usize::MAX))
        })?;
        Ok(Self::File { file, len })
    }

    pub(super) const fn len(&self) -> usize {
        match self {
            Self::File { len, .. } => *len,
            Self::Memory(bytes) => bytes.len(),
        }
    }

    /// Fills `to` with the bytes from `at` on, which lie before the end.
    ///
    /// # Errors
    /// As [`InputFile::read_at`].
    pub(super) fn read(&self, at: usize, to: &mut [u8]) -> Result<()> {
        match self {
            Self::File { file, .. } => file.read_at(at as u64, to),
            Self::Memory(bytes) => {
                to.copy_from_slice(&bytes[at..at + to.len()]);
                Ok(())
            }
        }
    }

    /// Returns the bytes of `range`, which lies before the end.
    ///
    /// # Errors
    /// As [`InputFile::read_at`]; [`Kind::Memory`] where memory for them is missing.
    pub(super) fn bytes(&self, range: Range<usize>) -> Result<Cow<'_, [u8]>> {
        match self {
            Self::File { file, .. } => {
                let mut bytes = inputs::zeroed(file.path().display(), range.len())?;
                self.read(range.start, &mut bytes)?;
                Ok(Cow::Owned(bytes))
            }
            Self::Memory(bytes) => Ok(Cow::Borrowed(&bytes[range])),
        }
    }

    /// Returns the first bytes: all of a short file, else enough to know its kind by.
    ///
    /// # Errors
    /// As [`Source::bytes`].
    pub(super) fn head(&self) -> Result<Cow<'_, [u8]>> {
        self.bytes(0..self.len().min(HEAD))
    }

    /// Returns a buffered reader, at the start.
    pub(super) fn reader(&self) -> BufReader<Box<dyn ReadSeek + '_>> {
        let reader: Box<dyn ReadSeek + '_> = match self {
            Self::File { file, .. } => Box::new(file.reader()),
            Self::Memory(bytes) => Box::new(Cursor::new(bytes)),
        };
        BufReader::with_capacity(BLOCK, reader)
    }
}

pub(super) trait ReadSeek: Read + Seek {}
impl<T: Read + Seek> ReadSeek for T {}

/// Buffers that the threads of a reader take in turns.
#[derive(Debug, Default)]
pub(super) struct Buffers(Mutex<Vec<Vec<u8>>>);

impl Buffers {
    /// Calls `work` with a buffer of `len` bytes, whose content is what its last user left.
    ///
    /// # Errors
    /// [`Kind::Memory`] where memory is missing; otherwise those of `work`.
    pub(super) fn with<T>(&self, len: usize, work: impl FnOnce(&mut [u8]) -> Result<T>) -> Result<T> {
        let mut buffer = self.0.lock().unwrap_or_else(PoisonError::into_inner).pop().unwrap_or_default();
        if buffer.len() < len {
            buffer = inputs::zeroed("a buffer for readouts", len)?;
        }
        let done = work(&mut buffer[..len]);
        self.0.lock().unwrap_or_else(PoisonError::into_inner).push(buffer);
        done
    }
}
