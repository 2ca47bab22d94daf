//! A part of the stream, measured while the whole is.
//!
//! The sums of the whole grow within a part by what is the part's own, and by pairs of spikes of which the earlier one lies before it.
//! Only the first spikes of a pixel in the part have such partners, and these are still in the whole's history: their share is taken off,
//! and from then on nothing has to be summed up twice. What a pixel is judged by, its first intervals, is the part's own,
//! so that intervals beyond its fences are counted for each part.

use super::fast::{self, Found};
use super::pixel::Pixel;
use super::readouts::REFERENCE;
use super::{Intervals, LONGEST_LAG, Lengths, NEVER};
use spikelane::unstable::kernels::{ROOM, Shorts};

/// A part that has begun and not ended.
pub(super) struct Open {
    start: u32,
    lags: Vec<u32>,
    /// Spikes that the whole's history holds.
    depth: usize,
    /// Spikes of the whole before the part.
    before: Vec<u32>,
    /// What is the part's own. Products lack what the whole has at the end, and have no extremes.
    pixels: Vec<Pixel>,
    /// As in the whole; squares lack what the whole has at the end.
    sums: Vec<[u64; 2]>,
}

/// The 16-bit times of a pixel: new ones at `at..end`, counted from readout `start`, its history before.
#[derive(Clone, Copy)]
pub(super) struct Times<'a> {
    pub(super) times: &'a [i16],
    pub(super) at: usize,
    pub(super) end: usize,
    pub(super) start: u32,
}

/// Most spikes that are looked at where a part begins: the history and one more than that.
const MOST: usize = 2 * LONGEST_LAG as usize + 1;

const _: () = assert!(MOST <= ROOM && REFERENCE <= LONGEST_LAG as usize);

impl Open {
    /// Begins at the whole's next readout.
    pub(super) fn new(whole: &Intervals, depth: usize) -> Self {
        let less = |sum: u64| 0_u64.wrapping_sub(sum);
        let own = |pixel: &Pixel| Pixel { products: pixel.products.map(less), ..Pixel::new() };
        Self {
            start: whole.readouts,
            lags: whole.lags.clone(),
            depth,
            before: whole.pixels.iter().map(|p| p.spikes).collect(),
            pixels: whole.pixels.iter().map(own).collect(),
            sums: whole.sums.iter().map(|s| [0, less(s[1])]).collect(),
        }
    }

    /// Takes new spikes of pixel `p`, of which the whole had `spikes` before, with the whole's counts at its fences.
    #[inline(always)]
    pub(super) fn add_fast<S: Shorts>(
        &mut self,
        s: S,
        p: usize,
        spikes: u32,
        new: Times<'_>,
        intervals: &[i16],
        found: &Found,
    ) {
        let known = (spikes - self.before[p]) as usize;
        if known <= self.depth {
            self.begin_fast(p, known, new);
        }
        let pixel = &mut self.pixels[p];
        let Some(from) = judged(pixel, known, new.at) else { return };
        let fences = fast::fences(pixel);
        let above = match from == new.at && fences == found.fences {
            true => found.above,
            false => fast::above(s, intervals, from, new.end, fences),
        };
        pixel.add_above((new.end - from) as u32, above);
    }

    #[inline(never)]
    fn begin_fast(&mut self, p: usize, known: usize, new: Times<'_>) {
        let mut wide = [0; MOST];
        let n = new.end.min(new.at + self.depth + 1);
        for (wide, time) in wide.iter_mut().zip(&new.times[..n]) {
            *wide = new.start.wrapping_add_signed(i32::from(*time));
        }
        self.begin(p, known, &wide[..n], new.at);
    }

    /// Takes the new spikes `times[at..]`, one by one; the entries before are the whole's history.
    pub(super) fn add_exact(&mut self, p: usize, spikes: u32, times: &[u32], at: usize) {
        let known = (spikes - self.before[p]) as usize;
        if known <= self.depth {
            self.begin(p, known, times, at);
        }
        let pixel = &mut self.pixels[p];
        let Some(from) = judged(pixel, known, at) else { return };
        for k in from..times.len() {
            pixel.judge(times[k] - times[k - 1]);
        }
    }

    /// Takes the first spikes of a pixel, of which `known` came before `times[at..]`: they begin sums, tell the reference,
    /// and have partners before the part.
    fn begin(&mut self, p: usize, known: usize, times: &[u32], at: usize) {
        let (old, new) = times.split_at(at);
        let sums = &mut self.sums[p * self.lags.len()..(p + 1) * self.lags.len()];
        for (lag, sum) in self.lags.iter().map(|lag| *lag as usize).zip(sums) {
            let first = lag.saturating_sub(known).min(new.len());
            sum[0] += new[..first].iter().map(|t| u64::from(*t - self.start)).sum::<u64>();
            // The whole's own first spikes have no partner there.
            let from = lag.saturating_sub(at).min(first);
            let pairs = times[at + from..at + first].iter().zip(&times[(at + from).saturating_sub(lag)..]);
            let squares = pairs.map(|(t, before)| u64::from(t - before).pow(2)).sum();
            sum[1] = sum[1].wrapping_sub(squares);
        }
        let pixel = &mut self.pixels[p];
        let interval = |k: usize| u64::from(times[k] - times[k - 1]);
        for (apart, product) in (1_usize..).zip(&mut pixel.products) {
            for k in (at..times.len()).take((apart + 1).saturating_sub(known)).filter(|k| *k > apart) {
                *product = product.wrapping_sub(interval(k) * interval(k - apart));
            }
        }
        for (first, time) in pixel.first.iter_mut().skip(known).zip(new) {
            *first = time - self.start;
        }
        if let Some(time) = REFERENCE.checked_sub(known).and_then(|k| new.get(k)) {
            let zeroth = if known == 0 { new[0] } else { old[at - known] };
            pixel.reference = time - zeroth;
        }
    }

    /// The part up to where `whole` is now, with the last spikes of its pixels.
    pub(super) fn end(mut self, whole: &Intervals, history: &[u32]) -> Intervals {
        let mut latest = vec![[NEVER; 3]; self.pixels.len()];
        let histories = history.chunks_exact(self.depth);
        for (p, history) in histories.enumerate() {
            let pixel = &mut self.pixels[p];
            pixel.spikes = whole.pixels[p].spikes - self.before[p];
            let more = pixel.products.iter_mut().zip(whole.pixels[p].products);
            more.for_each(|(product, whole)| *product = product.wrapping_add(whole));
            let lags = p * self.lags.len()..(p + 1) * self.lags.len();
            let sums = self.sums[lags.clone()].iter_mut().zip(&whole.sums[lags]);
            for (lag, (sum, whole)) in self.lags.iter().zip(sums) {
                let last = history[self.depth - *lag as usize..].iter();
                let last: u64 = last.map(|t| u64::from(t.saturating_sub(self.start))).sum();
                let sum_of_spans = if pixel.spikes > *lag { last - sum[0] } else { 0 };
                *sum = [sum_of_spans, sum[1].wrapping_add(whole[1])];
            }
            let kept = (pixel.spikes as usize).min(3);
            let times = latest[p][3 - kept..].iter_mut().zip(&history[self.depth - kept..]);
            times.for_each(|(latest, time)| *latest = time - self.start);
        }
        Intervals {
            geometry: whole.geometry,
            rows: whole.rows.clone(),
            readouts: whole.readouts - self.start,
            lags: self.lags,
            pixels: self.pixels,
            sums: self.sums,
            latest,
            lengths: Lengths::new(whole.lengths.cap()),
            split: None,
            deviations: Vec::new(),
        }
    }
}

/// Where the intervals begin that can be judged, now that new spikes are taken from `at` on: with the spike that completes
/// the reference all those of which that is made.
#[inline(always)]
fn judged(pixel: &Pixel, known: usize, at: usize) -> Option<usize> {
    match known {
        _ if pixel.reference == 0 => None,
        0..=REFERENCE => Some(at + 1 - known),
        _ => Some(at),
    }
}
