//! One pass over a recording: what every statistic needs of it, per pixel and per readout.

use rayon::prelude::*;

use super::bits::{PixelBits, count_between, count_blocks};
use super::together::{changes, neighbours, row_halves, totals};
use super::wave::{Stretch, stretches};
use crate::kernels::counting;
use crate::spikes::{Geometry, Packed};

/// Blocks of time whose counts are compared.
pub(super) const BLOCKS: usize = 8;

/// Runs of pixels that are looked at side by side. A fixed number: sums of parts depend on where they are cut.
const BANDS: usize = 8;

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
    let totals = totals(frames);
    let stretches = look.half_period.map_or_else(Vec::new, |half| stretches(&totals, half));
    let dark: Vec<_> = dark_windows(&stretches).collect();
    let bits = PixelBits::new(frames);
    let geometry = bits.geometry;
    let n = geometry.pixels();
    let rows = n.div_ceil(BANDS);
    let of_band = |band: usize| {
        let mut deviations = vec![[0.0; 2]; if dim { bits.readouts } else { 0 }];
        let mut times = Vec::new();
        let mut pixels = Vec::with_capacity(rows);
        counting(
            #[inline(always)]
            || {
                for p in band * rows..((band + 1) * rows).min(n) {
                    pixels.push(pixel(&bits, p, dim, &dark, &mut times, &mut deviations));
                }
            },
        );
        (pixels, deviations)
    };
    let parts: Vec<(Vec<PixelScan>, Vec<[f64; 2]>)> = (0..BANDS).into_par_iter().map(of_band).collect();
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

#[inline(always)]
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
#[inline(always)]
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
#[inline(always)]
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
