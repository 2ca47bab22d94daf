//! Statistics of groups of pixels: the correlation between the halves of rows, and coincidences of neighbors.

use std::ops::Range;

use crate::recordings::bits::{PixelBits, coincidences};
use spikelane::unstable::kernels::dispatch;
use spikelane::unstable::threads;

/// Number of words that are processed together, so that the compiler vectorizes the loops.
const LANE_WORDS: usize = 8;

/// Largest number of binary digits of the spike count of half a row.
const MAX_DIGITS: usize = 28;

/// Returns the correlation over time between the spike counts of the left and of the right half of a row. The
/// result is the mean over all rows. Row noise increases it.
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
    // The rows are summed in a fixed order, because the rounding of a sum depends on the order.
    let rows: Vec<f64> = threads::map(0..bits.geometry.height(), of_row);
    rows.iter().sum::<f64>() / bits.geometry.height() as f64
}

/// Spike counts of half a row at `64 * LANE_WORDS` readouts, as binary numbers. The element `[d][w]` contains digit
/// `d` of the counts at 64 readouts, with one bit per readout.
type Digits = [[u64; LANE_WORDS]];

/// Counts the spikes of `pixels` at each readout, from word `w` on. It is a binary adder that processes 64 readouts
/// per operation.
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

/// Adds the product `a * b` at each readout to `sums`. `a` and `b` are spike counts as binary digits ([`Digits`]).
/// The product of digit `i` of `a` and digit `j` of `b` has the weight `2^(i + j)`.
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

/// Returns the correlation over time between the spike counts of both halves of one row.
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

/// Returns the coincidences of neighbors divided by their expectation, minus 1. The elements are: right and below
/// at the same readout, then right and below at the next readout. `counts` contains the number of spikes of each
/// pixel.
pub(crate) fn neighbors(bits: &PixelBits, counts: &[u32]) -> [f64; 4] {
    let of_row = |row: usize| {
        dispatch(
            #[inline(always)]
            || row_neighbors(bits, counts, row),
        )
    };
    let rows: Vec<[[f64; 2]; 4]> = threads::map(0..bits.geometry.height(), of_row);
    std::array::from_fn(|k| {
        let sum = |i: usize| rows.iter().map(|r| r[k][i]).sum::<f64>();
        let (found, chance) = (sum(0), sum(1));
        if chance > 0.0 { found / chance - 1.0 } else { 0.0 }
    })
}

/// Returns the observed and the expected coincidences for one row. The elements are those of [`neighbors`].
#[inline(always)]
fn row_neighbors(bits: &PixelBits, counts: &[u32], row: usize) -> [[f64; 2]; 4] {
    let (width, n) = (bits.geometry.width(), counts.len());
    let mut sums = [[0.0; 2]; 4];
    // The pixels of one color of a checkerboard are visited. This includes half of all neighboring pairs, and no
    // pair twice.
    for p in (row * width + row % 2..(row + 1) * width).step_by(2) {
        let others = [(p % width + 1 < width, p + 1), (p + width < n, p + width)];
        for (k, (inside, q)) in others.into_iter().enumerate() {
            if !inside {
                continue;
            }
            let chance = f64::from(counts[p]) * f64::from(counts[q]) / bits.readouts as f64;
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
    use crate::recordings::bits::readout_totals;
    use spikelane::spikes::{Geometry, SpikeFramesRef, bit, set_bit};

    /// Returns a recording whose readouts do not fill whole words. Its rows and frames do not fill whole bytes.
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
        let [found, changes] = readout_totals(frames).unwrap();
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
