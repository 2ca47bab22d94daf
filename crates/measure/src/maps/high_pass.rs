//! The high-pass filter of a map.

use spikelane::unstable::kernels::dispatch;

/// Subtracts from each pixel the mean of the 5x5 box around the pixel.
///
/// The difference between a pixel and the mean of its box is multiplied by `sqrt(n / (n - 1))`, where `n` is the number
/// of finite pixels in the box. White noise therefore keeps its variance. This is the high-pass of EMVA 1288, release
/// 4. This function computes the factor for each pixel, so the variance is also preserved at the borders.
#[must_use]
pub fn high_pass(map: &[f64], width: usize) -> Vec<f64> {
    dispatch(
        #[inline(always)]
        || high_pass_rows(map, width),
    )
}

#[inline(always)]
fn high_pass_rows(map: &[f64], width: usize) -> Vec<f64> {
    let all = map.len() / width * width;
    let mut left = vec![f64::NAN; all];
    let (mut sums, mut counts) = (vec![0.0; all], vec![0.0; all]);
    let rows = sums.chunks_exact_mut(width).zip(counts.chunks_exact_mut(width));
    for (row, (sums, counts)) in map.chunks_exact(width).zip(rows) {
        box_sums(row, sums, counts);
    }
    let (mut sum, mut count) = (vec![0.0; width], vec![0.0; width]);
    for (r, (row, left)) in map.chunks_exact(width).zip(left.chunks_exact_mut(width)).enumerate() {
        sum.fill(0.0);
        count.fill(0.0);
        let near = r.saturating_sub(BOX_RADIUS) * width..((r + BOX_RADIUS + 1) * width).min(all);
        let others = sums[near.clone()].chunks_exact(width).zip(counts[near].chunks_exact(width));
        for (sums, counts) in others {
            add_each(&mut sum, sums);
            add_each(&mut count, counts);
        }
        for (((left, x), sum), count) in left.iter_mut().zip(row).zip(&sum).zip(&count) {
            let scale = f64::sqrt(count / (count - 1.0));
            *left = if *count < 2.0 { f64::NAN } else { (x - sum / count) * scale };
        }
    }
    left
}

#[inline(always)]
fn add_each(sums: &mut [f64], more: &[f64]) {
    for (sum, x) in sums.iter_mut().zip(more) {
        *sum += x;
    }
}

/// Number of pixels that the 5x5 box extends to each side of its center.
pub(super) const BOX_RADIUS: usize = 2;

/// Adds, for each position of a row, the sum and the count of the finite entries within [`BOX_RADIUS`] of the position.
#[inline(always)]
fn box_sums(row: &[f64], sums: &mut [f64], counts: &mut [f64]) {
    for by in 0..=2 * BOX_RADIUS {
        let (into, from) = (BOX_RADIUS.saturating_sub(by), by.saturating_sub(BOX_RADIUS));
        let from = row.get(from..).unwrap_or_default();
        let places = sums.iter_mut().zip(counts.iter_mut()).skip(into);
        for ((sum, count), x) in places.zip(from) {
            let entry = FiniteSum::from_entry(*x);
            *sum += entry.sum;
            *count += entry.count;
        }
    }
}

/// Sum and count of finite entries.
#[derive(Clone, Copy, Default)]
pub(super) struct FiniteSum {
    pub(super) sum: f64,
    pub(super) count: f64,
}

impl FiniteSum {
    /// Returns the sum and the count of one entry, which are 0 if the entry is not finite. The function has no branch,
    /// so the compiler vectorizes loops over rows.
    #[inline(always)]
    pub(super) fn from_entry(x: f64) -> Self {
        let known = x.is_finite();
        Self { sum: if known { x } else { 0.0 }, count: f64::from(u8::from(known)) }
    }

    #[inline(always)]
    pub(super) fn add(&mut self, other: Self) {
        self.sum += other.sum;
        self.count += other.count;
    }

    /// Returns the mean, or NaN if no finite entry was added.
    pub(super) fn mean(self) -> f64 {
        self.sum / self.count
    }
}
