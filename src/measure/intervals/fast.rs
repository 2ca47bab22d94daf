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

use super::pixel::{CUMULATIVE, Pixel};

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

/// Writes all intervals of `times[..end]`: entry `i` ends at `times[i]`. Eight
/// zeros follow the last.
pub(super) fn differences(times: &[i16], end: usize, intervals: &mut [i16]) {
    let n = (end - 1).next_multiple_of(8);
    let (before, after) = (&times[..n], &times[1..n + 1]);
    let out = intervals[1..n + 1].chunks_exact_mut(8);
    for ((x, a), b) in out.zip(after.chunks_exact(8)).zip(before.chunks_exact(8)) {
        x.copy_from_slice(&(load(a, 0) - load(b, 0)).to_array());
    }
    intervals[end..end + 8].fill(0);
}

/// Lags of one pass over a pixel's times: their sums stay in registers, and short loops, whose
/// ends are foreseen badly, are few.
pub(super) const TOGETHER: usize = 3;

/// Sums of the squares of the differences over each of `lags` spikes that end at `times[from..end]`.
#[inline(always)]
pub(super) fn squares(times: &[i16], from: usize, end: usize, lags: [usize; TOGETHER]) -> [u64; TOGETHER] {
    let mut sums = [i32x4::splat(0); TOGETHER];
    let n = (end - from).next_multiple_of(8);
    let after = &times[from..from + n];
    let before = lags.map(|lag| &times[from - lag..from - lag + n]);
    let last = n - 8;
    let mut add = |at: usize, mask: i16x8| {
        let time = load(after, at);
        for (sum, before) in sums.iter_mut().zip(before) {
            let d = (time - load(before, at)) & mask;
            *sum += d.dot(d);
        }
    };
    for at in (0..last).step_by(8) {
        add(at, i16x8::splat(-1));
    }
    // What follows the last spike is no time.
    add(last, i16x8::new(MASKS[end - from - last]));
    sums.map(|sum| sum.reduce_add() as u64)
}

/// What the new intervals of a pixel are, for the histogram.
pub(super) struct Found {
    pub(super) shortest: u32,
    pub(super) longest: u32,
    /// Intervals of at most `centre - 3 + j` readouts.
    pub(super) within: [u32; CUMULATIVE],
}

/// Adds products of successive intervals, extremes, and the counts at the
/// pixel's fences, for the intervals that end at entries `from..end`. Zeros
/// follow them: they lie beyond no fence and add nothing to a product.
pub(super) fn add_intervals(intervals: &[i16], from: usize, end: usize, pixel: &mut Pixel) -> Found {
    let fences = pixel.fences().map(|f| i16x8::splat(f.clamp(0, i64::from(i16::MAX)) as i16));
    let mut above = [i16x8::splat(0); 8];
    let mut products = [i32x4::splat(0); 2];
    let mut longest = i16x8::splat(0);
    let mut shortest = i16x8::splat(i16::MAX);
    let n = (end - from).next_multiple_of(8);
    let one = intervals[from - 1..from - 1 + n].chunks_exact(8);
    let two = intervals[from - 2..from - 2 + n].chunks_exact(8);
    let own = intervals[from..from + n].chunks_exact(8);
    for ((x, one), two) in own.zip(one).zip(two) {
        let x = load(x, 0);
        products[0] += x.dot(load(one, 0));
        products[1] += x.dot(load(two, 0));
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
