//! Errors of sums over pixels, if pixels of the same row or column are correlated.

/// Quantile 0.975 of the normal distribution. It is half the width of a 95 % interval in standard deviations.
pub(super) const NORMAL_QUANTILE_975: f64 = 1.959_964;

/// The variance of a sum and its degrees of freedom.
#[derive(Clone, Copy, Debug)]
pub(super) struct ClusteredVariance {
    /// Variance of the sum.
    pub variance: f64,
    /// Degrees of freedom of the variance (Satterthwaite 1946).
    pub degrees_of_freedom: f64,
    /// The variance of the sum, divided by the variance for independent pixels.
    pub excess: f64,
}

/// Returns the variance of the sum of the finite entries of a map, after subtracting their mean. Returns `None` with
/// fewer than two finite entries.
///
/// Pixels are clustered in two ways (Cameron, Gelbach and Miller 2011): `V = V_rows + V_columns - V_pixels`. `V_rows`
/// is the sum of the squared row sums, multiplied by `n / (n - 1)` for `n` rows. `V_columns` and `V_pixels` are
/// computed from columns and from pixels in the same way. By chance `V` can be too small or negative, so the returned
/// variance is at least half of `V_pixels`.
pub(super) fn clustered_variance(map: &[f64], width: usize) -> Option<ClusteredVariance> {
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
    Some(ClusteredVariance {
        variance,
        degrees_of_freedom: freedom,
        excess: if pixels > 0.0 { variance / pixels } else { 1.0 },
    })
}

/// Widens a standard error that has `freedom` degrees of freedom. Afterward the interval of +-1.96 errors covers the
/// truth with 95 % probability.
///
/// The factor is the quantile of Student's distribution (Abramowitz and Stegun 26.7.5) divided by the normal quantile.
pub(super) fn widen_error(error: f64, freedom: f64) -> f64 {
    let (z, v) = (NORMAL_QUANTILE_975, freedom.max(2.0));
    let powers = |terms: &[(i32, f64)]| terms.iter().map(|(k, c)| c * z.powi(*k)).sum::<f64>();
    let t = z
        + powers(&[(3, 1.0), (1, 1.0)]) / (4.0 * v)
        + powers(&[(5, 5.0), (3, 16.0), (1, 3.0)]) / (96.0 * v * v)
        + powers(&[(7, 3.0), (5, 19.0), (3, 17.0), (1, -15.0)]) / (384.0 * v.powi(3));
    error * t / z
}

/// Quantile 0.05 of the normal distribution.
const NORMAL_QUANTILE_05: f64 = -1.644_854;

/// Widens the standard error of a mean square that has `freedom` degrees of freedom. Afterward the interval of +-1.96
/// errors covers the truth with 95 % probability.
///
/// The error is proportional to the mean square itself. If the mean square is too small, its error is also too small.
/// Nearly all intervals that miss the truth therefore lie below the truth. The error is widened by a factor. If the
/// mean square equals its 5 % quantile (Wilson and Hilferty 1931), the upper end of the widened interval equals the
/// truth.
pub(super) fn widen_square_error(error: f64, freedom: f64) -> f64 {
    widen_power_error(error, freedom, 1.0)
}

/// Widens the standard error of the root of a mean square, as [`widen_square_error`] does for the mean square.
pub(super) fn widen_root_error(error: f64, freedom: f64) -> f64 {
    widen_power_error(error, freedom, 0.5)
}

fn widen_power_error(error: f64, freedom: f64, power: f64) -> f64 {
    let v = freedom.max(2.0);
    let third = 2.0 / (9.0 * v);
    let low = (1.0 - third + NORMAL_QUANTILE_05 * third.sqrt()).max(0.05).powf(3.0 * power);
    let needed = (1.0 / low - 1.0) / (NORMAL_QUANTILE_975 * power * (2.0 / v).sqrt());
    error * needed.max(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mean_square_with_30_degrees_of_freedom_is_widened_by_a_quarter() {
        // A chi-square table lists the 5 % quantile for 30 degrees of freedom as 18.49.
        let expected = (30.0 / 18.49 - 1.0) / (NORMAL_QUANTILE_975 * (2.0_f64 / 30.0).sqrt());
        assert!((widen_square_error(1.0, 30.0) / expected - 1.0).abs() < 0.005);
        let expected =
            ((30.0_f64 / 18.49).sqrt() - 1.0) / (NORMAL_QUANTILE_975 * 0.5 * (2.0_f64 / 30.0).sqrt());
        assert!((widen_root_error(1.0, 30.0) / expected - 1.0).abs() < 0.005);
    }

    #[test]
    fn students_quantiles_are_those_of_tables() {
        for (freedom, table) in [(3.0, 3.182), (5.0, 2.571), (10.0, 2.228), (30.0, 2.042)] {
            let factor = widen_error(NORMAL_QUANTILE_975, freedom);
            assert!((factor / table - 1.0).abs() < 0.01, "{freedom}: {factor}");
        }
    }

    #[test]
    fn perfectly_correlated_rows_count_once() {
        // The rows contain +1, -1, +1 and -1 in all of their 8 pixels, so each row sum is +8 or -8. The sum of the four
        // squares is 4 * 64. For n = 4 rows it is multiplied by n / (n - 1) = 4/3.
        let map: Vec<f64> = (0..32).map(|p| if p / 8 % 2 == 0 { 1.0 } else { -1.0 }).collect();
        let variance = clustered_variance(&map, 8).unwrap();
        // Each column sums to zero. The pixel term is 32 (sum of squares) times 32/31, and it is subtracted.
        let expected = 4.0 * 64.0 * 4.0 / 3.0 - 32.0 * 32.0 / 31.0;
        assert!((variance.variance - expected).abs() < 1e-9, "{variance:?}");
    }
}
