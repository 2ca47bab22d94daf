//! How the variance of spike times grows with their distance.
//!
//! For a lag of `n` intervals, with `d_k = t_(k+n) - t_k`, `K = N - n + 1` of
//! them, and the pixel's own mean interval `m = (t_N - t_0) / N`:
//!
//! `D(n) = 1/K sum (d_k - n m)^2`
//!
//! needs only the sums of `d_k` and `d_k^2` besides `N`, `t_0` and `t_N`; as
//! `m` is a ratio of integers, the whole is one integer over `N^2 K`, so
//! nothing cancels.
//!
//! **Bias.** `m` comes from the same spikes. Let `V(j)` be the true variance of
//! `t_(k+j) - t_k`. The covariance of two spans is
//! `cov(t_b - t_a, t_d - t_c) = (V(d-a) + V(b-c) - V(b-d) - V(a-c)) / 2`,
//! and averaging over `k` gives
//!
//! `E D(n) = V(n) + n^2 V(N)/N^2 - 2n/(N K) (V(N-n+1) + ... + V(N) - V(0) - ... - V(n-1))`.
//!
//! For `V(j) = s j + q` (`V(0) = 0`), phase noise `s` per spike on top of a
//! constant quantisation `q`, that is
//!
//! `E D(n) = s (n - n^2/N) + q (1 + n^2/N^2 - 2n/(N K))`:
//!
//! independent intervals lose the share `n/N`, a pixel without noise gains
//! nearly `n^2/N^2`. The quantisation is a lattice function of the rate: for
//! uniform phase `q(n) = u (1 - u)` with `u` the fraction of `n m`, whose mean
//! over a spread of rates tends to 1/6; near lag 1 a narrow range of rates has
//! its own value (0.172 for rates about 0.195).

use super::super::estimate::Estimate;
use super::Intervals;

/// Variance of spike times as `V(n) = n per_spike + constant`, in readouts squared.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
#[non_exhaustive]
pub struct PhaseNoise {
    /// Growth per spike: shot noise and threshold noise.
    pub per_spike: Estimate,
    /// The constant part: quantisation by readouts.
    pub constant: Estimate,
}

/// The shortest lag that tells the growth: below it, the lattice value of a
/// narrow range of rates is no constant (at lag 4, rates about 0.2 that differ
/// by 5 % cover a whole period of the lattice).
const SHORTEST_FITTED: u32 = 4;

/// What `D(n)` of a pixel with `intervals` intervals holds of noise per spike
/// and of the constant.
fn weights(lag: u32, intervals: u32) -> [f64; 2] {
    let (n, all) = (f64::from(lag), f64::from(intervals));
    let terms = all - n + 1.0;
    [n - n * n / all, 1.0 + n * n / (all * all) - 2.0 * n / (all * terms)]
}

/// The nearest float. Most numbers have 64 bits, of which the CPU makes one itself.
fn float(x: i128) -> f64 {
    match i64::try_from(x) {
        Ok(x) => x as f64,
        Err(_) => x as f64,
    }
}

impl Intervals {
    fn lag_index(&self, lag: u32) -> Option<usize> {
        self.lags.iter().position(|l| *l == lag)
    }

    /// `D(n)` of one pixel, NaN with fewer than `n` intervals.
    fn pixel_lag_variance(&self, p: usize, index: usize) -> f64 {
        let lag = self.lags[index];
        let (intervals, span) = self.span(p);
        if intervals < lag {
            return f64::NAN;
        }
        let [sum, squares] = self.sums[p * self.lags.len() + index].map(i128::from);
        let (n, all, span) = (i128::from(lag), i128::from(intervals), i128::from(span));
        let terms = all - n + 1;
        // At most 2^28 intervals and readouts, lags of at most 2^6, squares
        // below 2^62: no term exceeds 2^119.
        let numerator = all * all * squares - 2 * n * all * span * sum + terms * n * n * span * span;
        float(numerator) / float(all * all * terms)
    }

    /// `D(n)` per pixel, in readouts squared: NaN where a pixel has fewer than
    /// `n` intervals, or everywhere when the lag was not chosen.
    #[must_use]
    pub fn lag_variance_map(&self, lag: u32) -> Vec<f64> {
        let of_pixel = |p| match self.lag_index(lag) {
            Some(index) => self.pixel_lag_variance(p, index),
            None => f64::NAN,
        };
        (0..self.len()).map(of_pixel).collect()
    }

    /// `D(n)`, the mean over `pixels` (all when `None`), each with equal
    /// weight. Standard error: `sd / sqrt(pixels)`; pixels are independent.
    /// The value has the small-sample bias that the module states.
    #[must_use]
    pub fn lag_variance(&self, lag: u32, pixels: Option<&[usize]>) -> Estimate {
        match self.lag_index(lag) {
            Some(index) => self.mean(pixels, |p| self.pixel_lag_variance(p, index)),
            None => Estimate::mean([]),
        }
    }

    /// Growth and constant part of the variance of spike times: per pixel the
    /// least-squares solution over the lags from 4 on (bias included, so the estimate is
    /// unbiased as far as the constant is one), then the mean over `pixels`.
    /// Standard error: `sd / sqrt(pixels)`. Pixels with fewer than two usable
    /// lags are left out.
    #[must_use]
    pub fn decompose(&self, pixels: Option<&[usize]>) -> PhaseNoise {
        let mut found = Vec::new();
        self.each(pixels, |p| found.push(self.pixel_noise(p, SHORTEST_FITTED)));
        let mean = |which: usize| Estimate::mean(found.iter().map(|noise| noise[which]));
        PhaseNoise { per_spike: mean(0), constant: mean(1) }
    }

    /// Growth per spike of one pixel as in [`Self::decompose`], from the lag `shortest` on; NaN with
    /// fewer than two usable lags.
    #[must_use]
    pub fn growth(&self, p: usize, shortest: u32) -> f64 {
        self.pixel_noise(p, shortest)[0]
    }

    /// The map of the growth (`which` 0) or the constant (1) of [`Self::decompose`].
    pub(crate) fn noise_map(&self, which: usize) -> Vec<f64> {
        (0..self.len()).map(|p| self.pixel_noise(p, SHORTEST_FITTED)[which]).collect()
    }

    /// Normal equations of `D(n) = s a_n + q b_n` over the lags of a pixel.
    fn pixel_noise(&self, p: usize, shortest: u32) -> [f64; 2] {
        let (intervals, _) = self.span(p);
        let (mut aa, mut ab, mut bb, mut ad, mut bd) = (0.0, 0.0, 0.0, 0.0, 0.0);
        let mut used = 0;
        let from = self.lags.partition_point(|lag| *lag < shortest);
        for (index, lag) in self.lags.iter().enumerate().skip(from) {
            // Lags near the whole stream have few, dependent terms.
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

    /// [`Self::lag_variance`] with its bias taken out, for the noise found by
    /// [`Self::decompose`] on the same pixels.
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

    /// Autocovariance of a pixel's intervals `apart` (1 or 2) intervals apart:
    /// `1/K sum (x_k - m)(x_(k+apart) - m)`, `K = N - apart`; NaN below that.
    fn pixel_autocovariance(&self, p: usize, apart: usize) -> f64 {
        let (intervals, span) = self.span(p);
        let pixel = &self.pixels[p];
        if !(1..=2).contains(&apart) || intervals as usize <= apart {
            return f64::NAN;
        }
        let wide = |x: u32| i128::from(x);
        // The intervals without the last, and without the first, `apart` ones.
        let early = wide(self.latest[p][2 - apart] - pixel.first[0]);
        let late = wide(self.latest[p][2] - pixel.first[apart]);
        let (all, span, k) = (wide(intervals), wide(span), wide(intervals) - apart as i128);
        let products = i128::from(pixel.products[apart - 1]);
        let numerator = all * all * products - all * span * (early + late) + k * span * span;
        float(numerator) / float(all * all * k)
    }

    /// Autocovariance of intervals 1 or 2 `apart`, mean over `pixels`, in
    /// readouts squared. Standard error: `sd / sqrt(pixels)`. The bias is of
    /// order `V(N)/N^2`: `-s/N` for independent intervals, and `q/N^2` for an
    /// integrator, whose lag-1 value lies near minus half of `D(1)` or below it.
    #[must_use]
    pub fn autocovariance(&self, apart: usize, pixels: Option<&[usize]>) -> Estimate {
        self.mean(pixels, |p| self.pixel_autocovariance(p, apart))
    }

    /// The map of [`Self::autocovariance`].
    #[must_use]
    pub fn autocovariance_map(&self, apart: usize) -> Vec<f64> {
        (0..self.len()).map(|p| self.pixel_autocovariance(p, apart)).collect()
    }
}
