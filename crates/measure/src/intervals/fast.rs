//! Sums over the new spikes of a pixel that has been firing for long: 16-bit
//! times, sixteen or thirty-two intervals per instruction where the CPU can.
//!
//! All times of the block and of the kept history are taken relative to the
//! oldest one. When that span is at most [`span_limit`], no sum of squared
//! differences can leave 32 bits: the differences of one lag cover each
//! readout at most `lag` times, so they sum to `lag * span` and their squares
//! to `lag * span^2` at most. Other pixels, and those that have not fired often
//! enough to fill the history, take the exact path.

use std::ops::Range;

use wide::{i16x8, i32x8};

use super::pixel::{CUMULATIVE, Pixel};
use super::readouts::Table;
use spikelane::unstable::kernels::{SHORTS, Shorts};

/// The largest span of times for lags up to `longest`.
pub(super) fn span_limit(longest: u32) -> u32 {
    // Zero included, one readout less keeps the largest sum below 2^31.
    let sums = ((1_u32 << 31) / longest).isqrt() - 1;
    // Times are 16 bits, and the last word of a block may overhang it.
    sums.min(32_000)
}

/// Lanes that belong to a chunk with that many of its entries.
const MASKS: [[i16; SHORTS]; SHORTS + 1] = masks();

const fn masks() -> [[i16; SHORTS]; SHORTS + 1] {
    let mut table = [[0; SHORTS]; SHORTS + 1];
    let mut n = 0;
    while n <= SHORTS {
        let mut lane = 0;
        while lane < n {
            table[n][lane] = -1;
            lane += 1;
        }
        n += 1;
    }
    table
}

/// The whole chunks of `N` among the `n` entries from `from` on.
#[inline(always)]
fn chunks<const N: usize>(values: &[i16], from: usize, n: usize) -> &[[i16; N]] {
    values[from..from + n].as_chunks().0
}

/// Writes all intervals of `times[..end]`: entry `i` ends at `times[i]`. A chunk of
/// zeros follows the last.
#[inline(always)]
pub(super) fn differences<S: Shorts>(s: S, times: &[i16], end: usize, intervals: &mut [i16]) {
    let n = (end - 1).next_multiple_of(SHORTS);
    let (before, after) = (chunks(times, 0, n), chunks(times, 1, n));
    let out = intervals[1..n + 1].as_chunks_mut().0;
    for ((x, a), b) in out.iter_mut().zip(after).zip(before) {
        s.store(x, s.sub(s.load(a), s.load(b)));
    }
    intervals[end..end + SHORTS].fill(0);
}

/// Lags of one pass over a pixel's times: their sums stay in registers, and short loops, whose
/// ends are foreseen badly, are few.
pub(super) const TOGETHER: usize = 6;

/// Sums of the squares of the differences over each of `lags` spikes that end at `times[from..end]`.
#[inline(always)]
pub(super) fn squares<S: Shorts>(
    s: S,
    times: &[i16],
    from: usize,
    end: usize,
    lags: [usize; TOGETHER],
) -> [u64; TOGETHER] {
    let mut sums = [s.zero(); 8];
    let n = (end - from).next_multiple_of(SHORTS);
    let after = chunks(times, from, n);
    let before = lags.map(|lag| chunks(times, from - lag, n));
    let last = n / SHORTS - 1;
    for at in 0..last {
        let time = s.load(&after[at]);
        for (sum, before) in sums.iter_mut().zip(before) {
            let d = s.sub(time, s.load(&before[at]));
            *sum = s.add_products(*sum, d, d);
        }
    }
    // What follows the last spike is no time.
    let (time, mask) = (s.load(&after[last]), s.load(&MASKS[end - from - SHORTS * last]));
    for (sum, before) in sums.iter_mut().zip(before) {
        let d = s.and(s.sub(time, s.load(&before[last])), mask);
        *sum = s.add_products(*sum, d, d);
    }
    let totals = s.totals(sums);
    std::array::from_fn(|i| totals[i] as u64)
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
    let reference = i32x8::splat(reference as i32);
    // Sixteen deviations had to be written and read again: twice as slow.
    let eights = chunks::<8>(times, from, n);
    for (times, x) in eights.iter().zip(chunks(intervals, from, n)) {
        let x = i32x8::from_i16x8(i16x8::new(*x));
        let deviations: i32x8 = ((x << 4) - reference) & x.simd_gt(i32x8::splat(0));
        for (time, deviation) in times.iter().zip(deviations.to_array()) {
            table[usize::from(*time as u16)] += deviation;
        }
    }
}

/// What the new intervals of a pixel are, for the histogram.
pub(super) struct Found {
    pub(super) shortest: u32,
    pub(super) longest: u32,
    /// Intervals of at most `centre - 3 + j` readouts.
    pub(super) within: [u32; CUMULATIVE],
    /// The pixel's fences, and the intervals above each.
    pub(super) fences: [i16; FENCES],
    pub(super) above: [u32; FENCES],
}

/// Calls `visit` for every interval in `range` below `low` or above `high`. Zeros follow the last.
/// Most chunks have none.
#[inline(always)]
pub(super) fn outliers<S: Shorts>(
    s: S,
    intervals: &[i16],
    range: Range<usize>,
    low: i16,
    high: i16,
    mut visit: impl FnMut(i16),
) {
    let n = range.len().next_multiple_of(SHORTS);
    let (low, high, zero) = (s.splat(low), s.splat(high), s.splat(0));
    for chunk in chunks::<SHORTS>(intervals, range.start, n) {
        let x = s.load(chunk);
        let beyond = s.or(s.greater(x, high), s.greater(low, x));
        let mut out = s.signs(s.and(beyond, s.greater(x, zero)));
        while out != 0 {
            visit(chunk[out.trailing_zeros() as usize % SHORTS]);
            out &= out - 1;
        }
    }
}

/// Fences of a pixel: two for short and long intervals, and those at whole readouts.
pub(super) const FENCES: usize = 2 + CUMULATIVE;

/// The fences of a pixel in 16 bits: no interval lies beyond one that is greater.
#[inline(always)]
pub(super) fn fences(pixel: &Pixel) -> [i16; FENCES] {
    pixel.fences().map(|length| length.clamp(0, i64::from(i16::MAX)) as i16)
}

/// How many intervals that end at entries `from..end` lie beyond each fence. Zeros follow them.
#[inline(always)]
pub(super) fn above<S: Shorts>(
    s: S,
    intervals: &[i16],
    from: usize,
    end: usize,
    fences: [i16; FENCES],
) -> [u32; FENCES] {
    let beyond = splat(s, fences);
    let mut above = [s.none(); FENCES];
    for x in chunks(intervals, from, (end - from).next_multiple_of(SHORTS)) {
        let x = s.load(x);
        for (count, fence) in above.iter_mut().zip(beyond) {
            *count = s.count_greater(*count, x, fence);
        }
    }
    s.counted(above)
}

#[inline(always)]
fn splat<S: Shorts>(s: S, fences: [i16; FENCES]) -> [S::Short; FENCES] {
    let mut all = [s.splat(0); FENCES];
    for (vector, fence) in all.iter_mut().zip(fences) {
        *vector = s.splat(fence);
    }
    all
}

/// Adds products of successive intervals, extremes, and the counts at the
/// pixel's fences, for the intervals that end at entries `from..end`. Zeros
/// follow them: they lie beyond no fence and add nothing to a product.
#[inline(always)]
pub(super) fn add_intervals<S: Shorts>(
    s: S,
    intervals: &[i16],
    from: usize,
    end: usize,
    pixel: &mut Pixel,
) -> Found {
    let fences = fences(pixel);
    let beyond = splat(s, fences);
    let mut above = [s.none(); FENCES];
    // Sums of eight go together; six of these stay empty.
    let mut products = [s.zero(); 8];
    let (mut shortest, mut longest) = (s.splat(i16::MAX), s.splat(0));
    let (one, most) = (s.splat(1), s.splat(i16::MAX));
    let n = (end - from).next_multiple_of(SHORTS);
    let before = [1, 2].map(|apart| chunks(intervals, from - apart, n));
    let last = n / SHORTS - 1;
    for (at, x) in chunks(intervals, from, n).iter().enumerate() {
        let x = s.load(x);
        for (sum, before) in products.iter_mut().zip(before) {
            *sum = s.add_products(*sum, x, s.load(&before[at]));
        }
        longest = s.max(longest, x);
        if at < last {
            shortest = s.min(shortest, x);
        } else {
            // The zeros behind the last count as the greatest.
            shortest = s.min(shortest, s.or(x, s.and(s.greater(one, x), most)));
        }
        for (count, fence) in above.iter_mut().zip(beyond) {
            *count = s.count_greater(*count, x, fence);
        }
    }
    for (sum, product) in pixel.products.iter_mut().zip(s.totals(products)) {
        *sum += product as u64;
    }
    let above = s.counted(above);
    let n = (end - from) as u32;
    let found = Found {
        shortest: s.least(shortest) as u32,
        // The least of what lacks to the greatest.
        longest: (i16::MAX - s.least(s.sub(most, longest))) as u32,
        within: std::array::from_fn(|j| n - above[2 + j]),
        fences,
        above,
    };
    pixel.shortest = pixel.shortest.min(found.shortest);
    pixel.longest = pixel.longest.max(found.longest);
    pixel.add_above(n, above);
    found
}
