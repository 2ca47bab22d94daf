//! The frames of a stream, one after the other.

use std::ops::Range;

use super::reader::Reader;
use crate::error::Result;

/// How far [`Frames`] reads before it gives memory back.
const RELEASE: usize = 16 << 20;

/// The frames of a range of readouts; see [`Reader::frames`].
#[derive(Debug)]
pub struct Frames<'a> {
    reader: &'a Reader,
    frame: Vec<u8>,
    released: usize,
    next: usize,
    end: usize,
}

impl Frames<'_> {
    /// The next packed frame, `None` behind the last.
    ///
    /// Not an [`Iterator`]: the frame lives until the next call, so none is allocated.
    pub fn next_frame(&mut self) -> Option<Result<&[u8]>> {
        if self.next >= self.end {
            return None;
        }
        let result = self.reader.read_frame(self.next, &mut self.frame);
        self.next += 1;
        let passed = (self.next - self.released) * self.reader.codec().frame_bytes();
        if passed >= RELEASE {
            self.reader.release(self.released..self.next);
            self.released = self.next;
        }
        Some(result.map(|()| self.frame.as_slice()))
    }
}

impl Reader {
    /// The frames of `readouts`, one at a time, in constant memory.
    ///
    /// # Errors
    /// [`Kind::Usage`](crate::Kind::Usage) when they are not all in the stream.
    pub fn frames(&self, readouts: Range<usize>) -> Result<Frames<'_>> {
        self.check(&readouts)?;
        Ok(Frames {
            reader: self,
            frame: vec![0; self.geometry().frame_bytes()],
            released: readouts.start,
            next: readouts.start,
            end: readouts.end,
        })
    }
}
