//! The readouts that are measured together, one word row per pixel row.
//!
//! A packed frame lets rows begin at any bit. Here each row begins at a word,
//! and at least one zero bit follows its last pixel: the right neighbour of
//! all pixels of a word is a shift by one, the lower neighbour the word one
//! stride further on, and neither needs a mask. The copy costs far less than
//! the unaligned shifts it saves, and makes any size of batch the same work.

use std::ops::Range;

use spikelane::spikes::Geometry;
use spikelane_io::storage::Words;

/// Readouts measured together at most: eight turns of the 8-bit vertical counters (248 readouts each), and 31 words
/// of a pixel's history. What intervals cost per pixel and block is then shared by the four times as many spikes
/// of two turns: at a rate of 0.05 that is most of the work.
pub(super) const CAPACITY: usize = 1984;

/// One turn of the vertical counters.
const TURN: usize = spikelane::unstable::kernels::GROUPS * 8;

/// Readouts of any block at least.
const FEWEST: usize = 8;

/// Buffers of larger sensors hold fewer readouts, not more memory than this.
const LARGEST_BUFFER: usize = 1 << 26;

/// Some hundred readouts of a band of rows, and the readout before them.
pub(super) struct Block {
    geometry: Geometry,
    rows: Range<usize>,
    stride: usize,
    frame_words: usize,
    capacity: usize,
    len: usize,
    words: Words,
}

impl Block {
    /// The bytes of a buffer of as many readouts as are measured together.
    pub(super) fn bytes(geometry: Geometry, rows: usize) -> usize {
        let (frame_words, capacity) = Self::size(geometry, rows, CAPACITY);
        (capacity + 1) * frame_words * size_of::<u64>()
    }

    /// Of as many readouts as are measured together.
    pub(super) fn new(geometry: Geometry, rows: Range<usize>) -> Self {
        Self::of(geometry, rows, CAPACITY)
    }

    /// Of few readouts, which stay in the cache: for who looks at each when it comes in.
    pub(super) fn short(geometry: Geometry, rows: Range<usize>) -> Self {
        Self::of(geometry, rows, FEWEST)
    }

    /// Words of a readout, and readouts of a buffer of at most `most`.
    fn size(geometry: Geometry, rows: usize, most: usize) -> (usize, usize) {
        let stride = geometry.width() / 64 + 1;
        // One row below the band for its lower neighbours, and slack for tiles
        // that overhang the end. An odd number of cache lines per readout
        // spreads one word of many readouts over all sets of the cache.
        let lines = ((rows + 1) * stride + 8).div_ceil(8) | 1;
        let frame_words = lines * 8;
        let fitting = LARGEST_BUFFER / (frame_words * 8);
        let whole = if fitting >= TURN { TURN } else { FEWEST };
        (frame_words, (fitting / whole * whole).clamp(FEWEST, most))
    }

    fn of(geometry: Geometry, rows: Range<usize>, most: usize) -> Self {
        let stride = geometry.width() / 64 + 1;
        let (frame_words, capacity) = Self::size(geometry, rows.len(), most);
        let len = (capacity + 1) * frame_words;
        let words = Words::zeros(len);
        Self { geometry, rows, stride, frame_words, capacity, len: 0, words }
    }

    /// Words of a row: enough for its pixels and one zero bit.
    pub(super) const fn stride(&self) -> usize {
        self.stride
    }

    pub(super) const fn width(&self) -> usize {
        self.geometry.width()
    }

    /// Words of the band's own rows, without the row below.
    pub(super) fn band_words(&self) -> usize {
        self.rows.len() * self.stride
    }

    pub(super) const fn len(&self) -> usize {
        self.len
    }

    pub(super) const fn capacity(&self) -> usize {
        self.capacity
    }

    /// Words between one word of a readout and the same word of the next.
    pub(super) const fn frame_words(&self) -> usize {
        self.frame_words
    }

    /// Everything: slot 0 is the readout before the block (silence at the very
    /// start), slots 1 to `len` the block.
    pub(super) fn words(&self) -> &[u64] {
        &self.words
    }

    /// The words of a slot.
    pub(super) fn slot(&self, slot: usize) -> &[u64] {
        &self.words[slot * self.frame_words..(slot + 1) * self.frame_words]
    }

    /// The band's own rows of the newest readout.
    pub(super) fn newest(&self) -> &[u64] {
        &self.slot(self.len)[..self.band_words()]
    }

    /// Adds a packed frame; there must be room.
    pub(super) fn append(&mut self, frame: &[u8]) {
        self.len += 1;
        let slot = &mut self.words[self.len * self.frame_words..(self.len + 1) * self.frame_words];
        let width = self.geometry.width();
        let below = (self.rows.end + 1).min(self.geometry.height());
        let rows = self.rows.start..below;
        if width.is_multiple_of(8) && width >= 64 {
            let bytes = width / 8;
            let frame = &frame[rows.start * bytes..rows.end * bytes];
            match bytes {
                // The two cameras that exist: a length known to the compiler makes a row a few vector moves.
                50 => copy_rows::<50, 7>(frame, slot),
                125 => copy_rows::<125, 16>(frame, slot),
                _ => frame.chunks_exact(bytes).zip(slot.chunks_exact_mut(self.stride)).for_each(copy_bytes),
            }
            return;
        }
        for (row, out) in rows.zip(slot.chunks_exact_mut(self.stride)) {
            copy_bits(frame, row * width, width, out);
        }
    }

    /// Silences the slots after the last readout, so that groups of eight
    /// readouts and whole words of history need no tails.
    pub(super) fn silence_rest(&mut self) {
        self.words[(self.len + 1) * self.frame_words..].fill(0);
    }

    /// Empties the block; its last readout becomes the one before.
    pub(super) fn recycle(&mut self) {
        let last = self.len * self.frame_words;
        self.words.copy_within(last..last + self.frame_words, 0);
        self.len = 0;
    }
}

/// [`copy_bytes`] of rows of a known length.
fn copy_rows<const BYTES: usize, const STRIDE: usize>(frame: &[u8], slot: &mut [u64]) {
    let (rows, _) = frame.as_chunks::<BYTES>();
    let (out, _) = slot.as_chunks_mut::<STRIDE>();
    rows.iter().zip(out).for_each(|(row, out)| copy_bytes((row, out)));
}

/// Copies a row of eight bytes or more to whole words, zero-padded; the last word begins behind it or within its last eight bytes.
#[inline(always)]
fn copy_bytes((row, out): (&[u8], &mut [u64])) {
    let Some((last, words)) = out.split_last_mut() else { return };
    // A loop over the few words of a row, which the compiler prepares for many, takes 27 instructions more.
    let bytes: &mut [u8] = bytemuck::cast_slice_mut(words);
    let (whole, rest) = row.split_at(bytes.len());
    bytes.copy_from_slice(whole);
    words.iter_mut().for_each(|word| *word = u64::from_le(*word));
    let end = row.last_chunk().map_or(0, |eight| u64::from_le_bytes(*eight));
    *last = if rest.is_empty() { 0 } else { end >> (64 - 8 * rest.len()) };
}

/// Copies `bits` bits from bit `start` of `bytes` to whole words, zero-padded.
fn copy_bits(bytes: &[u8], start: usize, bits: usize, out: &mut [u64]) {
    let shift = start % 8;
    let whole = bits / 64;
    let from = &bytes[start / 8..];
    let (words, rest) = out.split_at_mut(whole);
    if shift == 0 {
        for (word, eight) in words.iter_mut().zip(from.as_chunks().0) {
            *word = u64::from_le_bytes(*eight);
        }
    } else {
        // The bits of a whole word end in the ninth byte.
        for (word, nine) in words.iter_mut().zip(from.windows(9).step_by(8)) {
            *word = partial(nine, 0) >> shift | u64::from(nine[8]) << (64 - shift);
        }
    }
    let at = whole * 8;
    let mut last = partial(from, at) >> shift;
    if shift != 0 {
        last |= u64::from(from.get(at + 8).copied().unwrap_or_default()) << (64 - shift);
    }
    rest[0] = last & ((1 << (bits % 64)) - 1);
}

/// Eight bytes from `at` on as a word, zeros behind the end.
#[inline(always)]
fn partial(bytes: &[u8], at: usize) -> u64 {
    if let Some(whole) = bytes.get(at..at + 8) {
        return u64::from_le_bytes(whole.try_into().unwrap_or_default());
    }
    let mut word = [0; 8];
    let rest = bytes.get(at..).unwrap_or_default();
    word[..rest.len()].copy_from_slice(rest);
    u64::from_le_bytes(word)
}

#[cfg(test)]
mod tests {
    use super::*;
    use spikelane::spikes::bit;

    #[test]
    fn every_bit_is_where_its_row_and_column_say() {
        for width in 1..=300 {
            let geometry = Geometry::new(width, 5).unwrap();
            let frame: Vec<u8> =
                (0..geometry.frame_bytes() as u32).map(|i| (i * 167 + width) as u8).collect();
            let mut block = Block::new(geometry, 1..4);
            block.append(&frame);
            for row in 0..4 {
                let words = &block.slot(1)[row * block.stride()..][..block.stride()];
                for column in 0..64 * block.stride() {
                    let p = (row + 1) * width as usize + column;
                    let expected = column < width as usize && bit(&frame, p);
                    assert_eq!(
                        words[column / 64] >> (column % 64) & 1 != 0,
                        expected,
                        "{width}: {row}, {column}"
                    );
                }
            }
        }
    }
}
