//! A buffer of successive readouts in which every pixel row begins at a word.
//!
//! In a packed frame a pixel row can begin at any bit. In this buffer each row begins at a word boundary, and at least
//! one zero bit follows the last pixel of a row. A shift of a word by one bit therefore returns the right neighbors of
//! its pixels. The word one stride later contains their lower neighbors. No mask is needed. Copying a frame into the
//! buffer is far cheaper than unaligned shifts. Blocks also have a fixed number of readouts, so the caller's batch size
//! does not affect the speed.

use std::ops::Range;

use spikelane::spikes::Geometry;
use spikelane_io::storage::WordBuffer;

/// Largest number of readouts in a block: eight periods of the 8-bit vertical counters (248 readouts each), or 31
/// words of a pixel's history.
///
/// The interval sums take a fixed time per pixel and block. At a rate of 0.05 spikes per readout this fixed time
/// dominates. A block of eight periods spreads the fixed time over four times as many spikes as a block of two periods.
pub(super) const MAX_BLOCK_READOUTS: usize = 1984;

/// Number of readouts that the 8-bit vertical counters can count before they overflow.
const COUNTER_PERIOD_READOUTS: usize = spikelane::unstable::kernels::MAX_GROUPS * 8;

/// Smallest number of readouts in a block.
const MIN_BLOCK_READOUTS: usize = 8;

/// Largest size of the buffer in bytes. Blocks of larger sensors contain fewer readouts.
const MAX_BUFFER_BYTES: usize = 1 << 26;

/// Successive readouts of a band of rows. The buffer also contains the readout that precedes the block.
pub(super) struct Block {
    geometry: Geometry,
    rows: Range<usize>,
    stride: usize,
    frame_words: usize,
    capacity: usize,
    len: usize,
    words: WordBuffer,
}

impl Block {
    /// Returns the buffer size in bytes of a block of up to [`MAX_BLOCK_READOUTS`] readouts.
    pub(super) fn bytes(geometry: Geometry, rows: usize) -> usize {
        let (frame_words, capacity) = Self::words_and_readouts(geometry, rows, MAX_BLOCK_READOUTS);
        (capacity + 1) * frame_words * size_of::<u64>()
    }

    /// Returns an empty block of up to [`MAX_BLOCK_READOUTS`] readouts.
    pub(super) fn new(geometry: Geometry, rows: Range<usize>) -> Self {
        Self::with_max_readouts(geometry, rows, MAX_BLOCK_READOUTS)
    }

    /// Returns an empty block of [`MIN_BLOCK_READOUTS`] readouts. The whole block fits into the CPU cache, for callers
    /// that process each readout as it arrives.
    pub(super) fn new_short(geometry: Geometry, rows: Range<usize>) -> Self {
        Self::with_max_readouts(geometry, rows, MIN_BLOCK_READOUTS)
    }

    /// Returns the number of words per readout, and the number of readouts that the buffer can store. The number of
    /// readouts is at most `max_readouts`.
    fn words_and_readouts(geometry: Geometry, rows: usize, max_readouts: usize) -> (usize, usize) {
        let stride = geometry.width() / 64 + 1;
        // The buffer has one extra row for the lower neighbors of the band's last row. It also has slack for tiles that
        // extend past the end of the last row. A readout is padded to an odd number of cache lines. Word `w` of
        // successive readouts then maps to different sets of the CPU cache.
        let lines = ((rows + 1) * stride + 8).div_ceil(8) | 1;
        let frame_words = lines * 8;
        let fitting = MAX_BUFFER_BYTES / (frame_words * 8);
        let unit =
            if fitting >= COUNTER_PERIOD_READOUTS { COUNTER_PERIOD_READOUTS } else { MIN_BLOCK_READOUTS };
        (frame_words, (fitting / unit * unit).clamp(MIN_BLOCK_READOUTS, max_readouts))
    }

    fn with_max_readouts(geometry: Geometry, rows: Range<usize>, max_readouts: usize) -> Self {
        let stride = geometry.width() / 64 + 1;
        let (frame_words, capacity) = Self::words_and_readouts(geometry, rows.len(), max_readouts);
        let len = (capacity + 1) * frame_words;
        let words = WordBuffer::zeros(len);
        Self { geometry, rows, stride, frame_words, capacity, len: 0, words }
    }

    /// Returns the number of words per row. They contain the row's pixels and at least one zero bit.
    pub(super) const fn stride(&self) -> usize {
        self.stride
    }

    pub(super) const fn width(&self) -> usize {
        self.geometry.width()
    }

    /// Returns the number of words of the band's own rows, without the extra row below the band.
    pub(super) fn band_words(&self) -> usize {
        self.rows.len() * self.stride
    }

    pub(super) const fn len(&self) -> usize {
        self.len
    }

    pub(super) const fn capacity(&self) -> usize {
        self.capacity
    }

    /// Returns the distance in words between a word of one readout and the same word of the next readout.
    pub(super) const fn frame_words(&self) -> usize {
        self.frame_words
    }

    /// Returns all words. Slot 0 is the readout before the block (zeros at the start of the stream). Slots 1 to `len`
    /// are the readouts of the block.
    pub(super) fn words(&self) -> &[u64] {
        &self.words
    }

    /// Returns the words of slot `slot`.
    pub(super) fn slot(&self, slot: usize) -> &[u64] {
        &self.words[slot * self.frame_words..(slot + 1) * self.frame_words]
    }

    /// Returns the words of the latest readout, without the extra row below the band.
    pub(super) fn latest_words(&self) -> &[u64] {
        &self.slot(self.len)[..self.band_words()]
    }

    /// Adds a packed frame. The block must not be full.
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
                // The sensors of the two known cameras are 400 and 1000 pixels wide. If the row length is a constant,
                // the compiler copies a row in a few vector moves.
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

    /// Zeroes the slots after the last readout. Code that processes groups of eight readouts, or whole history words,
    /// then needs no special case for the last group.
    pub(super) fn clear_rest(&mut self) {
        self.words[(self.len + 1) * self.frame_words..].fill(0);
    }

    /// Empties the block. The last readout moves to slot 0 and becomes the readout before the next block.
    pub(super) fn recycle(&mut self) {
        let last = self.len * self.frame_words;
        self.words.copy_within(last..last + self.frame_words, 0);
        self.len = 0;
    }
}

/// Copies rows of a constant length with [`copy_bytes`].
fn copy_rows<const BYTES: usize, const STRIDE: usize>(frame: &[u8], slot: &mut [u64]) {
    let (rows, _) = frame.as_chunks::<BYTES>();
    let (out, _) = slot.as_chunks_mut::<STRIDE>();
    rows.iter().zip(out).for_each(|(row, out)| copy_bytes((row, out)));
}

/// Copies a row of at least eight bytes to whole words and pads the last word with zeros. The last word contains the
/// zero to seven bytes that remain after the whole words.
#[inline(always)]
fn copy_bytes((row, out): (&[u8], &mut [u64])) {
    let Some((last, words)) = out.split_last_mut() else { return };
    // The bytes are copied as one slice. The compiler would vectorize a loop over words for long rows and so add 27
    // instructions.
    let bytes: &mut [u8] = bytemuck::cast_slice_mut(words);
    let (first, rest) = row.split_at(bytes.len());
    bytes.copy_from_slice(first);
    words.iter_mut().for_each(|word| *word = u64::from_le(*word));
    let end = row.last_chunk().map_or(0, |eight| u64::from_le_bytes(*eight));
    *last = if rest.is_empty() { 0 } else { end >> (64 - 8 * rest.len()) };
}

/// Copies `bits` bits, starting at bit `start` of `bytes`, to the words `out`. The last word is padded with zeros.
fn copy_bits(bytes: &[u8], start: usize, bits: usize, out: &mut [u64]) {
    let shift = start % 8;
    let full_words = bits / 64;
    let from = &bytes[start / 8..];
    let (words, rest) = out.split_at_mut(full_words);
    if shift == 0 {
        for (word, eight) in words.iter_mut().zip(from.as_chunks().0) {
            *word = u64::from_le_bytes(*eight);
        }
    } else {
        // If the row does not begin at a byte boundary, the last bits of a word are in the ninth byte.
        for (word, nine) in words.iter_mut().zip(from.windows(9).step_by(8)) {
            *word = load_partial_word(nine, 0) >> shift | u64::from(nine[8]) << (64 - shift);
        }
    }
    let at = full_words * 8;
    let mut last = load_partial_word(from, at) >> shift;
    if shift != 0 {
        last |= u64::from(from.get(at + 8).copied().unwrap_or_default()) << (64 - shift);
    }
    rest[0] = last & ((1 << (bits % 64)) - 1);
}

/// Returns the eight bytes that start at index `at` as a little-endian word. Bytes past the end of `bytes` are zero.
#[inline(always)]
fn load_partial_word(bytes: &[u8], at: usize) -> u64 {
    if let Some(word_bytes) = bytes.get(at..at + 8) {
        return u64::from_le_bytes(word_bytes.try_into().unwrap_or_default());
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
