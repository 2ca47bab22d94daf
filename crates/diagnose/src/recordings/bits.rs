//! The bits of a recording, stored by pixel, and counts of spikes.
//!
//! With this layout, statistics over time are operations on words of 64 readouts.

use spikelane::error::Result;
use spikelane::spikes::{Geometry, SpikeFramesRef};
use spikelane::unstable::kernels::{BitOps, I16Lanes, Task, dispatch_task};
use spikelane::unstable::{inputs, threads};
use spikelane_measure::{Accumulator, MeasureOptions};

/// Number of pixel ranges that are scanned in parallel. The number is the same on all machines, because the
/// rounding of a sum of partial sums depends on the ranges.
pub(crate) const BAND_COUNT: usize = 8;

/// Number of groups of 64 pixels that one task transposes. The bits of 8 groups have 64 bytes per frame, which is
/// one cache line.
const GROUPS_PER_TASK: usize = 8;

/// The bits of a recording by pixel. Bit `t % 64` of word `t / 64` of a pixel is the bit of readout `t`.
#[derive(Clone, Debug)]
pub(crate) struct PixelBits {
    pub geometry: Geometry,
    pub readouts: usize,
    /// Number of words per pixel.
    pub words: usize,
    data: Vec<u64>,
}

impl PixelBits {
    /// Transposes `frames`.
    ///
    /// # Errors
    /// Returns [`ErrorKind::Memory`](spikelane::error::ErrorKind::Memory) if the system has no memory for the bits.
    pub(crate) fn new(frames: SpikeFramesRef<'_>) -> Result<Self> {
        let geometry = frames.geometry();
        let readouts = frames.readouts();
        let words = readouts.div_ceil(64);
        let groups = geometry.pixels().div_ceil(64);
        let mut data = inputs::zeroed_vec(
            format_args!("{readouts} readouts of {geometry} pixels"),
            groups * 64 * words,
        )?;
        let transpose = |(i, pixels): (usize, &mut [u64])| {
            dispatch_task(TransposeTask { frames, first: i * GROUPS_PER_TASK, words, pixels });
        };
        let parts: Vec<_> = data.chunks_mut(GROUPS_PER_TASK * 64 * words.max(1)).enumerate().collect();
        threads::map(parts, transpose);
        Ok(Self { geometry, readouts, words, data })
    }

    pub(crate) fn pixel(&self, p: usize) -> &[u64] {
        &self.data[p * self.words..(p + 1) * self.words]
    }
}

/// A task that transposes some groups of 64 pixels. `first` is the index of the first group. `words` is the number
/// of words per pixel.
struct TransposeTask<'a> {
    frames: SpikeFramesRef<'a>,
    first: usize,
    words: usize,
    pixels: &'a mut [u64],
}

impl Task for TransposeTask<'_> {
    type Out = ();

    #[inline(always)]
    fn run<S: I16Lanes, B: BitOps>(self, _: S, b: B) {
        let bytes = self.frames.geometry().frame_bytes();
        let mut block = [0u64; 64];
        for (w, frames) in self.frames.as_bytes().chunks(64 * bytes).enumerate() {
            for (group, pixels) in self.pixels.chunks_exact_mut(64 * self.words).enumerate() {
                let at = 8 * (self.first + group);
                // Bits after the last readout must be zero.
                block[frames.len() / bytes..].fill(0);
                for (word, frame) in block.iter_mut().zip(frames.chunks_exact(bytes)) {
                    *word = word_at(frame, at);
                }
                b.transpose(&mut block);
                for (pixel, word) in pixels.chunks_exact_mut(self.words).zip(&block) {
                    pixel[w] = *word;
                }
            }
        }
    }
}

/// Returns the eight bytes at `at` as a little-endian word. Bytes after the end are zero.
#[inline(always)]
fn word_at(bytes: &[u8], at: usize) -> u64 {
    match bytes.get(at..).and_then(|rest| rest.first_chunk::<8>()) {
        Some(whole) => u64::from_le_bytes(*whole),
        None => {
            let rest = bytes.get(at..).unwrap_or(&[]);
            rest.iter().enumerate().fold(0, |word, (i, b)| word | u64::from(*b) << (8 * i))
        }
    }
}

/// Counts the spikes in successive blocks of time. `ends` contains the end of each block, in ascending order.
#[inline(always)]
pub(crate) fn count_blocks<const N: usize>(words: &[u64], ends: &[usize; N]) -> [u32; N] {
    let (mut word, mut before, mut total) = (0, 0, 0);
    let mut counts = [0; N];
    // A closure in `map` would not be compiled with the population count instruction of this function.
    for (count, end) in counts.iter_mut().zip(ends) {
        while word < end / 64 {
            total += words[word].count_ones();
            word += 1;
        }
        let rest = if end % 64 == 0 { 0 } else { (words[word] & ((1 << (end % 64)) - 1)).count_ones() };
        *count = total + rest - before;
        before = total + rest;
    }
    counts
}

/// Counts the spikes in the readouts `from..to`.
#[inline(always)]
pub(crate) fn count_between(words: &[u64], from: usize, to: usize) -> u32 {
    count_blocks(words, &[from, to])[1]
}

/// Counts the readouts at which both pixels fire. Also counts the pairs of spikes in which one pixel fires one
/// readout after the other.
#[inline(always)]
pub(crate) fn coincidences(a: &[u64], b: &[u64]) -> [u64; 2] {
    let n = a.len().min(b.len());
    let (a, b) = (&a[..n], &b[..n]);
    let both = |a: u64, b: u64| u64::from((a & b).count_ones());
    let (mut coincident, mut delayed) = (0, 0);
    if let ([a, ..], [b, ..]) = (a, b) {
        coincident += both(*a, *b);
        delayed += both(a << 1, *b) + both(b << 1, *a);
    }
    // The carry comes from the previous word, not from the previous iteration. The iterations are therefore
    // independent, and the compiler vectorizes the loop.
    for i in 1..n {
        coincident += both(a[i], b[i]);
        delayed += both(a[i] << 1 | a[i - 1] >> 63, b[i]) + both(b[i] << 1 | b[i - 1] >> 63, a[i]);
    }
    [coincident, delayed]
}

/// Returns the number of spikes in each readout, and the number of bits that differ between each readout and the
/// next one.
///
/// # Errors
/// Those of [`Accumulator::push`].
pub(crate) fn readout_totals(frames: SpikeFramesRef<'_>) -> Result<[Vec<u32>; 2]> {
    let options =
        MeasureOptions::frames_only().with_line_covariances(false).with_series_readouts(frames.readouts());
    let mut accumulator = Accumulator::new(frames.geometry(), &options)?;
    accumulator.push(frames)?;
    Ok(accumulator.finish().frames.map_or_else(Default::default, |f| [f.totals, f.distances]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use spikelane::spikes::{Geometry, bit, set_bit};

    #[test]
    fn transposed_bits_equal_the_frames() {
        let geometry = Geometry::new(13, 11).unwrap();
        let readouts = 150;
        let mut bytes = vec![0; readouts * geometry.frame_bytes()];
        for (t, frame) in bytes.chunks_exact_mut(geometry.frame_bytes()).enumerate() {
            (0..geometry.pixels()).filter(|p| (p * 7 + t * t) % 5 == 0).for_each(|p| set_bit(frame, p));
        }
        let bits = PixelBits::new(SpikeFramesRef::new(geometry, &bytes).unwrap()).unwrap();
        for (t, frame) in bytes.chunks_exact(geometry.frame_bytes()).enumerate() {
            for p in 0..geometry.pixels() {
                let found = bits.pixel(p)[t / 64] >> (t % 64) & 1 != 0;
                assert_eq!(found, bit(frame, p), "pixel {p}, readout {t}");
            }
        }
        let early =
            |p: usize| bytes.chunks_exact(geometry.frame_bytes()).take(70).filter(|f| bit(f, p)).count();
        assert!((0..143).all(|p| count_blocks(bits.pixel(p), &[70])[0] as usize == early(p)));
    }
}
