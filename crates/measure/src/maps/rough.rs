//! A map without its smooth part.

use spikelane::unstable::kernels::counting;

/// What is left of a map when the mean of the surrounding 5x5 box is taken
/// off, scaled by `sqrt(n / (n - 1))` for the `n` pixels of the box, so that
/// white noise keeps its variance: the high-pass of EMVA 1288, release 4, with
/// its factor applied per pixel, so that the borders keep theirs too.
#[must_use]
pub fn high_pass(map: &[f64], width: usize) -> Vec<f64> {
    counting(
        #[inline(always)]
        || high_passed(map, width),
    )
}

#[inline(always)]
fn high_passed(map: &[f64], width: usize) -> Vec<f64> {
    let all = map.len() / width * width;
    let mut left = vec![f64::NAN; all];
    let (mut sums, mut counts) = (vec![0.0; all], vec![0.0; all]);
    let rows = sums.chunks_exact_mut(width).zip(counts.chunks_exact_mut(width));
    for (row, (sums, counts)) in map.chunks_exact(width).zip(rows) {
        along(row, sums, counts);
    }
    let (mut sum, mut count) = (vec![0.0; width], vec![0.0; width]);
    for (r, (row, left)) in map.chunks_exact(width).zip(left.chunks_exact_mut(width)).enumerate() {
        sum.fill(0.0);
        count.fill(0.0);
        let near = r.saturating_sub(BOX) * width..((r + BOX + 1) * width).min(all);
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

/// Pixels on either side of the high-pass's own.
pub(super) const BOX: usize = 2;

/// Sums and counts of what lies within `BOX` of each place of a row.
#[inline(always)]
fn along(row: &[f64], sums: &mut [f64], counts: &mut [f64]) {
    for by in 0..=2 * BOX {
        let (into, from) = (BOX.saturating_sub(by), by.saturating_sub(BOX));
        let from = row.get(from..).unwrap_or_default();
        let places = sums.iter_mut().zip(counts.iter_mut()).skip(into);
        for ((sum, count), x) in places.zip(from) {
            let of = Sum::of(*x);
            *sum += of.sum;
            *count += of.count;
        }
    }
}

/// Of the finite entries among some.
#[derive(Clone, Copy, Default)]
pub(super) struct Sum {
    pub(super) sum: f64,
    pub(super) count: f64,
}

impl Sum {
    /// Of one entry. Without a branch, so that loops over rows run in lanes.
    #[inline(always)]
    pub(super) fn of(x: f64) -> Self {
        let known = x.is_finite();
        Self { sum: if known { x } else { 0.0 }, count: f64::from(u8::from(known)) }
    }

    #[inline(always)]
    pub(super) fn add(&mut self, other: Self) {
        self.sum += other.sum;
        self.count += other.count;
    }

    /// NaN of none.
    pub(super) fn mean(self) -> f64 {
        self.sum / self.count
    }
}
