//! Spike times about the pixels' own lines, and rates that neighbours share.

use spikelane::{Geometry, Packed};

/// Classes of rate, in spikes per readout.
pub(crate) const CLASSES: [f64; 7] = [0.02, 0.025, 0.03, 0.035, 0.042, 0.055, 0.1];

/// D(1) to D(3).
pub(crate) const LAGS: usize = 3;

/// Pixels of a place's side: what is told apart for errors.
const PLACE: usize = 25;

/// Fewest spikes of a line.
const LEAST: usize = 4;

/// Half the side of the neighbourhood that shares a rate.
const NEAR: isize = 3;

pub(crate) struct Recording {
    geometry: Geometry,
    readouts: usize,
    times: Vec<Vec<f64>>,
}

/// Means over places by class and lag, with their errors.
pub(crate) struct Measured {
    pub(crate) geometry: Geometry,
    pub(crate) places: [usize; CLASSES.len() - 1],
    pub(crate) mean: [[f64; LAGS]; CLASSES.len() - 1],
    pub(crate) error: [[f64; LAGS]; CLASSES.len() - 1],
}

impl Recording {
    pub(crate) fn new(packed: Packed<'_>, readouts: usize) -> Self {
        let geometry = packed.geometry();
        let mut times = vec![Vec::new(); geometry.pixels()];
        for t in 0..readouts {
            let frame = packed.frame(t);
            for (p, times) in times.iter_mut().enumerate() {
                if frame[p / 8] >> (p % 8) & 1 == 1 {
                    times.push(t as f64);
                }
            }
        }
        Self { geometry, readouts, times }
    }

    /// Rates that neighbours share; NaN for a pixel that fires quite otherwise than these (hot, dead).
    pub(crate) fn shared(&self) -> Vec<f64> {
        let (width, height) = (self.geometry.width() as isize, self.geometry.height() as isize);
        let count = |row: isize, col: isize| self.times[(row * width + col) as usize].len() as f64;
        let of = |p: usize| {
            let (row, col) = (p as isize / width, p as isize % width);
            let mut around: Vec<f64> = Vec::new();
            for r in (row - NEAR).max(0)..=(row + NEAR).min(height - 1) {
                for c in (col - NEAR).max(0)..=(col + NEAR).min(width - 1) {
                    around.push(count(r, c));
                }
            }
            around.sort_by(f64::total_cmp);
            // Without hot and dead ones, a twelfth at each end.
            let cut = around.len() / 12;
            let kept = &around[cut..around.len() - cut];
            let mean = kept.iter().sum::<f64>() / kept.len() as f64;
            let own = count(row, col);
            let alike = (own - mean).abs() < 2.0 + 0.5 * mean;
            if alike { mean / self.readouts as f64 } else { f64::NAN }
        };
        (0..self.times.len()).map(of).collect()
    }

    /// D(n) about the pixels' own lines in thresholds squared, less what counting in readouts makes, by the classes of `shared`.
    pub(crate) fn measure(&self, shared: &[f64]) -> Measured {
        let across = self.geometry.width().div_ceil(PLACE);
        let places = across * self.geometry.height().div_ceil(PLACE);
        let classes = CLASSES.len() - 1;
        let mut sums = vec![[[0.0; 2]; LAGS]; classes * places];
        for (p, times) in self.times.iter().enumerate().filter(|(_, t)| t.len() >= LEAST) {
            let rate = shared[p];
            // Not a number compares with nothing.
            let class = CLASSES.iter().filter(|c| **c <= rate).count();
            if class == 0 || class > classes {
                continue;
            }
            let place = p / self.geometry.width() / PLACE * across + p % self.geometry.width() / PLACE;
            let slope = slope(times);
            for n in 1..=LAGS.min(times.len() - 2) {
                for run in times.windows(n + 1) {
                    let away = (run[n] - run[0] - n as f64 * slope) * rate;
                    let sum = &mut sums[(class - 1) * places + place][n - 1];
                    *sum = [sum[0] + away * away, sum[1] + 1.0];
                }
            }
        }
        let mut found = Measured {
            geometry: self.geometry,
            places: [0; CLASSES.len() - 1],
            mean: [[0.0; LAGS]; CLASSES.len() - 1],
            error: [[0.0; LAGS]; CLASSES.len() - 1],
        };
        for c in 0..classes {
            for n in 0..LAGS {
                let here: Vec<[f64; 2]> =
                    sums[c * places..][..places].iter().map(|s| s[n]).filter(|s| s[1] >= 50.0).collect();
                let (square, count) = here.iter().fold((0.0, 0.0), |(a, b), s| (a + s[0], b + s[1]));
                let mean = square / count;
                // Of a ratio of sums over places.
                let scatter = here.iter().map(|s| (s[0] - mean * s[1]).powi(2)).sum::<f64>();
                found.places[c] = here.len();
                found.mean[c][n] = mean;
                found.error[c][n] = scatter.sqrt() / count;
            }
        }
        found
    }
}

fn slope(times: &[f64]) -> f64 {
    let n = times.len() as f64;
    let middle = (n - 1.0) / 2.0;
    let spread = n * (n * n - 1.0) / 12.0;
    times.iter().enumerate().map(|(k, t)| (k as f64 - middle) * t).sum::<f64>() / spread
}

impl Measured {
    /// Logarithm of the Gaussian likelihood of this under `twins`, but for a constant.
    pub(crate) fn likelihood(&self, twins: &[Self]) -> f64 {
        let mut sum = 0.0;
        for c in (0..CLASSES.len() - 1).filter(|c| self.places[*c] > 1) {
            for n in 0..LAGS {
                let all = twins.iter().map(|t| t.mean[c][n]).filter(|m| m.is_finite());
                let count = all.clone().count() as f64;
                let mean = all.clone().sum::<f64>() / count;
                let square = all.map(|m| (m - mean).powi(2)).sum::<f64>() / (count - 1.0);
                let variance = self.error[c][n].powi(2) + square / count;
                if self.places[c] > 4 && variance.is_finite() && variance > 0.0 {
                    sum -= 0.5 * ((self.mean[c][n] - mean).powi(2) / variance + variance.ln());
                }
            }
        }
        sum
    }
}
