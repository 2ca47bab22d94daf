//! The rows of the 1000x1000 camera: 128 bytes, two halves of 500 pixel bits and a tag.
//!
//! The last two bytes of a half row, little-endian, are `channel << 14 | line << 4 | pixels`:
//! the low four bits are the last pixels of the half, the other twelve the tag. Top row first.
//! A frame begins with the half row tagged (line 500, channel 0) and ends with (500, 3);
//! lines run from 1 to 500 (SpikeCV, `sps_parser.py`). The order of the tags between is
//! published nowhere; the writer counts lines down to 1 in channels 0 and 1 and up again in
//! 2 and 3, the simplest order that meets both ends and uses each tag once. Readers,
//! SpikeCV's and this one, do not depend on it.

use super::copy_bits;
use crate::formats::source::Source;
use spikelane::error::Result;

/// Rows of a frame, and pixels of a row.
const SIDE: usize = 1000;
/// Pixels of a half row.
const HALF_PIXELS: usize = SIDE / 2;
/// Bytes of a half row in the file.
const HALF: usize = 64;
/// Bytes of a row of pixels in memory.
const ROW: usize = SIDE / 8;
/// Bytes of a frame in the file.
pub(crate) const FRAME: usize = SIDE * 2 * HALF;

/// Where a frame can begin: the camera's link moves 16 bytes at a time, and SpikeCV
/// looks for the first tag in such steps.
const STEP: usize = 16;

/// How far into a file the first whole frame is looked for. A recording loses less than
/// one frame at its start; a second one allows for a damaged one.
const SEARCH: usize = 2 * FRAME;

/// Bytes in memory while a frame is looked for at every byte.
const WINDOW: usize = 8 * FRAME;

/// The tag of a half row: (line, channel).
fn tag(half: &[u8]) -> (u16, u16) {
    let word = u16::from_le_bytes([half[HALF - 2], half[HALF - 1]]);
    (word >> 4 & 0x3ff, word >> 14)
}

/// The tag this project writes for a half row.
fn tag_of(row: usize, half: usize) -> u16 {
    let (line, channel) =
        if row < SIDE / 2 { (SIDE / 2 - row, half) } else { (row + 1 - SIDE / 2, half + 2) };
    (channel << 14 | line << 4) as u16
}

/// Whether a frame's worth of bytes begins and ends as a frame does.
pub(crate) fn is_framed(file: &[u8]) -> bool {
    are_ends(&file[..HALF], &file[FRAME - HALF..])
}

/// Whether these are the first and the last half row of a frame.
fn are_ends(first: &[u8], last: &[u8]) -> bool {
    tag(first) == (500, 0) && tag(last) == (500, 3)
}

/// Whether all tags are possible. Pixels look like the first tag once in 4,096 places,
/// so finding that one alone would lock onto pictures.
fn is_frame(file: &[u8]) -> bool {
    is_framed(file) && file.chunks_exact(HALF).all(|h| (1..=500).contains(&tag(h).0))
}

/// A stretch of a file in memory, moved along while frames are looked for.
struct Window<'a> {
    source: &'a Source,
    /// Bytes of the file that are looked at.
    len: usize,
    start: usize,
    bytes: Vec<u8>,
}

impl<'a> Window<'a> {
    fn new(source: &'a Source, len: usize) -> Self {
        Self { source, len, start: 0, bytes: Vec::new() }
    }

    /// Whether a frame of possible tags begins at `at`, and a whole frame fits there.
    fn is_frame(&mut self, at: usize) -> Result<bool> {
        if at < self.start || at + FRAME > self.start + self.bytes.len() {
            self.bytes.resize(WINDOW.min(self.len - at), 0);
            self.source.read(at, &mut self.bytes)?;
            self.start = at;
        }
        Ok(is_frame(&self.bytes[at - self.start..][..FRAME]))
    }

    /// Whether a frame begins and ends at `at` as frames do, by its two ends alone.
    fn is_framed(&self, at: usize) -> Result<bool> {
        let [mut first, mut last] = [[0; HALF]; 2];
        self.source.read(at, &mut first)?;
        self.source.read(at + FRAME - HALF, &mut last)?;
        Ok(are_ends(&first, &last))
    }

    /// The first of these places at which a frame begins.
    fn find(&mut self, mut places: impl Iterator<Item = usize>) -> Result<Option<usize>> {
        places.find_map(|at| self.is_frame(at).map(|found| found.then_some(at)).transpose()).transpose()
    }

    /// The offset of the first whole frame, which lies in steps of the link unless bytes were lost before it.
    fn synchronise(&mut self) -> Result<Option<usize>> {
        let Some(last) = self.len.checked_sub(FRAME).map(|n| n.min(SEARCH)) else { return Ok(None) };
        match self.find((0..=last).step_by(STEP))? {
            None => self.find(0..=last),
            found => Ok(found),
        }
    }
}

/// Where the frames of a recording lie.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Found {
    /// The offset of each frame; `None` where one was lost.
    pub(crate) frames: Vec<Option<usize>>,
    /// Bytes of partial frames before the first and behind the last one.
    pub(crate) leading: usize,
    pub(crate) trailing: usize,
}

/// Finds all frames in the first `len` bytes. Where one does not follow the other the next whole frame is looked for, at any
/// byte; what lies between counts as the frames that it would take to hold its bytes, so a loss of whole frames leaves no trace.
///
/// # Errors
/// Those of reading `source`.
pub(crate) fn find(source: &Source, len: usize) -> Result<Option<Found>> {
    let mut window = Window::new(source, len);
    let Some(leading) = window.synchronise()? else { return Ok(None) };
    let (mut frames, mut at) = (Vec::new(), leading);
    while len - at >= FRAME {
        if window.is_framed(at)? {
            frames.push(Some(at));
            at += FRAME;
            continue;
        }
        // Pixels may look like a last tag where bytes are missing before it.
        if let Some(last) = frames.last().copied().flatten()
            && !window.is_frame(last)?
        {
            at -= FRAME;
            frames.pop();
        }
        let next = window.find(at + 1..=len - FRAME)?;
        let lost = next.map_or((len - at) / FRAME, |next| (next - at).div_ceil(FRAME));
        frames.extend(std::iter::repeat_n(None, lost));
        at = next.unwrap_or(at + lost * FRAME);
    }
    Ok(Some(Found { frames, leading, trailing: len - at }))
}

pub(crate) fn encode(packed: &[u8], file: &mut [u8]) {
    let rows = packed.chunks_exact(ROW).zip(file.chunks_exact_mut(2 * HALF));
    for (row, (pixels, out)) in rows.enumerate() {
        for (half, out) in out.chunks_exact_mut(HALF).enumerate() {
            copy_bits(out, 0, pixels, half * HALF_PIXELS, HALF_PIXELS);
            let [low, high] = tag_of(row, half).to_le_bytes();
            out[HALF - 2] = out[HALF - 2] & 0x0f | low;
            out[HALF - 1] = high;
        }
    }
}

pub(crate) fn decode(file: &[u8], packed: &mut [u8]) {
    let rows = file.chunks_exact(2 * HALF).zip(packed.chunks_exact_mut(ROW));
    for (row, pixels) in rows {
        copy_bits(pixels, 0, row, 0, HALF_PIXELS);
        copy_bits(pixels, HALF_PIXELS, row, HALF * 8, HALF_PIXELS);
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
