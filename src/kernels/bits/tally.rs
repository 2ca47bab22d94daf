//! How often each pixel fires in some frames, and when first and last.

use super::counting::{Work, counting_with};
use super::matrix::Bits;
use super::planes::{Planes, TILE};
use super::shorts::Shorts;
use super::vertical::{Counters, GROUPS};

/// Bytes of a tile.
const BYTES: usize = 8 * TILE;

/// Packed frames, one after the other, of which a pixel's spikes are counted, all pixels of a word together.
#[derive(Clone, Copy)]
pub struct Tally<'a> {
    frames: &'a [u8],
    /// Of a frame.
    bytes: usize,
}

/// Spikes of a pixel, and its first and last one, as readouts from the first frame on; meaningless where there is none.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Times {
    /// How many.
    pub spikes: u32,
    /// The readout of the first one.
    pub first: u32,
    /// The readout of the last one.
    pub last: u32,
}

impl<'a> Tally<'a> {
    /// Frames of `bytes` bytes each.
    pub fn new(frames: &'a [u8], bytes: usize) -> Self {
        Self { frames, bytes }
    }

    /// Adds each bit's spikes to its entry, the lowest bit of the first byte first.
    pub fn add(self, counts: &mut [u32]) {
        counting_with(Counted { tally: self, counts, change: u32::wrapping_add });
    }

    /// Takes them away again.
    pub fn subtract(self, counts: &mut [u32]) {
        counting_with(Counted { tally: self, counts, change: u32::wrapping_sub });
    }

    /// What is known of each bit.
    pub fn times(self) -> Vec<Times> {
        counting_with(Timed(self))
    }

    /// Eight frames of the tile at byte `at`, from `frame` on; frames that are not there are silent.
    #[inline(always)]
    fn eight<P: Planes>(self, p: P, frame: usize, at: usize) -> [P::Row; 8] {
        let mut tiles = [p.row(&[0; TILE]); 8];
        for (i, tile) in tiles.iter_mut().enumerate() {
            let from = (frame + i) * self.bytes + at;
            if (frame + i) * self.bytes >= self.frames.len() {
                break;
            }
            let count = BYTES.min(self.bytes - at);
            *tile = match self.frames[from..from + count].first_chunk::<BYTES>() {
                Some(whole) => p.row(&words(whole)),
                None => {
                    let mut padded = [0; BYTES];
                    padded[..count].copy_from_slice(&self.frames[from..from + count]);
                    p.row(&words(&padded))
                }
            };
        }
        tiles
    }

    /// Runs of frames that the counters hold.
    fn turns(self) -> impl Iterator<Item = std::ops::Range<usize>> {
        let all = self.frames.len() / self.bytes;
        (0..all).step_by(8 * GROUPS).map(move |from| from..all.min(from + 8 * GROUPS))
    }
}

#[inline(always)]
fn words(bytes: &[u8; BYTES]) -> [u64; TILE] {
    let mut words = [0; TILE];
    for (word, bytes) in words.iter_mut().zip(bytes.as_chunks::<8>().0) {
        *word = u64::from_le_bytes(*bytes);
    }
    words
}

struct Counted<'a, 'b, F> {
    tally: Tally<'a>,
    counts: &'b mut [u32],
    change: F,
}

impl<F: Fn(u32, u32) -> u32> Work for Counted<'_, '_, F> {
    type Out = ();

    #[inline(always)]
    fn run<S: Shorts, B: Bits>(self, _: S, b: B) {
        let Self { tally, counts, change } = self;
        for turn in tally.turns() {
            for at in (0..tally.bytes).step_by(BYTES) {
                let mut counters = Counters::new(b);
                for frame in turn.clone().step_by(8) {
                    counters.add8(b, &tally.eight(b, frame, at));
                }
                let found = counters.counts(b);
                let counts = &mut counts[8 * at..8 * tally.bytes.min(at + BYTES)];
                for (counts, found) in counts.chunks_mut(64).zip(&found) {
                    for (sum, count) in counts.iter_mut().zip(found) {
                        *sum = change(*sum, u32::from(*count));
                    }
                }
            }
        }
    }
}

struct Timed<'a>(Tally<'a>);

impl Work for Timed<'_> {
    type Out = Vec<Times>;

    #[inline(always)]
    fn run<S: Shorts, B: Bits>(self, _: S, b: B) -> Vec<Times> {
        let tally = self.0;
        let mut all = vec![Times::default(); 8 * tally.bytes];
        for turn in tally.turns() {
            let groups = turn.len().div_ceil(8);
            for at in (0..tally.bytes).step_by(BYTES) {
                let [mut spikes, mut first, mut last] = [Counters::new(b); 3];
                for group in 0..groups {
                    let eight = tally.eight(b, turn.start + 8 * group, at);
                    spikes.add8(b, &eight);
                    last.remember8(b, &eight, group);
                    // The other way round the last is the first.
                    let mut back = tally.eight(b, turn.start + 8 * (groups - 1 - group), at);
                    back.reverse();
                    first.remember8(b, &back, group);
                }
                let mut found = [[[0; 64]; TILE]; 3];
                for (found, counters) in found.iter_mut().zip([&spikes, &first, &last]) {
                    *found = counters.counts(b);
                }
                let times = &mut all[8 * at..8 * tally.bytes.min(at + BYTES)];
                for (word, times) in times.chunks_mut(64).enumerate() {
                    let [spikes, first, last] = [&found[0][word], &found[1][word], &found[2][word]];
                    for (i, times) in times.iter_mut().enumerate().filter(|(i, _)| spikes[*i] != 0) {
                        if times.spikes == 0 {
                            times.first = (turn.start + 8 * groups - 1) as u32 - u32::from(first[i]);
                        }
                        times.spikes += u32::from(spikes[i]);
                        times.last = turn.start as u32 + u32::from(last[i]);
                    }
                }
            }
        }
        all
    }
}

#[cfg(test)]
mod tests {
    use rand_pcg::Pcg64Mcg;
    use rand_pcg::rand_core::{Rng, SeedableRng};

    use super::*;

    #[test]
    fn counts_and_times_are_those_of_a_visit_of_each_bit() {
        let mut random = Pcg64Mcg::seed_from_u64(11);
        // Bytes of a frame, frames.
        for (bytes, frames) in [(1, 1), (3, 9), (32, 248), (33, 249), (47, 700), (100, 8), (5, 0)] {
            let stream: Vec<u8> = (0..bytes * frames)
                .map(|_| (random.next_u32() & random.next_u32() & random.next_u32()) as u8)
                .collect();
            let mut expected = vec![Times::default(); 8 * bytes];
            for (readout, frame) in stream.chunks(bytes).enumerate() {
                for (p, times) in expected.iter_mut().enumerate() {
                    if frame[p / 8] >> (p % 8) & 1 != 0 {
                        let first = if times.spikes == 0 { readout as u32 } else { times.first };
                        *times = Times { spikes: times.spikes + 1, first, last: readout as u32 };
                    }
                }
            }
            let tally = Tally::new(&stream, bytes);
            assert_eq!(tally.times(), expected, "{frames} frames of {bytes} bytes");
            let mut counts = vec![7; 8 * bytes];
            tally.add(&mut counts);
            let spikes: Vec<u32> = expected.iter().map(|t| 7 + t.spikes).collect();
            assert_eq!(counts, spikes, "{frames} frames of {bytes} bytes");
            tally.subtract(&mut counts);
            assert_eq!(counts, vec![7; 8 * bytes]);
        }
    }
}
