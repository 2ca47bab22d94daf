//! Adds the new spikes of a pixel whose history is full, with vectors of 16-bit times.
//!
//! A vector contains sixteen intervals, or thirty-two intervals if the CPU supports it. All times of the block and of
//! the history are relative to the start of the block. If the times span at most [`span_limit`] readouts, no sum of
//! squared differences exceeds 32 bits. Proof: the differences of one lag cover each readout at most `lag` times.
//! Therefore the differences sum to at most `lag * span`, and their squares sum to at most `lag * span^2`. Pixels with a
//! longer span, and pixels whose history is not full, are added by the exact path.

use std::ops::Range;

use super::pixel::{CUMULATIVE_FENCES, PixelSums};
use spikelane::unstable::kernels::{I16_LANES, I16Lanes};

/// Returns the largest span of spike times, in readouts, for which the sums of lags up to `max_lag` fit into 32 bits.
pub(super) fn span_limit(max_lag: u32) -> u32 {
    // One readout is subtracted to make the largest sum less than 2^31.
    let sums = ((1_u32 << 31) / max_lag).isqrt() - 1;
    // Times have 16 bits. The limit is below 2^15, because the last word of a block can extend past the end of the
    // block.
    sums.min(32_000)
}

/// Lane masks: entry `n` selects the first `n` lanes of a chunk.
const MASKS: [[i16; I16_LANES]; I16_LANES + 1] = masks();

const fn masks() -> [[i16; I16_LANES]; I16_LANES + 1] {
    let mut table = [[0; I16_LANES]; I16_LANES + 1];
    let mut n = 0;
    while n <= I16_LANES {
        let mut lane = 0;
        while lane < n {
            table[n][lane] = -1;
            lane += 1;
        }
        n += 1;
    }
    table
}

/// Returns the `n` entries that start at index `from`, as chunks of `N` entries. A partial last chunk is omitted.
#[inline(always)]
fn chunks<const N: usize>(values: &[i16], from: usize, n: usize) -> &[[i16; N]] {
    values[from..from + n].as_chunks().0
}

/// Writes all intervals of `times[..end]` to `intervals`. Interval `i` ends at `times[i]`. Zeros up to the end of a
/// vector chunk follow the last interval.
#[inline(always)]
pub(super) fn differences<S: I16Lanes>(s: S, times: &[i16], end: usize, intervals: &mut [i16]) {
    let n = (end - 1).next_multiple_of(I16_LANES);
    let (before, after) = (chunks(times, 0, n), chunks(times, 1, n));
    let out = intervals[1..n + 1].as_chunks_mut().0;
    for ((x, a), b) in out.iter_mut().zip(after).zip(before) {
        s.store(x, s.sub(s.load(a), s.load(b)));
    }
    intervals[end..end + I16_LANES].fill(0);
}

/// Number of lags that are summed in one pass over the times of a pixel. The sums of six lags stay in registers. One pass
/// per lag would need more short loops, and the CPU predicts the ends of short loops badly.
pub(super) const LAGS_PER_PASS: usize = 6;

/// Returns, for each lag, the sum of squared differences between a time in `times[from..end]` and the time `lag` spikes
/// earlier.
#[inline(always)]
pub(super) fn sum_squares<S: I16Lanes>(
    s: S,
    times: &[i16],
    from: usize,
    end: usize,
    lags: [usize; LAGS_PER_PASS],
) -> [u64; LAGS_PER_PASS] {
    let mut sums = [s.zero_sums(); 8];
    let n = (end - from).next_multiple_of(I16_LANES);
    let after = chunks(times, from, n);
    let before = lags.map(|lag| chunks(times, from - lag, n));
    let last = n / I16_LANES - 1;
    for at in 0..last {
        let time = s.load(&after[at]);
        for (sum, before) in sums.iter_mut().zip(before) {
            let d = s.sub(time, s.load(&before[at]));
            *sum = s.add_products(*sum, d, d);
        }
    }
    // Entries after the last spike are not times, so the mask sets their differences to zero.
    let (time, mask) = (s.load(&after[last]), s.load(&MASKS[end - from - I16_LANES * last]));
    for (sum, before) in sums.iter_mut().zip(before) {
        let d = s.and(s.sub(time, s.load(&before[last])), mask);
        *sum = s.add_products(*sum, d, d);
    }
    let totals = s.totals(sums);
    std::array::from_fn(|i| totals[i] as u64)
}

/// Extremes and fence counts of the new intervals of a pixel. The histogram uses them.
pub(super) struct NewIntervals {
    pub(super) shortest: u32,
    pub(super) longest_interval: u32,
    /// Entry `j` is the number of intervals of at most `c - 3 + j` readouts, where `c` is [`PixelSums::center`].
    pub(super) cumulative: [u32; CUMULATIVE_FENCES],
    /// The fences of the pixel. `above_fences[j]` is the number of intervals greater than fence `j`.
    pub(super) fences: [i16; FENCE_COUNT],
    pub(super) above_fences: [u32; FENCE_COUNT],
}

/// Calls `visit` for every interval in `range` that is below `low` or above `high`.
///
/// Zeros after the last interval are skipped. Most chunks contain no interval below `low` or above `high`, and are
/// skipped as a whole.
#[inline(always)]
pub(super) fn for_each_outlier<S: I16Lanes>(
    s: S,
    intervals: &[i16],
    range: Range<usize>,
    low: i16,
    high: i16,
    mut visit: impl FnMut(i16),
) {
    let n = range.len().next_multiple_of(I16_LANES);
    let (low, high, zero) = (s.splat(low), s.splat(high), s.splat(0));
    for chunk in chunks::<I16_LANES>(intervals, range.start, n) {
        let x = s.load(chunk);
        let beyond = s.or(s.greater(x, high), s.greater(low, x));
        let mut out = s.sign_mask(s.and(beyond, s.greater(x, zero)));
        while out != 0 {
            visit(chunk[out.trailing_zeros() as usize % I16_LANES]);
            out &= out - 1;
        }
    }
}

/// Number of fences of a pixel: one for short intervals, one for long intervals, and [`CUMULATIVE_FENCES`] at whole
/// readouts.
pub(super) const FENCE_COUNT: usize = 2 + CUMULATIVE_FENCES;

/// Returns the fences of a pixel, clamped to 16 bits. Clamping changes no count, because intervals are 1 to `i16::MAX`.
#[inline(always)]
pub(super) fn fences(pixel: &PixelSums) -> [i16; FENCE_COUNT] {
    pixel.fences().map(|length| length.clamp(0, i64::from(i16::MAX)) as i16)
}

/// Returns, for each fence, the number of intervals above the fence. Only intervals that end at entries `from..end` of
/// the spike times are counted. Zeros follow the last interval.
#[inline(always)]
pub(super) fn count_above_fences<S: I16Lanes>(
    s: S,
    intervals: &[i16],
    from: usize,
    end: usize,
    fences: [i16; FENCE_COUNT],
) -> [u32; FENCE_COUNT] {
    let beyond = splat(s, fences);
    let mut above = [s.zero_counts(); FENCE_COUNT];
    for x in chunks(intervals, from, (end - from).next_multiple_of(I16_LANES)) {
        let x = s.load(x);
        for (count, fence) in above.iter_mut().zip(beyond) {
            *count = s.count_greater(*count, x, fence);
        }
    }
    s.total_counts(above)
}

#[inline(always)]
fn splat<S: I16Lanes>(s: S, fences: [i16; FENCE_COUNT]) -> [S::Short; FENCE_COUNT] {
    let mut all = [s.splat(0); FENCE_COUNT];
    for (vector, fence) in all.iter_mut().zip(fences) {
        *vector = s.splat(fence);
    }
    all
}

/// Adds to `pixel` the products of successive intervals, the extremes and the fence counts. Only intervals that end at
/// entries `from..end` of the spike times are added.
///
/// Zeros follow the last interval. A zero exceeds no fence, and its products are zero.
#[inline(always)]
pub(super) fn add_intervals<S: I16Lanes>(
    s: S,
    intervals: &[i16],
    from: usize,
    end: usize,
    pixel: &mut PixelSums,
) -> NewIntervals {
    let fences = fences(pixel);
    let beyond = splat(s, fences);
    let mut above = [s.zero_counts(); FENCE_COUNT];
    // `totals` reduces eight sums in one call. Only two of the eight sums are used.
    let mut products = [s.zero_sums(); 8];
    let (mut shortest, mut longest_interval) = (s.splat(i16::MAX), s.splat(0));
    let (one, max_value) = (s.splat(1), s.splat(i16::MAX));
    let n = (end - from).next_multiple_of(I16_LANES);
    let before = [1, 2].map(|lag| chunks(intervals, from - lag, n));
    let last = n / I16_LANES - 1;
    for (at, x) in chunks(intervals, from, n).iter().enumerate() {
        let x = s.load(x);
        for (sum, before) in products.iter_mut().zip(before) {
            *sum = s.add_products(*sum, x, s.load(&before[at]));
        }
        longest_interval = s.max(longest_interval, x);
        if at < last {
            shortest = s.min(shortest, x);
        } else {
            // The zeros after the last interval are replaced by the largest value, because they must not become the minimum.
            shortest = s.min(shortest, s.or(x, s.and(s.greater(one, x), max_value)));
        }
        for (count, fence) in above.iter_mut().zip(beyond) {
            *count = s.count_greater(*count, x, fence);
        }
    }
    for (sum, product) in pixel.lag_products.iter_mut().zip(s.totals(products)) {
        *sum += product as u64;
    }
    let above = s.total_counts(above);
    let n = (end - from) as u32;
    let new_intervals = NewIntervals {
        shortest: s.min_non_negative(shortest) as u32,
        // longest = MAX - min(MAX - x), because the CPU finds only a minimum across the lanes of a vector.
        longest_interval: (i16::MAX - s.min_non_negative(s.sub(max_value, longest_interval))) as u32,
        cumulative: std::array::from_fn(|j| n - above[2 + j]),
        fences,
        above_fences: above,
    };
    pixel.shortest = pixel.shortest.min(new_intervals.shortest);
    pixel.longest_interval = pixel.longest_interval.max(new_intervals.longest_interval);
    pixel.add_above(n, above);
    new_intervals
}
