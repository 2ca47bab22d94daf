//! Structure of per-pixel maps: lines, neighbors, and the high-pass residual. Maps are row-major, `width` is the number
//! of entries per row, and NaN marks a missing value.

mod high_pass;
mod neighbors;

use std::ops::Range;

pub use high_pass::high_pass;
use high_pass::{BOX_RADIUS, FiniteSum};
pub use neighbors::pattern_correlations;

use super::estimate::{Estimate, median, median_and_spread};
use spikelane::unstable::kernels::dispatch;

/// Returns the finite entries in the square box around pixel `p`. The box extends `radius` pixels to each side.
fn neighborhood(map: &[f64], width: usize, p: usize, radius: usize) -> impl Iterator<Item = f64> + '_ {
    let (row, col) = (p / width, p % width);
    let rows = row.saturating_sub(radius)..(row + radius + 1).min(map.len() / width);
    let cols = col.saturating_sub(radius)..(col + radius + 1).min(width);
    rows.flat_map(move |r| map[r * width + cols.start..r * width + cols.end].iter().copied())
        .filter(|x| x.is_finite())
}

/// Returns the sum of the products of two rows. The sum uses eight accumulators in turn, because additions to a single
/// accumulator wait for each other.
#[inline(always)]
fn sum_products(a: &[f64], b: &[f64]) -> FiniteSum {
    // The rows can differ in length.
    let both = a.len().min(b.len());
    let ((eights, rest), (others, other_rest)) = (a[..both].as_chunks::<8>(), b[..both].as_chunks::<8>());
    let (mut sums, mut counts) = ([0.0; 8], [0.0; 8]);
    for (a, b) in eights.iter().zip(others) {
        for i in 0..8 {
            let entry = FiniteSum::from_entry(a[i] * b[i]);
            sums[i] += entry.sum;
            counts[i] += entry.count;
        }
    }
    for (i, (a, b)) in rest.iter().zip(other_rest).enumerate() {
        let entry = FiniteSum::from_entry(a * b);
        sums[i] += entry.sum;
        counts[i] += entry.count;
    }
    let mut all = FiniteSum::default();
    sums.into_iter().zip(counts).for_each(|(sum, count)| all.add(FiniteSum { sum, count }));
    all
}

/// Returns the mean of the finite entries of each row and of each column of a map.
pub(super) fn line_means(map: &[f64], width: usize) -> [Vec<f64>; 2] {
    let mut columns = vec![FiniteSum::default(); width];
    let mut row_mean = |row: &[f64]| {
        let mut row_sum = FiniteSum::default();
        for (column, x) in columns.iter_mut().zip(row) {
            row_sum.add(FiniteSum::from_entry(*x));
            column.add(FiniteSum::from_entry(*x));
        }
        row_sum.mean()
    };
    let rows = map.chunks_exact(width).map(&mut row_mean).collect();
    [rows, columns.into_iter().map(FiniteSum::mean).collect()]
}

/// Returns the difference of each pixel from the median of the 5x5 box around the pixel.
///
/// Unlike a mean, a median is hardly affected by one hot pixel, so the residuals of its neighbors stay small.
pub(super) fn local_median_residual(map: &[f64], width: usize) -> Vec<f64> {
    let mut near = Vec::with_capacity(25);
    let mut difference = |p: usize| {
        near.clear();
        near.extend(neighborhood(map, width, p, 2));
        map[p] - median(&mut near)
    };
    (0..map.len()).map(&mut difference).collect()
}

/// Returns the third smallest and the third largest finite entry of the 5x5 box around pixel `p`, without the pixel. A
/// value is NaN if the box has fewer than three other entries.
pub(super) fn local_range(map: &[f64], width: usize, p: usize) -> [f64; 2] {
    let mut near: Vec<f64> = neighborhood(map, width, p, 2).collect();
    if let Some(i) = near.iter().position(|x| *x == map[p]) {
        near.swap_remove(i);
    }
    near.sort_by(f64::total_cmp);
    [near.get(2), near.iter().rev().nth(2)].map(|x| x.copied().unwrap_or(f64::NAN))
}

/// Returns the pixels in uniform areas.
///
/// For each selected pixel, the square box around the pixel meets two conditions. The box extends `radius` pixels to
/// each side.
/// * The median of the box is in `range`.
/// * The robust standard deviation of the box is at most `tolerance` times this median.
///
/// The value of the pixel itself has almost no influence. Selected pixels are therefore not biased toward low or high
/// noise.
#[must_use]
pub fn select_uniform(
    map: &[f64],
    width: usize,
    range: &Range<f64>,
    radius: usize,
    tolerance: f64,
) -> Vec<usize> {
    let mut near = Vec::new();
    let mut even = |p: &usize| {
        near.clear();
        near.extend(neighborhood(map, width, *p, radius));
        let (center, spread) = median_and_spread(&mut near);
        range.contains(&center) && spread <= tolerance * center
    };
    (0..map.len()).filter(|p| even(p)).collect()
}

/// Returns, for each pixel, the mean of the finite entries in the square box around the pixel. The box extends `radius`
/// pixels to each side. The mean is NaN if the box has no finite entry.
///
/// # Examples
/// ```
/// // A row of three pixels. A box with radius 1 includes the neighbors.
/// assert_eq!(spikelane_measure::box_means(&[0.0, 3.0, 6.0], 3, 1), [1.5, 3.0, 4.5]);
/// ```
#[must_use]
pub fn box_means(map: &[f64], width: usize, radius: usize) -> Vec<f64> {
    let mean = |p: usize| {
        let (sum, n) = neighborhood(map, width, p, radius).fold((0.0, 0.0), |(s, n), x| (s + x, n + 1.0));
        sum / n
    };
    (0..map.len()).map(mean).collect()
}

/// Means of the rows and of the columns of a map, and the standard deviations of these means.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct LineStructure {
    /// Mean of each row.
    pub rows: Vec<f64>,
    /// Mean of each column.
    pub columns: Vec<f64>,
    /// Standard deviation of the row offsets, in the unit of the map.
    ///
    /// The contribution of pixel noise is subtracted from the variance of the row means. If the difference is negative,
    /// the standard deviation is 0.
    pub row_sd: Estimate,
    /// Standard deviation of the column offsets, computed in the same way as [`Self::row_sd`].
    pub column_sd: Estimate,
}

/// Returns the row and column means of a map and the standard deviations of the row and column patterns.
///
/// Smooth gradients are not part of a pattern. The row means and the column means are therefore high-pass filtered (box
/// of five lines, scaled as in [`high_pass()`]). The variance of a pattern is `var(means) - v/L`. `means` are the
/// filtered means, `v` is the pixel variance of the high-passed map, and `L` is the number of pixels in a line.
///
/// For `n` lines, the standard error of the variance of a pattern is `sqrt(2.9/n) var(means)`. The factor is 2.9
/// instead of 2 because the high-pass correlates adjacent lines. To get the standard error of the standard deviation
/// `sd`, this error is divided by `2 sd`.
#[must_use]
pub fn line_structure(map: &[f64], width: usize) -> LineStructure {
    let (height, [rows, columns]) = (map.len() / width, line_means(map, width));
    let pixel_sd = median_and_spread(&mut super::finite_values(&high_pass(map, width))).1;
    LineStructure {
        row_sd: line_pattern(&rows, pixel_sd, width),
        column_sd: line_pattern(&columns, pixel_sd, height),
        rows,
        columns,
    }
}

/// Variance of the means of lines (rows or columns).
#[derive(Clone, Copy, Debug)]
pub(super) struct LineExcess {
    /// Variance of the high-passed means.
    pub variance: f64,
    /// `variance` minus the contribution of pixel noise. It can be negative by chance.
    pub excess: f64,
    /// Number of lines.
    pub lines: usize,
}

/// Returns `var(means) - v / L` for lines of `length` pixels.
pub(super) fn line_excess(means: &[f64], pixel_sd: f64, length: usize) -> LineExcess {
    // The means are filtered as a map of one row. The box is then a line of five entries.
    let rough = high_pass_line(means);
    let variance = rough.iter().map(|x| x * x).sum::<f64>() / rough.len() as f64;
    LineExcess { variance, excess: variance - pixel_sd * pixel_sd / length as f64, lines: rough.len() }
}

impl LineExcess {
    /// Returns the standard error of the variance between sensors.
    ///
    /// For `n` independent means, the standard error is `sqrt(2 / n)` times the variance. The high-pass correlates
    /// adjacent lines, and the sum of their squared autocorrelations is 1.45. The standard error is therefore
    /// `sqrt(2 * 1.45 / n)` times the variance.
    pub(super) fn error(self) -> f64 {
        self.variance * (2.0 * 1.45 / self.lines as f64).sqrt()
    }
}

/// Returns the standard deviation of the row or column pattern. `means` are the means of lines of `length` pixels.
fn line_pattern(means: &[f64], pixel_sd: f64, length: usize) -> Estimate {
    let line = line_excess(means, pixel_sd, length);
    let value = line.excess.max(0.0).sqrt();
    Estimate {
        value,
        error: if value > 0.0 { line.error() / (2.0 * value) } else { f64::NAN },
        samples: line.lines,
    }
}

fn high_pass_line(means: &[f64]) -> Vec<f64> {
    super::finite_values(&high_pass(means, means.len().max(1)))
}

/// Correlations of a map with the same map shifted by one pixel.
#[derive(Clone, Copy, Debug, serde::Serialize)]
#[non_exhaustive]
pub struct Correlations {
    /// Correlation with the right neighbor.
    pub right: Estimate,
    /// Correlation with the lower neighbor.
    pub lower: Estimate,
    /// Correlation with the lower right neighbor.
    pub diagonal: Estimate,
    /// Correlation with the lower left neighbor.
    pub antidiagonal: Estimate,
}

/// Returns the correlations of neighbors in a map.
///
/// A correlation is the mean product of the deviations of two neighbors from the overall mean, divided by the overall
/// variance. Its standard error `1 / sqrt(pairs)` applies to white noise, so use it to test the correlation against 0.
/// In a [`high_pass()`] map of white noise the correlation is about -0.05. [`pattern_correlations`] corrects this bias.
#[must_use]
pub fn map_correlations(map: &[f64], width: usize) -> Correlations {
    dispatch(
        #[inline(always)]
        || correlations(map, width),
    )
}

#[inline(always)]
fn correlations(map: &[f64], width: usize) -> Correlations {
    let all = Estimate::mean(map.iter().copied());
    let variance = all.error * all.error * all.samples as f64;
    let away: Vec<f64> = map.iter().map(|x| x - all.value).collect();
    let mut correlations = [all; 4];
    for (correlation, (down, right)) in correlations.iter_mut().zip([(0, 1), (1, 0), (1, 1), (1, -1_isize)]) {
        let (mut products, shift) = (FiniteSum::default(), right.unsigned_abs());
        let rows = away.chunks_exact(width);
        for (row, other) in rows.clone().zip(rows.skip(down)) {
            let (row, other) = match right < 0 {
                true => (row.get(shift..).unwrap_or_default(), other),
                false => (row, other.get(shift..).unwrap_or_default()),
            };
            products.add(sum_products(row, other));
        }
        *correlation = Estimate {
            value: products.mean() / variance,
            error: 1.0 / products.count.sqrt(),
            samples: products.count as usize,
        };
    }
    let [right, lower, diagonal, antidiagonal] = correlations;
    Correlations { right, lower, diagonal, antidiagonal }
}
