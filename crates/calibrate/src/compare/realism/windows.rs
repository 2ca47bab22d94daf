//! Windows of a recording and their features.

use super::spike_times::{RateFit, SpikeTimes};

/// Upper ends of the classes of interval lengths, divided by the mean interval of the pixel.
const INTERVAL_CLASS_BOUNDS: [f64; 7] = [0.6, 0.8, 0.9, 1.0, 1.1, 1.25, 1.5];

/// Lags of the variance of spike times, in intervals. A lag above 1 is used only if it is at most six tenths of the
/// mean number of intervals in a window.
const FEATURE_LAGS: [usize; 7] = [1, 2, 4, 8, 12, 16, 24];

/// Number of bands of the spectrum of a window's spike totals.
const SPECTRUM_BAND_COUNT: usize = 4;

/// Smallest share of used pixels in a window. A pixel is used if nothing moves around it and if it has a rate.
const MIN_USED_SHARE: f64 = 0.75;

/// Offset that is added to a share before taking the logarithm. The logarithm of a share of 0 is then finite.
const MIN_LOGARITHM_ARGUMENT: f64 = 1e-5;

/// Size of a window.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
pub struct WindowSize {
    /// Side of the square window in pixels.
    pub side: usize,
    /// Duration of the window in readouts.
    pub readouts: usize,
}

impl Default for WindowSize {
    fn default() -> Self {
        Self { side: 32, readouts: 100 }
    }
}

/// One measured window of a recording.
#[derive(Clone, Debug)]
pub(super) struct WindowSample {
    /// Index of the place of the window.
    pub(super) place: usize,
    /// First row of the window.
    pub(super) row: usize,
    /// Mean rate in spikes per readout.
    pub(super) mean_rate: f64,
    /// Features, before the logarithm that [`discriminator_value`] applies to some of them.
    pub(super) values: Vec<f64>,
}

/// Returns the name of each feature, and whether the discriminator uses the logarithm of the feature.
pub(super) fn feature_names(lags: &[usize]) -> Vec<(String, bool)> {
    let mut all = Vec::new();
    let mut from = 0.0;
    for to in INTERVAL_CLASS_BOUNDS {
        all.push((format!("intervals {from} to {to} of the mean"), true));
        from = to;
    }
    all.push((format!("intervals beyond {from} of the mean"), true));
    all.push(("early intervals".to_owned(), true));
    all.push(("late intervals".to_owned(), true));
    all.extend(lags.iter().map(|n| (format!("D({n}), readouts squared"), true)));
    all.extend(lags.iter().map(|n| (format!("D({n}) above the quantization, thresholds squared"), false)));
    all.push(("correlation of one interval with the next".to_owned(), false));
    for pair in ["right", "lower"] {
        all.push((format!("coincidences with the {pair} neighbor"), false));
        all.push((format!("coincidences with the {pair} neighbor's next readout"), false));
    }
    all.push(("variance of row totals over pixels'".to_owned(), true));
    all.push(("variance of column totals over pixels'".to_owned(), true));
    all.push(("variance of totals over pixels'".to_owned(), true));
    all.extend(
        (1..=SPECTRUM_BAND_COUNT)
            .map(|b| (format!("totals' power in band {b} of {SPECTRUM_BAND_COUNT}"), true)),
    );
    all.push(("change from half to half, thresholds squared".to_owned(), true));
    all.push(("neighbors' correlation of that change".to_owned(), false));
    all
}

/// Returns the lags that are usable in windows of this size at the mean rate `rate`.
pub(super) fn usable_lags(window: WindowSize, rate: f64) -> Vec<usize> {
    let max_lag = 0.6 * window.readouts as f64 * rate;
    FEATURE_LAGS.into_iter().filter(|n| *n == 1 || *n as f64 <= max_lag).collect()
}

/// Divides recordings into windows and computes the features of each window.
pub(super) struct WindowSampler<'a> {
    pub(super) window: WindowSize,
    pub(super) lags: &'a [usize],
    /// Whether each pixel is used. The real recording and the simulated recordings use the same pixels.
    pub(super) used_pixels: &'a [bool],
    /// Rows that contain windows.
    pub(super) rows: std::ops::Range<usize>,
}

impl WindowSampler<'_> {
    /// Computes the features of all windows. A place is an area of the sensor, and places are visited in row-major
    /// order. The windows of a place follow each other in time without overlap.
    pub(super) fn samples(&self, times: &SpikeTimes, lines: &[RateFit]) -> Vec<WindowSample> {
        let WindowSize { side, readouts } = self.window;
        let (across, down) = (times.geometry.width() / side, self.rows.len() / side);
        let mut all = Vec::new();
        for place in 0..across * down {
            let (top, left) = (self.rows.start + place / across * side, place % across * side);
            for from in (0..times.readouts / readouts).map(|k| k * readouts) {
                let pixels = WindowPixels {
                    times,
                    lines,
                    used_pixels: self.used_pixels,
                    top,
                    left,
                    side,
                    from,
                    readouts,
                };
                if let Some((rate, values)) = pixels.measure_features(self.lags) {
                    all.push(WindowSample { place, row: top, mean_rate: rate, values });
                }
            }
        }
        all
    }
}

/// The pixels of one window.
struct WindowPixels<'a> {
    times: &'a SpikeTimes,
    lines: &'a [RateFit],
    used_pixels: &'a [bool],
    top: usize,
    left: usize,
    side: usize,
    from: usize,
    readouts: usize,
}

impl WindowPixels<'_> {
    fn pixel_index(&self, row: usize, column: usize) -> usize {
        (self.top + row) * self.times.geometry.width() + self.left + column
    }

    /// Returns whether a pixel is used. Nothing must move around the pixel, and its rate must be high enough for at
    /// least one interval per window.
    fn is_used(&self, p: usize) -> bool {
        let rate = self.lines[p].rate;
        self.used_pixels[p] && rate * self.readouts as f64 >= 1.5 && rate <= 1.0
    }

    fn spikes(&self, p: usize) -> &[u32] {
        self.times.within(p, self.from, self.from + self.readouts)
    }

    fn measure_features(&self, lags: &[usize]) -> Option<(f64, Vec<f64>)> {
        let places = (0..self.side * self.side).map(|i| (i / self.side, i % self.side));
        let all: Vec<(usize, usize, usize)> = places
            .map(|(r, c)| (r, c, self.pixel_index(r, c)))
            .filter(|(_, _, p)| self.is_used(*p))
            .collect();
        if (all.len() as f64) < MIN_USED_SHARE * (self.side * self.side) as f64 {
            return None;
        }
        let rate = all.iter().map(|(_, _, p)| self.lines[*p].rate).sum::<f64>() / all.len() as f64;
        let mut values = self.interval_shares(&all);
        values.extend(self.off_lattice_shares(&all));
        let variances: Vec<[f64; 2]> = lags.iter().map(|n| self.lag_variance(&all, *n)).collect();
        values.extend(variances.iter().map(|v| v[0]));
        values.extend(variances.iter().map(|v| v[1]));
        values.push(self.successive_interval_correlation(&all));
        for (down, right) in [(0, 1), (1, 0)] {
            values.extend([0, 1].map(|later| self.coincidence_correlation(&all, down, right, later)));
        }
        values.extend(self.total_variances(&all));
        values.extend(self.half_changes(&all));
        values.iter().all(|v| v.is_finite()).then_some((rate, values))
    }

    /// Returns the share of the intervals in each class of lengths. Lengths are divided by the mean interval of the pixel.
    fn interval_shares(&self, all: &[(usize, usize, usize)]) -> Vec<f64> {
        let mut interval_counts = vec![0.0; INTERVAL_CLASS_BOUNDS.len() + 1];
        for (_, _, p) in all {
            for pair in self.spikes(*p).windows(2) {
                let relative = f64::from(pair[1] - pair[0]) * self.lines[*p].rate;
                interval_counts[INTERVAL_CLASS_BOUNDS.partition_point(|c| *c < relative)] += 1.0;
            }
        }
        let sum = interval_counts.iter().sum::<f64>();
        interval_counts.iter().map(|n| n / sum).collect()
    }

    /// Returns the share of the intervals that are shorter than the pixel's mean interval rounded down. Also returns
    /// the share of the intervals that are longer than the mean interval rounded up.
    fn off_lattice_shares(&self, all: &[(usize, usize, usize)]) -> [f64; 2] {
        let (mut early, mut late, mut count) = (0.0, 0.0, 0.0);
        for (_, _, p) in all {
            let mean = 1.0 / self.lines[*p].rate;
            for pair in self.spikes(*p).windows(2) {
                let interval = f64::from(pair[1] - pair[0]);
                early += f64::from(u8::from(interval < mean.floor()));
                late += f64::from(u8::from(interval > mean.ceil()));
                count += 1.0;
            }
        }
        [early / count, late / count]
    }

    /// Returns a variance in two units: the variance of the total length of `n` successive intervals about `n` mean
    /// intervals of the pixel.
    ///
    /// The first variance is in readouts squared. The second variance is in thresholds squared, after subtracting the
    /// quantization variance of 1/6 readout squared. The first variance depends on the light, because it depends on the
    /// rate. If the noise is a noise of the charge, the second variance does not depend on the light.
    fn lag_variance(&self, all: &[(usize, usize, usize)], n: usize) -> [f64; 2] {
        let (mut sum, mut above, mut count) = (0.0, 0.0, 0.0);
        for (_, _, p) in all {
            let rate = self.lines[*p].rate;
            for run in self.spikes(*p).windows(n + 1) {
                let square = (f64::from(run[n] - run[0]) - n as f64 / rate).powi(2);
                sum += square;
                above += (square - 1.0 / 6.0) * rate * rate;
                count += 1.0;
            }
        }
        [sum / count, above / count]
    }

    /// Returns the correlation between the deviations of two successive intervals from the mean interval.
    fn successive_interval_correlation(&self, all: &[(usize, usize, usize)]) -> f64 {
        let (mut both, mut square) = (0.0, 0.0);
        for (_, _, p) in all {
            for run in self.spikes(*p).windows(3) {
                let away = |a: u32, b: u32| f64::from(b - a) * self.lines[*p].rate - 1.0;
                let (x, y) = (away(run[0], run[1]), away(run[1], run[2]));
                both += x * y;
                square += (x * x + y * y) / 2.0;
            }
        }
        // If the window is too dim for two successive intervals, the correlation cannot be computed and is set to 0.
        if square > 0.0 { both / square } else { 0.0 }
    }

    /// Returns the correlation between the spikes of a pixel and the spikes of a neighbor `later` readouts later.
    fn coincidence_correlation(
        &self,
        all: &[(usize, usize, usize)],
        down: usize,
        right: usize,
        later: u32,
    ) -> f64 {
        let (mut coincidences, mut expected, mut scale) = (0.0, 0.0, 0.0);
        for (row, column, p) in all.iter().filter(|(r, c, _)| r + down < self.side && c + right < self.side) {
            let q = self.pixel_index(row + down, column + right);
            if !self.is_used(q) {
                continue;
            }
            let (a, b) = (self.spikes(*p), self.spikes(q));
            coincidences += a.iter().filter(|t| b.binary_search(&(**t + later)).is_ok()).count() as f64;
            let readouts = (self.readouts - later as usize) as f64;
            // Rates are computed from spike counts. The errors of fitted rates would correlate neighbors that share light.
            let rate = |s: &[u32]| s.len() as f64 / self.readouts as f64;
            expected += readouts * rate(a) * rate(b);
            scale += readouts * (rate(a) * (1.0 - rate(a)) * rate(b) * (1.0 - rate(b))).sqrt();
        }
        (coincidences - expected) / scale
    }

    /// Returns the variances of the spike totals of rows, of columns and of the window. Each variance is divided by the
    /// variance for independent pixels. The spectrum of the spike totals of the window is appended.
    fn total_variances(&self, all: &[(usize, usize, usize)]) -> Vec<f64> {
        let n = self.readouts;
        let (mut rows, mut columns) = (vec![0.0; self.side * n], vec![0.0; self.side * n]);
        let (mut own_rows, mut own_columns) = (vec![0.0; self.side], vec![0.0; self.side]);
        for (row, column, p) in all {
            let spikes = self.spikes(*p);
            let rate = spikes.len() as f64 / n as f64;
            own_rows[*row] += rate * (1.0 - rate);
            own_columns[*column] += rate * (1.0 - rate);
            for t in spikes {
                let at = *t as usize - self.from;
                rows[row * n + at] += 1.0;
                columns[column * n + at] += 1.0;
            }
        }
        let mut values = vec![variance_ratio(&rows, n, &own_rows), variance_ratio(&columns, n, &own_columns)];
        let totals: Vec<f64> = (0..n).map(|t| (0..self.side).map(|r| rows[r * n + t]).sum()).collect();
        let own_variance = own_rows.iter().sum::<f64>();
        values.push(variance(&totals) / own_variance);
        values.extend(band_powers(&totals).map(|power| power / own_variance));
        values
    }

    /// Let the change of a pixel be its spike count in the second half of a window minus its spike count in the first
    /// half. Returns the variance of the changes of all pixels, and the correlation between the changes of neighbors.
    /// The mean change is subtracted first.
    fn half_changes(&self, all: &[(usize, usize, usize)]) -> [f64; 2] {
        let middle = self.from + self.readouts / 2;
        let change = |p: usize| {
            let spikes = self.spikes(p);
            let early = spikes.partition_point(|t| (*t as usize) < middle) as f64;
            spikes.len() as f64 - 2.0 * early
        };
        let mut map = vec![f64::NAN; self.side * self.side];
        for (row, column, p) in all {
            map[row * self.side + column] = change(*p);
        }
        let mean = all.iter().map(|(r, c, _)| map[r * self.side + c]).sum::<f64>() / all.len() as f64;
        let (mut both, mut pairs, mut square) = (0.0, 0.0_f64, 0.0);
        for (row, column, _) in all {
            let deviation = map[row * self.side + column] - mean;
            square += deviation * deviation;
            for (r, c) in [(*row, column + 1), (row + 1, *column)] {
                let other =
                    if r < self.side && c < self.side { map[r * self.side + c] - mean } else { f64::NAN };
                if other.is_finite() {
                    both += deviation * other;
                    pairs += 1.0;
                }
            }
        }
        let square = square / all.len() as f64;
        let shared = if square > 0.0 && pairs > 0.0 { both / pairs / square } else { 0.0 };
        [square, shared]
    }
}

/// Returns the mean over all rows or columns of a ratio. The ratio is the variance of the spike totals of the row or
/// column, divided by the variance for independent pixels.
fn variance_ratio(lines: &[f64], readouts: usize, own_variances: &[f64]) -> f64 {
    let ratios =
        lines.chunks_exact(readouts).zip(own_variances).filter(|(_, own_variance)| **own_variance > 0.0);
    let count = ratios.clone().count() as f64;
    ratios.map(|(line, own_variance)| variance(line) / own_variance).sum::<f64>() / count
}

fn variance(all: &[f64]) -> f64 {
    let n = all.len() as f64;
    let mean = all.iter().sum::<f64>() / n;
    all.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (n - 1.0)
}

/// Returns the power of `totals` in bands of equal width. The bands cover all frequencies up to half a cycle per
/// readout. If the totals are white noise, the power of every band equals the variance of the totals.
fn band_powers(totals: &[f64]) -> [f64; SPECTRUM_BAND_COUNT] {
    let n = totals.len();
    let mean = totals.iter().sum::<f64>() / n as f64;
    let (mut power, mut count) = ([0.0; SPECTRUM_BAND_COUNT], [0.0_f64; SPECTRUM_BAND_COUNT]);
    let last = n / 2;
    for k in 1..=last {
        let turn = std::f64::consts::TAU * k as f64 / n as f64;
        let (mut x, mut y) = (0.0, 0.0);
        for (t, total) in totals.iter().enumerate() {
            let angle = turn * t as f64;
            x += (total - mean) * angle.cos();
            y += (total - mean) * angle.sin();
        }
        let band = ((k - 1) * SPECTRUM_BAND_COUNT / last).min(SPECTRUM_BAND_COUNT - 1);
        power[band] += (x * x + y * y) / n as f64;
        count[band] += 1.0;
    }
    std::array::from_fn(|b| power[b] / count[b].max(1.0))
}

/// Returns the value that the discriminator uses for a feature.
pub(super) fn discriminator_value(value: f64, logarithm: bool) -> f64 {
    if logarithm { (value.max(0.0) + MIN_LOGARITHM_ARGUMENT).ln() } else { value }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn white_totals_have_their_variance_in_every_band() {
        let mut state = 1_u64;
        let mut draw = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 40) as f64 / (1_u64 << 24) as f64
        };
        let totals: Vec<f64> = (0..4000).map(|_| draw()).collect();
        for power in band_powers(&totals) {
            // Each band is the mean of 500 exponentially distributed values, so its relative standard deviation is 4.5 %.
            assert!((power * 12.0 - 1.0).abs() < 0.2, "{power}");
        }
    }

    #[test]
    fn names_and_values_go_together() {
        let window = WindowSize { side: 8, readouts: 50 };
        let geometry = spikelane::spikes::Geometry::new(8, 8).unwrap();
        // Every pixel fires at every fifth readout. The phase depends on the column.
        let packed: Vec<u8> =
            (0..50).flat_map(|t| [(0..8).map(|c| u8::from((t + c) % 5 == 0) << c).sum::<u8>(); 8]).collect();
        let times = SpikeTimes::from_packed(geometry, &packed).unwrap();
        let lags = usable_lags(window, 0.2);
        assert_eq!(lags, [1, 2, 4]);
        let cutter = WindowSampler { window, lags: &lags, used_pixels: &[true; 64], rows: 0..8 };
        let samples = cutter.samples(&times, &times.fit_rates());
        assert_eq!((samples.len(), samples[0].values.len()), (1, feature_names(&lags).len()));
        // Regular spikes have no variance at any lag. A pixel and its lower neighbor always fire together.
        let at = |name: &str| feature_names(&lags).iter().position(|(n, _)| n == name).unwrap();
        assert!(samples[0].values[at("D(2), readouts squared")] < 1e-20);
        assert!((samples[0].values[at("coincidences with the lower neighbor")] - 1.0).abs() < 1e-9);
    }
}
