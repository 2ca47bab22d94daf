//! Sums over the new spikes of a pixel that has been firing for long: 16-bit
//! times, eight intervals per instruction.
//!
//! All times of the block and of the kept history are taken relative to the
//! oldest one. When that span is at most [`span_limit`], no sum of squared
//! differences can leave 32 bits: the differences of one lag cover each
//! readout at most `lag` times, so they sum to `lag * span` and their squares
//! to `lag * span^2` at most. Other pixels, and those that have not fired often
//! enough to fill the history, take the exact path.

use std::ops::Range;

use wide::{i16x8, i32x4, i32x8};

use super::pixel::{CUMULATIVE, Pixel};

/// A sum at each readout of the block. There is a place for every 16-bit time, so that none needs a check; those
/// behind the block are never touched but for nothing.
pub(super) type Table = [i64; 1 << 16];

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

/// The whole chunks of eight among the `n` entries from `from` on.
#[inline(always)]
fn eights(values: &[i16], from: usize, n: usize) -> &[[i16; 8]] {
    values[from..from + n].as_chunks().0
}

/// Writes all intervals of `times[..end]`: entry `i` ends at `times[i]`. Eight
/// zeros follow the last.
#[inline(always)]
pub(super) fn differences(times: &[i16], end: usize, intervals: &mut [i16]) {
    let n = (end - 1).next_multiple_of(8);
    let (before, after) = (eights(times, 0, n), eights(times, 1, n));
    let out = intervals[1..n + 1].as_chunks_mut().0;
    for ((x, a), b) in out.iter_mut().zip(after).zip(before) {
        *x = (i16x8::new(*a) - i16x8::new(*b)).to_array();
    }
    intervals[end..end + 8].fill(0);
}

/// Lags of one pass over a pixel's times: their sums stay in registers, and short loops, whose
/// ends are foreseen badly, are few.
pub(super) const TOGETHER: usize = 6;

/// Sums of the squares of the differences over each of `lags` spikes that end at `times[from..end]`.
#[inline(always)]
pub(super) fn squares(times: &[i16], from: usize, end: usize, lags: [usize; TOGETHER]) -> [u64; TOGETHER] {
    let mut sums = [i32x4::splat(0); TOGETHER];
    let n = (end - from).next_multiple_of(8);
    let after = eights(times, from, n);
    let before = lags.map(|lag| eights(times, from - lag, n));
    let last = n / 8 - 1;
    for at in 0..last {
        let time = i16x8::new(after[at]);
        for (sum, before) in sums.iter_mut().zip(before) {
            let d = time - i16x8::new(before[at]);
            *sum += d.dot(d);
        }
    }
    // What follows the last spike is no time.
    let (time, mask) = (i16x8::new(after[last]), i16x8::new(MASKS[end - from - 8 * last]));
    for (sum, before) in sums.iter_mut().zip(before) {
        let d = (time - i16x8::new(before[last])) & mask;
        *sum += d.dot(d);
    }
    sums.map(|sum| sum.reduce_add() as u64)
}

/// Adds to `table`, at the time of each of the spikes `from..end`, how its interval deviates from `reference`, in sixteenths.
/// Zeros follow the intervals, and nothing is added for them, wherever their times point.
#[inline(always)]
pub(super) fn deviate(
    times: &[i16],
    intervals: &[i16],
    from: usize,
    end: usize,
    reference: u32,
    table: &mut Table,
) {
    let n = (end - from).next_multiple_of(8);
    // Below 2^29 with intervals of 15 bits and a reference within `MAX_READOUTS`.
    let reference = i32x8::splat(reference as i32);
    for (times, x) in eights(times, from, n).iter().zip(eights(intervals, from, n)) {
        let x = i32x8::from_i16x8(i16x8::new(*x));
        let deviations: i32x8 = ((x << 4) - reference) & x.simd_gt(i32x8::splat(0));
        for (time, deviation) in times.iter().zip(deviations.to_array()) {
            table[usize::from(*time as u16)] += i64::from(deviation);
        }
    }
}

/// What the new intervals of a pixel are, for the histogram.
pub(super) struct Found {
    pub(super) shortest: u32,
    pub(super) longest: u32,
    /// Intervals of at most `centre - 3 + j` readouts.
    pub(super) within: [u32; CUMULATIVE],
}

/// Calls `visit` for every interval in `range` below `low` or above `high`. Zeros follow the last.
/// Most eights have none.
#[inline(always)]
pub(super) fn outliers(
    intervals: &[i16],
    range: Range<usize>,
    low: i16,
    high: i16,
    mut visit: impl FnMut(i16),
) {
    let n = range.len().next_multiple_of(8);
    let (low, high) = (i16x8::splat(low), i16x8::splat(high));
    for eight in eights(intervals, range.start, n) {
        let x = i16x8::new(*eight);
        let out: i16x8 = (x.simd_gt(high) | x.simd_lt(low)) & x.simd_gt(i16x8::splat(0));
        let mut out = out.to_bitmask();
        while out != 0 {
            visit(eight[out.trailing_zeros() as usize % 8]);
            out &= out - 1;
        }
    }
}

/// Adds products of successive intervals, extremes, and the counts at the
/// pixel's fences, for the intervals that end at entries `from..end`. Zeros
/// follow them: they lie beyond no fence and add nothing to a product.
#[inline(always)]
pub(super) fn add_intervals(intervals: &[i16], from: usize, end: usize, pixel: &mut Pixel) -> Found {
    let fences = pixel.fences().map(|f| i16x8::splat(f.clamp(0, i64::from(i16::MAX)) as i16));
    let mut above = [i16x8::splat(0); 8];
    let mut products = [i32x4::splat(0); 2];
    let mut longest = i16x8::splat(0);
    let mut shortest = i16x8::splat(i16::MAX);
    let n = (end - from).next_multiple_of(8);
    let one = eights(intervals, from - 1, n);
    let two = eights(intervals, from - 2, n);
    let own = eights(intervals, from, n);
    for ((x, one), two) in own.iter().zip(one).zip(two) {
        let x = i16x8::new(*x);
        products[0] += x.dot(i16x8::new(*one));
        products[1] += x.dot(i16x8::new(*two));
        longest = longest.max(x);
        // Less one and biased: the zeros come out as the greatest.
        shortest = shortest.min((x - i16x8::splat(1)) ^ i16x8::splat(i16::MIN));
        for (count, fence) in above.iter_mut().zip(fences) {
            // A comparison is -1 where it holds.
            *count -= x.simd_gt(fence);
        }
    }
    for (sum, product) in pixel.products.iter_mut().zip(products) {
        *sum += product.reduce_add() as u64;
    }
    let above = above.map(|count| count.reduce_add() as u32);
    let n = (end - from) as u32;
    let found = Found {
        shortest: (i32::from(shortest.reduce_min()) + 32_769) as u32,
        longest: longest.reduce_max() as u32,
        within: std::array::from_fn(|j| n - above[2 + j]),
    };
    pixel.shortest = pixel.shortest.min(found.shortest);
    pixel.longest = pixel.longest.max(found.longest);
    pixel.add_above(n, above);
    found
}
