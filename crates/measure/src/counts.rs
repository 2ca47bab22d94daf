//! Spike counts, first and last spikes, and coincidences of neighbors.

use std::array::from_fn;
use std::ops::Range;

use super::block::Block;
use super::estimate::{Estimate, tiled_ratio};
use spikelane::spikes::{Geometry, span_rate};
use spikelane::unstable::kernels::{
    BitOps, Counters, I16Lanes, MAX_GROUPS, ROW_WORDS, Task, dispatch_task, load_row,
};

/// Value that [`Counts::first_spike`] and [`Counts::last_spike`] contain for a pixel that never fired.
pub const NO_SPIKE: u32 = u32::MAX;

/// A neighbor of a pixel, and the lag in readouts from a spike of the pixel to a spike of the neighbor.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum NeighborPair {
    /// The pixel and its right neighbor in the same readout.
    Right,
    /// The right neighbor one readout after the pixel.
    RightAfter,
    /// The right neighbor one readout before the pixel.
    RightBefore,
    /// The pixel and its lower neighbor in the same readout.
    Lower,
    /// The lower neighbor one readout after the pixel.
    LowerAfter,
    /// The lower neighbor one readout before the pixel.
    LowerBefore,
}

impl NeighborPair {
    /// All pairs, in the order of [`Counts::coincidences`].
    pub const ALL: [Self; 6] =
        [Self::Right, Self::RightAfter, Self::RightBefore, Self::Lower, Self::LowerAfter, Self::LowerBefore];

    /// Whether the spike of the neighbor is one readout earlier or later than the spike of the pixel.
    #[must_use]
    pub const fn is_lagged(self) -> bool {
        !matches!(self, Self::Right | Self::Lower)
    }

    /// The key of the correlation of this pair in [`super::statistics()`].
    #[must_use]
    pub const fn key(self) -> &'static str {
        match self {
            Self::Right => "coincidence-right",
            Self::RightAfter => "coincidence-right-after",
            Self::RightBefore => "coincidence-right-before",
            Self::Lower => "coincidence-lower",
            Self::LowerAfter => "coincidence-lower-after",
            Self::LowerBefore => "coincidence-lower-before",
        }
    }

    const fn is_right(self) -> bool {
        matches!(self, Self::Right | Self::RightAfter | Self::RightBefore)
    }
}

/// Per-pixel counts of a band of rows.
///
/// Maps are row-major and contain one entry per pixel of the band. Readout 0 is the first readout of the stream.
///
/// # Examples
/// ```
/// use spikelane::{Geometry, SpikeFramesRef};
/// use spikelane_measure::{Accumulator, MeasureOptions, NO_SPIKE};
/// let geometry = Geometry::new(8, 1)?;
/// let mut sums = Accumulator::new(geometry, &MeasureOptions::without_intervals())?;
/// // Pixel 0 fires at the readouts 1 and 3.
/// sums.push(SpikeFramesRef::new(geometry, &[0, 1, 0, 1])?)?;
/// let counts = sums.finish().counts.expect("the options select counts");
/// assert_eq!((counts.count[0], counts.first_spike[0], counts.last_spike[0]), (2, 1, 3));
/// assert_eq!((counts.count[1], counts.first_spike[1]), (0, NO_SPIKE));
/// # Ok::<(), spikelane::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Counts {
    pub(super) geometry: Geometry,
    pub(super) rows: Range<usize>,
    pub(super) readouts: u32,
    /// Number of spikes.
    pub count: Vec<u32>,
    /// Readout of the first spike; [`NO_SPIKE`] if the pixel never fired.
    pub first_spike: Vec<u32>,
    /// Readout of the last spike; [`NO_SPIKE`] if the pixel never fired.
    pub last_spike: Vec<u32>,
    /// Number of coincident spikes of the pixel and a neighbor. There is one map per [`NeighborPair`], in the order of
    /// [`NeighborPair::ALL`]. An entry is zero if the pixel lacks that neighbor.
    pub coincidences: [Vec<u32>; 6],
}

/// Accumulates the counts of the readouts that were processed so far.
pub(super) struct CountAccumulator {
    result: Counts,
    /// One bit per pixel, in the word layout of the block. A bit is 1 until the pixel fires.
    unfired: Vec<u64>,
}

/// Task that adds a block to the counts.
struct CountTask<'a> {
    state: &'a mut CountAccumulator,
    block: &'a Block,
    start: u32,
}

impl Task for CountTask<'_> {
    type Out = ();

    #[inline(always)]
    fn run<S: I16Lanes, B: BitOps>(self, _: S, b: B) {
        self.state.process_block(b, self.block, self.start);
    }
}

impl CountAccumulator {
    /// Memory per pixel: nine maps of 32 bits and one bit of `unfired`, rounded up.
    pub(super) const BYTES_PER_PIXEL: usize = 40;

    pub(super) fn new(geometry: Geometry, rows: Range<usize>, block: &Block) -> Self {
        let pixels = rows.len() * geometry.width();
        Self {
            unfired: vec![u64::MAX; block.band_words()],
            result: Counts {
                geometry,
                rows,
                readouts: 0,
                count: vec![0; pixels],
                first_spike: vec![NO_SPIKE; pixels],
                last_spike: vec![NO_SPIKE; pixels],
                coincidences: from_fn(|_| vec![0; pixels]),
            },
        }
    }

    /// Adds the counts of a block. `start` is the readout number of the block's first readout.
    pub(super) fn process(&mut self, block: &Block, start: u32) {
        dispatch_task(CountTask { state: self, block, start });
    }

    #[inline(always)]
    fn process_block<B: BitOps>(&mut self, b: B, block: &Block, start: u32) {
        for from in (0..block.len()).step_by(MAX_GROUPS * 8) {
            let slots = from + 1..(from + MAX_GROUPS * 8).min(block.len()) + 1;
            for at in (0..block.band_words()).step_by(ROW_WORDS) {
                let counters = count_tile(b, block, &slots, at);
                self.flush(b, block, &counters, &slots, at, start);
            }
        }
        self.result.readouts = start + block.len() as u32;
    }

    pub(super) fn finish(self) -> Counts {
        self.result
    }

    /// Returns the number of spikes of each pixel so far.
    pub(super) fn snapshot(&self) -> Vec<u32> {
        self.result.count.clone()
    }

    /// Adds the counters of a tile to the maps.
    #[inline(always)]
    fn flush<B: BitOps>(
        &mut self,
        b: B,
        block: &Block,
        counters: &[Counters<B>; 8],
        slots: &Range<usize>,
        at: usize,
        start: u32,
    ) {
        let fired = counters[0].non_zero(b);
        let mut row_counts = [[[0; 64]; ROW_WORDS]; 8];
        for (counts, counters) in row_counts.iter_mut().zip(counters) {
            *counts = counters.counts(b);
        }
        for lane in 0..ROW_WORDS.min(block.band_words() - at) {
            if fired[lane] == 0 {
                continue;
            }
            let word = at + lane;
            let (row, column) = (word / block.stride(), word % block.stride() * 64);
            let pixels = 64.min(block.width() - column);
            let pixel = row * block.width() + column;
            let maps = std::iter::once(&mut self.result.count).chain(&mut self.result.coincidences);
            for (map, counts) in maps.zip(&row_counts) {
                for (sum, count) in map[pixel..pixel + pixels].iter_mut().zip(&counts[lane]) {
                    *sum += u32::from(*count);
                }
            }
            let readout = start + slots.start as u32 - 1;
            let last = &mut self.result.last_spike[pixel..pixel + pixels];
            for (i, (last, late)) in last.iter_mut().zip(&row_counts[7][lane]).enumerate() {
                if fired[lane] >> i & 1 != 0 {
                    *last = readout + u32::from(*late);
                }
            }
            self.resolve_first(block, slots, word, pixel, fired[lane], start);
        }
    }

    /// Stores the readout of the first spike for pixels of word `word`. The function visits only pixels that fire for
    /// the first time in `slots`.
    fn resolve_first(
        &mut self,
        block: &Block,
        slots: &Range<usize>,
        word: usize,
        pixel: usize,
        fired: u64,
        start: u32,
    ) {
        let mut open = fired & self.unfired[word];
        self.unfired[word] &= !fired;
        for slot in slots.clone() {
            if open == 0 {
                break;
            }
            let bits = block.words()[slot * block.frame_words() + word];
            mark(&mut self.result.first_spike[pixel..], open & bits, start + slot as u32 - 1);
            open &= !bits;
        }
    }
}

/// Writes `value` to the entry of `map` at the index of every set bit.
fn mark(map: &mut [u32], mut bits: u64, value: u32) {
    while bits != 0 {
        map[bits.trailing_zeros() as usize] = value;
        bits &= bits - 1;
    }
}

/// Returns three tiles of one readout: the pixels from word `at` on, their right neighbors and their lower neighbors.
#[inline(always)]
fn neighbor_rows<B: BitOps>(b: B, slot: &[u64], at: usize, stride: usize) -> (B::Row, B::Row, B::Row) {
    let center = load_row(b, slot, at);
    (center, b.shift_down(center, load_row(b, slot, at + 1)), load_row(b, slot, at + stride))
}

/// Counts the spikes and the six coincidences of a tile in a range of slots. Slots are processed in groups of eight.
/// Slots after the last readout are zero.
///
/// Counter 0 counts spikes and counters 1 to 6 count coincidences. Counter 7 stores the slot of each pixel's last
/// spike, relative to the first slot.
#[inline(always)]
fn count_tile<B: BitOps>(b: B, block: &Block, slots: &Range<usize>, at: usize) -> [Counters<B>; 8] {
    let mut counters = [Counters::new(b); 8];
    let zero = b.row(&[0; ROW_WORDS]);
    // Entry 0 is the readout before the group. Entries 1 to 8 are the readouts of the group.
    let (mut center, mut right, mut lower) = ([zero; 9], [zero; 9], [zero; 9]);
    let before = block.slot(slots.start - 1);
    (center[8], right[8], lower[8]) = neighbor_rows(b, before, at, block.stride());
    for (turn, group) in slots.clone().step_by(8).enumerate() {
        (center[0], right[0], lower[0]) = (center[8], right[8], lower[8]);
        for i in 1..9 {
            let slot = block.slot(group + i - 1);
            // Prefetches the lower neighbors of the second tile after this one.
            b.prefetch(slot, at + block.stride() + 2 * ROW_WORDS);
            (center[i], right[i], lower[i]) = neighbor_rows(b, slot, at, block.stride());
        }
        // Tuples: neighbor tiles, first entry of the pixel, first entry of the neighbor.
        let pairs =
            [(&right, 1, 1), (&right, 0, 1), (&right, 1, 0), (&lower, 1, 1), (&lower, 0, 1), (&lower, 1, 0)];
        let mut now = [zero; 8];
        now.copy_from_slice(&center[1..]);
        counters[0].add8(b, &now);
        for (counter, (other, mine, theirs)) in counters[1..].iter_mut().zip(pairs) {
            let mut both = [zero; 8];
            for (i, both) in both.iter_mut().enumerate() {
                *both = b.and(center[i + mine], other[i + theirs]);
            }
            counter.add8(b, &both);
        }
        counters[7].record_last8(b, &now, turn);
    }
    counters
}

impl Counts {
    /// Appends the counts of the band below this band. The caller must check that the two bands are compatible.
    pub(super) fn append(&mut self, below: Self) {
        self.rows.end = below.rows.end;
        self.count.extend(below.count);
        self.first_spike.extend(below.first_spike);
        self.last_spike.extend(below.last_spike);
        for (map, more) in self.coincidences.iter_mut().zip(below.coincidences) {
            map.extend(more);
        }
    }

    /// Number of readouts that were counted.
    #[must_use]
    pub const fn readouts(&self) -> u32 {
        self.readouts
    }

    /// Returns the rate of each pixel from its count, in spikes per readout.
    ///
    /// Let `f` be the rate of a pixel after `T` readouts. If the readouts are independent, the standard error of `f` is
    /// `sqrt(f (1 - f) / T)`. For a pixel that integrates charge, the count is wrong by less than one spike. If its
    /// start phase is uniformly distributed, the standard error of `f` is at most `1 / (2 T)`.
    #[must_use]
    pub fn rate(&self) -> Vec<f64> {
        let readouts = f64::from(self.readouts);
        self.count.iter().map(|n| f64::from(*n) / readouts).collect()
    }

    /// Returns the rate of each pixel, computed from the readouts of its first and last spike as
    /// `(N - 1) / (t_last - t_first)` for `N` spikes.
    ///
    /// The unit is spikes per readout. The rate is NaN with fewer than two spikes.
    ///
    /// The standard error of a rate `f` from `N` spikes is `f^2 sqrt(V) / (N - 1)`. `V` is the variance of the duration
    /// between the first and the last spike. A pixel that integrates charge has `V = 1/6 + (N - 1) s`, where `s` is the
    /// phase variance per spike (see [`super::Intervals::decompose`]). If `s` is small, the standard error after `T`
    /// readouts is about `0.41 f / T`.
    #[must_use]
    pub fn rate_by_time(&self) -> Vec<f64> {
        let spans = self.count.iter().zip(self.first_spike.iter().zip(&self.last_spike));
        spans.map(|(n, (first, last))| span_rate(*n, *first, *last).unwrap_or(f64::NAN)).collect()
    }

    /// Returns the map of the coincidences of `pair`.
    #[must_use]
    pub fn coincidence(&self, pair: NeighborPair) -> &[u32] {
        &self.coincidences[pair as usize]
    }

    /// Returns the correlation between the bit of a pixel and the bit of its neighbor.
    ///
    /// The numerator is the sum, over all pairs of pixels, of the covariance of their two bits. The denominator is the
    /// sum of `sqrt(f (1 - f) f' (1 - f'))` over all pairs, where `f` and `f'` are the rates of the two pixels.
    ///
    /// For independent pixels, the mean of the correlation over all start phases is 0. A single pair of pixels with
    /// equal rates can still be correlated. The standard error comes from the scatter of 8x8-pixel tiles (linearized
    /// ratio estimator). This error does not assume that neighboring pairs are independent.
    #[must_use]
    pub fn correlation(&self, pair: NeighborPair) -> Estimate {
        let pairs = self.pair_terms(pair);
        tiled_ratio(pairs.len(), self.geometry.width(), 8, |p| pairs[p])
    }

    /// Returns what each pair adds to the numerator and to the denominator of [`Self::correlation`]. An entry is `None` if
    /// the pixel lacks that neighbor.
    fn pair_terms(&self, pair: NeighborPair) -> Vec<Option<(f64, f64)>> {
        let width = self.geometry.width();
        let map = self.coincidence(pair);
        let step = if pair.is_right() { 1 } else { width };
        let terms = f64::from(self.readouts) - f64::from(u8::from(pair.is_lagged()));
        let rate = self.rate();
        let spread = |f: f64| (f * (1.0 - f)).sqrt();
        let of_pixel = |p: usize| {
            let has = if pair.is_right() { p % width + 1 < width } else { p + width < rate.len() };
            has.then(|| {
                let (f, g) = (rate[p], rate[p + step]);
                (f64::from(map[p]) / terms - f * g, spread(f) * spread(g))
            })
        };
        (0..rate.len()).map(of_pixel).collect()
    }

    /// Returns the influence of each pair of pixels on the result of [`Self::correlation`].
    ///
    /// The influence of a pair is `(a - r b) / mean(b)`, where `r` is the correlation. The pair adds `a` to the
    /// numerator and `b` to the denominator of `r`. The influences of all pairs sum to 0. An entry is NaN if the pixel
    /// lacks that neighbor.
    pub(super) fn correlation_map(&self, pair: NeighborPair) -> Vec<f64> {
        let pairs = self.pair_terms(pair);
        let valid = pairs.iter().flatten();
        let (x, y, n) = valid.fold((0.0, 0.0, 0.0), |s, v| (s.0 + v.0, s.1 + v.1, s.2 + 1.0));
        pairs.iter().map(|v| v.map_or(f64::NAN, |(a, b)| (a - x / y * b) / (y / n))).collect()
    }
}
