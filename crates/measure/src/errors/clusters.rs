//! Errors of sums over pixels of which those of a row, or of a column, go together.

/// The normal quantile of a 95 % interval.
pub(super) const NORMAL: f64 = 1.959_964;

/// The variance of a sum, and how well it is known.
#[derive(Clone, Copy, Debug)]
pub(super) struct Clustered {
    /// Variance of the sum.
    pub variance: f64,
    /// Its degrees of freedom (Satterthwaite 1946).
    pub freedom: f64,
    /// The variance over that of independent pixels.
    pub excess: f64,
}

/// Variance of the sum of a map's entries, NaN left out, about their mean.
///
/// Clusters in two ways (Cameron, Gelbach and Miller 2011): `V = V_rows + V_columns - V_pixels`, each from the squares of
/// its sums with the factor `n / (n - 1)`. At least half of `V_pixels`, as the difference of two scattered numbers may fall
/// below what is possible. `None` with fewer than two entries.
pub(super) fn clustered(map: &[f64], width: usize) -> Option<Clustered> {
    let height = map.len() / width;
    let finite = map.iter().filter(|x| x.is_finite());
    let n = finite.clone().count() as f64;
    if n < 2.0 {
        return None;
    }
    let mean = finite.sum::<f64>() / n;
    let (mut rows, mut columns) = (vec![(0.0, false); height], vec![(0.0, false); width]);
    let mut pixels = 0.0;
    for (p, x) in map.iter().enumerate().filter(|(_, x)| x.is_finite()) {
        let away = x - mean;
        pixels += away * away;
        for line in [&mut rows[p / width], &mut columns[p % width]] {
            *line = (line.0 + away, true);
        }
    }
    let pixels = pixels * n / (n - 1.0);
    let of_lines = |lines: &[(f64, bool)]| {
        let used = lines.iter().filter(|l| l.1);
        let k = used.clone().count() as f64;
        match k >= 2.0 {
            true => (used.map(|l| l.0 * l.0).sum::<f64>() * k / (k - 1.0), k - 1.0),
            false => (pixels, n - 1.0),
        }
    };
    let (row, column) = (of_lines(&rows), of_lines(&columns));
    let variance = (row.0 + column.0 - pixels).max(0.5 * pixels);
    let scatter =
        2.0 * (row.0 * row.0 / row.1 + column.0 * column.0 / column.1 + pixels * pixels / (n - 1.0));
    let freedom = if scatter > 0.0 { (2.0 * variance * variance / scatter).max(2.0) } else { n - 1.0 };
    Some(Clustered { variance, freedom, excess: if pixels > 0.0 { variance / pixels } else { 1.0 } })
}

/// A standard error known with `freedom` degrees, widened so that 1.96 of it on either side cover 95 %: by
/// Student's quantile (Abramowitz and Stegun 26.7.5) over the normal one.
pub(super) fn widened(error: f64, freedom: f64) -> f64 {
    let (z, v) = (NORMAL, freedom.max(2.0));
    let powers = |terms: &[(i32, f64)]| terms.iter().map(|(k, c)| c * z.powi(*k)).sum::<f64>();
    let t = z
        + powers(&[(3, 1.0), (1, 1.0)]) / (4.0 * v)
        + powers(&[(5, 5.0), (3, 16.0), (1, 3.0)]) / (96.0 * v * v)
        + powers(&[(7, 3.0), (5, 19.0), (3, 17.0), (1, -15.0)]) / (384.0 * v.powi(3));
    error * t / z
}

/// The normal quantile that one value in twenty falls below.
const TWENTIETH: f64 = -1.644_854;

/// A standard error of a mean square with so many degrees of freedom, known by that mean square itself, widened so that 1.96 of it on
/// either side cover 95 %. A small value has a small error, so the truth is missed above it and nowhere else: the
/// value that one in twenty falls below (Wilson and Hilferty 1931) has to reach the truth.
pub(super) fn widened_square(error: f64, freedom: f64) -> f64 {
    widened_power(error, freedom, 1.0)
}

/// The same for the error of a mean square that is told as its root.
pub(super) fn widened_root(error: f64, freedom: f64) -> f64 {
    widened_power(error, freedom, 0.5)
}

fn widened_power(error: f64, freedom: f64, power: f64) -> f64 {
    let v = freedom.max(2.0);
    let third = 2.0 / (9.0 * v);
    let low = (1.0 - third + TWENTIETH * third.sqrt()).max(0.05).powf(3.0 * power);
    let needed = (1.0 / low - 1.0) / (NORMAL * power * (2.0 / v).sqrt());
    error * needed.max(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mean_square_of_thirty_degrees_is_widened_by_a_quarter() {
        // Chi-square tables: one in twenty is below 18.49 of 30.
        let expected = (30.0 / 18.49 - 1.0) / (NORMAL * (2.0_f64 / 30.0).sqrt());
        assert!((widened_square(1.0, 30.0) / expected - 1.0).abs() < 0.005);
        let expected = ((30.0_f64 / 18.49).sqrt() - 1.0) / (NORMAL * 0.5 * (2.0_f64 / 30.0).sqrt());
        assert!((widened_root(1.0, 30.0) / expected - 1.0).abs() < 0.005);
    }

    #[test]
    fn students_quantiles_are_those_of_tables() {
        for (freedom, table) in [(3.0, 3.182), (5.0, 2.571), (10.0, 2.228), (30.0, 2.042)] {
            let found = widened(NORMAL, freedom);
            assert!((found / table - 1.0).abs() < 0.01, "{freedom}: {found}");
        }
    }

    #[test]
    fn rows_that_go_together_count_once() {
        // Four rows of +1, -1, +1, -1: sums of eight, squared, 4/3 of them.
        let map: Vec<f64> = (0..32).map(|p| if p / 8 % 2 == 0 { 1.0 } else { -1.0 }).collect();
        let found = clustered(&map, 8).unwrap();
        // Columns add up to nothing; the pixels' own 32 * 32/31 is taken off.
        let expected = 4.0 * 64.0 * 4.0 / 3.0 - 32.0 * 32.0 / 31.0;
        assert!((found.variance - expected).abs() < 1e-9, "{found:?}");
    }
}
