//! The error of the variance of frame totals.

use realfft::RealFftPlanner;

use super::clusters::widen_square_error;
use crate::spectrum::squared_magnitudes;

/// Returns the standard error of the variance of `totals`, in spikes squared. Returns NaN with fewer than eight totals.
///
/// Totals of regular pixels are correlated over many readouts. The variance of the totals is the sum of the entries
/// `P_k` of their periodogram. These entries are independent and have exponential distributions. The variance of the
/// sum is therefore half the sum of `P_k^2`, for any correlation of the totals (Priestley 1981, section 6.2). For the
/// autocorrelations `r` of `T` totals, this is Bartlett's formula `2/T sum r^2` written with frequencies. The variance
/// `v` of the totals has `2 v^2 / error^2` degrees of freedom.
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
    // The power of a bin has two degrees of freedom. The bin at half a cycle per readout has only one. The expectation
    // of its squared power is therefore three times the square of its expected power.
    let (mut variance, mut square) = (0.0, 0.0);
    for (k, magnitude) in squares.iter().enumerate().skip(1) {
        let is_nyquist = k == last && n.is_multiple_of(2);
        let power = magnitude / (n as f64 * n as f64) * if is_nyquist { 1.0 } else { 2.0 };
        variance += power;
        square += power * power * if is_nyquist { 2.0 / 3.0 } else { 0.5 };
    }
    if square == 0.0 {
        return 0.0;
    }
    widen_square_error(square.sqrt(), 2.0 * variance * variance / square)
}

#[cfg(test)]
mod tests {
    use rand_pcg::Pcg64Mcg;
    use rand_pcg::rand_core::{Rng, SeedableRng};

    #[test]
    fn white_noise_totals_have_the_error_of_independent_samples() {
        let mut random = Pcg64Mcg::seed_from_u64(3);
        // A sum of sixteen dice is nearly normal. Its variance is 16 * 85.25, and the relative error of the variance is
        // sqrt(2 / T).
        let mut total = || (0..16).map(|_| random.next_u32() % 32).sum::<u32>();
        let totals: Vec<u32> = (0..20_000).map(|_| total()).collect();
        let ratio = super::variance_error(&totals) / (16.0 * 85.25 * (2.0_f64 / 20_000.0).sqrt());
        assert!((ratio - 1.0).abs() < 0.05, "{ratio}");
        assert!(super::variance_error(&[3; 100]) == 0.0 && super::variance_error(&[1, 2]).is_nan());
    }
}
