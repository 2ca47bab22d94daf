//! Inter-spike intervals: sums per pixel, and a histogram over all pixels.

mod decode;
mod fast;
mod histogram;
mod parts;
mod pixel;
mod result;
#[cfg(test)]
mod tests;
mod variance;

use std::ops::Range;
use std::sync::Arc;

use super::LightClock;
use super::block::{Block, MAX_BLOCK_READOUTS};
use super::counts::NO_SPIKE;
use decode::{Histories, History};
use histogram::BlockHistogram;
use parts::OpenPart;
use pixel::{PixelSums, REFERENCE_INTERVALS};
use spikelane::spikes::Geometry;
use spikelane::unstable::kernels::{BLOCK_WORDS, BitOps, I16Lanes, OVERRUN, Positions, Task, dispatch_task};
use spikelane::unstable::spikes::set_bits;

pub(super) use decode::MAX_LAG_INTERVALS;
pub use histogram::{IntervalHistogram, total_variation};
pub use result::{Intervals, PixelIntervals};
pub use variance::PhaseNoise;

/// Accumulates the sums of the intervals that were added so far.
pub(super) struct IntervalAccumulator {
    result: Intervals,
    tally: BlockHistogram,
    /// Number of past spikes that are stored per pixel: at least the longest lag and at least [`REFERENCE_INTERVALS`].
    depth: usize,
    /// The last `depth` spike times of each pixel in ascending order.
    history: Vec<u32>,
    span_limit: u32,
    /// The clock of the spike times, and the number of pixels of the sensor before the band.
    clock: Option<(Arc<LightClock>, usize)>,
    scratch: Scratch,
    /// Parts of the stream that are measured together with the whole stream.
    open_parts: [Option<OpenPart>; PART_COUNT],
}

/// Number of parts that can be open at the same time.
pub(super) const PART_COUNT: usize = 2;

/// Work buffers that are reused for each pixel.
struct Scratch {
    times: Box<Positions>,
    intervals: Vec<i16>,
    exact: Vec<u32>,
}

/// Task that adds a block to the sums.
struct IntervalTask<'a> {
    state: &'a mut IntervalAccumulator,
    block: &'a Block,
    start: u32,
}

impl Task for IntervalTask<'_> {
    type Out = ();

    #[inline(always)]
    fn run<S: I16Lanes, B: BitOps>(self, s: S, b: B) {
        self.state.process_block(s, b, self.block, self.start);
    }
}

impl IntervalAccumulator {
    /// Returns two sizes in bytes per pixel. The first is the size of the history, which `finish` frees. The second is
    /// the size of the sums and of the latest spikes.
    pub(super) fn bytes_per_pixel(lags: &[u32]) -> [usize; 2] {
        let depth = (lags.last().copied().unwrap_or(1) as usize).max(REFERENCE_INTERVALS);
        let sums = size_of::<PixelSums>() + lags.len() * size_of::<[u64; 2]>() + size_of::<[u32; 3]>();
        [depth * size_of::<u32>(), sums]
    }

    /// Returns an empty accumulator for a band of rows.
    ///
    /// `lags` is sorted and begins with 1. `cap` is the longest interval that has its own histogram bin.
    pub(super) fn new(geometry: Geometry, rows: Range<usize>, lags: Vec<u32>, cap: u32) -> Self {
        let pixels = rows.len() * geometry.width();
        let max_lag = lags.last().copied().unwrap_or(1);
        let depth = (max_lag as usize).max(REFERENCE_INTERVALS);
        let room = depth + MAX_BLOCK_READOUTS + 2 * OVERRUN;
        Self {
            tally: BlockHistogram::new(cap),
            depth,
            history: vec![0; pixels * depth],
            span_limit: fast::span_limit(max_lag),
            clock: None,
            open_parts: [None, None],
            scratch: Scratch {
                times: Box::new([0; _]),
                intervals: vec![0; room],
                exact: Vec::with_capacity(room),
            },
            result: Intervals {
                geometry,
                rows,
                readouts: 0,
                pixels: vec![PixelSums::new(); pixels],
                sums: vec![[0; 2]; pixels * lags.len()],
                lags,
                latest_spikes: Vec::new(),
                histogram: IntervalHistogram::new(cap),
            },
        }
    }

    /// Sets the clock of all spike times. `first` is the number of pixels of the sensor before the band. Call it before the
    /// first block.
    pub(super) fn set_clock(&mut self, clock: Arc<LightClock>, first: usize) {
        self.clock = Some((clock, first));
    }

    /// Adds a block. `start` is the readout number of its first readout.
    pub(super) fn process(&mut self, block: &Block, start: u32) {
        dispatch_task(IntervalTask { state: self, block, start });
    }

    #[inline(always)]
    fn process_block<S: I16Lanes, B: BitOps>(&mut self, s: S, b: B, block: &Block, start: u32) {
        let mut histories = Histories::new();
        let mut group = 0;
        for at in 0..block.band_words() {
            let (row, column) = (at / block.stride(), at % block.stride() * 64);
            let next = IntervalHistogram::group(self.result.rows.start + row, self.result.geometry);
            if next != group {
                self.tally.flush(&mut self.result.histogram, group);
                group = next;
            }
            if at % BLOCK_WORDS == 0 {
                histories.gather(b, block, at);
            }
            let pixels = 64.min(block.width() - column);
            for i in 0..pixels {
                let words = histories.pixel(at, i);
                if words.iter().any(|w| *w != 0) {
                    self.add_pixel(s, b, row * block.width() + column + i, &words, start);
                }
            }
        }
        self.tally.flush(&mut self.result.histogram, group);
        self.result.readouts = start + block.len() as u32;
    }

    /// Adds the spikes of a pixel in this block. The caller guarantees that the pixel has at least one spike.
    #[inline(always)]
    fn add_pixel<S: I16Lanes, B: BitOps>(&mut self, s: S, b: B, p: usize, words: &History, start: u32) {
        let known = self.result.pixels[p].spikes as usize;
        if self.clock.is_some() {
            self.add_exact(p, words, start);
            return;
        }
        if known > self.depth {
            self.add_with_full_history(s, b, p, words, start);
            return;
        }
        // The exact path adds the first `depth + 1` spikes or more, because a reference of 16 intervals needs 17
        // spikes.
        let mut late = *words;
        let early = decode::take_spikes(&mut late, self.depth + 1 - known);
        self.add_exact(p, &early, start);
        if late.iter().any(|w| *w != 0) {
            self.add_with_full_history(s, b, p, &late, start);
        }
    }

    /// Adds the spikes of a pixel whose history is full. The caller guarantees that the pixel has at least one spike.
    #[inline(always)]
    fn add_with_full_history<S: I16Lanes, B: BitOps>(
        &mut self,
        s: S,
        b: B,
        p: usize,
        words: &History,
        start: u32,
    ) {
        // `before` is the number of readouts between the oldest time in the history and the start of the block.
        let before = start.wrapping_sub(self.history[p * self.depth]);
        // If all spikes of the history are in this block, the oldest time is after `start` and `before` is negative.
        // Adding the block length makes the number positive.
        if before.wrapping_add(MAX_BLOCK_READOUTS as u32) <= self.span_limit {
            self.add_fast(s, b, p, words, start);
        } else {
            self.add_exact(p, words, start);
        }
    }

    #[inline(always)]
    fn add_fast<S: I16Lanes, B: BitOps>(&mut self, s: S, b: B, p: usize, words: &History, start: u32) {
        let depth = self.depth;
        let Scratch { times, intervals, .. } = &mut self.scratch;
        let history = &mut self.history[p * depth..(p + 1) * depth];
        for (time, old) in times.iter_mut().zip(history.iter()) {
            *time = old.wrapping_sub(start) as i16;
        }
        let end = decode::write_times(b, words, times, depth);
        let times = times.as_slice();
        fast::differences(s, times, end, intervals);
        let lags = &self.result.lags;
        let sums = &mut self.result.sums[p * lags.len()..(p + 1) * lags.len()];
        for (lags, sums) in lags.chunks(fast::LAGS_PER_PASS).zip(sums.chunks_mut(fast::LAGS_PER_PASS)) {
            // Unused entries of the array repeat the last lag. `zip` ignores their sums.
            let all = std::array::from_fn(|i| lags[i.min(lags.len() - 1)] as usize);
            let squares = fast::sum_squares(s, times, depth, end, all);
            sums.iter_mut().zip(squares).for_each(|(sum, more)| sum[1] += more);
        }
        let pixel = &mut self.result.pixels[p];
        let new_intervals = fast::add_intervals(s, intervals, depth, end, pixel);
        for open in self.open_parts.iter_mut().flatten() {
            open.add_fast(
                s,
                p,
                pixel.spikes,
                parts::PixelTimes { times, at: depth, end, start },
                intervals,
                &new_intervals,
            );
        }
        pixel.spikes += (end - depth) as u32;
        self.tally.add_new_intervals(s, &new_intervals, pixel.center(), intervals, depth..end);
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
        if let Some((clock, first)) = &self.clock {
            clock.convert(first + p, times, known);
        }
        let lags = &self.result.lags;
        let sums = &mut self.result.sums[p * lags.len()..(p + 1) * lags.len()];
        for open in self.open_parts.iter_mut().flatten() {
            open.add_exact(p, pixel.spikes, times, known);
        }
        // Times of a clock are not readouts, so their lengths are not counted.
        let in_readouts = self.clock.is_none();
        pixel.add_each(times, known, lags, sums, in_readouts);
        let counted = if in_readouts { known.max(1)..times.len() } else { 0..0 };
        for k in counted {
            self.tally.add(k, times[k] - times[k - 1]);
        }
        let kept_count = times.len().min(self.depth);
        history[self.depth - kept_count..].copy_from_slice(&times[times.len() - kept_count..]);
    }

    /// Begins part `which` at the next readout. The caller must first process all readouts that were pushed.
    pub(super) fn begin_part(&mut self, which: usize) {
        self.open_parts[which] = Some(OpenPart::new(&self.result, self.depth));
    }

    /// Ends part `which` and returns its intervals, or `None` if the part never began.
    ///
    /// The result does not contain the histogram of lengths or the extremes.
    pub(super) fn end_part(&mut self, which: usize) -> Option<Intervals> {
        let open = self.open_parts[which].take()?;
        Some(open.end(&self.result, &self.history))
    }

    /// Completes, for each lag `n`, the sum of `t_(k+n) - t_k` over the spike times `t_k` of a pixel. This sum equals
    /// the sum of the last `n` times minus the sum of the first `n` times.
    ///
    /// Before this call, `sums` contains the sum of the first `n` times.
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
        let latest = |(pixel, history): (&PixelSums, &[u32])| {
            let mut latest = [NO_SPIKE; 3];
            let kept_count = (pixel.spikes as usize).min(3);
            latest[3 - kept_count..].copy_from_slice(&history[self.depth - kept_count..]);
            latest
        };
        let histories = self.history.chunks_exact(self.depth);
        self.result.latest_spikes = self.result.pixels.iter().zip(histories).map(latest).collect();
        self.result
    }
}
