//! Finds the first spike of each pixel in a sequence of frames.
//!
//! A row of 512 pixels is searched at a time, from the first frame on. The numbers of the frames are stored in bit
//! planes: bit `i` of plane `j` is bit `j` of the frame number of pixel `i`. In scalar code:
//!
//! ```text
//! for number in 1..=frames {
//!     let new = frame[number] & pending;
//!     pending &= !frame[number];
//!     for j in bits_of(number) { planes[j] |= new; }
//! }
//! ```
//!
//! Eight frames are searched before the upper planes change. The search of a row ends when all its pixels have fired.

use super::bit_ops::BitOps;
use super::bit_planes::{BitPlanes, ROW_WORDS};
use super::dispatch::{Task, dispatch_task};
use super::i16_lanes::I16Lanes;
use super::tally::{ROW_BYTES, words};

/// Largest number of bits of a frame number.
const MAX_PLANES: usize = 32;

/// The direction in which [`first_spikes`] searches.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SearchOrder {
    /// From the first frame to the last frame.
    Forward,
    /// From the last frame to the first frame.
    Backward,
}

/// Returns the number of the first frame in which each pixel fires. Frames are numbered from 1 in the order of the
/// search. The number is 0 if a pixel does not fire.
///
/// Each frame has `bytes` bytes, and the first `pixels` bits of a frame are pixels.
///
/// # Panics
/// Panics if a frame has fewer than `pixels` bits, or if there are `u32::MAX` or more frames.
pub fn first_spikes(frames: &[u8], bytes: usize, pixels: usize, order: SearchOrder) -> Vec<u32> {
    assert!(pixels <= 8 * bytes, "pixels of a frame");
    let count = frames.len() / bytes.max(1);
    assert!(count < u32::MAX as usize, "number of frames");
    dispatch_task(SearchTask { frames, bytes, count, pixels, order })
}

struct SearchTask<'a> {
    frames: &'a [u8],
    bytes: usize,
    count: usize,
    pixels: usize,
    order: SearchOrder,
}

impl SearchTask<'_> {
    /// Returns the row at byte `at` of frame `number`. Frames that do not exist, such as frame 0, contain no spikes.
    #[inline(always)]
    fn row<P: BitPlanes>(&self, p: P, number: usize, at: usize) -> P::Row {
        if number == 0 || number > self.count {
            return p.row(&[0; ROW_WORDS]);
        }
        let index = match self.order {
            SearchOrder::Forward => number - 1,
            SearchOrder::Backward => self.count - number,
        };
        let frame = &self.frames[index * self.bytes..][..self.bytes];
        match frame[at..].first_chunk::<ROW_BYTES>() {
            Some(row) => p.row(&words(row)),
            None => {
                let mut padded = [0; ROW_BYTES];
                padded[..self.bytes - at].copy_from_slice(&frame[at..]);
                p.row(&words(&padded))
            }
        }
    }

    /// Returns the numbers of the 512 pixels at byte `at`, as bit planes. Only the lowest `width` planes are used.
    #[inline(always)]
    fn search_row<P: BitPlanes>(&self, p: P, at: usize, width: usize) -> [P::Row; MAX_PLANES] {
        let zero = p.row(&[0; ROW_WORDS]);
        let mut planes = [zero; MAX_PLANES];
        let mut pending = p.row(&pixel_mask(self.pixels.saturating_sub(8 * at)));
        for block in 0..=self.count / 8 {
            let (mut any, mut low) = (zero, [zero; 3]);
            for i in 0..8 {
                let row = self.row(p, 8 * block + i, at);
                let new = p.and(row, pending);
                pending = p.and_not(row, pending);
                any = p.or(any, new);
                for (j, plane) in low.iter_mut().enumerate() {
                    if i >> j & 1 != 0 {
                        *plane = p.or(*plane, new);
                    }
                }
            }
            for (plane, low) in planes.iter_mut().zip(low) {
                *plane = p.or(*plane, low);
            }
            for (j, plane) in planes[3..width.max(3)].iter_mut().enumerate() {
                if block >> j & 1 != 0 {
                    *plane = p.or(*plane, any);
                }
            }
            if p.words(pending) == [0; ROW_WORDS] {
                break;
            }
        }
        planes
    }
}

impl Task for SearchTask<'_> {
    type Out = Vec<u32>;

    #[inline(always)]
    fn run<S: I16Lanes, B: BitOps>(self, _: S, b: B) -> Vec<u32> {
        let width = (usize::BITS - self.count.leading_zeros()) as usize;
        let mut numbers = vec![0; self.pixels];
        for (row, numbers) in numbers.chunks_mut(8 * ROW_BYTES).enumerate() {
            let planes = self.search_row(b, row * ROW_BYTES, width);
            for (byte, planes) in planes.as_chunks::<8>().0[..width.div_ceil(8)].iter().enumerate() {
                let parts = b.transpose_planes(*planes);
                for (number, part) in numbers.iter_mut().zip(parts.as_flattened()) {
                    *number |= u32::from(*part) << (8 * byte);
                }
            }
        }
        numbers
    }
}

/// Returns a row in which the first `pixels` bits are set.
fn pixel_mask(pixels: usize) -> [u64; ROW_WORDS] {
    std::array::from_fn(|word| match pixels.saturating_sub(64 * word) {
        0 => 0,
        bits @ 1..64 => (1 << bits) - 1,
        _ => u64::MAX,
    })
}

#[cfg(test)]
mod tests {
    use rand_pcg::Pcg64Mcg;
    use rand_pcg::rand_core::{Rng, SeedableRng};

    use super::*;
    use crate::kernels::bits::AnyCpu;

    #[test]
    fn first_spikes_equal_a_loop_over_bits() {
        let mut random = Pcg64Mcg::seed_from_u64(12);
        // Each row contains the pixels, the number of frames, and the number of random words that are combined by AND.
        // The shares of spikes are 1/2 to 1/1024.
        for (pixels, frames, rarity) in
            [(1, 1, 1), (8, 7, 1), (21, 9, 2), (512, 8, 3), (513, 300, 7), (1100, 700, 9), (40, 70_000, 10)]
        {
            let bytes = usize::div_ceil(pixels, 8);
            let stream: Vec<u8> = (0..bytes * frames)
                .map(|_| (0..rarity).fold(0xff, |byte, _| byte & random.next_u32() as u8))
                .collect();
            for order in [SearchOrder::Forward, SearchOrder::Backward] {
                let mut all: Vec<&[u8]> = stream.chunks(bytes).collect();
                if order == SearchOrder::Backward {
                    all.reverse();
                }
                let fires = |frame: &&[u8], p: usize| frame[p / 8] >> (p % 8) & 1 != 0;
                let expected: Vec<u32> = (0..pixels)
                    .map(|p| all.iter().position(|frame| fires(frame, p)).map_or(0, |at| at as u32 + 1))
                    .collect();
                let case = format!("{frames} frames of {pixels} pixels, {order:?}");
                assert_eq!(first_spikes(&stream, bytes, pixels, order), expected, "{case}");
                let task = SearchTask { frames: &stream, bytes, count: frames, pixels, order };
                assert_eq!(task.run(AnyCpu, AnyCpu), expected, "any CPU: {case}");
            }
        }
    }

    #[test]
    fn a_stream_without_frames_has_no_spikes() {
        assert_eq!(first_spikes(&[], 2, 9, SearchOrder::Forward), [0; 9]);
    }
}
