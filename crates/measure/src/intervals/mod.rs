//! Inter-spike intervals: sums per pixel, lengths over all pixels, deviations
//! per readout.

mod decode;
mod fast;
mod lengths;
mod parts;
mod pixel;
mod readouts;
mod result;
#[cfg(test)]
mod tests;
mod variance;

use std::ops::Range;

use super::block::{Block, CAPACITY};
use super::counts::NEVER;
use decode::{Histories, History};
use lengths::Tally;
use parts::Open;
use pixel::Pixel;
pub(super) use readouts::DeviationSum;
use readouts::REFERENCE;
use readouts::Readouts;
use spikelane::spikes::{Geometry, set_bits};
use spikelane::unstable::kernels::{Bits, Places, SLACK, Shorts, WORDS, Work, counting_with};

pub(super) use decode::LONGEST_LAG;
pub use lengths::Lengths;
use result::Snapshot;
pub use result::{Deviation, Halves, Intervals, PixelIntervals};
pub use variance::PhaseNoise;

/// What is kept while frames come in.
pub(super) struct State {
    result: Intervals,
    tally: Tally,
    /// Spikes of history per pixel, at least the longest lag and the reference.
    depth: usize,
    /// The last `depth` spike times of each pixel, newest last.
    history: Vec<u32>,
    span_limit: u32,
    series: usize,
    scratch: Scratch,
    /// Parts of the stream that are measured with it.
    open: [Option<Open>; PARTS],
}

/// Parts that may be open at a time.
pub(super) const PARTS: usize = 2;

/// Buffers of one pixel's work.
struct Scratch {
    times: Box<Places>,
    intervals: Vec<i16>,
    exact: Vec<u32>,
    readouts: Readouts,
}

/// A block on its way into the sums.
struct Taking<'a> {
    state: &'a mut State,
    block: &'a Block,
    start: u32,
}

impl Work for Taking<'_> {
    type Out = ();

    #[inline(always)]
    fn run<S: Shorts, B: Bits>(self, s: S, b: B) {
        self.state.take(s, b, self.block, self.start);
    }
}

impl State {
    /// The memory of one pixel in bytes: its history, which ends with the recording, and its sums with the latest spikes.
    pub(super) fn bytes_per_pixel(lags: &[u32]) -> [usize; 2] {
        let depth = (lags.last().copied().unwrap_or(1) as usize).max(REFERENCE);
        let sums = size_of::<Pixel>() + lags.len() * size_of::<[u64; 2]>() + size_of::<[u32; 3]>();
        [depth * size_of::<u32>(), sums]
    }

    /// `lags` is sorted and begins with 1; `cap` is the longest interval with
    /// an own bin; `series` readouts are kept one by one.
    pub(super) fn new(
        geometry: Geometry,
        rows: Range<usize>,
        lags: Vec<u32>,
        cap: u32,
        series: usize,
    ) -> Self {
        let pixels = rows.len() * geometry.width();
        let longest = lags.last().copied().unwrap_or(1);
        let depth = (longest as usize).max(REFERENCE);
        let room = depth + CAPACITY + 2 * SLACK;
        Self {
            tally: Tally::new(cap),
            depth,
            history: vec![0; pixels * depth],
            span_limit: fast::span_limit(longest),
            series,
            open: [None, None],
            scratch: Scratch {
                times: Box::new([0; _]),
                intervals: vec![0; room],
                exact: Vec::with_capacity(room),
                readouts: Readouts::new(),
            },
            result: Intervals {
                geometry,
                rows,
                readouts: 0,
                pixels: vec![Pixel::new(); pixels],
                sums: vec![[0; 2]; pixels * lags.len()],
                lags,
                latest: Vec::new(),
                lengths: Lengths::new(cap),
                split: None,
                deviations: Vec::new(),
            },
        }
    }

    /// Whether [`Self::push`] still has to be told of readouts: for the series of deviations.
    pub(super) fn wants_totals(&self) -> bool {
        self.result.deviations.len() < self.series
    }

    /// Takes the number of spikes of readout `i` of the next block, before that is processed.
    pub(super) fn push(&mut self, i: usize, spikes: u32) {
        self.scratch.readouts.spikes[i] = spikes;
    }

    /// Takes a block that starts at readout `start`.
    pub(super) fn process(&mut self, block: &Block, start: u32) {
        counting_with(Taking { state: self, block, start });
    }

    #[inline(always)]
    fn take<S: Shorts, B: Bits>(&mut self, s: S, b: B, block: &Block, start: u32) {
        let room = (self.series - self.result.deviations.len()).min(block.len());
        let mut histories = Histories::new();
        self.scratch.readouts.begin(start);
        let mut group = 0;
        for at in 0..block.band_words() {
            let (row, column) = (at / block.stride(), at % block.stride() * 64);
            let next = Lengths::group(self.result.rows.start + row, self.result.geometry);
            if next != group {
                self.tally.empty(&mut self.result.lengths, group);
                group = next;
            }
            if at % WORDS == 0 {
                histories.gather(b, block, at);
            }
            if at % (readouts::MOST / 64) == 0 {
                self.scratch.readouts.sum();
            }
            let pixels = 64.min(block.width() - column);
            for i in 0..pixels {
                let words = histories.pixel(at, i);
                if words.iter().any(|w| *w != 0) {
                    self.add_pixel(s, b, row * block.width() + column + i, &words, start);
                }
            }
        }
        self.tally.empty(&mut self.result.lengths, group);
        self.scratch.readouts.sum();
        self.result.deviations.extend(self.scratch.readouts.sums(room));
        self.result.readouts = start + block.len() as u32;
    }

    /// Adds the spikes of a pixel in this block; there is at least one.
    #[inline(always)]
    fn add_pixel<S: Shorts, B: Bits>(&mut self, s: S, b: B, p: usize, words: &History, start: u32) {
        let known = self.result.pixels[p].spikes as usize;
        if known > self.depth {
            self.add_late(s, b, p, words, start);
            return;
        }
        // One more than the history, so that the reference is known as well.
        let mut late = *words;
        let early = decode::split(&mut late, self.depth + 1 - known);
        self.add_exact(p, &early, start);
        if late.iter().any(|w| *w != 0) {
            self.add_late(s, b, p, &late, start);
        }
    }

    /// Adds the spikes of a pixel whose history is full; there is at least one.
    #[inline(always)]
    fn add_late<S: Shorts, B: Bits>(&mut self, s: S, b: B, p: usize, words: &History, start: u32) {
        // From the oldest time of the history to the start of the block.
        let before = start.wrapping_sub(self.history[p * self.depth]);
        // A history that ends within the block begins after its start, and the difference is small and negative.
        let near = before.wrapping_add(CAPACITY as u32) <= self.span_limit;
        if near && self.result.pixels[p].reference <= readouts::LARGEST_REFERENCE {
            self.add_fast(s, b, p, words, start);
        } else {
            self.add_exact(p, words, start);
        }
    }

    #[inline(always)]
    fn add_fast<S: Shorts, B: Bits>(&mut self, s: S, b: B, p: usize, words: &History, start: u32) {
        let depth = self.depth;
        let Scratch { times, intervals, readouts, .. } = &mut self.scratch;
        let history = &mut self.history[p * depth..(p + 1) * depth];
        for (time, old) in times.iter_mut().zip(history.iter()) {
            *time = old.wrapping_sub(start) as i16;
        }
        let end = decode::times(b, words, times, depth);
        let times = times.as_slice();
        fast::differences(s, times, end, intervals);
        let lags = &self.result.lags;
        let sums = &mut self.result.sums[p * lags.len()..(p + 1) * lags.len()];
        for (lags, sums) in lags.chunks(fast::TOGETHER).zip(sums.chunks_mut(fast::TOGETHER)) {
            // Places behind the last lag do it again, for nobody.
            let all = std::array::from_fn(|i| lags[i.min(lags.len() - 1)] as usize);
            let squares = fast::squares(s, times, depth, end, all);
            sums.iter_mut().zip(squares).for_each(|(sum, more)| sum[1] += more);
        }
        let pixel = &mut self.result.pixels[p];
        let found = fast::add_intervals(s, intervals, depth, end, pixel);
        for open in self.open.iter_mut().flatten() {
            open.add_fast(
                s,
                p,
                pixel.spikes,
                parts::Times { times, at: depth, end, start },
                intervals,
                &found,
            );
        }
        pixel.spikes += (end - depth) as u32;
        self.tally.add_found(s, &found, pixel.centre(), intervals, depth..end);
        if self.result.deviations.len() < self.series {
            fast::deviate(times, intervals, depth, end, pixel.reference, &mut readouts.table);
        }
        for (old, time) in history.iter_mut().zip(&times[end - depth..end]) {
            *old = start.wrapping_add_signed(i32::from(*time));
        }
    }

    #[inline(never)]
    fn add_exact(&mut self, p: usize, words: &History, start: u32) {
        let pixel = &mut self.result.pixels[p];
        let history = &mut self.history[p * self.depth..(p + 1) * self.depth];
        let known = (pixel.spikes as usize).min(self.depth);
        let times = &mut self.scratch.exact;
        times.clear();
        times.extend_from_slice(&history[self.depth - known..]);
        for (word, bits) in words.iter().enumerate() {
            times.extend(set_bits(*bits).map(|bit| start + 64 * word as u32 + bit));
        }
        let lags = &self.result.lags;
        let sums = &mut self.result.sums[p * lags.len()..(p + 1) * lags.len()];
        for open in self.open.iter_mut().flatten() {
            open.add_exact(p, pixel.spikes, times, known);
        }
        pixel.add_each(times, known, lags, sums, &mut self.scratch.readouts);
        for k in known.max(1)..times.len() {
            self.tally.add(k, times[k] - times[k - 1]);
        }
        let kept = times.len().min(self.depth);
        history[self.depth - kept..].copy_from_slice(&times[times.len() - kept..]);
    }

    /// Begins part `which` at the next readout. What was pushed has been processed.
    pub(super) fn begin_part(&mut self, which: usize) {
        self.open[which] = Some(Open::new(&self.result, self.depth));
    }

    /// The intervals of part `which`, without the histogram of lengths, the extremes, and deviations by readout; `None` if it never
    /// began.
    pub(super) fn end_part(&mut self, which: usize) -> Option<Intervals> {
        let open = self.open[which].take()?;
        Some(open.end(&self.result, &self.history))
    }

    /// Remembers the sums of the first half.
    pub(super) fn split(&mut self) {
        let lags = self.result.lags.len();
        let last = self.history.chunks_exact(self.depth);
        self.result.split = Some(Snapshot {
            spikes: self.result.pixels.iter().map(|p| p.spikes).collect(),
            last: last.map(|h| h[self.depth - 1]).collect(),
            squares: self.result.sums.iter().step_by(lags).map(|s| s[1]).collect(),
        });
    }

    /// The sum of `t_(k+n) - t_k` over all `k` telescopes to the last `n` times less the first `n`, of
    /// which the sum was kept.
    fn finish_sums(&mut self) {
        let lags = &self.result.lags;
        let pixels = self.result.pixels.iter().zip(self.history.chunks_exact(self.depth));
        for ((pixel, history), sums) in pixels.zip(self.result.sums.chunks_exact_mut(lags.len())) {
            for (lag, sum) in lags.iter().zip(sums) {
                let last = history[self.depth - *lag as usize..].iter().map(|t| u64::from(*t));
                sum[0] = if pixel.spikes > *lag { last.sum::<u64>() - sum[0] } else { 0 };
            }
        }
    }

    pub(super) fn finish(mut self) -> Intervals {
        self.finish_sums();
        let latest = |(pixel, history): (&Pixel, &[u32])| {
            let mut latest = [NEVER; 3];
            let kept = (pixel.spikes as usize).min(3);
            latest[3 - kept..].copy_from_slice(&history[self.depth - kept..]);
            latest
        };
        let histories = self.history.chunks_exact(self.depth);
        self.result.latest = self.result.pixels.iter().zip(histories).map(latest).collect();
        self.result
    }
}
