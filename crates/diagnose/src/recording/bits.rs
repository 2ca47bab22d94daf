//! The bits of a recording, stored by pixel, with counts and joint statistics of pixels.
//!
//! Statistics along time become operations on whole words.

use std::ops::Range;

use super::scan::PixelScan;
use spikelane::error::Result;
use spikelane::spikes::{Geometry, SpikeFramesRef};
use spikelane::unstable::kernels::{BitOps, I16Lanes, Task, dispatch, dispatch_task};
use spikelane::unstable::{inputs, threads};

/// Number of pixel ranges that are scanned in parallel. The number is fixed, because a sum of partial sums depends on
/// the limits of the parts.
pub(crate) const BAND_COUNT: usize = 8;

/// Number of groups of 64 pixels that one task transposes. 8 groups have 64 bytes per frame, which is one cache line.
const GROUPS_PER_TASK: usize = 8;

/// Number of words that are processed together, so that the compiler vectorizes the loops.
const LANE_WORDS: usize = 8;

/// Largest number of binary digits of a count of pixels in half a row.
const MAX_DIGITS: usize = 28;

/// The bits of a recording by pixel. Bit `t % 64` of word `t / 64` of a pixel is readout `t`.
#[derive(Clone, Debug)]
pub(crate) struct PixelBits {
    pub geometry: Geometry,
    pub readouts: usize,
    /// Number of words per pixel.
    pub words: usize,
    data: Vec<u64>,
}

impl PixelBits {
    /// Transposes `frames`.
    ///
    /// # Errors
    /// Returns [`ErrorKind::Memory`](spikelane::error::ErrorKind::Memory) if the system has no memory for the bits or
    /// for a scan of them.
    pub(crate) fn new(frames: SpikeFramesRef<'_>) -> Result<Self> {
        let geometry = frames.geometry();
        let readouts = frames.readouts();
        let words = readouts.div_ceil(64);
        let groups = geometry.pixels().div_ceil(64);
        let mut data = inputs::zeroed_vec(
            format_args!("{readouts} readouts of {geometry} pixels"),
            groups * 64 * words,
        )?;
        // A scan contains each pixel twice, in its band and in the joined list, and four maps.
        let per_pixel = 2 * size_of::<PixelScan>() + 4 * size_of::<f64>();
        inputs::check_memory(format_args!("scan of {geometry} pixels"), per_pixel * geometry.pixels())?;
        let transpose = |(i, pixels): (usize, &mut [u64])| {
            dispatch_task(TransposeTask { frames, first: i * GROUPS_PER_TASK, words, pixels });
        };
        let parts: Vec<_> = data.chunks_mut(GROUPS_PER_TASK * 64 * words.max(1)).enumerate().collect();
        threads::map(parts, transpose);
        Ok(Self { geometry, readouts, words, data })
    }

    pub(crate) fn pixel(&self, p: usize) -> &[u64] {
        &self.data[p * self.words..(p + 1) * self.words]
    }
}

/// A task that transposes some groups of 64 pixels. `first` is the index of the first group, and each pixel has
/// `words` words.
struct TransposeTask<'a> {
    frames: SpikeFramesRef<'a>,
    first: usize,
    words: usize,
    pixels: &'a mut [u64],
}

impl Task for TransposeTask<'_> {
    type Out = ();

    #[inline(always)]
    fn run<S: I16Lanes, B: BitOps>(self, _: S, b: B) {
        let bytes = self.frames.geometry().frame_bytes();
        let mut block = [0u64; 64];
        for (w, frames) in self.frames.as_bytes().chunks(64 * bytes).enumerate() {
            for (group, pixels) in self.pixels.chunks_exact_mut(64 * self.words).enumerate() {
                let at = 8 * (self.first + group);
                // The bits after the last readout are zero.
                block[frames.len() / bytes..].fill(0);
                for (word, frame) in block.iter_mut().zip(frames.chunks_exact(bytes)) {
                    *word = word_at(frame, at);
                }
                b.transpose(&mut block);
                for (pixel, word) in pixels.chunks_exact_mut(self.words).zip(&block) {
                    pixel[w] = *word;
                }
            }
        }
    }
}

/// Returns the eight bytes at `at` as a little-endian word. Bytes after the end are zero.
#[inline(always)]
pub(crate) fn word_at(bytes: &[u8], at: usize) -> u64 {
    match bytes.get(at..).and_then(|rest| rest.first_chunk::<8>()) {
        Some(whole) => u64::from_le_bytes(*whole),
        None => {
            let rest = bytes.get(at..).unwrap_or(&[]);
            rest.iter().enumerate().fold(0, |word, (i, b)| word | u64::from(*b) << (8 * i))
        }
    }
}

/// Counts the spikes in blocks of time that end at `ends`, in ascending order.
#[inline(always)]
pub(crate) fn count_blocks<const N: usize>(words: &[u64], ends: &[usize; N]) -> [u32; N] {
    let (mut word, mut before, mut total) = (0, 0, 0);
    let mut counts = [0; N];
    // A closure of `map` would be a function call without the population count instruction.
    for (count, end) in counts.iter_mut().zip(ends) {
        while word < end / 64 {
            total += words[word].count_ones();
            word += 1;
        }
        let rest = if end % 64 == 0 { 0 } else { (words[word] & ((1 << (end % 64)) - 1)).count_ones() };
        *count = total + rest - before;
        before = total + rest;
    }
    counts
}

/// Counts the spikes in the readouts `from..to`.
#[inline(always)]
pub(crate) fn count_between(words: &[u64], from: usize, to: usize) -> u32 {
    count_blocks(words, &[from, to])[1]
}

/// Counts the readouts at which both pixels fire, and those at which one pixel fires one readout after the other.
#[inline(always)]
pub(crate) fn coincidences(a: &[u64], b: &[u64]) -> [u64; 2] {
    let n = a.len().min(b.len());
    let (a, b) = (&a[..n], &b[..n]);
    let both = |a: u64, b: u64| u64::from((a & b).count_ones());
    let (mut coincident, mut delayed) = (0, 0);
    if let ([a, ..], [b, ..]) = (a, b) {
        coincident += both(*a, *b);
        delayed += both(a << 1, *b) + both(b << 1, *a);
    }
    // Each word takes its carry from the previous word and not from the previous iteration. The iterations are
    // independent, so the compiler vectorizes the loop.
    for i in 1..n {
        coincident += both(a[i], b[i]);
        delayed += both(a[i] << 1 | a[i - 1] >> 63, b[i]) + both(b[i] << 1 | b[i - 1] >> 63, a[i]);
    }
    [coincident, delayed]
}

/// Returns the number of spikes of each readout, and the number of bits that differ between successive readouts.
pub(crate) fn readout_totals(frames: SpikeFramesRef<'_>) -> [Vec<u32>; 2] {
    dispatch(
        #[inline(always)]
        || {
            let bytes = frames.geometry().frame_bytes();
            let (mut totals, mut changes) = (vec![0; frames.readouts()], vec![0; frames.readouts()]);
            // The first frame is compared with itself. Its change of zero is removed below.
            let mut before = &frames.as_bytes()[..bytes.min(frames.as_bytes().len())];
            let places = totals.iter_mut().zip(&mut changes);
            for (frame, (total, change)) in frames.as_bytes().chunks_exact(bytes).zip(places) {
                [*total, *change] = count_frame(before, frame);
                before = frame;
            }
            changes.drain(..changes.len().min(1));
            [totals, changes]
        },
    )
}

/// Returns the number of spikes in `frame`, and the number of bits that differ from `before`.
#[inline(always)]
fn count_frame(before: &[u8], frame: &[u8]) -> [u32; 2] {
    let (a, b) = (before.as_chunks::<8>().0, frame.as_chunks::<8>().0);
    let (mut total, mut change) = (0, 0);
    for (a, b) in a.iter().zip(b) {
        let (a, b) = (u64::from_le_bytes(*a), u64::from_le_bytes(*b));
        total += u64::from(b.count_ones());
        change += u64::from((a ^ b).count_ones());
    }
    let (a, b) = (word_at(before, 8 * a.len()), word_at(frame, 8 * b.len()));
    [total as u32 + b.count_ones(), change as u32 + (a ^ b).count_ones()]
}

/// Returns the correlation between the spike counts of the two halves of a row over readouts, averaged over the rows.
/// Row noise increases it.
pub(crate) fn row_halves(bits: &PixelBits) -> f64 {
    if bits.geometry.width() < 4 || bits.readouts < 2 {
        return 0.0;
    }
    let of_row = |row: usize| {
        dispatch(
            #[inline(always)]
            || row_correlation(bits, row),
        )
    };
    // The sum has a fixed order, because the rounding of a sum depends on its order.
    let rows: Vec<f64> = threads::map(0..bits.geometry.height(), of_row);
    rows.iter().sum::<f64>() / bits.geometry.height() as f64
}

/// Numbers of spikes in half a row at `64 * LANE_WORDS` readouts, in binary. The element `[d][w]` holds digit `d` of
/// the counts at 64 readouts, one bit per readout.
type Digits = [[u64; LANE_WORDS]];

/// Counts the spikes of `pixels` at each readout from word `w` on, with a binary adder over bits.
#[inline(always)]
fn sum_bits(bits: &PixelBits, pixels: Range<usize>, w: usize, number: &mut Digits) {
    number.fill([0; LANE_WORDS]);
    for p in pixels {
        let words = &bits.pixel(p)[w..];
        let mut carry = [0; LANE_WORDS];
        match words.first_chunk::<LANE_WORDS>() {
            Some(whole) => carry = *whole,
            None => carry[..words.len()].copy_from_slice(words),
        }
        for digit in number.iter_mut() {
            for i in 0..LANE_WORDS {
                let both = digit[i] & carry[i];
                digit[i] ^= carry[i];
                carry[i] = both;
            }
        }
    }
}

/// Adds the products `a * b` at all readouts to `sums`: the product of digits `i` and `j` has the weight `2^(i + j)`.
#[inline(always)]
fn add_products(a: &Digits, b: &Digits, sums: &mut [u64; LANE_WORDS]) {
    for (i, a) in a.iter().enumerate() {
        for (j, b) in b.iter().enumerate() {
            for k in 0..LANE_WORDS {
                sums[k] += u64::from((a[k] & b[k]).count_ones()) << (i + j);
            }
        }
    }
}

/// Returns the correlation between the halves of one row.
#[inline(always)]
fn row_correlation(bits: &PixelBits, row: usize) -> f64 {
    let (width, n) = (bits.geometry.width(), bits.readouts as f64);
    let (start, middle, end) = (row * width, row * width + width / 2, (row + 1) * width);
    let mut scratch = [[[0; LANE_WORDS]; MAX_DIGITS]; 2];
    let [l, r] = scratch.each_mut().map(|number| &mut number[..=(end - middle).ilog2() as usize]);
    let [mut l1, mut r1, mut lr, mut l2, mut r2] = [[0; LANE_WORDS]; 5];
    for w in (0..bits.words).step_by(LANE_WORDS) {
        sum_bits(bits, start..middle, w, l);
        sum_bits(bits, middle..end, w, r);
        add_products(l, &[[!0; LANE_WORDS]], &mut l1);
        add_products(r, &[[!0; LANE_WORDS]], &mut r1);
        add_products(l, r, &mut lr);
        add_products(l, l, &mut l2);
        add_products(r, r, &mut r2);
    }
    let mean = |sums: &[u64; LANE_WORDS]| sums.iter().sum::<u64>() as f64 / n;
    let (l1, r1, lr) = (mean(&l1), mean(&r1), mean(&lr));
    let scale = ((mean(&l2) - l1 * l1) * (mean(&r2) - r1 * r1)).sqrt();
    if scale > 0.0 { (lr - l1 * r1) / scale } else { 0.0 }
}

/// Returns the coincidences of neighbors divided by their expectation, minus 1: right and below at lag 0, then at lag 1.
pub(crate) fn neighbors(bits: &PixelBits, pixels: &[PixelScan]) -> [f64; 4] {
    let of_row = |row: usize| {
        dispatch(
            #[inline(always)]
            || row_neighbors(bits, pixels, row),
        )
    };
    let rows: Vec<[[f64; 2]; 4]> = threads::map(0..bits.geometry.height(), of_row);
    std::array::from_fn(|k| {
        let sum = |i: usize| rows.iter().map(|r| r[k][i]).sum::<f64>();
        let (found, chance) = (sum(0), sum(1));
        if chance > 0.0 { found / chance - 1.0 } else { 0.0 }
    })
}

/// Returns the found and the expected coincidences for the neighbors to the right and below at lag 0, then at lag 1.
#[inline(always)]
fn row_neighbors(bits: &PixelBits, pixels: &[PixelScan], row: usize) -> [[f64; 2]; 4] {
    let (width, n) = (bits.geometry.width(), pixels.len());
    let mut sums = [[0.0; 2]; 4];
    // The pixels of one color of a checkerboard cover every second pair, and each pair once.
    for p in (row * width + row % 2..(row + 1) * width).step_by(2) {
        let others = [(p % width + 1 < width, p + 1), (p + width < n, p + width)];
        for (k, (inside, q)) in others.into_iter().enumerate() {
            if !inside {
                continue;
            }
            let chance = f64::from(pixels[p].count) * f64::from(pixels[q].count) / bits.readouts as f64;
            let [coincident, delayed] = coincidences(bits.pixel(p), bits.pixel(q));
            sums[k][0] += coincident as f64;
            sums[k][1] += chance;
            sums[k + 2][0] += delayed as f64;
            sums[k + 2][1] += 2.0 * chance;
        }
    }
    sums
}

#[cfg(test)]
mod tests {
    use super::*;
    use spikelane::spikes::{Geometry, bit, set_bit};

    #[test]
    fn transposed_bits_equal_the_frames() {
        let geometry = Geometry::new(13, 11).unwrap();
        let readouts = 150;
        let mut bytes = vec![0; readouts * geometry.frame_bytes()];
        for (t, frame) in bytes.chunks_exact_mut(geometry.frame_bytes()).enumerate() {
            (0..geometry.pixels()).filter(|p| (p * 7 + t * t) % 5 == 0).for_each(|p| set_bit(frame, p));
        }
        let bits = PixelBits::new(SpikeFramesRef::new(geometry, &bytes).unwrap()).unwrap();
        for (t, frame) in bytes.chunks_exact(geometry.frame_bytes()).enumerate() {
            for p in 0..geometry.pixels() {
                let found = bits.pixel(p)[t / 64] >> (t % 64) & 1 != 0;
                assert_eq!(found, bit(frame, p), "pixel {p}, readout {t}");
            }
        }
        let early =
            |p: usize| bytes.chunks_exact(geometry.frame_bytes()).take(70).filter(|f| bit(f, p)).count();
        assert!((0..143).all(|p| count_blocks(bits.pixel(p), &[70])[0] as usize == early(p)));
    }

    /// A recording whose readouts do not fill whole words, and whose rows and frames do not fill whole bytes.
    fn recording(geometry: Geometry) -> Vec<u8> {
        let mut bytes = vec![0; 700 * geometry.frame_bytes()];
        for (t, frame) in bytes.chunks_exact_mut(geometry.frame_bytes()).enumerate() {
            let fires = |p: &usize| (p * 2_654_435 + t * t * 40_503 + t * p) % 7 < 1 + t % 4;
            (0..geometry.pixels()).filter(fires).for_each(|p| set_bit(frame, p));
        }
        bytes
    }

    #[test]
    fn word_operations_equal_operations_on_single_bits() {
        let geometry = Geometry::new(13, 11).unwrap();
        let bytes = recording(geometry);
        let frames = SpikeFramesRef::new(geometry, &bytes).unwrap();
        let [found, changes] = readout_totals(frames);
        let on = |t: usize, p: usize| bit(frames.frame(t).as_bytes(), p);
        let bits = PixelBits::new(frames).unwrap();
        for t in 0..700 {
            assert_eq!(found[t] as usize, (0..143).filter(|p| on(t, *p)).count());
            let changed = |t: usize| (0..143).filter(|p| on(t - 1, *p) != on(t, *p)).count();
            assert!(t == 0 || changes[t - 1] as usize == changed(t));
        }
        assert_eq!(changes.len(), 699);
        let both =
            |p: usize, q: usize, lag: usize| (lag..700).filter(|t| on(t - lag, p) && on(*t, q)).count();
        for (p, q) in [(0, 1), (17, 30), (141, 142)] {
            let wanted = [both(p, q, 0), both(p, q, 1) + both(q, p, 1)];
            assert_eq!(coincidences(bits.pixel(p), bits.pixel(q)).map(|n| n as usize), wanted);
        }
        let half = |t: usize, row: usize, from: usize, to: usize| {
            (from..to).filter(|c| on(t, 13 * row + c)).count() as f64
        };
        let correlation = |row: usize| {
            let mean = |f: &dyn Fn(f64, f64) -> f64| {
                (0..700).map(|t| f(half(t, row, 0, 6), half(t, row, 6, 13))).sum::<f64>() / 700.0
            };
            let (l, r) = (mean(&|l, _| l), mean(&|_, r| r));
            let scale = ((mean(&|l, _| l * l) - l * l) * (mean(&|_, r| r * r) - r * r)).sqrt();
            if scale > 0.0 { (mean(&|l, r| l * r) - l * r) / scale } else { 0.0 }
        };
        assert_eq!(row_halves(&bits), (0..11).map(correlation).sum::<f64>() / 11.0);
    }
}
