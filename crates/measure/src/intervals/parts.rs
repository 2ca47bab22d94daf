//! Measures a part of the stream together with the whole stream.
//!
//! Each term of the sums belongs to a pair of spikes of one pixel. During a part, the sums of the whole stream grow by
//! the terms of two kinds of pairs. In most pairs both spikes are in the part. In the other pairs the earlier spike
//! precedes the part and is still in the history of the pixel. Subtracting the terms of the other pairs leaves the sums
//! of the part, so later spikes need no second summation. The reference of a pixel in a part is the part's own first
//! intervals. Therefore intervals beyond the fences are counted for each part separately.

use super::fast::{self, NewIntervals};
use super::pixel::{PixelSums, REFERENCE_INTERVALS};
use super::{IntervalHistogram, Intervals, MAX_LAG_INTERVALS, NO_SPIKE};
use spikelane::unstable::kernels::{I16Lanes, MAX_SPIKES};

/// A part that has begun and has not yet ended.
pub(super) struct OpenPart {
    start: u32,
    lags: Vec<u32>,
    /// Number of spikes per pixel in the history of the whole stream.
    depth: usize,
    /// Number of spikes of each pixel of the whole stream before the part.
    spikes_before: Vec<u32>,
    /// The sums of the part. [`Self::end`] adds the lag products of the whole stream. Extremes are not measured.
    pixels: Vec<PixelSums>,
    /// Sums per pixel and lag, as in [`Intervals`]. [`Self::end`] adds the sums of squares of the whole stream.
    sums: Vec<[u64; 2]>,
}

/// The 16-bit times of a pixel, relative to readout `start`. Entries `at..end` are new. The entries before `at` are the
/// history.
#[derive(Clone, Copy)]
pub(super) struct PixelTimes<'a> {
    pub(super) times: &'a [i16],
    pub(super) at: usize,
    pub(super) end: usize,
    pub(super) start: u32,
}

/// Largest number of spikes that [`OpenPart::begin_fast`] converts. It converts the `depth` spikes of the history and
/// at most `depth + 1` new spikes.
const MAX_START_SPIKES: usize = 2 * MAX_LAG_INTERVALS as usize + 1;

const _: () = assert!(MAX_START_SPIKES <= MAX_SPIKES && REFERENCE_INTERVALS <= MAX_LAG_INTERVALS as usize);

impl OpenPart {
    /// Begins a part at the next readout of the stream. `total` contains the sums of the whole stream.
    pub(super) fn new(total: &Intervals, depth: usize) -> Self {
        let less = |sum: u64| 0_u64.wrapping_sub(sum);
        let boundary_sums =
            |pixel: &PixelSums| PixelSums { lag_products: pixel.lag_products.map(less), ..PixelSums::new() };
        Self {
            start: total.readouts,
            lags: total.lags.clone(),
            depth,
            spikes_before: total.pixels.iter().map(|p| p.spikes).collect(),
            pixels: total.pixels.iter().map(boundary_sums).collect(),
            sums: total.sums.iter().map(|s| [0, less(s[1])]).collect(),
        }
    }

    /// Adds the new spikes of pixel `p`. The whole stream contains `spikes` earlier spikes of this pixel.
    /// `new_intervals` contains the fences of the pixel in the whole stream, and the numbers of new intervals above
    /// these fences.
    #[inline(always)]
    pub(super) fn add_fast<S: I16Lanes>(
        &mut self,
        s: S,
        p: usize,
        spikes: u32,
        new: PixelTimes<'_>,
        intervals: &[i16],
        new_intervals: &NewIntervals,
    ) {
        let known = (spikes - self.spikes_before[p]) as usize;
        if known <= self.depth {
            self.begin_fast(p, known, new);
        }
        let pixel = &mut self.pixels[p];
        let Some(from) = first_judged(pixel, known, new.at) else { return };
        let fences = fast::fences(pixel);
        let above = match from == new.at && fences == new_intervals.fences {
            true => new_intervals.above_fences,
            false => fast::count_above_fences(s, intervals, from, new.end, fences),
        };
        pixel.add_above((new.end - from) as u32, above);
    }

    #[inline(never)]
    fn begin_fast(&mut self, p: usize, known: usize, new: PixelTimes<'_>) {
        let mut wide = [0; MAX_START_SPIKES];
        let n = new.end.min(new.at + self.depth + 1);
        for (wide, time) in wide.iter_mut().zip(&new.times[..n]) {
            *wide = new.start.wrapping_add_signed(i32::from(*time));
        }
        self.begin(p, known, &wide[..n], new.at);
    }

    /// Adds the new spikes `times[at..]` one by one. The entries before `at` are the history of the whole stream.
    pub(super) fn add_exact(&mut self, p: usize, spikes: u32, times: &[u32], at: usize) {
        let known = (spikes - self.spikes_before[p]) as usize;
        if known <= self.depth {
            self.begin(p, known, times, at);
        }
        let pixel = &mut self.pixels[p];
        let Some(from) = first_judged(pixel, known, at) else { return };
        for k in from..times.len() {
            pixel.count_at_fences(times[k] - times[k - 1]);
        }
    }

    /// Adds the first spikes of a pixel in the part. The part contains `known` spikes of the pixel before `times[at..]`.
    ///
    /// The first spikes of a pixel in the part begin its sums and determine its reference. They also form pairs with
    /// spikes before the part. The function subtracts the terms of these pairs.
    fn begin(&mut self, p: usize, known: usize, times: &[u32], at: usize) {
        let (old, new) = times.split_at(at);
        let sums = &mut self.sums[p * self.lags.len()..(p + 1) * self.lags.len()];
        for (lag, sum) in self.lags.iter().map(|lag| *lag as usize).zip(sums) {
            let first = lag.saturating_sub(known).min(new.len());
            sum[0] += new[..first].iter().map(|t| u64::from(*t - self.start)).sum::<u64>();
            // Spikes with fewer than `lag` earlier spikes in the whole stream form no pair.
            let from = lag.saturating_sub(at).min(first);
            let pairs = times[at + from..at + first].iter().zip(&times[(at + from).saturating_sub(lag)..]);
            let squares = pairs.map(|(t, before)| u64::from(t - before).pow(2)).sum();
            sum[1] = sum[1].wrapping_sub(squares);
        }
        let pixel = &mut self.pixels[p];
        let interval = |k: usize| u64::from(times[k] - times[k - 1]);
        for (offset, product) in (1_usize..).zip(&mut pixel.lag_products) {
            for k in (at..times.len()).take((offset + 1).saturating_sub(known)).filter(|k| *k > offset) {
                *product = product.wrapping_sub(interval(k) * interval(k - offset));
            }
        }
        for (first, time) in pixel.first_spikes.iter_mut().skip(known).zip(new) {
            *first = time - self.start;
        }
        if let Some(time) = REFERENCE_INTERVALS.checked_sub(known).and_then(|k| new.get(k)) {
            let zeroth = if known == 0 { new[0] } else { old[at - known] };
            pixel.reference = time - zeroth;
        }
    }

    /// Ends the part at the current readout of the stream. `total` contains the sums of the whole stream, and `history`
    /// contains the last spikes of each pixel.
    pub(super) fn end(mut self, total: &Intervals, history: &[u32]) -> Intervals {
        let mut latest = vec![[NO_SPIKE; 3]; self.pixels.len()];
        let histories = history.chunks_exact(self.depth);
        for (p, history) in histories.enumerate() {
            let pixel = &mut self.pixels[p];
            pixel.spikes = total.pixels[p].spikes - self.spikes_before[p];
            let more = pixel.lag_products.iter_mut().zip(total.pixels[p].lag_products);
            more.for_each(|(product, total_product)| *product = product.wrapping_add(total_product));
            let lags = p * self.lags.len()..(p + 1) * self.lags.len();
            let sums = self.sums[lags.clone()].iter_mut().zip(&total.sums[lags]);
            for (lag, (sum, total)) in self.lags.iter().zip(sums) {
                let last = history[self.depth - *lag as usize..].iter();
                let last: u64 = last.map(|t| u64::from(t.saturating_sub(self.start))).sum();
                let sum_of_spans = if pixel.spikes > *lag { last - sum[0] } else { 0 };
                *sum = [sum_of_spans, sum[1].wrapping_add(total[1])];
            }
            let kept_count = (pixel.spikes as usize).min(3);
            let times = latest[p][3 - kept_count..].iter_mut().zip(&history[self.depth - kept_count..]);
            times.for_each(|(latest, time)| *latest = time - self.start);
        }
        Intervals {
            geometry: total.geometry,
            rows: total.rows.clone(),
            readouts: total.readouts - self.start,
            lags: self.lags,
            pixels: self.pixels,
            sums: self.sums,
            latest_spikes: latest,
            histogram: IntervalHistogram::new(total.histogram.longest_bin()),
        }
    }
}

/// Returns the index of the first interval to compare with the reference, if new spikes begin at index `at`. Returns
/// `None` while the reference is incomplete.
///
/// When a spike completes the reference, the intervals of the reference itself are also compared.
#[inline(always)]
fn first_judged(pixel: &PixelSums, known: usize, at: usize) -> Option<usize> {
    match known {
        _ if pixel.reference == 0 => None,
        0..=REFERENCE_INTERVALS => Some(at + 1 - known),
        _ => Some(at),
    }
}
