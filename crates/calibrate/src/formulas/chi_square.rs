//! Limits of chi-square.

/// Returns the limit of chi-square over its degrees of freedom that corresponds to the normal quantile `z`, by the cube root
/// of Wilson and Hilferty.
///
/// The upper limit with a probability of 0.001 (`z` = 3.09) is 3 % too large for one degree of freedom and 0.6 % for ten. A
/// lower limit needs at least three.
#[must_use]
pub fn chi_square_over_freedom(freedom: f64, z: f64) -> f64 {
    let c = 2.0 / (9.0 * freedom);
    (1.0 - c + z * c.sqrt()).powi(3)
}

#[cfg(test)]
mod tests {
    use super::chi_square_over_freedom;

    /// Limits of the tables: 10.828 and 29.588 at 0.001, and 0.352 and 3.940 at 0.95.
    #[test]
    fn limits_are_those_of_tables() {
        for (freedom, z, limit, tolerance) in [
            (1.0, 3.0902, 10.828, 0.04),
            (10.0, 3.0902, 29.588, 0.007),
            (3.0, -1.6449, 0.352, 0.07),
            (10.0, -1.6449, 3.940, 0.003),
        ] {
            let found = freedom * chi_square_over_freedom(freedom, z);
            assert!((found / limit - 1.0_f64).abs() < tolerance, "{freedom} {z}: {found}");
        }
    }
}
