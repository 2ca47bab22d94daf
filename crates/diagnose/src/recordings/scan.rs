//! One pass over a recording that measures every pixel and every readout.

use std::ops::Range;

use crate::recordings::bits::{BAND_COUNT, PixelBits, count_between, count_blocks, readout_totals};
use crate::recordings::joint::{neighbors, row_halves};
use crate::recordings::stretches::{Stretch, find_stretches};
use crate::thresholds::SETTLED_READOUTS;
use spikelane::error::Result;
use spikelane::spikes::{Geometry, SpikeFramesRef};
use spikelane::unstable::kernels::{BitOps, I16Lanes, MAX_SPIKES, OVERRUN, Positions, Task, dispatch_task};
use spikelane::unstable::{inputs, threads};
use spikelane_measure::{SceneMotion, detect_motion};

/// Number of blocks of time in which spikes are counted.
pub(crate) const BLOCK_COUNT: usize = 8;

/// Lags at which the variance of the phase is measured, in intervals.
pub(crate) const PHASE_LAGS: [usize; 3] = [1, 4, 16];

/// Longest mean interval, in readouts, of a bright pixel whose intervals are counted with shifted words. The
/// intervals of bright pixels with longer mean intervals are not examined.
const MAX_SHIFTED_INTERVAL: usize = 8;

/// Number of spike positions that are converted in one loop.
const POSITION_CHUNK: usize = 16;

/// Number of words that are processed together, so that the compiler vectorizes the loops.
const LANE_WORDS: usize = 8;

/// The measured quantities of one pixel.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct PixelScan {
    pub count: u32,
    /// Readout of the first spike, or 0 without a spike.
    pub first: u32,
    /// Spikes per readout. If the pixel has at least three spikes, it is the number of intervals divided by the
    /// time between the first and the last spike.
    pub rate: f64,
    pub blocks: [u32; BLOCK_COUNT],
    /// Sum of the phase variance at each of [`PHASE_LAGS`], in thresholds squared. The variance by quantization to
    /// whole readouts is subtracted. `terms` contains the numbers of summands.
    pub variance: [f64; PHASE_LAGS.len()],
    pub terms: [f64; PHASE_LAGS.len()],
    /// Sum of the products of the deviations of two intervals at distance 1, and at distance 2, in thresholds
    /// squared.
    pub covariance: [f64; 2],
    /// Number of spikes between each fall of the light and the next rise. The first [`SETTLED_READOUTS`] readouts
    /// after a fall are excluded.
    pub after_falls: u32,
    /// Number of intervals that are shorter than the two whole numbers around the mean interval, and number of
    /// longer ones. For a dim pixel, a difference of one readout does not count.
    pub off_lattice: [u32; 2],
}

/// The optional quantities of a scan.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct ScanOptions {
    /// Whether all intervals are measured. It is set for dim scenes, whose pixels have few spikes.
    pub with_intervals: bool,
    /// Whether the correlation between the halves of rows is computed.
    pub with_row_halves: bool,
    /// Half period of a square wave in readouts. If it is set, the spikes in the dark stretches are counted.
    pub half_period: Option<usize>,
}

/// The result of a scan.
#[derive(Clone, Debug)]
pub(crate) struct Scan {
    pub geometry: Geometry,
    pub pixels: Vec<PixelScan>,
    /// Number of spikes of each readout.
    pub totals: Vec<u32>,
    /// Number of bits that differ between each readout and the next one.
    pub changes: Vec<u32>,
    /// Mean correlation between the spike counts of the halves of a row.
    pub row_halves: f64,
    /// Coincidences of neighbors divided by their expectation, minus 1. The elements are: right and below at the
    /// same readout, then right and below at the next readout.
    pub neighbors: [f64; 4],
    /// For each readout, the sum of the deviations of the intervals that end there, in readouts, and the number of
    /// these intervals.
    pub deviations: Deviations,
    /// The stretches between the steps of a square wave. It is empty for other light.
    pub stretches: Vec<Stretch>,
    /// Relative difference between neighboring pixels. It is measured for static scenes only.
    pub contrast: f64,
}

impl Scan {
    /// Tests whether the scene moves between the first and the second half of the recording.
    pub(crate) fn motion(&self, readouts: usize) -> SceneMotion {
        let half = BLOCK_COUNT / 2 * readouts / BLOCK_COUNT;
        let rate =
            |blocks: &[u32], readouts: usize| f64::from(blocks.iter().sum::<u32>()) / readouts.max(1) as f64;
        let rates = |is_second: bool| -> Vec<f64> {
            let parts = self.pixels.iter().map(|p| p.blocks.split_at(BLOCK_COUNT / 2));
            parts.map(|(a, b)| if is_second { rate(b, readouts - half) } else { rate(a, half) }).collect()
        };
        // The spike counts of both halves differ by `u0 - 2 u1 + u2`. Each `u` is a uniform phase with the variance
        // 1/12. The variance of the difference is therefore 6/12.
        let sd = 0.5_f64.sqrt() / half.max(1) as f64;
        detect_motion(&[rates(false), rates(true)], self.geometry.width(), sd, half)
    }
}

/// Transposes and scans packed frames.
///
/// # Errors
/// See [`PixelBits::new`] and [`scan_bits`].
pub(crate) fn scan(frames: SpikeFramesRef<'_>, options: ScanOptions) -> Result<Scan> {
    scan_bits(frames, &PixelBits::new(frames)?, options)
}

/// Scans packed frames. `bits` contains their transposed bits.
///
/// # Errors
/// Returns [`ErrorKind::Memory`](spikelane::error::ErrorKind::Memory) if the system has no memory for the scan.
pub(crate) fn scan_bits(frames: SpikeFramesRef<'_>, bits: &PixelBits, options: ScanOptions) -> Result<Scan> {
    let geometry = bits.geometry;
    // The scan contains each pixel twice: in the list of its band, and in the joined list. It also contains four
    // maps.
    let per_pixel = 2 * size_of::<PixelScan>() + 4 * size_of::<f64>();
    inputs::check_memory(format_args!("scan of {geometry} pixels"), per_pixel * geometry.pixels())?;
    let [totals, changes] = readout_totals(frames)?;
    let stretches = options.half_period.map_or_else(Vec::new, |half| find_stretches(&totals, half));
    let dark: Vec<_> = dark_windows(&stretches).collect();
    let n = geometry.pixels();
    let rows = n.div_ceil(BAND_COUNT);
    let of_band = |band: usize| {
        let pixels = (band * rows).min(n)..((band + 1) * rows).min(n);
        dispatch_task(Band { bits, pixels, with_intervals: options.with_intervals, dark: &dark })
    };
    let parts: Vec<(Vec<PixelScan>, Deviations)> = threads::map(0..BAND_COUNT, of_band);
    let mut pixels = Vec::with_capacity(n);
    let mut deviations = vec![[0.0; 2]; if options.with_intervals { bits.readouts } else { 0 }];
    for (part, more) in parts {
        pixels.extend(part);
        deviations.iter_mut().zip(more).for_each(|(a, b)| *a = [a[0] + b[0], a[1] + b[1]]);
    }
    let counts: Vec<u32> = pixels.iter().map(|p| p.count).collect();
    Ok(Scan {
        geometry,
        changes,
        row_halves: if options.with_row_halves { row_halves(bits) } else { 0.0 },
        neighbors: neighbors(bits, &counts),
        pixels,
        totals,
        deviations,
        stretches,
        contrast: 0.0,
    })
}

/// See [`Scan::deviations`].
pub(crate) type Deviations = Vec<[f64; 2]>;

/// A task that scans a range of pixels, one after the other.
struct Band<'a> {
    bits: &'a PixelBits,
    pixels: Range<usize>,
    with_intervals: bool,
    dark: &'a [(usize, usize)],
}

impl Task for Band<'_> {
    type Out = (Vec<PixelScan>, Deviations);

    #[inline(always)]
    fn run<S: I16Lanes, B: BitOps>(self, _: S, b: B) -> Self::Out {
        let readouts = self.bits.readouts;
        let mut deviations = vec![[0.0; 2]; if self.with_intervals { readouts } else { 0 }];
        let (mut places, mut all) = ([0; MAX_SPIKES + OVERRUN], Vec::new());
        let ends: [usize; BLOCK_COUNT] = std::array::from_fn(|b| (b + 1) * readouts / BLOCK_COUNT);
        let mut pixels = Vec::with_capacity(self.pixels.len());
        for p in self.pixels {
            let words = self.bits.pixel(p);
            let mut scan = count_pixel(words, readouts, &ends, self.dark);
            if scan.count >= 4 {
                let mean = scan.rate.recip();
                if self.with_intervals {
                    let times = spike_times(b, words, scan.count as usize, &mut places, &mut all);
                    measure_intervals(times, mean, &mut scan, &mut deviations);
                } else {
                    count_off_lattice(words, mean, &mut scan);
                }
            }
            pixels.push(scan);
        }
        (pixels, deviations)
    }
}

/// Returns the spike counts and the rate of a pixel.
#[inline(always)]
fn count_pixel(
    words: &[u64],
    readouts: usize,
    ends: &[usize; BLOCK_COUNT],
    dark: &[(usize, usize)],
) -> PixelScan {
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

/// Returns each dark stretch of a square wave without its first [`SETTLED_READOUTS`].
pub(crate) fn dark_windows(stretches: &[Stretch]) -> impl Iterator<Item = (usize, usize)> {
    stretches.iter().filter(|s| !s.is_bright).map(|s| (s.from + SETTLED_READOUTS, s.to))
}

/// Returns the readouts of all spikes of a pixel. They are written into `all`. `count` is the number of spikes, and
/// `places` is scratch space for the positions in one word.
#[inline(always)]
pub(crate) fn spike_times<'a, B: BitOps>(
    b: B,
    words: &[u64],
    count: usize,
    places: &mut Positions,
    all: &'a mut Vec<u32>,
) -> &'a [u32] {
    // Writing the last chunk of a word overwrites up to 16 elements after its spikes.
    if all.len() < count + POSITION_CHUNK {
        all.resize(count + POSITION_CHUNK, 0);
    }
    let (mut at, mut base) = (0, 0);
    for word in words {
        let end = at + b.positions(*word, 0, places, 0);
        for chunk in places.as_chunks::<POSITION_CHUNK>().0 {
            if at >= end {
                break;
            }
            for (time, place) in all[at..at + POSITION_CHUNK].iter_mut().zip(chunk) {
                *time = base + *place as u32;
            }
            at += POSITION_CHUNK;
        }
        (at, base) = (end, base + 64);
    }
    &all[..count]
}

/// Returns the sum of the squared differences between the intervals and `expected`. Each difference is first
/// limited to `limit`.
#[inline(always)]
fn squared_deviations(ends: &[u32], starts: &[u32], expected: f64, limit: f64) -> f64 {
    let deviation = |end: u32, start: u32| {
        let difference = (f64::from(end - start) - expected).clamp(-limit, limit);
        difference * difference
    };
    // Eight independent sums avoid the latency of a chain of additions.
    let mut sums = [0.0; 8];
    let (wide, rest) = ends.as_chunks::<8>();
    for (e, s) in wide.iter().zip(starts.as_chunks::<8>().0) {
        for i in 0..8 {
            sums[i] += deviation(e[i], s[i]);
        }
    }
    let mut last = 0.0;
    for (e, s) in rest.iter().zip(&starts[wide.len() * 8..]) {
        last += deviation(*e, *s);
    }
    sums[0] += last;
    sums.iter().sum()
}

/// Measures all intervals of a dim pixel. The deviation of each interval is added to the element of `deviations` at
/// which the interval ends.
#[inline(always)]
pub(crate) fn measure_intervals(times: &[u32], mean: f64, scan: &mut PixelScan, deviations: &mut [[f64; 2]]) {
    let square = scan.rate * scan.rate;
    // Without the limit, a single missing or additional spike would exceed the noise of all other intervals. Such
    // spikes are counted in `off_lattice` instead.
    let limit = 3.0 + 0.06 * mean;
    for (k, lag) in PHASE_LAGS.into_iter().enumerate() {
        let expected = lag as f64 * mean;
        // The intervals of an integrator without noise are the two whole numbers around `expected`. With the
        // fractional part `part`, their variance is `part * (1 - part)`.
        let part = expected.fract();
        let lattice = part * (1.0 - part);
        let pairs = times.len().saturating_sub(lag);
        let sum = squared_deviations(&times[times.len() - pairs..], &times[..pairs], expected, limit);
        scan.variance[k] += square * (sum - pairs as f64 * lattice);
        scan.terms[k] += pairs as f64;
    }
    let (low, high) = (mean.floor() as u32, mean.ceil() as u32);
    let margin = 1 + (0.03 * mean) as u32;
    let (mut previous, mut covariance) = ([0.0; 2], [0.0; 2]);
    let (mut shorter, mut longer) = (0, 0);
    for (end, start) in times[1..].iter().zip(times) {
        let length = end - start;
        let deviation = f64::from(length) - mean;
        let limited = deviation.clamp(-limit, limit);
        covariance[0] += square * limited * previous[0];
        covariance[1] += square * limited * previous[1];
        previous = [limited, previous[0]];
        shorter += u32::from(length + margin < low);
        longer += u32::from(length > high + margin);
        let ends = &mut deviations[*end as usize];
        *ends = [ends[0] + deviation, ends[1] + 1.0];
    }
    scan.covariance = covariance;
    scan.off_lattice = [shorter, longer];
}

/// Counts the intervals of a bright pixel that are off its lattice, the two whole numbers around the mean. It
/// compares words that are shifted by the length of an interval.
#[inline(always)]
pub(crate) fn count_off_lattice(words: &[u64], mean: f64, scan: &mut PixelScan) {
    let (low, high) = (mean.floor() as usize, mean.ceil() as usize);
    if high > MAX_SHIFTED_INTERVAL {
        return;
    }
    let (mut shorter, mut within) = ([0; LANE_WORDS], [0; LANE_WORDS]);
    for w in (0..words.len()).step_by(LANE_WORDS) {
        let (word, next) = (load_words(words, w), load_words(words, w + 1));
        // Each bit marks a spike that is followed by another spike at most `length` readouts later.
        let mut followed = [0; LANE_WORDS];
        for length in 1..=high {
            if length == low {
                for i in 0..LANE_WORDS {
                    shorter[i] += u64::from((word[i] & followed[i]).count_ones());
                }
            }
            for i in 0..LANE_WORDS {
                followed[i] |= word[i] >> length | next[i] << (64 - length);
            }
        }
        for i in 0..LANE_WORDS {
            within[i] += u64::from((word[i] & followed[i]).count_ones());
        }
    }
    let sum = |sums: [u64; LANE_WORDS]| sums.iter().sum::<u64>() as u32;
    scan.off_lattice = [sum(shorter), (scan.count - 1).saturating_sub(sum(within))];
}

/// Returns the words from index `w` on. Words after the end are zero.
#[inline(always)]
fn load_words(words: &[u64], w: usize) -> [u64; LANE_WORDS] {
    let words = words.get(w..).unwrap_or(&[]);
    let mut wide = [0; LANE_WORDS];
    match words.first_chunk::<LANE_WORDS>() {
        Some(whole) => wide = *whole,
        None => wide[..words.len()].copy_from_slice(words),
    }
    wide
}

#[cfg(test)]
mod tests {
    use super::*;
    use spikelane::unstable::kernels::{AnyCpu, I16Lanes, MAX_SPIKES, OVERRUN, Task, dispatch_task};

    struct IntervalTask<'a>(&'a [u64], f64);

    impl Task for IntervalTask<'_> {
        type Out = (Vec<u32>, [u32; 2]);

        fn run<S: I16Lanes, B: BitOps>(self, _: S, b: B) -> Self::Out {
            let count = self.0.iter().map(|w| w.count_ones()).sum();
            let mut scan = PixelScan { count, ..PixelScan::default() };
            count_off_lattice(self.0, self.1, &mut scan);
            let (mut places, mut all) = ([0; MAX_SPIKES + OVERRUN], Vec::new());
            (spike_times(b, self.0, count as usize, &mut places, &mut all).to_vec(), scan.off_lattice)
        }
    }

    #[test]
    fn spike_times_and_off_lattice_counts_equal_operations_on_single_bits() {
        let mut state = 1_u64;
        let mut next = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            state >> 32
        };
        for step in 1..=7 {
            let mut words = [0; 21];
            let mut t = next() % step;
            while t < 1300 {
                words[t as usize / 64] |= 1 << (t % 64);
                t += step + next() % 2 + if next() % 20 == 0 { next() % 30 } else { 0 };
            }
            let wanted: Vec<u32> =
                (0..21 * 64).filter(|t| words[*t as usize / 64] >> (t % 64) & 1 != 0).collect();
            let mean = step as f64 + 0.5;
            let lengths = || wanted.windows(2).map(|w| w[1] - w[0]);
            let off = [
                lengths().filter(|n| f64::from(*n) < mean.floor()).count() as u32,
                lengths().filter(|n| f64::from(*n) > mean.ceil()).count() as u32,
            ];
            let wanted = (wanted, off);
            assert_eq!(dispatch_task(IntervalTask(&words, mean)), wanted, "this CPU, {step}");
            assert_eq!(IntervalTask(&words, mean).run(AnyCpu, AnyCpu), wanted, "{step}");
        }
    }
}
