//! Second differences of spike times, and rates that neighbours share.

use std::ops::Range;

use spikelane::{Geometry, Packed};

/// Classes of rate, in spikes per readout.
pub(crate) const CLASSES: [f64; 6] = [0.015, 0.025, 0.035, 0.045, 0.055, 0.1];

/// Over one interval and over two.
pub(crate) const LAGS: usize = 2;

/// Pixels of a place's side: what is told apart for errors.
const PLACE: usize = 25;

/// Fewest differences of a place that counts.
const LEAST: f64 = 20.0;

/// Fewest places of a class that counts.
const FEWEST: usize = 5;

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

    /// Variances of second differences about their mean in a place, in thresholds squared, by the classes of `shared`, of the pixels
    /// that are `used`: t(k + 2n) - 2 t(k + n) + t(k). A rate cancels in them, and light that changes evenly is their mean.
    pub(crate) fn measure(&self, shared: &[f64], used: &[bool]) -> Measured {
        let across = self.geometry.width().div_ceil(PLACE);
        let places = across * self.geometry.height().div_ceil(PLACE);
        let classes = CLASSES.len() - 1;
        let mut sums = vec![[[0.0; 3]; LAGS]; classes * places];
        for (p, times) in self.times.iter().enumerate().filter(|(p, _)| used[*p]) {
            let rate = shared[p];
            // Not a number compares with nothing.
            let class = CLASSES.iter().filter(|c| **c <= rate).count();
            if class == 0 || class > classes {
                continue;
            }
            let place = p / self.geometry.width() / PLACE * across + p % self.geometry.width() / PLACE;
            for n in 1..=LAGS {
                for run in times.windows(2 * n + 1) {
                    let away = (run[2 * n] - 2.0 * run[n] + run[0]) * rate;
                    let sum = &mut sums[(class - 1) * places + place][n - 1];
                    *sum = [sum[0] + away * away, sum[1] + 1.0, sum[2] + away];
                }
            }
        }
        let mut found = Measured {
            geometry: self.geometry,
            places: [0; CLASSES.len() - 1],
            mean: [[f64::NAN; LAGS]; CLASSES.len() - 1],
            error: [[f64::NAN; LAGS]; CLASSES.len() - 1],
        };
        for c in 0..classes {
            for n in 0..LAGS {
                let of_place = |s: &[[f64; 3]; LAGS]| [s[n][0] - s[n][2] * s[n][2] / s[n][1], s[n][1] - 1.0];
                let here: Vec<[f64; 2]> =
                    sums[c * places..][..places].iter().map(of_place).filter(|s| s[1] >= LEAST).collect();
                let (square, count) = here.iter().fold((0.0, 0.0), |(a, b), s| (a + s[0], b + s[1]));
                let mean = square / count;
                // Of a ratio of sums over places.
                let scatter = here.iter().map(|s| (s[0] - mean * s[1]).powi(2)).sum::<f64>();
                found.places[c] = found.places[c].max(here.len());
                if here.len() >= FEWEST {
                    found.mean[c][n] = mean;
                    found.error[c][n] = scatter.sqrt() / count;
                }
            }
        }
        found
    }

    /// What a shift shows: correlation of a pixel's change from its first interval to its last with that of the pixel `down` rows below, over
    /// the rows and columns given; where each pixel has noise of its own it is 0, where a grain moves by as many rows it tends to -0.5.
    pub(crate) fn shared_change(&self, rows: Range<usize>, columns: Range<usize>, down: usize) -> f64 {
        let change = |row: usize, column: usize| {
            let times = &self.times[row * self.geometry.width() + column];
            let n = times.len();
            if n < 3 { f64::NAN } else { ((times[1] - times[0]) / (times[n - 1] - times[n - 2])).ln() }
        };
        let all = || rows.clone().flat_map(|r| columns.clone().map(move |c| (r, c)));
        let own: Vec<f64> = all().map(|(r, c)| change(r, c)).filter(|x| x.is_finite()).collect();
        let mean = own.iter().sum::<f64>() / own.len() as f64;
        let square = own.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / own.len() as f64;
        let pairs: Vec<f64> = all()
            .filter(|(r, _)| r + down < rows.end)
            .map(|(r, c)| (change(r, c) - mean) * (change(r + down, c) - mean))
            .filter(|x| x.is_finite())
            .collect();
        pairs.iter().sum::<f64>() / pairs.len() as f64 / square
    }
}

impl Measured {
    /// Logarithm of the Gaussian likelihood of this under `twins`, but for a constant.
    pub(crate) fn likelihood(&self, twins: &[Self]) -> f64 {
        let mut sum = 0.0;
        for c in 0..CLASSES.len() - 1 {
            for n in 0..LAGS {
                let all = twins.iter().map(|t| t.mean[c][n]).filter(|m| m.is_finite());
                let count = all.clone().count() as f64;
                let mean = all.clone().sum::<f64>() / count;
                let square = all.map(|m| (m - mean).powi(2)).sum::<f64>() / (count - 1.0);
                let variance = self.error[c][n].powi(2) + square / count;
                // A class or a lag of too few places is not a number.
                if variance.is_finite() && variance > 0.0 {
                    sum -= 0.5 * ((self.mean[c][n] - mean).powi(2) / variance + variance.ln());
                }
            }
        }
        sum
    }
}
