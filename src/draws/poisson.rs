//! Poisson counts of small means from 32 random bits, by table lookup.
//!
//! Each mean on a grid has an alias table of 128 columns, so a draw takes one lookup and one comparison. The square
//! roots of the grid's means are equally spaced. For a mean between two grid points, each draw randomly selects the
//! table of one of these points.
//!
//! For a mean between two grid points, the mixture of two Poisson distributions is slightly too wide. With
//! [`POINTS_PER_ROOT`] grid points per unit of the square root of the mean, the total variation distance between the
//! mixture and the Poisson distribution is at most `0.5 / POINTS_PER_ROOT^2 = 1.2e-4`:
//! * For each count, the error of the mixture is at most `step^2 / 8` times the second derivative of the Poisson
//!   probability with respect to the mean. `step = 2 sqrt(mean) / POINTS_PER_ROOT` is the distance between two grid
//!   points.
//! * The second derivative with respect to the mean equals the second difference with respect to the count. Half the
//!   sum of the absolute second differences is `0.97 / mean` for large means and at most 2 for small means.
//!
//! A search in the cumulative distribution would be exact, but one draw would take up to a hundred comparisons.

/// Smallest mean for which a normal value replaces the Poisson count.
pub const MAX_MEAN: f32 = 64.0;

/// Grid points per unit of the square root of the mean.
pub const POINTS_PER_ROOT: f32 = 64.0;

/// Number of columns of an alias table: counts 0 to 127.
pub const COLUMNS: usize = 128;

/// Number of grid points, which include mean 0 and [`MAX_MEAN`].
const GRID_POINTS: usize = 513;

/// The alias tables of all grid points, 460 KB.
#[derive(Clone, Debug, PartialEq)]
pub struct PoissonTables {
    /// `threshold << 8 | alias` for each column; [`COLUMNS`] words per grid point.
    pub alias: Vec<u32>,
    /// The alias tables as bytes, for instruction sets that can look up bytes in registers.
    ///
    /// Each grid point has three arrays: all aliases, the low bytes of all thresholds, and the high bytes of all
    /// thresholds.
    pub bytes: Vec<[[u8; COLUMNS]; 3]>,
    /// Mean count of each grid point's alias table, computed from the rounded thresholds.
    pub mean: Vec<f32>,
    /// `512 / (mean[i + 1] - mean[i])`.
    pub inverse_step: Vec<f32>,
    /// `(mean[i + 1] - mean[i]) / 512`.
    pub step: Vec<f32>,
}

/// A mean in the form that [`PoissonTables::draw`] uses.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PreparedMean {
    /// Index of the lower grid point.
    pub point: u32,
    /// Probability of the upper grid point in units of 1/512.
    pub share: u32,
    /// Exact mean of the draws.
    pub mean: f32,
}

impl Default for PoissonTables {
    fn default() -> Self {
        Self::new()
    }
}

impl PoissonTables {
    /// Builds the tables.
    #[must_use]
    pub fn new() -> Self {
        let mut alias = Vec::with_capacity(GRID_POINTS * COLUMNS);
        let mut mean = Vec::with_capacity(GRID_POINTS);
        for i in 0..GRID_POINTS {
            let root = i as f64 / f64::from(POINTS_PER_ROOT);
            let column = alias_table(&probabilities(root * root));
            mean.push(table_mean(&column) as f32);
            alias.extend(column);
        }
        let bytes = alias.chunks_exact(COLUMNS).map(table_bytes).collect();
        let gaps = || mean.windows(2).map(|m| m[1] - m[0]);
        let inverse_step = gaps().map(|g| 512.0 / g).collect();
        let step = gaps().map(|g| g / 512.0).collect();
        Self { alias, bytes, mean, inverse_step, step }
    }

    /// Returns the grid point, share and exact mean for `mean` in `[0, MAX_MEAN)`.
    #[must_use]
    pub fn prepare(&self, mean: f32) -> PreparedMean {
        let point = ((mean.sqrt() * POINTS_PER_ROOT) as u32).min(GRID_POINTS as u32 - 2);
        let i = point as usize;
        let share = ((mean - self.mean[i]) * self.inverse_step[i]).clamp(0.0, 512.0);
        let share = share.round_ties_even();
        PreparedMean { point, share: share as u32, mean: self.mean[i] + share * self.step[i] }
    }

    /// Returns the count for 32 random bits.
    #[must_use]
    pub fn draw(&self, prepared: PreparedMean, bits: u32) -> u32 {
        let upper = u32::from(bits & 511 < prepared.share);
        let column = bits >> 25;
        let entry = self.alias[((prepared.point + upper) * COLUMNS as u32 + column) as usize];
        let is_column = (bits >> 9 & 0xffff) < entry >> 8;
        if is_column { column } else { entry & 0xff }
    }
}

/// Returns the aliases of a table, and the low and high bytes of the thresholds of the table.
///
/// A threshold of 65,536 means that every draw returns the column. This threshold needs a 17th bit, which the byte
/// tables omit. Instead, the byte tables store the column itself as its alias.
fn table_bytes(table: &[u32]) -> [[u8; COLUMNS]; 3] {
    let mut bytes = [[0; COLUMNS]; 3];
    for (column, entry) in table.iter().enumerate() {
        let always = entry >> 8 > 0xffff;
        bytes[0][column] = if always { column as u8 } else { *entry as u8 };
        bytes[1][column] = (entry >> 8) as u8;
        bytes[2][column] = (entry >> 16) as u8;
    }
    bytes
}

/// Returns the Poisson probabilities of the counts 0 to 127, scaled to the sum 1.
fn probabilities(mean: f64) -> [f64; COLUMNS] {
    let mut p = [0.0; COLUMNS];
    p[0] = libm::exp(-mean);
    for k in 1..COLUMNS {
        p[k] = p[k - 1] * mean / k as f64;
    }
    let sum: f64 = p.iter().sum();
    p.map(|v| v / sum)
}

/// Returns an alias table of 16-bit thresholds, built by Walker's method in Vose's form.
fn alias_table(p: &[f64; COLUMNS]) -> Vec<u32> {
    let mut rest = p.map(|v| v * COLUMNS as f64);
    let mut table: Vec<u32> = (0..COLUMNS as u32).map(|k| 0xffff << 8 | k).collect();
    let (mut small, mut large): (Vec<_>, Vec<_>) = (0..COLUMNS).partition(|&k| rest[k] < 1.0);
    while let (Some(s), Some(&l)) = (small.pop(), large.last()) {
        table[s] = ((rest[s] * 65_536.0).round() as u32) << 8 | l as u32;
        rest[l] -= 1.0 - rest[s];
        if rest[l] < 1.0 {
            large.pop();
            small.push(l);
        }
    }
    table
}

fn table_mean(table: &[u32]) -> f64 {
    let parts = table.iter().enumerate().map(|(k, &entry)| {
        let column_share = f64::from(entry >> 8) / 65_536.0;
        column_share * k as f64 + (1.0 - column_share) * f64::from(entry & 0xff)
    });
    parts.sum::<f64>() / COLUMNS as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the exact distribution of `draw` for a prepared mean.
    fn distribution(tables: &PoissonTables, prepared: PreparedMean) -> Vec<f64> {
        let mut p = vec![0.0; COLUMNS];
        let upper = f64::from(prepared.share) / 512.0;
        for (point, weight) in [(prepared.point, 1.0 - upper), (prepared.point + 1, upper)] {
            for column in 0..COLUMNS {
                let entry = tables.alias[point as usize * COLUMNS + column];
                let column_share = f64::from(entry >> 8) / 65_536.0;
                p[column] += weight * column_share / COLUMNS as f64;
                p[(entry & 0xff) as usize] += weight * (1.0 - column_share) / COLUMNS as f64;
            }
        }
        p
    }

    #[test]
    fn the_total_variation_from_poisson_is_below_two_in_ten_thousand() {
        let tables = PoissonTables::new();
        let mut worst = 0.0f64;
        for i in 0..4000 {
            // The means are spread through the whole range, including values between grid points. Small means are
            // denser.
            let mean = 64.0 * (f64::from(i) + 0.37).powi(2) / 4000.0f64.powi(2);
            let prepared = tables.prepare(mean as f32);
            let actual = distribution(&tables, prepared);
            let truth = probabilities(mean);
            let distance: f64 = actual.iter().zip(&truth).map(|(a, b)| (a - b).abs()).sum();
            worst = worst.max(0.5 * distance);
            let found_mean: f64 = actual.iter().enumerate().map(|(k, p)| k as f64 * p).sum();
            assert!((found_mean - f64::from(prepared.mean)).abs() < 1e-6 * found_mean + 1e-7);
        }
        assert!(worst < 2e-4, "{worst}");
        assert!(worst > 1e-5, "the test would not see a defect: {worst}");
    }

    #[test]
    fn the_bytes_draw_what_the_words_draw() {
        let tables = PoissonTables::new();
        let mut with_17_bits = 0;
        for (row, bytes) in tables.alias.chunks_exact(COLUMNS).zip(&tables.bytes) {
            for (column, entry) in row.iter().enumerate() {
                let bound = u32::from(bytes[2][column]) << 8 | u32::from(bytes[1][column]);
                with_17_bits += u32::from(entry >> 8 > 0xffff);
                // The result of a draw changes only at a threshold, so the test uses the random numbers next to each
                // threshold.
                for draw in [0, (entry >> 8).saturating_sub(1), entry >> 8, 0xffff].map(|d| d.min(0xffff)) {
                    let choose = |bound: u32, alias: u32| if draw < bound { column as u32 } else { alias };
                    assert_eq!(choose(bound, bytes[0][column].into()), choose(entry >> 8, entry & 0xff));
                }
            }
        }
        assert!(with_17_bits > 0, "the rule for them is not tested");
    }

    #[test]
    fn every_column_of_bits_draws_what_the_distribution_says() {
        let tables = PoissonTables::new();
        let prepared = tables.prepare(3.3);
        let mut histogram = vec![0u32; COLUMNS];
        let draws = 1u32 << 20;
        for i in 0..draws {
            let bits = i.wrapping_mul(0x9e37_79b9) ^ i >> 7;
            histogram[tables.draw(prepared, bits) as usize] += 1;
        }
        let truth = distribution(&tables, prepared);
        for (count, p) in histogram.iter().zip(truth) {
            // The bound is five standard deviations of a binomial count.
            let expected = p * f64::from(draws);
            assert!((f64::from(*count) - expected).abs() < 5.0 * expected.sqrt() + 3.0);
        }
    }
}
