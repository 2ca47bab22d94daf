//! One pass over a recording: what every statistic needs of it, per pixel and per readout.

use rayon::prelude::*;

use super::bits::{PixelBits, coincidences, count_between, count_blocks, word_at};
use super::wave::{Stretch, stretches};
use crate::spikes::{Geometry, Packed, count};

/// Blocks of time whose counts are compared.
pub(super) const BLOCKS: usize = 8;

/// Lags of the phase variance, in intervals.
pub(super) const LAGS: [usize; 3] = [1, 4, 16];

/// Longest interval with a mask of its own in bright light.
const LONGEST: usize = 8;

/// What a scene makes worth looking at.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Look {
    /// Every interval: where spikes are few.
    pub dim: bool,
    /// The halves of rows together.
    pub rows: bool,
    /// The dark stretches of a square wave of this half period, in readouts.
    pub half_period: Option<usize>,
}

/// Readouts from an edge on, after which the response counts as steady.
pub(super) const STEADY: usize = 300;

/// Readouts after a fall that the first interval in the new light may take.
pub(super) const SETTLED: usize = 20;

/// What a pixel did.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct PixelScan {
    pub count: u32,
    /// Spikes per readout: by time from three spikes on, by count below.
    pub rate: f64,
    pub blocks: [u32; BLOCKS],
    /// Phase variance at [`LAGS`] less its quantisation, in thresholds squared; sums over terms.
    pub variance: [f64; LAGS.len()],
    pub terms: [f64; LAGS.len()],
    /// Covariance of intervals one and two apart, in thresholds squared; sums.
    pub covariance: [f64; 2],
    /// Spikes from [`SETTLED`] readouts after every fall of the light to its next rise.
    pub after_falls: u32,
    /// Intervals off the pixel's lattice: shorter, longer.
    pub off_lattice: [u32; 2],
}

/// What a recording holds.
#[derive(Clone, Debug)]
pub(super) struct Scan {
    pub geometry: Geometry,
    pub pixels: Vec<PixelScan>,
    /// Spikes of each readout.
    pub totals: Vec<u32>,
    /// Bits that changed since the readout before.
    pub changes: Vec<u32>,
    /// Covariance of the two halves of a row, over the binomial variance of a half.
    pub row_halves: f64,
    /// Coincidences of neighbours over their chance less one: beside and below at lag 0, then at lag 1.
    pub neighbours: [f64; 4],
    /// Sum of the deviations of intervals that end at a readout, in readouts, and their number.
    pub deviations: Vec<[f64; 2]>,
    /// The stretches between the steps of a square wave.
    pub stretches: Vec<Stretch>,
    /// Relative difference of pixels side by side; of still scenes only.
    pub contrast: f64,
}

/// Scans packed frames for what `look` asks.
pub(super) fn scan(frames: Packed<'_>, look: Look) -> Scan {
    let dim = look.dim;
    let totals: Vec<u32> = frames.frames().map(|f| count(f) as u32).collect();
    let stretches = look.half_period.map_or_else(Vec::new, |half| stretches(&totals, half));
    let dark: Vec<_> = dark_windows(&stretches).collect();
    let bits = PixelBits::new(frames);
    let geometry = bits.geometry;
    let n = geometry.pixels();
    let bands = rayon::current_num_threads().max(1);
    let rows = n.div_ceil(bands);
    let parts: Vec<(Vec<PixelScan>, Vec<[f64; 2]>)> = (0..bands)
        .into_par_iter()
        .map(|band| {
            let mut deviations = vec![[0.0; 2]; if dim { bits.readouts } else { 0 }];
            let mut times = Vec::new();
            let of_pixel = |p| pixel(&bits, p, dim, &dark, &mut times, &mut deviations);
            let pixels = (band * rows..((band + 1) * rows).min(n)).map(of_pixel).collect();
            (pixels, deviations)
        })
        .collect();
    let mut pixels = Vec::with_capacity(n);
    let mut deviations = vec![[0.0; 2]; if dim { bits.readouts } else { 0 }];
    for (part, more) in parts {
        pixels.extend(part);
        deviations.iter_mut().zip(more).for_each(|(a, b)| *a = [a[0] + b[0], a[1] + b[1]]);
    }
    Scan {
        geometry,
        changes: changes(frames),
        row_halves: if look.rows { row_halves(frames) } else { 0.0 },
        neighbours: neighbours(&bits, &pixels),
        pixels,
        totals,
        deviations,
        stretches,
        contrast: 0.0,
    }
}

fn pixel(
    bits: &PixelBits,
    p: usize,
    dim: bool,
    dark: &[(usize, usize)],
    times: &mut Vec<u32>,
    deviations: &mut [[f64; 2]],
) -> PixelScan {
    let words = bits.pixel(p);
    let mut scan = PixelScan::default();
    scan.blocks = count_blocks(words, std::array::from_fn(|b| (b + 1) * bits.readouts / BLOCKS));
    scan.count = scan.blocks.iter().sum();
    scan.after_falls = dark.iter().map(|(from, to)| count_between(words, *from, *to)).sum();
    let Some(first) = words.iter().position(|w| *w != 0) else { return scan };
    let last = words.iter().rposition(|w| *w != 0).unwrap_or(first);
    let start = first * 64 + words[first].trailing_zeros() as usize;
    let end = last * 64 + 63 - words[last].leading_zeros() as usize;
    scan.rate = if scan.count < 3 {
        f64::from(scan.count) / bits.readouts as f64
    } else {
        f64::from(scan.count - 1) / (end - start) as f64
    };
    if scan.count < 4 {
        return scan;
    }
    let mean = scan.rate.recip();
    if dim {
        times.clear();
        for (w, word) in words.iter().enumerate() {
            let mut rest = *word;
            while rest != 0 {
                times.push((w * 64) as u32 + rest.trailing_zeros());
                rest &= rest - 1;
            }
        }
        intervals(times, mean, &mut scan, deviations);
    } else {
        bright(words, mean, &mut scan);
    }
    scan
}

/// The settled part of each dark stretch of a square wave.
pub(super) fn dark_windows(stretches: &[Stretch]) -> impl Iterator<Item = (usize, usize)> {
    stretches.iter().filter(|s| !s.bright).map(|s| (s.from + SETTLED, s.to))
}

/// Every interval of a dim pixel.
fn intervals(times: &[u32], mean: f64, scan: &mut PixelScan, deviations: &mut [[f64; 2]]) {
    let square = scan.rate * scan.rate;
    // A spike too many or too few must not drown the noise of all others; it is counted below.
    let widest = 3.0 + 0.06 * mean;
    for (k, lag) in LAGS.into_iter().enumerate() {
        let expected = lag as f64 * mean;
        // An integrator without noise: the lag falls on the whole numbers about its mean.
        let part = expected.fract();
        let lattice = part * (1.0 - part);
        let pairs = times.len().saturating_sub(lag);
        let ends = &times[times.len() - pairs..];
        let off = |end: u32, start: u32| {
            let off = (f64::from(end - start) - expected).clamp(-widest, widest);
            off * off
        };
        // Eight sums side by side: one would wait for its own last addition.
        let mut sums = [0.0; 8];
        let (wide, rest) = ends.as_chunks::<8>();
        for (e, s) in wide.iter().zip(times.as_chunks::<8>().0) {
            (0..8).for_each(|i| sums[i] += off(e[i], s[i]));
        }
        let tail = &times[wide.len() * 8..];
        sums[0] += rest.iter().zip(tail).map(|(e, s)| off(*e, *s)).sum::<f64>();
        scan.variance[k] += square * (sums.iter().sum::<f64>() - pairs as f64 * lattice);
        scan.terms[k] += pairs as f64;
    }
    let (low, high) = (mean.floor() as u32, mean.ceil() as u32);
    let margin = 1 + (0.03 * mean) as u32;
    let mut past = [0.0; 2];
    for pair in times.windows(2) {
        let length = pair[1] - pair[0];
        let off = f64::from(length) - mean;
        let usual = off.clamp(-widest, widest);
        scan.covariance[0] += square * usual * past[0];
        scan.covariance[1] += square * usual * past[1];
        past = [usual, past[0]];
        scan.off_lattice[0] += u32::from(length + margin < low);
        scan.off_lattice[1] += u32::from(length > high + margin);
        let ends = &mut deviations[pair[1] as usize];
        *ends = [ends[0] + off, ends[1] + 1.0];
    }
}

/// Lengths of a bright pixel's intervals by shifted words.
fn bright(words: &[u64], mean: f64, scan: &mut PixelScan) {
    let (low, high) = (mean.floor() as usize, mean.ceil() as usize);
    if high > LONGEST {
        return;
    }
    let mut shorter = 0;
    let mut within = 0;
    for w in 0..words.len() {
        let next = words.get(w + 1).copied().unwrap_or(0);
        let mut open = words[w];
        for length in 1..=high {
            let hit = open & (words[w] >> length | next << (64 - length));
            open &= !hit;
            if length < low {
                shorter += hit.count_ones();
            } else {
                within += hit.count_ones();
            }
        }
    }
    scan.off_lattice = [shorter, (scan.count - 1).saturating_sub(within + shorter)];
}

fn changes(frames: Packed<'_>) -> Vec<u32> {
    let change = |(a, b): (&[u8], &[u8])| {
        let words = (0..a.len()).step_by(8);
        words.map(|i| (word_at(a, i) ^ word_at(b, i)).count_ones()).sum()
    };
    frames.frames().zip(frames.frames().skip(1)).map(change).collect()
}

/// Bits `from..to` of a frame.
fn count_range(frame: &[u8], from: usize, to: usize) -> u32 {
    let mut total = 0;
    let mut at = from;
    while at < to {
        let take = (to - at).min(56);
        let word = word_at(frame, at / 8) >> (at % 8);
        total += (word & ((1 << take) - 1)).count_ones();
        at += take;
    }
    total
}

/// Rows gain or lose together: `(var(l + r) - var(l - r)) / 4` over readouts, mean over rows.
fn row_halves(frames: Packed<'_>) -> f64 {
    let geometry = frames.geometry();
    let (width, height, n) = (geometry.width(), geometry.height(), frames.readouts() as f64);
    if width < 4 || frames.readouts() < 2 {
        return 0.0;
    }
    // A whole row in one word, wherever in a byte it begins.
    let short = width <= 56;
    let of_row = |row: usize| {
        let (start, middle) = (row * width, row * width + width / 2);
        let (mut l1, mut r1, mut lr, mut l2, mut r2) = (0u64, 0u64, 0u64, 0u64, 0u64);
        for frame in frames.frames() {
            let [l, r] = if short {
                let row = word_at(frame, start / 8) >> (start % 8);
                let left = row & ((1 << (width / 2)) - 1);
                let right = (row ^ left) & ((1 << width) - 1);
                [u64::from(left.count_ones()), u64::from(right.count_ones())]
            } else {
                [(start, middle), (middle, start + width)].map(|(a, b)| u64::from(count_range(frame, a, b)))
            };
            l1 += l;
            r1 += r;
            lr += l * r;
            l2 += l * l;
            r2 += r * r;
        }
        let [l1, r1, lr, l2, r2] = [l1, r1, lr, l2, r2].map(|x| x as f64 / n);
        let scale = ((l2 - l1 * l1) * (r2 - r1 * r1)).sqrt();
        if scale > 0.0 { (lr - l1 * r1) / scale } else { 0.0 }
    };
    (0..height).into_par_iter().map(of_row).sum::<f64>() / height as f64
}

fn neighbours(bits: &PixelBits, pixels: &[PixelScan]) -> [f64; 4] {
    let (width, n) = (bits.geometry.width(), pixels.len());
    let of_pixel = |p: usize| {
        let mut sums = [[0.0; 2]; 4];
        // Half of the pairs, like the squares of one colour.
        if !(p / width + p % width).is_multiple_of(2) {
            return sums;
        }
        let mut add = |k: usize, q: usize| {
            let chance = f64::from(pixels[p].count) * f64::from(pixels[q].count) / bits.readouts as f64;
            let (a, b) = (bits.pixel(p), bits.pixel(q));
            sums[k] = [f64::from(coincidences(a, b, 0)), chance];
            let late = coincidences(a, b, 1) + coincidences(b, a, 1);
            sums[k + 2] = [f64::from(late), 2.0 * chance];
        };
        if p % width + 1 < width {
            add(0, p + 1);
        }
        if p + width < n {
            add(1, p + width);
        }
        sums
    };
    let merge =
        |a: [[f64; 2]; 4], b: [[f64; 2]; 4]| std::array::from_fn(|k| [a[k][0] + b[k][0], a[k][1] + b[k][1]]);
    let sums = (0..n).into_par_iter().map(of_pixel).reduce(|| [[0.0; 2]; 4], merge);
    sums.map(|[found, chance]| if chance > 0.0 { found / chance - 1.0 } else { 0.0 })
}
