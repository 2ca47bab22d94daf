//! Sums over the new spikes of a pixel that has been firing for long: 16-bit
//! times, eight intervals per instruction.
//!
//! All times of the block and of the kept history are taken relative to the
//! oldest one. When that span is at most [`span_limit`], no sum of squared
//! differences can leave 32 bits: the differences of one lag cover each
//! readout at most `lag` times, so they sum to `lag * span` and their squares
//! to `lag * span^2` at most. Other pixels, and those that have not fired often
//! enough to fill the history, take the exact path.

use wide::{i16x8, i32x4};

use super::Pixel;

/// The largest span of times for lags up to `longest`.
pub(super) fn span_limit(longest: u32) -> u32 {
    // Zero included, one readout less keeps the largest sum below 2^31.
    let sums = ((1_u32 << 31) / longest).isqrt() - 1;
    // Times are 16 bits, and the last word of a block may overhang it.
    sums.min(32_000)
}

/// Lanes that belong to a chunk with that many of its eight entries.
const MASKS: [[i16; 8]; 9] = masks();

const fn masks() -> [[i16; 8]; 9] {
    let mut table = [[0; 8]; 9];
    let mut n = 0;
    while n < 9 {
        let mut lane = 0;
        while lane < n {
            table[n][lane] = -1;
            lane += 1;
        }
        n += 1;
    }
    table
}

#[inline(always)]
fn load(values: &[i16], at: usize) -> i16x8 {
    let mut lanes = [0; 8];
    lanes.copy_from_slice(&values[at..at + 8]);
    i16x8::new(lanes)
}

/// The chunks of eight of `n` entries, with the mask of their lanes.
#[inline(always)]
fn chunks(n: usize) -> impl Iterator<Item = (usize, i16x8)> {
    (0..n)
        .step_by(8)
        .map(move |i| (i, i16x8::new(MASKS[(n - i).min(8)])))
}

/// Writes all intervals of `times[..end]`: entry `i` ends at `times[i]`.
pub(super) fn differences(times: &[i16], end: usize, intervals: &mut [i16]) {
    for i in (1..end).step_by(8) {
        let x = load(times, i) - load(times, i - 1);
        intervals[i..i + 8].copy_from_slice(&x.to_array());
    }
}

/// Adds the differences over `lag` spikes that end at `times[from..end]`.
#[inline(always)]
pub(super) fn add_lag(times: &[i16], from: usize, end: usize, lag: usize, sums: &mut [u64; 2]) {
    let one = i16x8::splat(1);
    let mut sum = i32x4::splat(0);
    let mut squares = i32x4::splat(0);
    for (i, mask) in chunks(end - from) {
        let d = (load(times, from + i) - load(times, from + i - lag)) & mask;
        sum += d.dot(one);
        squares += d.dot(d);
    }
    sums[0] += sum.reduce_add() as u64;
    sums[1] += squares.reduce_add() as u64;
}

/// Adds products of successive intervals, extremes, and the counts at the
/// pixel's fences, for the intervals that end at entries `from..end`.
pub(super) fn add_intervals(intervals: &[i16], from: usize, end: usize, pixel: &mut Pixel) {
    let fences = pixel
        .fences()
        .map(|f| i16x8::splat(f.min(i64::from(i16::MAX)) as i16));
    let mut above = [i16x8::splat(0); 8];
    let mut products = [i32x4::splat(0); 2];
    let mut longest = i16x8::splat(0);
    let mut shortest = i16x8::splat(i16::MAX);
    for (i, mask) in chunks(end - from) {
        let at = from + i;
        let x = load(intervals, at) & mask;
        products[0] += x.dot(load(intervals, at - 1));
        products[1] += x.dot(load(intervals, at - 2));
        longest = longest.max(x);
        shortest = shortest.min(x | (!mask & i16x8::splat(i16::MAX)));
        for (count, fence) in above.iter_mut().zip(fences) {
            // A comparison is -1 where it holds.
            *count -= x.simd_gt(fence) & mask;
        }
    }
    for (sum, product) in pixel.products.iter_mut().zip(products) {
        *sum += product.reduce_add() as u64;
    }
    pixel.shortest = pixel.shortest.min(shortest.reduce_min() as u32);
    pixel.longest = pixel.longest.max(longest.reduce_max() as u32);
    let n = (end - from) as u32;
    pixel.add_above(n, above.map(|count| count.reduce_add() as u32));
}
