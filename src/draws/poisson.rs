//! Poisson counts of small means from 32 random bits, by tables.
//!
//! A grid of means, equally spaced in their square root, has an alias table
//! each (128 columns: one look-up and one comparison a draw). A mean between
//! two grid points takes one of them at random. That mixture is a little too
//! wide; with [`DENSITY`] points per unit of the root its total variation
//! distance from the Poisson distribution is at most `0.5 / DENSITY^2` =
//! 1.2e-4: the mixture's defect is at most `step^2 / 8` times the second
//! difference of the distribution, whose half absolute sum is 0.97 / mean for
//! large means and at most 2 for small ones, and `step = 2 sqrt(mean) / DENSITY`.
//! A search along the cumulative distribution would be exact but needs up to
//! a hundred comparisons a draw.

/// Above this mean a normal draw takes over.
pub const LIMIT: f32 = 64.0;

/// Grid points per unit of the square root of the mean.
pub const DENSITY: f32 = 64.0;

/// Columns of an alias table: counts 0 to 127.
pub const COLUMNS: usize = 128;

/// Grid points, 0 to [`LIMIT`] inclusive.
const POINTS: usize = 513;

/// The tables, 460 KB.
#[derive(Clone, Debug, PartialEq)]
pub struct Tables {
    /// `threshold << 8 | alias`, [`COLUMNS`] words for every grid point.
    pub alias: Vec<u32>,
    /// The same in bytes, for instruction sets that look bytes up within registers: of every grid
    /// point first all aliases, then the low and then the high bytes of all thresholds.
    pub bytes: Vec<[[u8; COLUMNS]; 3]>,
    /// Mean of every grid point's table, exactly as the table has it.
    pub mean: Vec<f32>,
    /// `512 / (mean[i + 1] - mean[i])`.
    pub inverse_step: Vec<f32>,
    /// `(mean[i + 1] - mean[i]) / 512`.
    pub step: Vec<f32>,
}

/// A mean, prepared for many draws.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Prepared {
    /// Lower grid point.
    pub point: u32,
    /// Share of the upper grid point, of 512.
    pub share: u32,
    /// The mean that the draws really have.
    pub mean: f32,
}

impl Default for Tables {
    fn default() -> Self {
        Self::new()
    }
}

impl Tables {
    /// Builds the tables.
    #[must_use]
    pub fn new() -> Self {
        let mut alias = Vec::with_capacity(POINTS * COLUMNS);
        let mut mean = Vec::with_capacity(POINTS);
        for i in 0..POINTS {
            let root = i as f64 / f64::from(DENSITY);
            let column = alias_table(&probabilities(root * root));
            mean.push(table_mean(&column) as f32);
            alias.extend(column);
        }
        let bytes = alias.chunks_exact(COLUMNS).map(bytes_of).collect();
        let gaps = || mean.windows(2).map(|m| m[1] - m[0]);
        let inverse_step = gaps().map(|g| 512.0 / g).collect();
        let step = gaps().map(|g| g / 512.0).collect();
        Self { alias, bytes, mean, inverse_step, step }
    }

    /// The grid point, share and true mean for `mean` in `[0, LIMIT)`.
    #[must_use]
    pub fn prepare(&self, mean: f32) -> Prepared {
        let point = ((mean.sqrt() * DENSITY) as u32).min(POINTS as u32 - 2);
        let i = point as usize;
        let share = ((mean - self.mean[i]) * self.inverse_step[i]).clamp(0.0, 512.0);
        let share = share.round_ties_even();
        Prepared { point, share: share as u32, mean: self.mean[i] + share * self.step[i] }
    }

    /// The count that belongs to 32 random bits.
    #[must_use]
    pub fn draw(&self, prepared: Prepared, bits: u32) -> u32 {
        let upper = u32::from(bits & 511 < prepared.share);
        let column = bits >> 25;
        let entry = self.alias[((prepared.point + upper) * COLUMNS as u32 + column) as usize];
        let kept = (bits >> 9 & 0xffff) < entry >> 8;
        if kept { column } else { entry & 0xff }
    }
}

/// A table's aliases and the bytes of its thresholds. A threshold of 65,536, which takes a 17th bit, always
/// keeps its column: so does an alias that is the column itself.
fn bytes_of(table: &[u32]) -> [[u8; COLUMNS]; 3] {
    let mut bytes = [[0; COLUMNS]; 3];
    for (column, entry) in table.iter().enumerate() {
        let always = entry >> 8 > 0xffff;
        bytes[0][column] = if always { column as u8 } else { *entry as u8 };
        bytes[1][column] = (entry >> 8) as u8;
        bytes[2][column] = (entry >> 16) as u8;
    }
    bytes
}

/// Poisson probabilities of 0 to 127, normalised.
fn probabilities(mean: f64) -> [f64; COLUMNS] {
    let mut p = [0.0; COLUMNS];
    p[0] = libm::exp(-mean);
    for k in 1..COLUMNS {
        p[k] = p[k - 1] * mean / k as f64;
    }
    let sum: f64 = p.iter().sum();
    p.map(|v| v / sum)
}

/// Walker's alias method in Vose's form, with thresholds of 16 bits.
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
        let kept = f64::from(entry >> 8) / 65_536.0;
        kept * k as f64 + (1.0 - kept) * f64::from(entry & 0xff)
    });
    parts.sum::<f64>() / COLUMNS as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The exact distribution of `draw` for a prepared mean.
    fn distribution(tables: &Tables, prepared: Prepared) -> Vec<f64> {
        let mut p = vec![0.0; COLUMNS];
        let upper = f64::from(prepared.share) / 512.0;
        for (point, weight) in [(prepared.point, 1.0 - upper), (prepared.point + 1, upper)] {
            for column in 0..COLUMNS {
                let entry = tables.alias[point as usize * COLUMNS + column];
                let kept = f64::from(entry >> 8) / 65_536.0;
                p[column] += weight * kept / COLUMNS as f64;
                p[(entry & 0xff) as usize] += weight * (1.0 - kept) / COLUMNS as f64;
            }
        }
        p
    }

    #[test]
    fn the_total_variation_from_poisson_is_below_two_in_ten_thousand() {
        let tables = Tables::new();
        let mut worst = 0.0f64;
        for i in 0..4000 {
            // Means over the whole range, off the grid points, denser for dim light.
            let mean = 64.0 * (f64::from(i) + 0.37).powi(2) / 4000.0f64.powi(2);
            let prepared = tables.prepare(mean as f32);
            let found = distribution(&tables, prepared);
            let truth = probabilities(mean);
            let distance: f64 = found.iter().zip(&truth).map(|(a, b)| (a - b).abs()).sum();
            worst = worst.max(0.5 * distance);
            let found_mean: f64 = found.iter().enumerate().map(|(k, p)| k as f64 * p).sum();
            assert!((found_mean - f64::from(prepared.mean)).abs() < 1e-6 * found_mean + 1e-7);
        }
        assert!(worst < 2e-4, "{worst}");
        assert!(worst > 1e-5, "the test would not see a defect: {worst}");
    }

    #[test]
    fn the_bytes_draw_what_the_words_draw() {
        let tables = Tables::new();
        let mut with_17_bits = 0;
        for (row, bytes) in tables.alias.chunks_exact(COLUMNS).zip(&tables.bytes) {
            for (column, entry) in row.iter().enumerate() {
                let bound = u32::from(bytes[2][column]) << 8 | u32::from(bytes[1][column]);
                with_17_bits += u32::from(entry >> 8 > 0xffff);
                // Between two thresholds nothing changes: the draws at their borders say it all.
                for draw in [0, (entry >> 8).saturating_sub(1), entry >> 8, 0xffff].map(|d| d.min(0xffff)) {
                    let kept = |bound: u32, alias: u32| if draw < bound { column as u32 } else { alias };
                    assert_eq!(kept(bound, bytes[0][column].into()), kept(entry >> 8, entry & 0xff));
                }
            }
        }
        assert!(with_17_bits > 0, "the rule for them is not tested");
    }

    #[test]
    fn every_column_of_bits_draws_what_the_distribution_says() {
        let tables = Tables::new();
        let prepared = tables.prepare(3.3);
        let mut histogram = vec![0u32; COLUMNS];
        let draws = 1u32 << 20;
        for i in 0..draws {
            let bits = i.wrapping_mul(0x9e37_79b9) ^ i >> 7;
            histogram[tables.draw(prepared, bits) as usize] += 1;
        }
        let truth = distribution(&tables, prepared);
        for (count, p) in histogram.iter().zip(truth) {
            // Five standard deviations of a binomial count.
            let expected = p * f64::from(draws);
            assert!((f64::from(*count) - expected).abs() < 5.0 * expected.sqrt() + 3.0);
        }
    }
}
