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
    let left = |p: usize| {
        let (sum, n) = neighbourhood(map, width, p, 2).fold((0.0, 0.0), |(s, n), x| (s + x, n + 1.0));
        if n < 2.0 {
            return f64::NAN;
        }
        (map[p] - sum / n) * f64::sqrt(n / (n - 1.0))
    };
    (0..map.len()).map(left).collect()
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
    let height = map.len() / width;
    let row_mean = |r: usize| Estimate::mean(map[r * width..(r + 1) * width].iter().copied()).value;
    let column_mean = |c: usize| Estimate::mean(map[c..].iter().step_by(width).copied()).value;
    let rows: Vec<f64> = (0..height).map(row_mean).collect();
    let columns: Vec<f64> = (0..width).map(column_mean).collect();
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
    let with = |down: usize, right: isize| {
        let product = |p: usize| {
            let col = (p % width).checked_add_signed(right).filter(|c| *c < width)?;
            let other = map.get((p / width + down) * width + col)?;
            let both = (map[p] - all.value) * (other - all.value);
            both.is_finite().then_some(both)
        };
        let mean = Estimate::mean((0..map.len()).filter_map(product));
        Estimate {
            value: mean.value / variance,
            error: 1.0 / (mean.samples as f64).sqrt(),
            samples: mean.samples,
        }
    };
    Correlations { right: with(0, 1), lower: with(1, 0), diagonal: with(1, 1), antidiagonal: with(1, -1) }
}
