//! One pass over a recording: what every statistic needs of it, per pixel and per readout.

use std::ops::Range;

use super::bits::BANDS;
use super::bits::{PixelBits, count_between, count_blocks};
use super::coincidences::{neighbors, row_halves, totals};
use super::intervals::{bright, intervals, times};
use super::pixel::BLOCKS;
use super::pixel::PixelScan;
use super::stretches::SETTLED;
use super::stretches::{Stretch, stretches};
use spikelane::error::Result;
use spikelane::spikes::{Geometry, SpikeFramesRef};
use spikelane::unstable::kernels::{BitOps, I16Lanes, MAX_SPIKES, OVERRUN, Task, dispatch_task};
use spikelane::unstable::threads;
use spikelane_measure::{SceneMotion, detect_motion};

/// What a scene makes worth looking at.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::diagnose) struct Look {
    /// Every interval: where spikes are few.
    pub dim: bool,
    /// The halves of rows together.
    pub rows: bool,
    /// The dark stretches of a square wave of this half period, in readouts.
    pub half_period: Option<usize>,
}

/// What a recording holds.
#[derive(Clone, Debug)]
pub(in crate::diagnose) struct Scan {
    pub geometry: Geometry,
    pub pixels: Vec<PixelScan>,
    /// Spikes of each readout.
    pub totals: Vec<u32>,
    /// Bits that changed since the readout before.
    pub changes: Vec<u32>,
    /// Covariance of the two halves of a row, over the binomial variance of a half.
    pub row_halves: f64,
    /// Coincidences of neighbors over their chance less one: beside and below at lag 0, then at lag 1.
    pub neighbors: [f64; 4],
    /// Sum of the deviations of intervals that end at a readout, in readouts, and their number.
    pub deviations: Deviations,
    /// The stretches between the steps of a square wave.
    pub stretches: Vec<Stretch>,
    /// Relative difference of pixels side by side; of still scenes only.
    pub contrast: f64,
}

impl Scan {
    /// Whether the scene moved between the halves of its readouts.
    pub(in crate::diagnose) fn motion(&self, readouts: usize) -> SceneMotion {
        let half = BLOCKS / 2 * readouts / BLOCKS;
        let rate =
            |blocks: &[u32], readouts: usize| f64::from(blocks.iter().sum::<u32>()) / readouts.max(1) as f64;
        let of = |late: bool| -> Vec<f64> {
            let parts = self.pixels.iter().map(|p| p.blocks.split_at(BLOCKS / 2));
            parts.map(|(a, b)| if late { rate(b, readouts - half) } else { rate(a, half) }).collect()
        };
        // Counts of two halves differ by u0 - 2 u1 + u2 with phases of 1/12 each.
        let sd = 0.5_f64.sqrt() / half.max(1) as f64;
        detect_motion(&[of(false), of(true)], self.geometry.width(), sd, half)
    }
}

/// Scans packed frames for what `look` asks.
///
/// # Errors
/// As [`PixelBits::new`].
pub(in crate::diagnose) fn scan(frames: SpikeFramesRef<'_>, look: Look) -> Result<Scan> {
    Ok(scan_turned(frames, &PixelBits::new(frames)?, look))
}

/// The same where the frames have been turned round already.
pub(in crate::diagnose) fn scan_turned(frames: SpikeFramesRef<'_>, bits: &PixelBits, look: Look) -> Scan {
    let [totals, changes] = totals(frames);
    let stretches = look.half_period.map_or_else(Vec::new, |half| stretches(&totals, half));
    let dark: Vec<_> = dark_windows(&stretches).collect();
    let geometry = bits.geometry;
    let n = geometry.pixels();
    let rows = n.div_ceil(BANDS);
    let of_band = |band: usize| {
        let pixels = (band * rows).min(n)..((band + 1) * rows).min(n);
        dispatch_task(Band { bits, pixels, dim: look.dim, dark: &dark })
    };
    let parts: Vec<(Vec<PixelScan>, Deviations)> = threads::map(0..BANDS, of_band);
    let mut pixels = Vec::with_capacity(n);
    let mut deviations = vec![[0.0; 2]; if look.dim { bits.readouts } else { 0 }];
    for (part, more) in parts {
        pixels.extend(part);
        deviations.iter_mut().zip(more).for_each(|(a, b)| *a = [a[0] + b[0], a[1] + b[1]]);
    }
    Scan {
        geometry,
        changes,
        row_halves: if look.rows { row_halves(bits) } else { 0.0 },
        neighbors: neighbors(bits, &pixels),
        pixels,
        totals,
        deviations,
        stretches,
        contrast: 0.0,
    }
}

/// See [`Scan::deviations`].
pub(in crate::diagnose) type Deviations = Vec<[f64; 2]>;

/// Some of the pixels, which are looked at one after the other.
struct Band<'a> {
    bits: &'a PixelBits,
    pixels: Range<usize>,
    dim: bool,
    dark: &'a [(usize, usize)],
}

impl Task for Band<'_> {
    type Out = (Vec<PixelScan>, Deviations);

    #[inline(always)]
    fn run<S: I16Lanes, B: BitOps>(self, _: S, b: B) -> Self::Out {
        let readouts = self.bits.readouts;
        let mut deviations = vec![[0.0; 2]; if self.dim { readouts } else { 0 }];
        let (mut places, mut all) = ([0; MAX_SPIKES + OVERRUN], Vec::new());
        let ends: [usize; BLOCKS] = std::array::from_fn(|b| (b + 1) * readouts / BLOCKS);
        let mut pixels = Vec::with_capacity(self.pixels.len());
        for p in self.pixels {
            let words = self.bits.pixel(p);
            let mut scan = counts(words, readouts, &ends, self.dark);
            if scan.count >= 4 {
                let mean = scan.rate.recip();
                if self.dim {
                    let times = times(b, words, scan.count as usize, &mut places, &mut all);
                    intervals(times, mean, &mut scan, &mut deviations);
                } else {
                    bright(words, mean, &mut scan);
                }
            }
            pixels.push(scan);
        }
        (pixels, deviations)
    }
}

/// Counts of a pixel's spikes, and its rate.
#[inline(always)]
fn counts(words: &[u64], readouts: usize, ends: &[usize; BLOCKS], dark: &[(usize, usize)]) -> PixelScan {
    let blocks = count_blocks(words, ends);
    let mut scan = PixelScan { blocks, count: blocks.iter().sum(), ..PixelScan::default() };
    for (from, to) in dark {
        scan.after_falls += count_between(words, *from, *to);
    }
    let Some(first) = words.iter().position(|w| *w != 0) else { return scan };
    let last = words.iter().rposition(|w| *w != 0).unwrap_or(first);
    let start = first * 64 + words[first].trailing_zeros() as usize;
    let end = last * 64 + 63 - words[last].leading_zeros() as usize;
    scan.first = start as u32;
    scan.rate = if scan.count < 3 {
        f64::from(scan.count) / readouts as f64
    } else {
        f64::from(scan.count - 1) / (end - start) as f64
    };
    scan
}

/// The settled part of each dark stretch of a square wave.
pub(in crate::diagnose) fn dark_windows(stretches: &[Stretch]) -> impl Iterator<Item = (usize, usize)> {
    stretches.iter().filter(|s| !s.bright).map(|s| (s.from + SETTLED, s.to))
}
