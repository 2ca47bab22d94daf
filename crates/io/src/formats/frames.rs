//! A reader that returns the frames of a stream in order.

use std::ops::Range;

use super::reader::StreamReader;
use spikelane::error::Result;
use spikelane::unstable::inputs;

/// Number of bytes of packed frames that [`StreamFrames`] reads in one block.
const BUFFER_BYTES: usize = 256 << 10;

/// The frames of a range of readouts; see [`StreamReader::frames`].
#[derive(Debug)]
pub struct StreamFrames<'a> {
    reader: &'a StreamReader,
    /// Packed frames of the readouts `first..read`, possibly followed by unused space.
    block: Vec<u8>,
    first: usize,
    read: usize,
    next: usize,
    end: usize,
}

impl StreamFrames<'_> {
    /// Returns the next packed frame, or `None` after the last frame. Frames are read in blocks, so an error can be
    /// returned before the frame that caused the error is reached.
    ///
    /// `StreamFrames` does not implement [`Iterator`], because the returned frame borrows a buffer that the next call
    /// overwrites.
    pub fn next_frame(&mut self) -> Option<Result<&[u8]>> {
        if self.next >= self.end {
            return None;
        }
        let size = self.reader.geometry().frame_bytes();
        if self.next == self.read {
            let count = (self.block.len() / size).min(self.end - self.next);
            (self.first, self.read) = (self.next, self.next + count);
            if let Err(e) = self.reader.read_frames(self.first, &mut self.block[..count * size]) {
                self.next = self.end;
                return Some(Err(e));
            }
        }
        let at = (self.next - self.first) * size;
        self.next += 1;
        Some(Ok(&self.block[at..at + size]))
    }
}

impl StreamReader {
    /// Returns the frames of `readouts`, one frame per call of `next_frame`. Memory use does not depend on the length
    /// of `readouts`.
    ///
    /// # Errors
    /// * [`ErrorKind::Usage`](spikelane::ErrorKind::Usage) if `readouts` exceeds the stream.
    /// * [`ErrorKind::Memory`](spikelane::ErrorKind::Memory) if the buffer cannot be allocated.
    pub fn frames(&self, readouts: Range<usize>) -> Result<StreamFrames<'_>> {
        self.check(&readouts)?;
        let size = self.geometry().frame_bytes();
        let count = (BUFFER_BYTES / size).max(1).min(readouts.len());
        let block = inputs::zeroed_vec(self.name(), count * size)?;
        let Range { start, end } = readouts;
        Ok(StreamFrames { reader: self, block, first: start, read: start, next: start, end })
    }
}
