//! A recording turned round: one row of bits for every pixel.
//!
//! All statistics along time are then operations on whole words.

use rayon::prelude::*;

use crate::kernels::{Bits, Shorts, Work, counting_with};
use crate::spikes::{Geometry, Packed};

/// The bits of a recording by pixel: bit `t % 64` of word `t / 64` of a pixel is its readout `t`.
#[derive(Clone, Debug)]
pub(super) struct PixelBits {
    pub geometry: Geometry,
    pub readouts: usize,
    /// Words of a pixel.
    pub words: usize,
    data: Vec<u64>,
}

impl PixelBits {
    pub fn new(frames: Packed<'_>) -> Self {
        let geometry = frames.geometry();
        let readouts = frames.readouts();
        let words = readouts.div_ceil(64);
        let groups = geometry.pixels().div_ceil(64);
        let mut data = vec![0; groups * 64 * words];
        let turn = |(g, pixels): (usize, &mut [u64])| {
            counting_with(Turning { frames, group: g, words, pixels });
        };
        data.par_chunks_exact_mut(64 * words.max(1)).enumerate().for_each(turn);
        Self { geometry, readouts, words, data }
    }

    pub fn pixel(&self, p: usize) -> &[u64] {
        &self.data[p * self.words..(p + 1) * self.words]
    }
}

/// The bits of the `group`th 64 pixels, on their way to `words` words of each.
struct Turning<'a> {
    frames: Packed<'a>,
    group: usize,
    words: usize,
    pixels: &'a mut [u64],
}

impl Work for Turning<'_> {
    type Out = ();

    #[inline(always)]
    fn run<S: Shorts, B: Bits>(self, _: S, b: B) {
        let (readouts, bytes) = (self.frames.readouts(), self.frames.geometry().frame_bytes());
        let mut block = [0u64; 64];
        for w in 0..self.words {
            for (i, word) in block.iter_mut().enumerate() {
                let t = w * 64 + i;
                *word = if t < readouts {
                    word_at(&self.frames.bytes()[t * bytes..(t + 1) * bytes], self.group * 8)
                } else {
                    0
                };
            }
            b.transpose(&mut block);
            for (i, word) in block.iter().enumerate() {
                self.pixels[i * self.words + w] = *word;
            }
        }
    }
}

/// Eight bytes from `at`, zeros behind the end.
#[inline(always)]
pub(super) fn word_at(bytes: &[u8], at: usize) -> u64 {
    match bytes.get(at..).and_then(|rest| rest.first_chunk::<8>()) {
        Some(whole) => u64::from_le_bytes(*whole),
        None => {
            let rest = bytes.get(at..).unwrap_or(&[]);
            rest.iter().enumerate().fold(0, |word, (i, b)| word | u64::from(*b) << (8 * i))
        }
    }
}

/// Spikes in blocks of time that end at `ends`, which rise.
#[inline(always)]
pub(super) fn count_blocks<const N: usize>(words: &[u64], ends: [usize; N]) -> [u32; N] {
    let (mut word, mut before, mut total) = (0, 0, 0);
    ends.map(|end| {
        while word < end / 64 {
            total += words[word].count_ones();
            word += 1;
        }
        let rest = if end % 64 == 0 { 0 } else { (words[word] & ((1 << (end % 64)) - 1)).count_ones() };
        let now = total + rest;
        now - std::mem::replace(&mut before, now)
    })
}

/// Spikes in a stretch of time.
#[inline(always)]
pub(super) fn count_between(words: &[u64], from: usize, to: usize) -> u32 {
    count_blocks(words, [from, to])[1]
}

/// Readouts at which both pixels fired, the second `lag` (0 or 1) readouts later.
#[inline(always)]
pub(super) fn coincidences(first: &[u64], second: &[u64], lag: usize) -> u32 {
    if lag == 0 {
        return first.iter().zip(second).map(|(a, b)| (a & b).count_ones()).sum();
    }
    let mut carried = 0;
    let mut total = 0;
    for (a, b) in first.iter().zip(second) {
        total += ((a << 1 | carried) & b).count_ones();
        carried = a >> 63;
    }
    total
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spikes::{bit, set_bit};

    #[test]
    fn every_bit_of_a_recording_is_found_under_its_pixel() {
        let geometry = Geometry::new(13, 11).unwrap();
        let readouts = 150;
        let mut bytes = vec![0; readouts * geometry.frame_bytes()];
        for (t, frame) in bytes.chunks_exact_mut(geometry.frame_bytes()).enumerate() {
            (0..geometry.pixels()).filter(|p| (p * 7 + t * t) % 5 == 0).for_each(|p| set_bit(frame, p));
        }
        let turned = PixelBits::new(Packed::new(geometry, &bytes).unwrap());
        for (t, frame) in bytes.chunks_exact(geometry.frame_bytes()).enumerate() {
            for p in 0..geometry.pixels() {
                let found = turned.pixel(p)[t / 64] >> (t % 64) & 1 != 0;
                assert_eq!(found, bit(frame, p), "pixel {p}, readout {t}");
            }
        }
        let early =
            |p: usize| bytes.chunks_exact(geometry.frame_bytes()).take(70).filter(|f| bit(f, p)).count();
        assert!((0..143).all(|p| count_blocks(turned.pixel(p), [70])[0] as usize == early(p)));
    }
}
