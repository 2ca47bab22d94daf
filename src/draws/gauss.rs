//! A standard normal value from 16 random bits.
//!
//! A draw divides its 16 random bits into two bytes, and each byte into two nibbles. Each nibble selects an entry of a
//! table of 16 one-byte entries. Low and high nibbles have separate tables. The sum of the two entries of a byte is
//! multiplied by the weight of that byte. The draw is the sum of both products. In every vector instruction set, a draw
//! takes two byte shuffles, one byte addition and one multiply-add.
//!
//! The tables and weights were optimized by simulated annealing. The objective was the distance to the normal
//! distribution.
//! `docs/why/random.md` and the tests below document these properties of the 65,536 values:
//!
//! | property | value |
//! |---|--:|
//! | Kolmogorov-Smirnov distance to the normal distribution | 3.2e-4 |
//! | P(abs z > 3.5) relative to the normal distribution | -1.6 % |
//! | largest value | 4.267 standard deviations |
//! | kurtosis | 3.0013 |
//!
//! Tables of equally probable quantiles of the normal distribution would have a Kolmogorov-Smirnov distance of at least
//! 2e-3. Their largest value would be at most 3.7 standard deviations.

/// Entries for the low nibble of a byte; `LOW_NIBBLE_TABLE[15 - i] = -LOW_NIBBLE_TABLE[i]`.
pub const LOW_NIBBLE_TABLE: [i8; 16] = [-64, -22, -19, -14, -11, -7, -4, -1, 1, 4, 7, 11, 14, 19, 22, 64];

/// Entries for the high nibble of a byte; `HIGH_NIBBLE_TABLE[15 - i] = -HIGH_NIBBLE_TABLE[i]`.
pub const HIGH_NIBBLE_TABLE: [i8; 16] = [-63, -47, -34, -28, -20, -15, -9, -4, 4, 9, 15, 20, 28, 34, 47, 63];

/// Weights of the low and the high byte of the 16 bits.
pub const BYTE_WEIGHTS: [i16; 2] = [23, 22];

/// Exact variance of [`draw`] for uniformly distributed arguments.
pub const VARIANCE: f64 = 1_793_516.5;

/// Standard deviation of [`draw`]: the square root of [`VARIANCE`].
pub const STD_DEV: f64 = 1_339.222_348_977_197;

/// The largest value of [`draw`].
pub const MAX_DRAW: i16 = 5715;

/// Computes a normal value from 16 random bits. Its mean is 0 and its standard deviation is [`STD_DEV`].
#[must_use]
pub const fn draw(bits: u16) -> i16 {
    byte_sum(bits) * BYTE_WEIGHTS[0] + byte_sum(bits >> 8) * BYTE_WEIGHTS[1]
}

const fn byte_sum(byte: u16) -> i16 {
    LOW_NIBBLE_TABLE[(byte & 15) as usize] as i16 + HIGH_NIBBLE_TABLE[(byte >> 4 & 15) as usize] as i16
}

#[cfg(test)]
mod tests {
    use super::*;

    fn all() -> Vec<f64> {
        let mut z: Vec<_> = (0..=u16::MAX).map(|b| f64::from(draw(b)) / STD_DEV).collect();
        z.sort_by(f64::total_cmp);
        z
    }

    fn normal_cdf(x: f64) -> f64 {
        0.5 * libm::erfc(-x / std::f64::consts::SQRT_2)
    }

    #[test]
    fn variance_and_mean_are_the_stated_ones() {
        let sum: i64 = (0..=u16::MAX).map(|b| i64::from(draw(b))).sum();
        let squares: i64 = (0..=u16::MAX).map(|b| i64::from(draw(b)).pow(2)).sum();
        assert_eq!(sum, 0);
        assert_eq!(squares as f64 / 65_536.0, VARIANCE);
        assert!((STD_DEV * STD_DEV - VARIANCE).abs() < 1e-6);
        assert_eq!((0..=u16::MAX).map(draw).max(), Some(MAX_DRAW));
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
