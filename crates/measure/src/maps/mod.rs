//! Structure of per-pixel maps: lines, neighbours, what is left after the
//! smooth part. Maps are row-major with rows of `width`; NaN is no value.

mod neighbours;
mod rough;

use std::ops::Range;

pub use neighbours::pattern_correlations;
pub use rough::high_pass;
use rough::{BOX, Sum};

use super::estimate::{Estimate, median, median_and_spread};
use spikelane::unstable::kernels::counting;

/// The entries of the box of `radius` around pixel `p` that lie on the map.
fn neighbourhood(map: &[f64], width: usize, p: usize, radius: usize) -> impl Iterator<Item = f64> + '_ {
    let (row, col) = (p / width, p % width);
    let rows = row.saturating_sub(radius)..(row + radius + 1).min(map.len() / width);
    let cols = col.saturating_sub(radius)..(col + radius + 1).min(width);
    rows.flat_map(move |r| map[r * width + cols.start..r * width + cols.end].iter().copied())
        .filter(|x| x.is_finite())
}

/// The sum of products of two rows, in eight sums that take turns: one alone waits for each addition.
#[inline(always)]
fn of_products(a: &[f64], b: &[f64]) -> Sum {
    // One row may end before the other.
    let both = a.len().min(b.len());
    let ((eights, rest), (others, other_rest)) = (a[..both].as_chunks::<8>(), b[..both].as_chunks::<8>());
    let (mut sums, mut counts) = ([0.0; 8], [0.0; 8]);
    for (a, b) in eights.iter().zip(others) {
        for i in 0..8 {
            let of = Sum::of(a[i] * b[i]);
            sums[i] += of.sum;
            counts[i] += of.count;
        }
    }
    for (i, (a, b)) in rest.iter().zip(other_rest).enumerate() {
        let of = Sum::of(a * b);
        sums[i] += of.sum;
        counts[i] += of.count;
    }
    let mut all = Sum::default();
    sums.into_iter().zip(counts).for_each(|(sum, count)| all.add(Sum { sum, count }));
    all
}

/// Means of the rows and of the columns of a map, over their finite entries.
pub(super) fn line_means(map: &[f64], width: usize) -> [Vec<f64>; 2] {
    let mut columns = vec![Sum::default(); width];
    let mut row_mean = |row: &[f64]| {
        let mut own = Sum::default();
        for (column, x) in columns.iter_mut().zip(row) {
            own.add(Sum::of(*x));
            column.add(Sum::of(*x));
        }
        own.mean()
    };
    let rows = map.chunks_exact(width).map(&mut row_mean).collect();
    [rows, columns.into_iter().map(Sum::mean).collect()]
}

/// The difference of each pixel from the median of its 5x5 box: unlike the
/// mean, it does not spread a hot pixel over its neighbours.
pub(super) fn from_local_median(map: &[f64], width: usize) -> Vec<f64> {
    let mut near = Vec::with_capacity(25);
    let mut difference = |p: usize| {
        near.clear();
        near.extend(neighbourhood(map, width, p, 2));
        map[p] - median(&mut near)
    };
    (0..map.len()).map(&mut difference).collect()
}

/// Pixels whose value lies in `range` (its end excluded), in order.
#[must_use]
pub fn select_rate(map: &[f64], range: &Range<f64>) -> Vec<usize> {
    let inside = map.iter().enumerate().filter(|(_, x)| range.contains(*x));
    inside.map(|(p, _)| p).collect()
}

/// Pixels in an even area: the median of the box of `radius` around the pixel
/// lies in `range`, and the box's robust spread is at most `tolerance` of it.
/// The pixel's own value decides nothing, so that noise is not selected by.
#[must_use]
pub fn select_smooth(
    map: &[f64],
    width: usize,
    range: &Range<f64>,
    radius: usize,
    tolerance: f64,
) -> Vec<usize> {
    let mut near = Vec::new();
    let mut even = |p: &usize| {
        near.clear();
        near.extend(neighbourhood(map, width, *p, radius));
        let (centre, spread) = median_and_spread(&mut near);
        range.contains(&centre) && spread <= tolerance * centre
    };
    (0..map.len()).filter(|p| even(p)).collect()
}

/// The mean of the box of `radius` around each pixel; NaN where nothing is finite.
#[must_use]
pub fn box_means(map: &[f64], width: usize, radius: usize) -> Vec<f64> {
    let mean = |p: usize| {
        let (sum, n) = neighbourhood(map, width, p, radius).fold((0.0, 0.0), |(s, n), x| (s + x, n + 1.0));
        sum / n
    };
    (0..map.len()).map(mean).collect()
}

/// Means of the rows and columns of a map, and how much they vary.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct LineStructure {
    /// Mean of each row.
    pub rows: Vec<f64>,
    /// Mean of each column.
    pub columns: Vec<f64>,
    /// Standard deviation of row offsets, in the unit of the map, with the
    /// pixel noise of a mean taken out; 0 when there is nothing above it.
    pub row_sd: Estimate,
    /// The same for columns.
    pub column_sd: Estimate,
}

/// Row and column means of a map, and the standard deviations of the row and
/// column patterns.
///
/// Smooth gradients are no pattern: the means are high-passed along the line
/// (box of 5, scaled as in [`high_pass`]), and `variance = var(means) - v/L` with
/// `v` the pixel variance of the high-passed map and `L` the length of a line.
/// Standard error of a variance `sqrt(2.9/n)` of `var(means)`, as the high-pass ties
/// neighbouring lines, halved and divided by the value for the standard deviation.
#[must_use]
pub fn line_structure(map: &[f64], width: usize) -> LineStructure {
    let (height, [rows, columns]) = (map.len() / width, line_means(map, width));
    let pixel_sd = median_and_spread(&mut super::finite(&high_pass(map, width))).1;
    LineStructure {
        row_sd: pattern(&rows, pixel_sd, width),
        column_sd: pattern(&columns, pixel_sd, height),
        rows,
        columns,
    }
}

/// What varies in the means of lines.
#[derive(Clone, Copy, Debug)]
pub(super) struct LineExcess {
    /// Variance of the high-passed means.
    pub variance: f64,
    /// The same without what the pixels' own noise makes; negative by chance.
    pub excess: f64,
    /// Lines.
    pub lines: usize,
}

/// `var(means) - v / L` of lines of `length` pixels.
pub(super) fn line_excess(means: &[f64], pixel_sd: f64, length: usize) -> LineExcess {
    // A map one row high: its box is the line of five.
    let rough = high_pass_line(means);
    let variance = rough.iter().map(|x| x * x).sum::<f64>() / rough.len() as f64;
    LineExcess { variance, excess: variance - pixel_sd * pixel_sd / length as f64, lines: rough.len() }
}

impl LineExcess {
    /// Standard error of the variance between sensors. Of `n` independent means it would be `sqrt(2 / n)` of it; the high-pass
    /// ties neighbours, and the sum of its squared autocorrelations is 1.45.
    pub(super) fn error(self) -> f64 {
        self.variance * (2.0 * 1.45 / self.lines as f64).sqrt()
    }
}

/// Standard deviation of the pattern in the means of lines of `length` pixels.
fn pattern(means: &[f64], pixel_sd: f64, length: usize) -> Estimate {
    let found = line_excess(means, pixel_sd, length);
    let value = found.excess.max(0.0).sqrt();
    Estimate {
        value,
        error: if value > 0.0 { found.error() / (2.0 * value) } else { f64::NAN },
        samples: found.lines,
    }
}

fn high_pass_line(means: &[f64]) -> Vec<f64> {
    super::finite(&high_pass(means, means.len().max(1)))
}

/// Correlations of a map with itself, shifted by one pixel.
#[derive(Clone, Copy, Debug, serde::Serialize)]
#[non_exhaustive]
pub struct Correlations {
    /// With the right neighbour.
    pub right: Estimate,
    /// With the lower neighbour.
    pub lower: Estimate,
    /// With the lower right neighbour.
    pub diagonal: Estimate,
    /// With the lower left neighbour.
    pub antidiagonal: Estimate,
}

/// Correlations of neighbours in a map: mean product of deviations from the
/// mean of all, over the variance of all. Standard error `1 / sqrt(pairs)`, that of
/// white noise (so it tests against 0). A [`high_pass`] map of white noise has about -1/24: see [`pattern_correlations`].
#[must_use]
pub fn map_correlations(map: &[f64], width: usize) -> Correlations {
    counting(
        #[inline(always)]
        || correlations(map, width),
    )
}

#[inline(always)]
fn correlations(map: &[f64], width: usize) -> Correlations {
    let all = Estimate::mean(map.iter().copied());
    let variance = all.error * all.error * all.samples as f64;
    let away: Vec<f64> = map.iter().map(|x| x - all.value).collect();
    let mut found = [all; 4];
    for (found, (down, right)) in found.iter_mut().zip([(0, 1), (1, 0), (1, 1), (1, -1_isize)]) {
        let (mut products, shift) = (Sum::default(), right.unsigned_abs());
        let rows = away.chunks_exact(width);
        for (row, other) in rows.clone().zip(rows.skip(down)) {
            let (row, other) = match right < 0 {
                true => (row.get(shift..).unwrap_or_default(), other),
                false => (row, other.get(shift..).unwrap_or_default()),
            };
            products.add(of_products(row, other));
        }
        *found = Estimate {
            value: products.mean() / variance,
            error: 1.0 / products.count.sqrt(),
            samples: products.count as usize,
        };
    }
    let [right, lower, diagonal, antidiagonal] = found;
    Correlations { right, lower, diagonal, antidiagonal }
}
