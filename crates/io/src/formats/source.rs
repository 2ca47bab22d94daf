//! The bytes of a stream and the offsets of its frames.

use std::borrow::Cow;
use std::io::{BufReader, Cursor, Read, Seek};
use std::ops::Range;
use std::path::Path;
use std::sync::{Mutex, PoisonError};

use crate::storage::READ_BYTES;
use spikelane::error::{Result, error};
use spikelane::unstable::Count;
use spikelane::unstable::inputs::{self, InputFile};

/// Number of bytes at the start of a file that are compared with the signatures of other formats. `.npy` headers are
/// shorter.
const HEAD_BYTES: usize = 16 << 10;

/// The offsets of the frames in the source.
#[derive(Debug)]
pub(super) enum FrameOffsets {
    /// Contiguous frames. The first frame starts at this offset.
    Contiguous(usize),
    /// An offset for each frame, or `None` for a missing frame.
    Individual(Vec<Option<usize>>),
}

/// A file, or bytes in memory.
#[derive(Debug)]
pub(super) enum ByteSource {
    File { file: InputFile, len: usize },
    Memory(Vec<u8>),
}

impl ByteSource {
    /// Uses an open file.
    ///
    /// # Errors
    /// [`ErrorKind::Input`](spikelane::ErrorKind::Input) if the file length does not fit in `usize`.
    pub(super) fn from_file(file: InputFile) -> Result<Self> {
        let len = usize::try_from(file.len()).map_err(|_| {
            error!(Input, "{}", file.path().display(); found "{}", Count(file.len(), "byte");
                expected "at most {}", usize::MAX)
        })?;
        Ok(Self::File { file, len })
    }

    /// Opens a file.
    ///
    /// # Errors
    /// As [`InputFile::open`] and [`ByteSource::from_file`].
    pub(super) fn open(path: &Path) -> Result<Self> {
        Self::from_file(InputFile::open(path)?)
    }

    pub(super) const fn len(&self) -> usize {
        match self {
            Self::File { len, .. } => *len,
            Self::Memory(bytes) => bytes.len(),
        }
    }

    /// Fills `to` with the bytes that start at offset `at`. The range must be inside the source.
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

    /// Returns the bytes of `range`, which must be inside the source.
    ///
    /// # Errors
    /// As [`InputFile::read_at`], and [`ErrorKind::Memory`](spikelane::ErrorKind::Memory) if the buffer cannot be allocated.
    pub(super) fn bytes(&self, range: Range<usize>) -> Result<Cow<'_, [u8]>> {
        match self {
            Self::File { file, .. } => {
                let mut bytes = inputs::zeroed_vec(file.path().display(), range.len())?;
                self.read(range.start, &mut bytes)?;
                Ok(Cow::Owned(bytes))
            }
            Self::Memory(bytes) => Ok(Cow::Borrowed(&bytes[range])),
        }
    }

    /// Returns the bytes at the start of the source that are needed to detect the format. A shorter source is returned
    /// completely.
    ///
    /// # Errors
    /// As [`ByteSource::bytes`].
    pub(super) fn head(&self) -> Result<Cow<'_, [u8]>> {
        self.bytes(0..self.len().min(HEAD_BYTES))
    }

    /// Returns a buffered reader that starts at offset 0.
    pub(super) fn reader(&self) -> BufReader<Box<dyn ReadSeek + '_>> {
        let reader: Box<dyn ReadSeek + '_> = match self {
            Self::File { file, .. } => Box::new(file.reader()),
            Self::Memory(bytes) => Box::new(Cursor::new(bytes)),
        };
        BufReader::with_capacity(READ_BYTES, reader)
    }
}

pub(super) trait ReadSeek: Read + Seek {}
impl<T: Read + Seek> ReadSeek for T {}

/// Buffers that the threads of a reader share.
#[derive(Debug, Default)]
pub(super) struct BufferPool(Mutex<Vec<Vec<u8>>>);

impl BufferPool {
    /// Calls `work` with a buffer of `len` bytes whose content is unspecified.
    ///
    /// # Errors
    /// [`ErrorKind::Memory`](spikelane::ErrorKind::Memory) if the buffer cannot be allocated; otherwise errors of `work`.
    pub(super) fn with_buffer<T>(&self, len: usize, work: impl FnOnce(&mut [u8]) -> Result<T>) -> Result<T> {
        let mut buffer = self.0.lock().unwrap_or_else(PoisonError::into_inner).pop().unwrap_or_default();
        if buffer.len() < len {
            buffer = inputs::zeroed_vec("a buffer for readouts", len)?;
        }
        let done = work(&mut buffer[..len]);
        self.0.lock().unwrap_or_else(PoisonError::into_inner).push(buffer);
        done
    }
}
