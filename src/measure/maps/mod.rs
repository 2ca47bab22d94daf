//! Structure of per-pixel maps: lines, neighbours, what is left after the
//! smooth part. Maps are row-major with rows of `width`; NaN is no value.

mod neighbours;

use std::ops::Range;

pub use neighbours::pattern_correlations;

use super::estimate::{Estimate, median, median_and_spread};

/// The entries of the box of `radius` around pixel `p` that lie on the map.
fn neighbourhood(map: &[f64], width: usize, p: usize, radius: usize) -> impl Iterator<Item = f64> + '_ {
    let (row, col) = (p / width, p % width);
    let rows = row.saturating_sub(radius)..(row + radius + 1).min(map.len() / width);
    let cols = col.saturating_sub(radius)..(col + radius + 1).min(width);
    rows.flat_map(move |r| map[r * width + cols.start..r * width + cols.end].iter().copied())
        .filter(|x| x.is_finite())
}

/// What is left of a map when the mean of the surrounding 5x5 box is taken
/// off, scaled by `sqrt(n / (n - 1))` for the `n` pixels of the box, so that
/// white noise keeps its variance: the high-pass of EMVA 1288, release 4, with
/// its factor applied per pixel, so that the borders keep theirs too.
#[must_use]
pub fn high_pass(map: &[f64], width: usize) -> Vec<f64> {
    let mut left = Vec::with_capacity(map.len());
    let rows: Vec<Vec<Sum>> = map.chunks_exact(width).map(|row| along(row, BOX)).collect();
    let mut near = vec![Sum::default(); width];
    for (r, row) in map.chunks_exact(width).enumerate() {
        near.fill(Sum::default());
        for other in &rows[r.saturating_sub(BOX)..(r + BOX + 1).min(rows.len())] {
            near.iter_mut().zip(other).for_each(|(sum, of)| sum.add(*of));
        }
        let of_pixel = |(x, near): (&f64, &Sum)| match near.count < 2.0 {
            true => f64::NAN,
            false => (x - near.mean()) * f64::sqrt(near.count / (near.count - 1.0)),
        };
        left.extend(row.iter().zip(&near).map(of_pixel));
    }
    left
}

/// Pixels on either side of the high-pass's own.
const BOX: usize = 2;

/// Of the finite entries among some.
#[derive(Clone, Copy, Default)]
struct Sum {
    sum: f64,
    count: f64,
}

impl Sum {
    /// Of one entry. Without a branch, so that loops over rows run in lanes.
    fn of(x: f64) -> Self {
        let known = x.is_finite();
        Self { sum: if known { x } else { 0.0 }, count: f64::from(u8::from(known)) }
    }

    fn add(&mut self, other: Self) {
        self.sum += other.sum;
        self.count += other.count;
    }

    /// NaN of none.
    fn mean(self) -> f64 {
        self.sum / self.count
    }
}

/// The sum of products of two rows, in eight sums that take turns: one alone waits for each addition.
fn of_products(a: &[f64], b: &[f64]) -> Sum {
    let mut sums = [Sum::default(); 8];
    for (a, b) in a.chunks(8).zip(b.chunks(8)) {
        sums.iter_mut().zip(a).zip(b).for_each(|((sum, a), b)| sum.add(Sum::of(a * b)));
    }
    let mut all = Sum::default();
    sums.into_iter().for_each(|sum| all.add(sum));
    all
}

/// What lies within `radius` of each place of a row.
fn along(row: &[f64], radius: usize) -> Vec<Sum> {
    let mut sums = vec![Sum::default(); row.len()];
    for by in 0..=2 * radius {
        let (into, from) = (radius.saturating_sub(by), by.saturating_sub(radius));
        let from = row.get(from..).unwrap_or_default();
        sums.iter_mut().skip(into).zip(from).for_each(|(sum, x)| sum.add(Sum::of(*x)));
    }
    sums
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
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "files", derive(serde::Serialize))]
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
    let all = Estimate::mean(map.iter().copied());
    let variance = all.error * all.error * all.samples as f64;
    let away: Vec<f64> = map.iter().map(|x| x - all.value).collect();
    let with = |down: usize, right: isize| {
        let (mut products, shift) = (Sum::default(), right.unsigned_abs());
        let rows = away.chunks_exact(width);
        for (row, other) in rows.clone().zip(rows.skip(down)) {
            let (row, other) = match right < 0 {
                true => (row.get(shift..).unwrap_or_default(), other),
                false => (row, other.get(shift..).unwrap_or_default()),
            };
            products.add(of_products(row, other));
        }
        Estimate {
            value: products.mean() / variance,
            error: 1.0 / products.count.sqrt(),
            samples: products.count as usize,
        }
    };
    Correlations { right: with(0, 1), lower: with(1, 0), diagonal: with(1, 1), antidiagonal: with(1, -1) }
}
