//! The variance of the difference of two spike times, as a function of their lag in intervals.
//!
//! A pixel has `N` intervals between its spike times `t_0` to `t_N`. A lag of `n` intervals has `K = N - n + 1`
//! differences `d_k = t_(k+n) - t_k`. Let `m = (t_N - t_0) / N` be the mean interval. The variance of the differences is
//!
//! `D(n) = 1/K sum (d_k - n m)^2`.
//!
//! `D(n)` depends on the spikes only through `N`, `t_0`, `t_N` and the sums of `d_k` and `d_k^2`. As `m` is a ratio of
//! integers, `D(n)` is one integer divided by `N^2 K`. The subtraction is done in integers and loses no digits.
//!
//! **Bias.** The mean interval `m` is computed from the same spikes as the differences `d_k`. Let `V(j)` be the true
//! variance of `t_(k+j) - t_k`. The covariance of two differences is
//! `cov(t_b - t_a, t_d - t_c) = (V(d-a) + V(b-c) - V(b-d) - V(a-c)) / 2`. Averaging over `k` gives the expectation
//! `E D(n) = V(n) + n^2 V(N)/N^2 - 2n/(N K) (V(N-n+1) + ... + V(N) - V(0) - ... - V(n-1))`.
//!
//! Let `s` be the phase noise per spike and `q` a constant quantization variance. With `V(j) = s j + q` and `V(0) = 0`,
//! the expectation is
//!
//! `E D(n) = s (n - n^2/N) + q (1 + n^2/N^2 - 2n/(N K))`.
//!
//! Consequently `D(n)` of independent intervals is too small by the share `n/N`. `D(n)` of a pixel without noise is too
//! large by nearly the share `n^2/N^2`.
//!
//! The quantization variance `q` depends on the rate. For a uniform phase, lag `n` and mean interval `m`, it is
//! `q(n) = u (1 - u)`, where `u` is the fractional part of `n m`. The mean of `q` over a wide range of rates tends to
//! 1/6. Near lag 1 the mean over a narrow range of rates can differ from 1/6 (0.172 for rates around 0.195).

use super::super::estimate::Estimate;
use super::Intervals;

/// Variance of the difference of two spike times that are `n` intervals apart. The model is
/// `V(n) = n * per_spike + constant`, in readouts squared.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
#[non_exhaustive]
pub struct PhaseNoise {
    /// Growth of the variance per spike, caused by shot noise and threshold noise.
    pub per_spike: Estimate,
    /// Constant part of the variance, caused by quantization to whole readouts.
    pub constant: Estimate,
}

/// Smallest lag in the fit of [`Intervals::decompose`].
///
/// At lags below 4 the quantization variance is not constant over a narrow range of rates. It depends on the fractional
/// part of `n m` for lag `n` and mean interval `m`. At lag 4, rates around 0.2 that differ by 5 % cover a whole period
/// of this fractional part.
const MIN_FITTED_LAG: u32 = 4;

/// Returns the coefficients `[a, b]` of the expectation `E D(n) = a s + b q` at lag `n`, for a pixel with `intervals`
/// intervals. `s` is the phase noise per spike and `q` is the quantization variance.
fn weights(lag: u32, intervals: u32) -> [f64; 2] {
    let (n, all) = (f64::from(lag), f64::from(intervals));
    let terms = all - n + 1.0;
    [n - n * n / all, 1.0 + n * n / (all * all) - 2.0 * n / (all * terms)]
}

/// Returns the nearest `f64`. Most numbers fit into 64 bits, and the CPU converts a 64-bit integer in one instruction.
fn to_float(x: i128) -> f64 {
    match i64::try_from(x) {
        Ok(x) => x as f64,
        Err(_) => x as f64,
    }
}

impl Intervals {
    fn lag_index(&self, lag: u32) -> Option<usize> {
        self.lags.iter().position(|l| *l == lag)
    }

    /// Returns `D(n)` of one pixel, or NaN if the pixel has fewer than `n` intervals. `index` is the index of the lag.
    fn pixel_lag_variance(&self, p: usize, index: usize) -> f64 {
        let lag = self.lags[index];
        let (intervals, span) = self.span(p);
        if intervals < lag {
            return f64::NAN;
        }
        let [sum, squares] = self.sums[p * self.lags.len() + index].map(i128::from);
        let (n, all, span) = (i128::from(lag), i128::from(intervals), i128::from(span));
        let terms = all - n + 1;
        // Intervals and readouts are at most 2^28, lags 2^6 and squares 2^62. Therefore no term exceeds 2^119.
        let numerator = all * all * squares - 2 * n * all * span * sum + terms * n * n * span * span;
        to_float(numerator) / to_float(all * all * terms)
    }

    /// Returns `D(n)` of each pixel in readouts squared.
    ///
    /// An entry is NaN if the pixel has fewer than `lag` intervals. All entries are NaN if the lag was not measured.
    #[must_use]
    pub fn lag_variance_map(&self, lag: u32) -> Vec<f64> {
        let of_pixel = |p| match self.lag_index(lag) {
            Some(index) => self.pixel_lag_variance(p, index),
            None => f64::NAN,
        };
        (0..self.len()).map(of_pixel).collect()
    }

    /// Returns the mean of `D(n)` over `pixels` with equal weights. `None` selects all pixels.
    ///
    /// The standard error is `sd / sqrt(pixels)`, because pixels are independent. The value has a small-sample bias.
    /// [`Self::unbiased_lag_variance`] removes this bias.
    #[must_use]
    pub fn lag_variance(&self, lag: u32, pixels: Option<&[usize]>) -> Estimate {
        match self.lag_index(lag) {
            Some(index) => self.mean(pixels, |p| self.pixel_lag_variance(p, index)),
            None => Estimate::mean([]),
        }
    }

    /// Separates the variance of the difference of two spike times into growth per spike and a constant part.
    ///
    /// Each pixel has its own least-squares fit to the lags of 4 or more. The result is the mean of the fits over
    /// `pixels`. The fit accounts for the bias of `D(n)`, so the result is unbiased if the quantization variance is
    /// constant. The standard error is `sd / sqrt(pixels)`. Pixels with fewer than two usable lags are excluded.
    #[must_use]
    pub fn decompose(&self, pixels: Option<&[usize]>) -> PhaseNoise {
        let mut noise_values = Vec::new();
        self.for_each_pixel(pixels, |p| noise_values.push(self.pixel_noise(p, MIN_FITTED_LAG)));
        let mean = |which: usize| Estimate::mean(noise_values.iter().map(|noise| noise[which]));
        PhaseNoise { per_spike: mean(0), constant: mean(1) }
    }

    /// Returns the growth per spike of one pixel, fitted as in [`Self::decompose`] to the lags of `shortest` or more.
    /// Returns NaN with fewer than two usable lags.
    #[must_use]
    pub fn growth(&self, p: usize, shortest: u32) -> f64 {
        self.pixel_noise(p, shortest)[0]
    }

    /// Returns the map of one result of [`Self::decompose`]: the growth per spike if `which` is 0, the constant part if it
    /// is 1.
    pub(crate) fn noise_map(&self, which: usize) -> Vec<f64> {
        (0..self.len()).map(|p| self.pixel_noise(p, MIN_FITTED_LAG)[which]).collect()
    }

    /// Fits `D(n) = s a_n + q b_n` to the lags of a pixel and returns `[s, q]`. [`weights`] returns `a_n` and `b_n`.
    fn pixel_noise(&self, p: usize, shortest: u32) -> [f64; 2] {
        let (intervals, _) = self.span(p);
        let (mut aa, mut ab, mut bb, mut ad, mut bd) = (0.0, 0.0, 0.0, 0.0, 0.0);
        let mut used = 0;
        let from = self.lags.partition_point(|lag| *lag < shortest);
        for (index, lag) in self.lags.iter().enumerate().skip(from) {
            // At lags above half the number of intervals, `D(n)` has few terms, and these terms are dependent.
            if 2 * lag > intervals {
                break;
            }
            let d = self.pixel_lag_variance(p, index);
            let [a, b] = weights(*lag, intervals);
            aa += a * a;
            ab += a * b;
            bb += b * b;
            ad += a * d;
            bd += b * d;
            used += 1;
        }
        let det = aa * bb - ab * ab;
        if used < 2 {
            return [f64::NAN; 2];
        }
        [(ad * bb - bd * ab) / det, (bd * aa - ad * ab) / det]
    }

    /// Returns [`Self::lag_variance`] minus its bias. The bias is computed for the noise that [`Self::decompose`] finds
    /// for `pixels`.
    #[must_use]
    pub fn unbiased_lag_variance(&self, lag: u32, pixels: Option<&[usize]>) -> Estimate {
        let noise = self.decompose(pixels);
        let Some(index) = self.lag_index(lag) else {
            return Estimate::mean([]);
        };
        self.mean(pixels, |p| {
            let [a, b] = weights(lag, self.span(p).0);
            let bias = noise.per_spike.value * (a - f64::from(lag)) + noise.constant.value * (b - 1.0);
            self.pixel_lag_variance(p, index) - bias
        })
    }

    /// Returns the autocovariance of a pixel's intervals at a distance of `lag` (1 or 2) intervals.
    ///
    /// For `N` intervals `x_k` with the mean `m`, the autocovariance is `1/K sum (x_k - m)(x_(k+lag) - m)`, where
    /// `K = N - lag`. It is NaN if `K < 1`.
    fn pixel_autocovariance(&self, p: usize, lag: usize) -> f64 {
        let (intervals, span) = self.span(p);
        let pixel = &self.pixels[p];
        if !(1..=2).contains(&lag) || intervals as usize <= lag {
            return f64::NAN;
        }
        let wide = |x: u32| i128::from(x);
        // `early` is the sum of all intervals without the last `lag` intervals. `late` is the sum without the first
        // `lag` intervals.
        let early = wide(self.latest_spikes[p][2 - lag] - pixel.first_spikes[0]);
        let late = wide(self.latest_spikes[p][2] - pixel.first_spikes[lag]);
        let (all, span, k) = (wide(intervals), wide(span), wide(intervals) - lag as i128);
        let products = i128::from(pixel.lag_products[lag - 1]);
        let numerator = all * all * products - all * span * (early + late) + k * span * span;
        to_float(numerator) / to_float(all * all * k)
    }

    /// Returns the mean autocovariance over `pixels` of intervals at a distance of `lag` (1 or 2) intervals, in readouts
    /// squared.
    ///
    /// The standard error is `sd / sqrt(pixels)`. Let `N` be the number of intervals of a pixel. Independent intervals
    /// of variance `s` cause a bias of `-s/N`. A pixel that integrates charge with the quantization variance `q` has a
    /// bias of `q/N^2`. At lag 1, its autocovariance is about `-D(1)/2` or below, where `D(1)` is the variance of one
    /// interval.
    #[must_use]
    pub fn autocovariance(&self, lag: usize, pixels: Option<&[usize]>) -> Estimate {
        self.mean(pixels, |p| self.pixel_autocovariance(p, lag))
    }

    /// Returns the autocovariance of each pixel, as in [`Self::autocovariance`].
    #[must_use]
    pub fn autocovariance_map(&self, lag: usize) -> Vec<f64> {
        (0..self.len()).map(|p| self.pixel_autocovariance(p, lag)).collect()
    }
}
