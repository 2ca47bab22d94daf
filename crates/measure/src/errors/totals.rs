//! The error of the variance of readouts' totals.

use realfft::RealFftPlanner;

use super::clusters::widened_square;
use crate::spectrum::squared_magnitudes;

/// Standard error of the variance of `totals`, in spikes squared.
///
/// Totals of pixels that fire regularly go together over many readouts. Their periodogram `P_k`, whose sum is the variance, has
/// independent entries with exponential laws, so that the variance of the sum is half the sum of the `P_k^2`, whatever the
/// totals' correlation (Priestley 1981, section 6.2; Bartlett's `2/T sum r^2` in the frequencies' terms). It is known with
/// `2 v^2 / error^2` degrees of freedom. NaN below eight totals.
pub(crate) fn variance_error(totals: &[u32]) -> f64 {
    let n = totals.len();
    if n < 8 {
        return f64::NAN;
    }
    let transform = RealFftPlanner::<f64>::new().plan_fft_forward(n);
    let Ok(squares) = squared_magnitudes(&*transform, totals, std::iter::repeat(1.0)) else {
        return f64::NAN;
    };
    let last = squares.len() - 1;
    // A bin has two degrees of freedom, the one at half a cycle per readout has one: its square is three times what it counts for.
    let (mut variance, mut square) = (0.0, 0.0);
    for (k, magnitude) in squares.iter().enumerate().skip(1) {
        let alone = k == last && n.is_multiple_of(2);
        let power = magnitude / (n as f64 * n as f64) * if alone { 1.0 } else { 2.0 };
        variance += power;
        square += power * power * if alone { 2.0 / 3.0 } else { 0.5 };
    }
    if square == 0.0 {
        return 0.0;
    }
    widened_square(square.sqrt(), 2.0 * variance * variance / square)
}

#[cfg(test)]
mod tests {
    use rand_pcg::Pcg64Mcg;
    use rand_pcg::rand_core::{Rng, SeedableRng};

    #[test]
    fn white_totals_have_the_error_of_independent_ones() {
        let mut random = Pcg64Mcg::seed_from_u64(3);
        // Sums of sixteen dice are near to normal: sqrt(2 / T) of the variance 16 * 85.25.
        let mut total = || (0..16).map(|_| random.next_u32() % 32).sum::<u32>();
        let totals: Vec<u32> = (0..20_000).map(|_| total()).collect();
        let found = super::variance_error(&totals) / (16.0 * 85.25 * (2.0_f64 / 20_000.0).sqrt());
        assert!((found - 1.0).abs() < 0.05, "{found}");
        assert!(super::variance_error(&[3; 100]) == 0.0 && super::variance_error(&[1, 2]).is_nan());
    }
}
