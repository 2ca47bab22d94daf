//! Interval statistics computed from lists of spike times by their definitions.

use super::{Stream, mean};
use spikelane_measure::{MeasureOptions, Statistics};

fn lengths(times: &[u32]) -> Vec<u32> {
    times.windows(2).map(|w| w[1] - w[0]).collect()
}

fn close(actual: f64, expected: f64, what: &str) {
    let same =
        (actual.is_nan() && expected.is_nan()) || (actual - expected).abs() <= 1e-9 * (1.0 + expected.abs());
    assert!(same, "{what}: found {actual}, expected {expected}");
}

/// Returns `D(n)` of a pixel for `n = lag`, computed by its definition.
pub(crate) fn lag_variance(times: &[u32], lag: usize) -> f64 {
    if times.len() <= lag {
        return f64::NAN;
    }
    let m = f64::from(times[times.len() - 1] - times[0]) / (times.len() - 1) as f64;
    let spans = times.windows(lag + 1).map(|w| f64::from(w[lag] - w[0]));
    let squares: Vec<f64> = spans.map(|d| (d - lag as f64 * m).powi(2)).collect();
    mean(&squares)
}

fn autocovariance(x: &[u32], lag: usize) -> f64 {
    if x.len() <= lag {
        return f64::NAN;
    }
    let m = x.iter().sum::<u32>() as f64 / x.len() as f64;
    let product = |w: &[u32]| (f64::from(w[0]) - m) * (f64::from(w[lag]) - m);
    mean(&x.windows(lag + 1).map(product).collect::<Vec<_>>())
}

impl Stream {
    /// Compares all interval statistics with their definitions.
    pub(crate) fn check_intervals(&self, statistics: &Statistics, options: &MeasureOptions) {
        let intervals = statistics.intervals.as_ref().unwrap();
        let maps: Vec<Vec<f64>> =
            intervals.lags().iter().map(|lag| intervals.lag_variance_map(*lag)).collect();
        let autos = [1, 2].map(|lag| intervals.autocovariance_map(lag));
        let mut histogram = vec![0; options.longest_bin as usize + 2];
        for p in 0..self.pixels() {
            let times = self.times(p);
            let x = lengths(&times);
            self.check_pixel(&intervals.pixel(p), &x);
            for (lag, map) in intervals.lags().iter().zip(&maps) {
                close(map[p], lag_variance(&times, *lag as usize), "D(n)");
            }
            for lag in [1, 2] {
                close(autos[lag - 1][p], autocovariance(&x, lag), "autocovariance");
            }
            for x in x {
                histogram[x.min(options.longest_bin + 1) as usize] += 1;
            }
        }
        assert_eq!(intervals.histogram().counts(), histogram);
    }

    fn check_pixel(&self, pixel: &spikelane_measure::PixelIntervals, x: &[u32]) {
        let n = x.len();
        assert_eq!(pixel.intervals as usize, n);
        let sum: u64 = x.iter().map(|x| u64::from(*x)).sum();
        assert_eq!(pixel.sum, sum);
        assert_eq!(pixel.sum_squares, x.iter().map(|x| u64::from(*x).pow(2)).sum::<u64>());
        let extremes = x.iter().min().copied().zip(x.iter().max().copied());
        assert_eq!(pixel.extremes, extremes);
        let judged = (n >= 16).then(|| f64::from(x[..16].iter().sum::<u32>()) / 16.0);
        let expected = judged.map(|m| {
            // The comparison uses integers, because 0.6 m has no exact floating-point value.
            let sixteen = (m * 16.0) as u32;
            let short = x.iter().filter(|x| **x * 160 < 6 * sixteen).count() as u32;
            let long = x.iter().filter(|x| **x * 160 > 16 * sixteen).count() as u32;
            (short, long)
        });
        assert_eq!(pixel.short_and_long_counts, expected);
        if let Some(reference) = judged {
            let (floor, ceil) = (sum / n as u64, sum.div_ceil(n as u64));
            let off = x.iter().filter(|x| !(floor..=ceil).contains(&u64::from(**x))).count();
            if let Some(off_lattice) = pixel.off_lattice_count {
                assert_eq!(off_lattice as usize, off);
            } else {
                // The count may be absent only if the mean interval differs from the reference mean by more than 1.4
                // readouts.
                assert!((sum as f64 / n as f64 - reference).abs() > 1.4);
            }
        } else {
            assert_eq!(pixel.off_lattice_count, None);
        }
    }
}
