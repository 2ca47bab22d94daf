//! Counts the spikes of each pixel in a range of frames, and finds the first and the last spike of each pixel.

use super::bit_ops::BitOps;
use super::bit_planes::{BitPlanes, ROW_WORDS};
use super::counters::{Counters, MAX_GROUPS};
use super::dispatch::{Task, dispatch_task};
use super::i16_lanes::I16Lanes;

/// Number of bytes in a row of words. A tile in this module is one row of words.
pub(super) const ROW_BYTES: usize = 8 * ROW_WORDS;

/// Packed frames. The spikes of many pixels are counted at once.
#[derive(Clone, Copy)]
pub struct Tally<'a> {
    frames: &'a [u8],
    /// Number of bytes in a frame.
    bytes: usize,
}

/// The number of spikes of a pixel, and the indices of the frames with the first and the last spike.
///
/// If there are no spikes, `first` and `last` have no meaning.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SpikeTimes {
    /// Number of spikes.
    pub spikes: u32,
    /// Index of the frame with the first spike.
    pub first: u32,
    /// Index of the frame with the last spike.
    pub last: u32,
}

impl<'a> Tally<'a> {
    /// Returns the tally of frames of `bytes` bytes each.
    pub fn new(frames: &'a [u8], bytes: usize) -> Self {
        Self { frames, bytes }
    }

    /// Counts the spikes at each bit position of the frames and adds the numbers to `counts`. The first entry of
    /// `counts` belongs to the lowest bit of the first byte.
    pub fn add(self, counts: &mut [u32]) {
        dispatch_task(CountTask { tally: self, counts, change: u32::wrapping_add });
    }

    /// Subtracts the number of spikes of each bit from `counts`.
    pub fn subtract(self, counts: &mut [u32]) {
        dispatch_task(CountTask { tally: self, counts, change: u32::wrapping_sub });
    }

    /// Returns the spike times of each bit.
    pub fn spike_times(self) -> Vec<SpikeTimes> {
        dispatch_task(TimesTask(self))
    }

    /// Returns the tile at byte `at` of eight frames, starting at frame `frame`. Missing frames contain no spikes.
    #[inline(always)]
    fn load_eight<P: BitPlanes>(self, p: P, frame: usize, at: usize) -> [P::Row; 8] {
        let mut tiles = [p.row(&[0; ROW_WORDS]); 8];
        for (i, tile) in tiles.iter_mut().enumerate() {
            let from = (frame + i) * self.bytes + at;
            if (frame + i) * self.bytes >= self.frames.len() {
                break;
            }
            let count = ROW_BYTES.min(self.bytes - at);
            *tile = match self.frames[from..from + count].first_chunk::<ROW_BYTES>() {
                Some(row) => p.row(&words(row)),
                None => {
                    let mut padded = [0; ROW_BYTES];
                    padded[..count].copy_from_slice(&self.frames[from..from + count]);
                    p.row(&words(&padded))
                }
            };
        }
        tiles
    }

    /// Splits the frames into ranges whose counts fit in the counters.
    fn frame_runs(self) -> impl Iterator<Item = std::ops::Range<usize>> {
        let all = self.frames.len() / self.bytes;
        (0..all).step_by(8 * MAX_GROUPS).map(move |from| from..all.min(from + 8 * MAX_GROUPS))
    }
}

#[inline(always)]
pub(super) fn words(bytes: &[u8; ROW_BYTES]) -> [u64; ROW_WORDS] {
    let mut words = [0; ROW_WORDS];
    for (word, bytes) in words.iter_mut().zip(bytes.as_chunks::<8>().0) {
        *word = u64::from_le_bytes(*bytes);
    }
    words
}

struct CountTask<'a, 'b, F> {
    tally: Tally<'a>,
    counts: &'b mut [u32],
    change: F,
}

impl<F: Fn(u32, u32) -> u32> Task for CountTask<'_, '_, F> {
    type Out = ();

    #[inline(always)]
    fn run<S: I16Lanes, B: BitOps>(self, _: S, b: B) {
        let Self { tally, counts, change } = self;
        for turn in tally.frame_runs() {
            for at in (0..tally.bytes).step_by(ROW_BYTES) {
                let mut counters = Counters::new(b);
                for frame in turn.clone().step_by(8) {
                    counters.add8(b, &tally.load_eight(b, frame, at));
                }
                let row_counts = counters.counts(b);
                let counts = &mut counts[8 * at..8 * tally.bytes.min(at + ROW_BYTES)];
                for (counts, row_counts) in counts.chunks_mut(64).zip(&row_counts) {
                    for (sum, count) in counts.iter_mut().zip(row_counts) {
                        *sum = change(*sum, u32::from(*count));
                    }
                }
            }
        }
    }
}

struct TimesTask<'a>(Tally<'a>);

impl Task for TimesTask<'_> {
    type Out = Vec<SpikeTimes>;

    #[inline(always)]
    fn run<S: I16Lanes, B: BitOps>(self, _: S, b: B) -> Vec<SpikeTimes> {
        let tally = self.0;
        let mut all = vec![SpikeTimes::default(); 8 * tally.bytes];
        for turn in tally.frame_runs() {
            let groups = turn.len().div_ceil(8);
            for at in (0..tally.bytes).step_by(ROW_BYTES) {
                let [mut spikes, mut first, mut last] = [Counters::new(b); 3];
                for group in 0..groups {
                    let eight = tally.load_eight(b, turn.start + 8 * group, at);
                    spikes.add8(b, &eight);
                    last.record_last8(b, &eight, group);
                    // The frames are visited in reverse order, so the last recorded spike is the first spike in time.
                    let mut back = tally.load_eight(b, turn.start + 8 * (groups - 1 - group), at);
                    back.reverse();
                    first.record_last8(b, &back, group);
                }
                let mut row_counts = [[[0; 64]; ROW_WORDS]; 3];
                for (counts, counters) in row_counts.iter_mut().zip([&spikes, &first, &last]) {
                    *counts = counters.counts(b);
                }
                let times = &mut all[8 * at..8 * tally.bytes.min(at + ROW_BYTES)];
                for (word, times) in times.chunks_mut(64).enumerate() {
                    let [spikes, first, last] =
                        [&row_counts[0][word], &row_counts[1][word], &row_counts[2][word]];
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
    fn counts_and_times_equal_a_loop_over_bits() {
        let mut random = Pcg64Mcg::seed_from_u64(11);
        // Each pair contains the number of bytes in a frame and the number of frames.
        for (bytes, frames) in [(1, 1), (3, 9), (32, 248), (33, 249), (47, 700), (100, 8), (5, 0)] {
            let stream: Vec<u8> = (0..bytes * frames)
                .map(|_| (random.next_u32() & random.next_u32() & random.next_u32()) as u8)
                .collect();
            let mut expected = vec![SpikeTimes::default(); 8 * bytes];
            for (readout, frame) in stream.chunks(bytes).enumerate() {
                for (p, times) in expected.iter_mut().enumerate() {
                    if frame[p / 8] >> (p % 8) & 1 != 0 {
                        let first = if times.spikes == 0 { readout as u32 } else { times.first };
                        *times = SpikeTimes { spikes: times.spikes + 1, first, last: readout as u32 };
                    }
                }
            }
            let tally = Tally::new(&stream, bytes);
            assert_eq!(tally.spike_times(), expected, "{frames} frames of {bytes} bytes");
            let mut counts = vec![7; 8 * bytes];
            tally.add(&mut counts);
            let spikes: Vec<u32> = expected.iter().map(|t| 7 + t.spikes).collect();
            assert_eq!(counts, spikes, "{frames} frames of {bytes} bytes");
            tally.subtract(&mut counts);
            assert_eq!(counts, vec![7; 8 * bytes]);
        }
    }
}
