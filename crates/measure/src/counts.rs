//! Spike counts, first and last spike, and coincidences of neighbours.

use std::array::from_fn;
use std::ops::Range;

use super::block::Block;
use super::estimate::{Estimate, tiles_ratio};
use spikelane::spikes::{Geometry, span_rate};
use spikelane::unstable::kernels::{Bits, Counters, GROUPS, Shorts, TILE, Work, counting_with, load};

/// In place of a readout where a pixel never fired.
pub const NEVER: u32 = u32::MAX;

/// A neighbour, and by how many readouts it fires later than the pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Pair {
    /// Pixel and right neighbour in the same readout.
    Right,
    /// The right neighbour one readout after the pixel.
    RightAfter,
    /// The right neighbour one readout before the pixel.
    RightBefore,
    /// Pixel and lower neighbour in the same readout.
    Lower,
    /// The lower neighbour one readout after the pixel.
    LowerAfter,
    /// The lower neighbour one readout before the pixel.
    LowerBefore,
}

impl Pair {
    /// All pairs, in the order of their maps.
    pub const ALL: [Self; 6] =
        [Self::Right, Self::RightAfter, Self::RightBefore, Self::Lower, Self::LowerAfter, Self::LowerBefore];

    /// Whether the two spikes lie one readout apart.
    #[must_use]
    pub const fn is_lagged(self) -> bool {
        !matches!(self, Self::Right | Self::Lower)
    }

    /// The key of its correlation in [`super::list`].
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

/// Per-pixel counts of a band of rows. Maps are row-major, one entry per pixel
/// of the band; readouts count from 0 at the start of the stream.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Counts {
    pub(super) geometry: Geometry,
    pub(super) rows: Range<usize>,
    pub(super) readouts: u32,
    /// Spikes.
    pub count: Vec<u32>,
    /// Readout of the first spike, or `u32::MAX` without one.
    pub first: Vec<u32>,
    /// Readout of the last spike, or `u32::MAX` without one.
    pub last: Vec<u32>,
    /// Coincidences with a neighbour, by [`Pair`] in the order of
    /// [`Pair::ALL`]; zero where there is no such neighbour.
    pub coincidences: [Vec<u32>; 6],
}

/// What is counted while frames come in.
pub(super) struct State {
    result: Counts,
    /// Per word of the band: pixels that have not fired yet.
    unseen: Vec<u64>,
}

/// A block on its way into the counts.
struct Taking<'a> {
    state: &'a mut State,
    block: &'a Block,
    start: u32,
}

impl Work for Taking<'_> {
    type Out = ();

    #[inline(always)]
    fn run<S: Shorts, B: Bits>(self, _: S, b: B) {
        self.state.take(b, self.block, self.start);
    }
}

impl State {
    /// Nine maps of 32 bits, a bit for whether the pixel has fired, and rounding up.
    pub(super) const BYTES_PER_PIXEL: usize = 40;

    pub(super) fn new(geometry: Geometry, rows: Range<usize>, block: &Block) -> Self {
        let pixels = rows.len() * geometry.width();
        Self {
            unseen: vec![u64::MAX; block.band_words()],
            result: Counts {
                geometry,
                rows,
                readouts: 0,
                count: vec![0; pixels],
                first: vec![NEVER; pixels],
                last: vec![NEVER; pixels],
                coincidences: from_fn(|_| vec![0; pixels]),
            },
        }
    }

    /// Counts a block that starts at readout `start`.
    pub(super) fn process(&mut self, block: &Block, start: u32) {
        counting_with(Taking { state: self, block, start });
    }

    #[inline(always)]
    fn take<B: Bits>(&mut self, b: B, block: &Block, start: u32) {
        for from in (0..block.len()).step_by(GROUPS * 8) {
            let slots = from + 1..(from + GROUPS * 8).min(block.len()) + 1;
            for at in (0..block.band_words()).step_by(TILE) {
                let counters = count_tile(b, block, &slots, at);
                self.empty(b, block, &counters, &slots, at, start);
            }
        }
        self.result.readouts = start + block.len() as u32;
    }

    pub(super) fn finish(self) -> Counts {
        self.result
    }

    /// Spikes so far, per pixel.
    pub(super) fn snapshot(&self) -> Vec<u32> {
        self.result.count.clone()
    }

    /// Moves the counters of a tile into the maps.
    #[inline(always)]
    fn empty<B: Bits>(
        &mut self,
        b: B,
        block: &Block,
        counters: &[Counters<B>; 8],
        slots: &Range<usize>,
        at: usize,
        start: u32,
    ) {
        let fired = counters[0].any(b);
        let mut found = [[[0; 64]; TILE]; 8];
        for (found, counters) in found.iter_mut().zip(counters) {
            *found = counters.counts(b);
        }
        for lane in 0..TILE.min(block.band_words() - at) {
            if fired[lane] == 0 {
                continue;
            }
            let word = at + lane;
            let (row, column) = (word / block.stride(), word % block.stride() * 64);
            let pixels = 64.min(block.width() - column);
            let pixel = row * block.width() + column;
            let maps = std::iter::once(&mut self.result.count).chain(&mut self.result.coincidences);
            for (map, found) in maps.zip(&found) {
                for (sum, count) in map[pixel..pixel + pixels].iter_mut().zip(&found[lane]) {
                    *sum += u32::from(*count);
                }
            }
            let readout = start + slots.start as u32 - 1;
            let last = &mut self.result.last[pixel..pixel + pixels];
            for (i, (last, late)) in last.iter_mut().zip(&found[7][lane]).enumerate() {
                if fired[lane] >> i & 1 != 0 {
                    *last = readout + u32::from(*late);
                }
            }
            self.resolve_first(block, slots, word, pixel, fired[lane], start);
        }
    }

    /// Finds the first spikes of the pixels of one word, in the blocks in which
    /// a pixel fires for the first time.
    fn resolve_first(
        &mut self,
        block: &Block,
        slots: &Range<usize>,
        word: usize,
        pixel: usize,
        fired: u64,
        start: u32,
    ) {
        let mut open = fired & self.unseen[word];
        self.unseen[word] &= !fired;
        for slot in slots.clone() {
            if open == 0 {
                break;
            }
            let bits = block.words()[slot * block.frame_words() + word];
            mark(&mut self.result.first[pixel..], open & bits, start + slot as u32 - 1);
            open &= !bits;
        }
    }
}

/// Writes `value` at every set bit.
fn mark(map: &mut [u32], mut bits: u64, value: u32) {
    while bits != 0 {
        map[bits.trailing_zeros() as usize] = value;
        bits &= bits - 1;
    }
}

/// A tile of one readout: its pixels, their right and their lower neighbours.
#[inline(always)]
fn neighbours<B: Bits>(b: B, slot: &[u64], at: usize, stride: usize) -> (B::Row, B::Row, B::Row) {
    let own = load(b, slot, at);
    (own, b.down(own, load(b, slot, at + 1)), load(b, slot, at + stride))
}

/// Spikes and the six coincidences of a tile over some slots, in groups of
/// eight: the slots after the last are silent.
///
/// The last of the eight holds the last spike, as a slot counted from the first.
#[inline(always)]
fn count_tile<B: Bits>(b: B, block: &Block, slots: &Range<usize>, at: usize) -> [Counters<B>; 8] {
    let mut counters = [Counters::new(b); 8];
    let zero = b.row(&[0; TILE]);
    // Entry 0 is the readout before the group.
    let (mut own, mut right, mut lower) = ([zero; 9], [zero; 9], [zero; 9]);
    let before = block.slot(slots.start - 1);
    (own[8], right[8], lower[8]) = neighbours(b, before, at, block.stride());
    for (turn, group) in slots.clone().step_by(8).enumerate() {
        (own[0], right[0], lower[0]) = (own[8], right[8], lower[8]);
        for i in 1..9 {
            let slot = block.slot(group + i - 1);
            // The lower neighbours of the tile after the next.
            b.ask(slot, at + block.stride() + 2 * TILE);
            (own[i], right[i], lower[i]) = neighbours(b, slot, at, block.stride());
        }
        // Of the pixel and of a neighbour, from which entry on.
        let pairs =
            [(&right, 1, 1), (&right, 0, 1), (&right, 1, 0), (&lower, 1, 1), (&lower, 0, 1), (&lower, 1, 0)];
        let mut now = [zero; 8];
        now.copy_from_slice(&own[1..]);
        counters[0].add8(b, &now);
        for (counter, (other, mine, theirs)) in counters[1..].iter_mut().zip(pairs) {
            let mut both = [zero; 8];
            for (i, both) in both.iter_mut().enumerate() {
                *both = b.and(own[i + mine], other[i + theirs]);
            }
            counter.add8(b, &both);
        }
        counters[7].remember8(b, &now, turn);
    }
    counters
}

impl Counts {
    /// Appends the band below; the caller has checked that they fit.
    pub(super) fn append(&mut self, below: Self) {
        self.rows.end = below.rows.end;
        self.count.extend(below.count);
        self.first.extend(below.first);
        self.last.extend(below.last);
        for (map, more) in self.coincidences.iter_mut().zip(below.coincidences) {
            map.extend(more);
        }
    }

    /// Readouts that were counted.
    #[must_use]
    pub const fn readouts(&self) -> u32 {
        self.readouts
    }

    /// Rate per pixel from its count, in spikes per readout.
    ///
    /// Standard error: independent readouts give `sqrt(f (1 - f) / T)`; a pixel
    /// that integrates misses less than one spike, so uniform phase gives at
    /// most `1 / (2 T)`.
    #[must_use]
    pub fn rate(&self) -> Vec<f64> {
        let readouts = f64::from(self.readouts);
        self.count.iter().map(|n| f64::from(*n) / readouts).collect()
    }

    /// Rate per pixel from the times of its first and last spike,
    /// `(N - 1) / (t_last - t_first)`, NaN below two spikes.
    ///
    /// Standard error: `f^2 sqrt(V) / (N - 1)` with `V` the variance of the
    /// span: `1/6 + (N - 1) s` for an integrator of phase variance `s` per
    /// spike (see [`super::Intervals::decompose`]), about `0.41 f / T` when `s` is small.
    #[must_use]
    pub fn rate_by_time(&self) -> Vec<f64> {
        let spans = self.count.iter().zip(self.first.iter().zip(&self.last));
        spans.map(|(n, (first, last))| span_rate(*n, *first, *last).unwrap_or(f64::NAN)).collect()
    }

    /// The map of a pair's coincidences.
    #[must_use]
    pub fn coincidence(&self, pair: Pair) -> &[u32] {
        &self.coincidences[pair as usize]
    }

    /// Correlation of pixel and neighbour: the covariance of the two bits over
    /// their readouts, summed over all pairs and divided by the sum of
    /// `sqrt(f(1-f) f'(1-f'))`.
    ///
    /// Independent pixels give 0 in the mean over start phases, though any one
    /// pair of equal rates does not. Standard error: the spread of the sums of
    /// 8x8-pixel tiles about the ratio (linearised ratio estimator), so
    /// neighbouring pairs need not be independent.
    #[must_use]
    pub fn correlation(&self, pair: Pair) -> Estimate {
        let pairs = self.pairs(pair);
        tiles_ratio(pairs.len(), self.geometry.width(), 8, |p| pairs[p])
    }

    /// What each pair adds to [`Self::correlation`] and to what it is a share of; `None` where there is no neighbour.
    fn pairs(&self, pair: Pair) -> Vec<Option<(f64, f64)>> {
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

    /// What each pair adds to the deviation of [`Self::correlation`], in units of it: the sum over all pairs is 0. NaN
    /// where there is no neighbour.
    pub(super) fn correlation_map(&self, pair: Pair) -> Vec<f64> {
        let pairs = self.pairs(pair);
        let told = pairs.iter().flatten();
        let (x, y, n) = told.fold((0.0, 0.0, 0.0), |s, v| (s.0 + v.0, s.1 + v.1, s.2 + 1.0));
        pairs.iter().map(|v| v.map_or(f64::NAN, |(a, b)| (a - x / y * b) / (y / n))).collect()
    }
}
