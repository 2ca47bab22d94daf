//! Spikes that are missing from pixels that fire regularly, by the readout at which they would have come.

use std::ops::Range;

use crate::diagnose::recording::bits::BANDS;
use crate::diagnose::recording::bits::{PixelBits, count_between};
use spikelane::unstable::spikes::set_bits;
use spikelane::unstable::threads;

/// Mean interval from which on a missing spike shows: twice 2.3 less one is more than three.
const SHORTEST: f64 = 2.3;

/// Length of an interval with a spike missing, in mean ones: at least.
const LEAST: f64 = 1.4;

/// Most spikes in succession that a pixel misses: two, where two readouts are lost a mean interval apart.
const RUN: u32 = 2;

/// Fewest spikes of a pixel that tell its mean interval.
const FEWEST: usize = 4;

/// Spikes that must be expected to go with a readout: of as many, none has fewer than [`SEEN`] of them in five hundred. With eleven, as in the
/// dark of 48x48 pixels, one in six was not found, and one that is not found is far beyond what the model strays by.
const EXPECTED: f64 = 30.0;

/// Share of them that must be seen, and how many times what is seen just before or after.
const SEEN: f64 = 0.45;
const SHARP: f64 = 4.0;

/// Share of them that is no stray: what lies beside a lost readout with as many is another one.
const JOINED: f64 = 0.15;

/// Spikes that are missing, by twice the readout that would follow, and how many would go with a lost readout.
#[derive(Clone, Debug)]
struct PeerMissing {
    at: Vec<u32>,
    expected: f64,
    pixels: usize,
}

/// Lost readouts in the times of one light; `None` where too few spikes go with one.
pub(in crate::diagnose) fn of_light(bits: &PixelBits, period: &[Range<usize>]) -> Option<Vec<usize>> {
    let pixels = bits.geometry.pixels();
    let rows = pixels.div_ceil(BANDS);
    let of_band = |band: usize| {
        let mut missing = PeerMissing { at: vec![0; 2 * bits.readouts + 2], expected: 0.0, pixels: 0 };
        let mut times = Vec::new();
        for p in (band * rows).min(pixels)..((band + 1) * rows).min(pixels) {
            missing.add(bits.pixel(p), period, &mut times);
        }
        missing
    };
    let bands: Vec<PeerMissing> = threads::map(0..BANDS, of_band);
    let sum = bands.into_iter().reduce(|mut sum, band| {
        sum.at.iter_mut().zip(band.at).for_each(|(a, b)| *a += b);
        sum.expected += band.expected;
        sum.pixels += band.pixels;
        sum
    })?;
    sum.places(period)
}

impl PeerMissing {
    /// Adds a pixel's; `times` is room for its spikes by stretch.
    fn add(&mut self, words: &[u64], period: &[Range<usize>], times: &mut Vec<Vec<u32>>) {
        let length: usize = period.iter().map(Range::len).sum();
        let ones: usize = period.iter().map(|r| count_between(words, r.start, r.end) as usize).sum();
        let flip = if 2 * ones > length { u64::MAX } else { 0 };
        times.resize(period.len(), Vec::new());
        for (range, times) in period.iter().zip(times.iter_mut()) {
            collect(words, flip, range, times);
        }
        let whole = |t: &&Vec<u32>| t.len() > 1;
        let (mut span, mut count) = (0, 0);
        for times in times.iter().filter(whole) {
            span += times[times.len() - 1] - times[0];
            count += times.len() - 1;
        }
        let mean = f64::from(span) / count as f64;
        if count < FEWEST || mean < SHORTEST {
            return;
        }
        self.expected += mean.recip();
        self.pixels += 1;
        let least = ((LEAST * mean) as u32).max(mean.ceil() as u32);
        for times in times.iter().filter(whole) {
            for pair in times.windows(2).filter(|pair| pair[1] - pair[0] > least) {
                self.add_gap(pair[0], pair[1] - pair[0], mean);
            }
        }
    }

    /// Adds the spikes that are missing in a gap after `start`: `n` lost readouts that take one each make `n + 1` intervals one that is
    /// shorter than these by `n`.
    fn add_gap(&mut self, start: u32, gap: u32, mean: f64) {
        let n = ((f64::from(gap) - mean) / (mean - 1.0)).round().max(1.0) as u32;
        if n > RUN {
            return;
        }
        for k in 0..n {
            let behind = 2 * (k + 1) * (gap + n) / (n + 1) - 2 * k;
            self.at[(2 * start + behind) as usize] += 1;
        }
    }

    /// Readouts at which as many are missing as go with one, and hardly any around.
    fn places(mut self, period: &[Range<usize>]) -> Option<Vec<usize>> {
        let usual = f64::from(self.at.iter().sum::<u32>()) / self.at.len() as f64;
        let reach = 2 + (0.06 * self.mean()) as usize;
        let chance = by_chance(usual * (2 * reach + 1) as f64);
        if self.expected < EXPECTED || chance > 0.8 * self.expected {
            return None;
        }
        let mut found = Vec::new();
        while let Some(i) = self.peak(reach, chance, period) {
            let window = i.saturating_sub(reach)..(i + reach + 1).min(self.at.len());
            let window = self.joined(window, reach + 1, usual);
            found.extend(self.centers(window.clone(), usual));
            self.at[window].fill(0);
        }
        Some(found)
    }

    /// Mean interval.
    fn mean(&self) -> f64 {
        self.pixels as f64 / self.expected
    }

    /// The entry with most within `reach`, of those that a lost readout may have.
    fn peak(&self, reach: usize, chance: f64, period: &[Range<usize>]) -> Option<usize> {
        let mean = self.mean();
        // Near an edge some pixels have no spike on its other side.
        let share = |at: usize| {
            let inside = period.iter().filter(|r| r.contains(&at));
            inside.map(|r| (at - r.start).min(r.end - at) as f64 / mean).fold(0.0, f64::max).min(1.0)
        };
        let (around, width) = (sums(&self.at, reach), (2 * reach + 1) as isize);
        let plain = |i: &usize| f64::from(around[*i]) >= chance.max(SEEN * self.expected * share(i / 2));
        let sharp = |i: &usize| {
            let shifted = |n: isize| around.get(i.wrapping_add_signed(n * width)).copied();
            let mut beside = [-2, -1, 1, 2].map(|n| shifted(n).unwrap_or(0));
            beside.sort_unstable();
            // One neighbor may be another lost readout.
            f64::from(around[*i]) >= SHARP * f64::from(beside[2])
        };
        let most = |best: usize, i: usize| if around[i] > around[best] { i } else { best };
        (0..around.len()).filter(|i| plain(i) && sharp(i)).reduce(most)
    }

    /// The readouts that are lost in `window`: two that are close to each other take twice the spikes along.
    fn centers(&self, window: Range<usize>, usual: f64) -> Vec<usize> {
        let chance = usual * window.len() as f64;
        let spikes: Vec<usize> = window.flat_map(|j| std::iter::repeat_n(j, self.at[j] as usize)).collect();
        let several = ((spikes.len() as f64 - chance) / self.expected).round().max(1.0) as usize;
        let center = |s: &[usize]| (0.5 * s.iter().sum::<usize>() as f64 / s.len() as f64).round() as usize;
        spikes.chunks(spikes.len().div_ceil(several)).map(center).collect()
    }

    /// A window with what lies next to it, as long as there is more than stray spikes of the same lost readout in `step` more.
    fn joined(&self, mut window: Range<usize>, step: usize, usual: f64) -> Range<usize> {
        let enough = by_chance(usual * step as f64).max(JOINED * self.expected);
        let more = |range: Range<usize>| {
            !range.is_empty() && f64::from(self.at[range].iter().sum::<u32>()) >= enough
        };
        while more(window.start.saturating_sub(step)..window.start) {
            window.start = window.start.saturating_sub(step);
        }
        while more(window.end..(window.end + step).min(self.at.len())) {
            window.end = (window.end + step).min(self.at.len());
        }
        window
    }
}

/// Spikes that are not to be expected at any time where so many are by chance: above one in a hundred million of Poisson's law.
fn by_chance(mean: f64) -> f64 {
    mean + 5.6 * mean.sqrt() + 3.5
}

/// For each entry the sum of those up to `reach` away.
fn sums(at: &[u32], reach: usize) -> Vec<u32> {
    let before: Vec<u32> = std::iter::once(0)
        .chain(at.iter().scan(0, |sum, n| {
            *sum += n;
            Some(*sum)
        }))
        .collect();
    (0..at.len()).map(|i| before[(i + reach + 1).min(at.len())] - before[i.saturating_sub(reach)]).collect()
}

/// The spikes of a pixel in `range`, or with `flip` the readouts without one. One after the other: [`crate::diagnose::recording::intervals::times`] takes all
/// of a recording at once, and this is for stretches of one, once for each set.
fn collect(words: &[u64], flip: u64, range: &Range<usize>, times: &mut Vec<u32>) {
    times.clear();
    for w in range.start / 64..range.end.div_ceil(64) {
        let mut word = words[w] ^ flip;
        if w == range.start / 64 {
            word &= u64::MAX << (range.start % 64);
        }
        if w == range.end / 64 {
            word &= (1 << (range.end % 64)) - 1;
        }
        times.extend(set_bits(word).map(|bit| 64 * w as u32 + bit));
    }
}
