//! The frames of a stream, one after the other.

use std::ops::Range;

use super::reader::Reader;
use spikelane::error::Result;
use spikelane::unstable::inputs;

/// Bytes of packed frames that [`Frames`] reads at a time.
const BLOCK: usize = 256 << 10;

/// The frames of a range of readouts; see [`Reader::frames`].
#[derive(Debug)]
pub struct Frames<'a> {
    reader: &'a Reader,
    /// Packed frames of the readouts `first..next`, and room for more.
    block: Vec<u8>,
    first: usize,
    read: usize,
    next: usize,
    end: usize,
}

impl Frames<'_> {
    /// The next packed frame, `None` behind the last. An error is that of the next frame or of one soon behind it.
    ///
    /// Not an [`Iterator`]: the frame lives until the next call, so none is allocated.
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

impl Reader {
    /// The frames of `readouts`, one at a time, in constant memory.
    ///
    /// # Errors
    /// [`Kind::Usage`](spikelane::Kind::Usage) when they are not all in the stream, [`Kind::Memory`](spikelane::Kind::Memory) when
    /// memory for one of them is missing.
    pub fn frames(&self, readouts: Range<usize>) -> Result<Frames<'_>> {
        self.check(&readouts)?;
        let size = self.geometry().frame_bytes();
        let count = (BLOCK / size).max(1).min(readouts.len());
        let block = inputs::zeroed(self.name(), count * size)?;
        let Range { start, end } = readouts;
        Ok(Frames { reader: self, block, first: start, read: start, next: start, end })
    }
}
