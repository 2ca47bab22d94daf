//! The rows of the 1000x1000 camera, top row first. A row has 128 bytes in two halves. Each half contains 500 pixel
//! bits and a tag.
//!
//! The last two bytes of a half row form the little-endian word `channel << 14 | line << 4 | pixels`. The low four
//! bits are the last four pixels of the half row. The other twelve bits are the tag of the half row. Lines are
//! numbered from 1 to 500. A frame begins with the tag (line 500, channel 0) and ends with the tag (line 500, channel
//! 3), as in `sps_parser.py` of SpikeCV.
//!
//! The camera vendor has not published the order of the tags inside a frame. In channels 0 and 1, the writer
//! decreases the line number from 500 to 1. In channels 2 and 3, the writer increases the line number from 1 to 500.
//! This is the simplest order that has the required first and last tags and uses each tag once. The reader of SpikeCV
//! and the reader of this crate accept every order.

use super::copy_bits;
use crate::formats::source::ByteSource;
use spikelane::error::Result;

/// Number of rows of a frame, and number of pixels of a row.
const SIDE: usize = 1000;
/// Pixels of a half row.
const HALF_PIXELS: usize = SIDE / 2;
/// Bytes of a half row in the file.
const HALF_ROW_BYTES: usize = 64;
/// Bytes of a row in memory.
const PACKED_ROW_BYTES: usize = SIDE / 8;
/// Bytes of a frame in the file.
pub(crate) const FRAME_BYTES: usize = SIDE * 2 * HALF_ROW_BYTES;

/// A frame can begin at multiples of this number of bytes. The camera's link transfers 16 bytes at a time, and SpikeCV
/// searches for the first tag with the same step.
const LINK_STEP_BYTES: usize = 16;

/// Number of bytes at the start of a file in which the first whole frame is searched. A recording can start inside a
/// frame, so the first whole frame starts within one frame length. The second frame length is searched in case the
/// first whole frame is damaged.
const SEARCH_BYTES: usize = 2 * FRAME_BYTES;

/// Number of bytes in memory while every byte offset is searched.
const WINDOW_BYTES: usize = 8 * FRAME_BYTES;

/// Returns the tag of a half row as (line, channel).
fn tag(half: &[u8]) -> (u16, u16) {
    let word = u16::from_le_bytes([half[HALF_ROW_BYTES - 2], half[HALF_ROW_BYTES - 1]]);
    (word >> 4 & 0x3ff, word >> 14)
}

/// Returns the tag that the writer stores in a half row. The four pixel bits are zero.
fn tag_of(row: usize, half: usize) -> u16 {
    let (line, channel) =
        if row < SIDE / 2 { (SIDE / 2 - row, half) } else { (row + 1 - SIDE / 2, half + 2) };
    (channel << 14 | line << 4) as u16
}

/// Returns whether `file` begins and ends with the tags of a frame. `file` must have the length of a frame.
pub(crate) fn is_framed(file: &[u8]) -> bool {
    are_ends(&file[..HALF_ROW_BYTES], &file[FRAME_BYTES - HALF_ROW_BYTES..])
}

/// Returns whether `first` and `last` have the tags of the first and the last half row of a frame.
fn are_ends(first: &[u8], last: &[u8]) -> bool {
    tag(first) == (500, 0) && tag(last) == (500, 3)
}

/// Returns whether all tags are valid. A check of the first tag alone is not sufficient, because random pixels match
/// the 12 bits of a tag at one in 4,096 positions.
fn is_frame(file: &[u8]) -> bool {
    is_framed(file) && file.chunks_exact(HALF_ROW_BYTES).all(|h| (1..=500).contains(&tag(h).0))
}

/// The part of a file that is currently in memory. The part moves along the file during the search for frames.
struct Window<'a> {
    source: &'a ByteSource,
    /// Number of bytes at the start of the file in which frames are searched.
    len: usize,
    start: usize,
    bytes: Vec<u8>,
}

impl<'a> Window<'a> {
    fn new(source: &'a ByteSource, len: usize) -> Self {
        Self { source, len, start: 0, bytes: Vec::new() }
    }

    /// Returns whether a whole frame with valid tags begins at `at`.
    fn is_frame(&mut self, at: usize) -> Result<bool> {
        if at < self.start || at + FRAME_BYTES > self.start + self.bytes.len() {
            self.bytes.resize(WINDOW_BYTES.min(self.len - at), 0);
            self.source.read(at, &mut self.bytes)?;
            self.start = at;
        }
        Ok(is_frame(&self.bytes[at - self.start..][..FRAME_BYTES]))
    }

    /// Returns whether the bytes at `at` begin and end with the tags of a frame. The other tags are not checked.
    fn is_framed(&self, at: usize) -> Result<bool> {
        let [mut first, mut last] = [[0; HALF_ROW_BYTES]; 2];
        self.source.read(at, &mut first)?;
        self.source.read(at + FRAME_BYTES - HALF_ROW_BYTES, &mut last)?;
        Ok(are_ends(&first, &last))
    }

    /// Returns the first offset in `places` at which a frame begins.
    fn find(&mut self, mut places: impl Iterator<Item = usize>) -> Result<Option<usize>> {
        places.find_map(|at| self.is_frame(at).map(|is_frame| is_frame.then_some(at)).transpose()).transpose()
    }

    /// Returns the offset of the first whole frame. Multiples of the link step are tried first, because other offsets
    /// occur only if bytes before the frame are missing.
    fn synchronize(&mut self) -> Result<Option<usize>> {
        let Some(last) = self.len.checked_sub(FRAME_BYTES).map(|n| n.min(SEARCH_BYTES)) else {
            return Ok(None);
        };
        match self.find((0..=last).step_by(LINK_STEP_BYTES))? {
            None => self.find(0..=last),
            found => Ok(found),
        }
    }
}

/// The positions of the frames in a recording.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct FrameScan {
    /// The offset of each frame, or `None` for a missing frame.
    pub(crate) frames: Vec<Option<usize>>,
    /// Bytes of a partial frame before the first whole frame.
    pub(crate) leading: usize,
    /// Bytes of a partial frame after the last whole frame.
    pub(crate) trailing: usize,
}

/// Finds all frames in the first `len` bytes. Returns `None` if no whole frame starts in the first two frame lengths
/// of the file.
///
/// If the bytes after a frame are not a frame, the next whole frame is searched at every byte offset. The bytes up to
/// the next whole frame count as missing frames. The number of missing frames is the number of these bytes divided by
/// the length of a frame, rounded up. The tags contain no frame counter, so a loss of a whole number of frames cannot
/// be detected.
///
/// # Errors
/// Errors of reading `source`.
pub(crate) fn find(source: &ByteSource, len: usize) -> Result<Option<FrameScan>> {
    let mut window = Window::new(source, len);
    let Some(leading) = window.synchronize()? else { return Ok(None) };
    let (mut frames, mut at) = (Vec::new(), leading);
    while len - at >= FRAME_BYTES {
        if window.is_framed(at)? {
            frames.push(Some(at));
            at += FRAME_BYTES;
            continue;
        }
        // If bytes are missing in the previous frame, pixels of the following frame can match the last tag of the
        // previous frame by chance. Therefore all tags of the previous frame are checked.
        if let Some(last) = frames.last().copied().flatten()
            && !window.is_frame(last)?
        {
            at -= FRAME_BYTES;
            frames.pop();
        }
        let next = window.find(at + 1..=len - FRAME_BYTES)?;
        let lost = next.map_or((len - at) / FRAME_BYTES, |next| (next - at).div_ceil(FRAME_BYTES));
        frames.extend(std::iter::repeat_n(None, lost));
        at = next.unwrap_or(at + lost * FRAME_BYTES);
    }
    Ok(Some(FrameScan { frames, leading, trailing: len - at }))
}

pub(crate) fn encode(packed: &[u8], file: &mut [u8]) {
    let rows = packed.chunks_exact(PACKED_ROW_BYTES).zip(file.chunks_exact_mut(2 * HALF_ROW_BYTES));
    for (row, (pixels, out)) in rows.enumerate() {
        for (half, out) in out.chunks_exact_mut(HALF_ROW_BYTES).enumerate() {
            copy_bits(out, 0, pixels, half * HALF_PIXELS, HALF_PIXELS);
            let [low, high] = tag_of(row, half).to_le_bytes();
            out[HALF_ROW_BYTES - 2] = out[HALF_ROW_BYTES - 2] & 0x0f | low;
            out[HALF_ROW_BYTES - 1] = high;
        }
    }
}

pub(crate) fn decode(file: &[u8], packed: &mut [u8]) {
    let rows = file.chunks_exact(2 * HALF_ROW_BYTES).zip(packed.chunks_exact_mut(PACKED_ROW_BYTES));
    for (row, pixels) in rows {
        copy_bits(pixels, 0, row, 0, HALF_PIXELS);
        copy_bits(pixels, HALF_PIXELS, row, HALF_ROW_BYTES * 8, HALF_PIXELS);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_tag_is_written_once_and_the_ends_are_the_cameras() {
        let mut tags: Vec<u16> = (0..SIDE).flat_map(|row| [tag_of(row, 0), tag_of(row, 1)]).collect();
        assert_eq!((tags[0], tags[2 * SIDE - 1]), (500 << 4, 3 << 14 | 500 << 4));
        tags.sort_unstable();
        tags.dedup();
        assert_eq!(tags.len(), 2 * SIDE);
    }
}
