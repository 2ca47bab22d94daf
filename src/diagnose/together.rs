//! What pixels do together in a recording: whole readouts, rows and neighbours.

use rayon::prelude::*;

use super::bits::{PixelBits, coincidences, word_at};
use super::scan::PixelScan;
use crate::kernels::counting;
use crate::spikes::{Packed, count};

/// Spikes of each readout.
pub(super) fn totals(frames: Packed<'_>) -> Vec<u32> {
    counting(
        #[inline(always)]
        || frames.frames().map(|f| count(f) as u32).collect(),
    )
}

/// Bits that changed since the readout before.
pub(super) fn changes(frames: Packed<'_>) -> Vec<u32> {
    let pairs = frames.frames().zip(frames.frames().skip(1));
    counting(
        #[inline(always)]
        || pairs.map(|(a, b)| changed(a, b)).collect(),
    )
}

#[inline(always)]
fn changed(before: &[u8], after: &[u8]) -> u32 {
    let words = (0..before.len()).step_by(8);
    words.map(|i| (word_at(before, i) ^ word_at(after, i)).count_ones()).sum()
}

/// Bits `from..to` of a frame.
#[inline(always)]
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
pub(super) fn row_halves(frames: Packed<'_>) -> f64 {
    let geometry = frames.geometry();
    if geometry.width() < 4 || frames.readouts() < 2 {
        return 0.0;
    }
    let of_row = |row: usize| {
        counting(
            #[inline(always)]
            || halves_of_row(frames, row),
        )
    };
    // Summed in order: a sum of parts would depend on who took which.
    let rows: Vec<f64> = (0..geometry.height()).into_par_iter().map(of_row).collect();
    rows.iter().sum::<f64>() / geometry.height() as f64
}

/// The correlation of the halves of one row.
#[inline(always)]
fn halves_of_row(frames: Packed<'_>, row: usize) -> f64 {
    let (width, n) = (frames.geometry().width(), frames.readouts() as f64);
    // A whole row in one word, wherever in a byte it begins.
    let short = width <= 56;
    let (start, middle) = (row * width, row * width + width / 2);
    let (mut l1, mut r1, mut lr, mut l2, mut r2) = (0u64, 0u64, 0u64, 0u64, 0u64);
    for frame in frames.frames() {
        let (l, r) = if short {
            let row = word_at(frame, start / 8) >> (start % 8);
            let left = row & ((1 << (width / 2)) - 1);
            let right = (row ^ left) & ((1 << width) - 1);
            (u64::from(left.count_ones()), u64::from(right.count_ones()))
        } else {
            let count = (count_range(frame, start, middle), count_range(frame, middle, start + width));
            (u64::from(count.0), u64::from(count.1))
        };
        l1 += l;
        r1 += r;
        lr += l * r;
        l2 += l * l;
        r2 += r * r;
    }
    let (l1, r1, lr) = (l1 as f64 / n, r1 as f64 / n, lr as f64 / n);
    let scale = ((l2 as f64 / n - l1 * l1) * (r2 as f64 / n - r1 * r1)).sqrt();
    if scale > 0.0 { (lr - l1 * r1) / scale } else { 0.0 }
}

pub(super) fn neighbours(bits: &PixelBits, pixels: &[PixelScan]) -> [f64; 4] {
    let of_row = |row: usize| {
        counting(
            #[inline(always)]
            || neighbours_of_row(bits, pixels, row),
        )
    };
    let rows: Vec<[[f64; 2]; 4]> = (0..bits.geometry.height()).into_par_iter().map(of_row).collect();
    std::array::from_fn(|k| {
        let sum = |i: usize| rows.iter().map(|r| r[k][i]).sum::<f64>();
        let (found, chance) = (sum(0), sum(1));
        if chance > 0.0 { found / chance - 1.0 } else { 0.0 }
    })
}

/// Coincidences found and expected by chance: beside and below at lag 0, then at lag 1.
#[inline(always)]
fn neighbours_of_row(bits: &PixelBits, pixels: &[PixelScan], row: usize) -> [[f64; 2]; 4] {
    let (width, n) = (bits.geometry.width(), pixels.len());
    let mut sums = [[0.0; 2]; 4];
    // Half of the pairs, like the squares of one colour.
    for p in (row * width..(row + 1) * width).filter(|p| (p / width + p % width).is_multiple_of(2)) {
        let others = [(p % width + 1 < width, p + 1), (p + width < n, p + width)];
        for (k, (_, q)) in others.into_iter().enumerate().filter(|(_, (inside, _))| *inside) {
            let chance = f64::from(pixels[p].count) * f64::from(pixels[q].count) / bits.readouts as f64;
            let (a, b) = (bits.pixel(p), bits.pixel(q));
            let late = coincidences(a, b, 1) + coincidences(b, a, 1);
            sums[k][0] += f64::from(coincidences(a, b, 0));
            sums[k][1] += chance;
            sums[k + 2][0] += f64::from(late);
            sums[k + 2][1] += 2.0 * chance;
        }
    }
    sums
}
