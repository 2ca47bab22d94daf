//! A unit normal value from 16 random bits.
//!
//! The four nibbles select entries of two tables of 16 bytes, one for low and
//! one for high nibbles; the two bytes' sums are weighted and added. That is
//! two byte shuffles, one byte addition and one multiply-add in any vector
//! instruction set. The tables and weights were found by annealing against
//! the true distribution. What the 65,536 values reach (`docs/why/random.md`,
//! and the tests below): distance to the normal distribution (Kolmogorov and
//! Smirnov) 3.2e-4; P(|z| > 3.5) 1.6 % below the true one; largest value
//! 4.267; kurtosis 3.0013. Tables of equal quantiles reach 2e-3 and 3.7.

/// For the low nibble of each byte; `LOW[15 - i] = -LOW[i]`.
pub const LOW: [i8; 16] = [-64, -22, -19, -14, -11, -7, -4, -1, 1, 4, 7, 11, 14, 19, 22, 64];

/// For the high nibble of each byte; `HIGH[15 - i] = -HIGH[i]`.
pub const HIGH: [i8; 16] = [-63, -47, -34, -28, -20, -15, -9, -4, 4, 9, 15, 20, 28, 34, 47, 63];

/// Weights of the low and the high byte.
pub const WEIGHTS: [i16; 2] = [23, 22];

/// Variance of [`unit()`] over its 65,536 arguments, exactly.
pub const VARIANCE: f64 = 1_793_516.5;

/// Standard deviation of [`unit()`]: the square root of [`VARIANCE`].
pub const SCALE: f64 = 1_339.222_348_977_197;

/// The largest value of [`unit()`].
pub const LARGEST: i16 = 5715;

/// A value of mean 0 and standard deviation [`SCALE`].
#[must_use]
pub const fn unit(bits: u16) -> i16 {
    byte_sum(bits) * WEIGHTS[0] + byte_sum(bits >> 8) * WEIGHTS[1]
}

const fn byte_sum(byte: u16) -> i16 {
    LOW[(byte & 15) as usize] as i16 + HIGH[(byte >> 4 & 15) as usize] as i16
}

#[cfg(test)]
mod tests {
    use super::*;

    fn all() -> Vec<f64> {
        let mut z: Vec<_> = (0..=u16::MAX).map(|b| f64::from(unit(b)) / SCALE).collect();
        z.sort_by(f64::total_cmp);
        z
    }

    fn normal_cdf(x: f64) -> f64 {
        0.5 * libm::erfc(-x / std::f64::consts::SQRT_2)
    }

    #[test]
    fn variance_and_mean_are_the_stated_ones() {
        let sum: i64 = (0..=u16::MAX).map(|b| i64::from(unit(b))).sum();
        let squares: i64 = (0..=u16::MAX).map(|b| i64::from(unit(b)).pow(2)).sum();
        assert_eq!(sum, 0);
        assert_eq!(squares as f64 / 65_536.0, VARIANCE);
        assert!((SCALE * SCALE - VARIANCE).abs() < 1e-6);
        assert_eq!((0..=u16::MAX).map(unit).max(), Some(LARGEST));
    }

    #[test]
    fn the_distance_to_the_normal_distribution_is_below_five_in_ten_thousand() {
        let z = all();
        let n = z.len() as f64;
        let mut distance = 0.0f64;
        for &x in &z {
            let below = z.partition_point(|&y| y < x) as f64 / n;
            let through = z.partition_point(|&y| y <= x) as f64 / n;
            let true_cdf = normal_cdf(x);
            distance = distance.max((true_cdf - below).abs()).max((through - true_cdf).abs());
        }
        assert!(distance < 3.2e-4, "{distance}");
    }

    #[test]
    fn tails_beyond_three_and_three_and_a_half_sigma_are_the_true_ones() {
        let z = all();
        for (x, tolerance) in [(2.0, 0.003), (3.0, 0.02), (3.5, 0.02), (4.0, 0.04)] {
            let share = z.iter().filter(|v| v.abs() > x).count() as f64 / z.len() as f64;
            let truth = 2.0 * normal_cdf(-x);
            assert!((share / truth - 1.0).abs() < tolerance, "{x}: {share} {truth}");
        }
        assert!(z[z.len() - 1] > 4.2);
    }
}
