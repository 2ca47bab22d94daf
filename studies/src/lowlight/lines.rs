//! Second differences of spike times, and rates of pixel neighborhoods.

use std::ops::Range;

use spikelane::{Geometry, SpikeFramesRef};

/// Bounds of the rate classes in spikes per readout.
pub(crate) const RATE_CLASS_BOUNDS: [f64; 6] = [0.015, 0.025, 0.035, 0.045, 0.055, 0.1];

/// Number of lags. Second differences of spike times use lags of one and of two intervals.
pub(crate) const LAG_COUNT: usize = 2;

/// The image is divided into squares, called places. This is the side of a place in pixels. Errors are computed from
/// the scatter between places.
const PLACE_SIDE_PX: usize = 25;

/// Minimum number of differences in a place. Places with fewer differences are ignored.
const MIN_DIFFERENCES: f64 = 20.0;

/// Minimum number of places with pixels of a rate class. Rate classes with fewer places are ignored.
const MIN_PLACES: usize = 5;

/// Distance in pixels from a pixel to each side of the square neighborhood whose rate is averaged.
const NEIGHBORHOOD_RADIUS_PX: isize = 3;

pub(crate) struct Recording {
    geometry: Geometry,
    readouts: usize,
    times: Vec<Vec<f64>>,
}

/// Mean variances over places for each rate class and lag, and their errors.
pub(crate) struct LagVariances {
    pub(crate) geometry: Geometry,
    pub(crate) places: [usize; RATE_CLASS_BOUNDS.len() - 1],
    pub(crate) mean: [[f64; LAG_COUNT]; RATE_CLASS_BOUNDS.len() - 1],
    pub(crate) error: [[f64; LAG_COUNT]; RATE_CLASS_BOUNDS.len() - 1],
}

impl Recording {
    pub(crate) fn new(packed: SpikeFramesRef<'_>, readouts: usize) -> Self {
        let geometry = packed.geometry();
        let mut times = vec![Vec::new(); geometry.pixels()];
        for t in 0..readouts {
            let frame = packed.frame(t).as_bytes();
            for (p, times) in times.iter_mut().enumerate() {
                if frame[p / 8] >> (p % 8) & 1 == 1 {
                    times.push(t as f64);
                }
            }
        }
        Self { geometry, readouts, times }
    }

    /// Returns the mean rate of each pixel's neighborhood. It is NaN if the rate of the pixel itself is very different, as
    /// for a hot or dead pixel.
    pub(crate) fn neighborhood_rates(&self) -> Vec<f64> {
        let (width, height) = (self.geometry.width() as isize, self.geometry.height() as isize);
        let count = |row: isize, col: isize| self.times[(row * width + col) as usize].len() as f64;
        let local_mean = |p: usize| {
            let (row, col) = (p as isize / width, p as isize % width);
            let mut around: Vec<f64> = Vec::new();
            for r in (row - NEIGHBORHOOD_RADIUS_PX).max(0)..=(row + NEIGHBORHOOD_RADIUS_PX).min(height - 1) {
                for c in (col - NEIGHBORHOOD_RADIUS_PX).max(0)..=(col + NEIGHBORHOOD_RADIUS_PX).min(width - 1)
                {
                    around.push(count(r, c));
                }
            }
            around.sort_by(f64::total_cmp);
            // Removes the lowest twelfth and the highest twelfth of the counts, to exclude hot and dead pixels.
            let cut = around.len() / 12;
            let trimmed = &around[cut..around.len() - cut];
            let mean = trimmed.iter().sum::<f64>() / trimmed.len() as f64;
            let spikes = count(row, col);
            let alike = (spikes - mean).abs() < 2.0 + 0.5 * mean;
            if alike { mean / self.readouts as f64 } else { f64::NAN }
        };
        (0..self.times.len()).map(local_mean).collect()
    }

    /// Returns the variances of second differences of spike times, in thresholds squared, for each rate class and lag.
    /// A variance is relative to the mean second difference of a place.
    ///
    /// Let t(k) be the time of spike k, and n the lag. A second difference is t(k + 2n) - 2 t(k + n) + t(k). If the
    /// rate is constant, the mean second difference is 0. If the rate changes with time, the mean is not 0. The rates
    /// `shared` determine the class of each pixel. Only pixels whose entry of `used` is true count.
    pub(crate) fn measure(&self, shared: &[f64], used: &[bool]) -> LagVariances {
        let across = self.geometry.width().div_ceil(PLACE_SIDE_PX);
        let places = across * self.geometry.height().div_ceil(PLACE_SIDE_PX);
        let classes = RATE_CLASS_BOUNDS.len() - 1;
        let mut sums = vec![[[0.0; 3]; LAG_COUNT]; classes * places];
        for (p, times) in self.times.iter().enumerate().filter(|(p, _)| used[*p]) {
            let rate = shared[p];
            // Comparisons with NaN are false, so a pixel with the rate NaN is in no class.
            let class = RATE_CLASS_BOUNDS.iter().filter(|c| **c <= rate).count();
            if class == 0 || class > classes {
                continue;
            }
            let place = p / self.geometry.width() / PLACE_SIDE_PX * across
                + p % self.geometry.width() / PLACE_SIDE_PX;
            for n in 1..=LAG_COUNT {
                for run in times.windows(2 * n + 1) {
                    let away = (run[2 * n] - 2.0 * run[n] + run[0]) * rate;
                    let sum = &mut sums[(class - 1) * places + place][n - 1];
                    *sum = [sum[0] + away * away, sum[1] + 1.0, sum[2] + away];
                }
            }
        }
        let mut variances = LagVariances {
            geometry: self.geometry,
            places: [0; RATE_CLASS_BOUNDS.len() - 1],
            mean: [[f64::NAN; LAG_COUNT]; RATE_CLASS_BOUNDS.len() - 1],
            error: [[f64::NAN; LAG_COUNT]; RATE_CLASS_BOUNDS.len() - 1],
        };
        for c in 0..classes {
            for n in 0..LAG_COUNT {
                let of_place =
                    |s: &[[f64; 3]; LAG_COUNT]| [s[n][0] - s[n][2] * s[n][2] / s[n][1], s[n][1] - 1.0];
                let here: Vec<[f64; 2]> = sums[c * places..][..places]
                    .iter()
                    .map(of_place)
                    .filter(|s| s[1] >= MIN_DIFFERENCES)
                    .collect();
                let (square, count) = here.iter().fold((0.0, 0.0), |(a, b), s| (a + s[0], b + s[1]));
                let mean = square / count;
                // The error is the standard error of a ratio of sums over places.
                let scatter = here.iter().map(|s| (s[0] - mean * s[1]).powi(2)).sum::<f64>();
                variances.places[c] = variances.places[c].max(here.len());
                if here.len() >= MIN_PLACES {
                    variances.mean[c][n] = mean;
                    variances.error[c][n] = scatter.sqrt() / count;
                }
            }
        }
        variances
    }

    /// Returns the correlation between the change of a pixel and the change of the pixel `down` rows below it. Only
    /// pixels in `rows` and `columns` count.
    ///
    /// The change of a pixel is the logarithm of its first interval divided by its last interval. If each pixel has
    /// independent noise, the correlation of the changes is 0. If a grain pattern moves by `down` rows, the correlation
    /// tends to -0.5.
    pub(crate) fn change_correlation(&self, rows: Range<usize>, columns: Range<usize>, down: usize) -> f64 {
        let change = |row: usize, column: usize| {
            let times = &self.times[row * self.geometry.width() + column];
            let n = times.len();
            if n < 3 { f64::NAN } else { ((times[1] - times[0]) / (times[n - 1] - times[n - 2])).ln() }
        };
        let all = || rows.clone().flat_map(|r| columns.clone().map(move |c| (r, c)));
        let changes: Vec<f64> = all().map(|(r, c)| change(r, c)).filter(|x| x.is_finite()).collect();
        let mean = changes.iter().sum::<f64>() / changes.len() as f64;
        let square = changes.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / changes.len() as f64;
        let pairs: Vec<f64> = all()
            .filter(|(r, _)| r + down < rows.end)
            .map(|(r, c)| (change(r, c) - mean) * (change(r + down, c) - mean))
            .filter(|x| x.is_finite())
            .collect();
        pairs.iter().sum::<f64>() / pairs.len() as f64 / square
    }
}

impl LagVariances {
    /// Returns the log likelihood of these variances, up to a constant. It assumes that the variances are normally
    /// distributed, with the mean and spread of `twins`.
    pub(crate) fn likelihood(&self, twins: &[Self]) -> f64 {
        let mut sum = 0.0;
        for c in 0..RATE_CLASS_BOUNDS.len() - 1 {
            for n in 0..LAG_COUNT {
                let all = twins.iter().map(|t| t.mean[c][n]).filter(|m| m.is_finite());
                let count = all.clone().count() as f64;
                let mean = all.clone().sum::<f64>() / count;
                let square = all.map(|m| (m - mean).powi(2)).sum::<f64>() / (count - 1.0);
                let variance = self.error[c][n].powi(2) + square / count;
                // If a class or lag has too few places, its variance is NaN.
                if variance.is_finite() && variance > 0.0 {
                    sum -= 0.5 * ((self.mean[c][n] - mean).powi(2) / variance + variance.ln());
                }
            }
        }
        sum
    }
}
