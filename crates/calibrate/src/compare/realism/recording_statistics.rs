//! Statistics of whole real and simulated recordings.

use serde::Serialize;

use super::spike_times::{RateFit, SpikeTimes};
use spikelane::effects::Camera;
use spikelane::error::Result;
use spikelane::unstable::draws::Seeds;

/// Lags, in intervals, at which the variance of spike times is listed.
pub(super) const VARIANCE_LAGS: [usize; 4] = [1, 8, 16, 32];

/// Quantiles at which the dark rate is listed, as shares of the pixels. The last quantile is the maximum.
pub(super) const DARK_QUANTILES: [f64; 5] = [0.01, 0.5, 0.99, 0.9999, 1.0];

/// Statistics of the recordings of one camera.
#[derive(Clone, Debug, Serialize)]
pub struct RecordingStatistics {
    /// Name of the camera, or `real` for the real recording.
    pub name: String,
    /// Variance of the total length of `n` successive intervals about `n` times the pixel's mean interval, for `n` of 1,
    /// 8, 16 and 32. The unit is readouts squared.
    ///
    /// The value is the mean over the pixels with more than `1.5 n` spikes. `None` if no pixel has so many spikes.
    pub lag_variance: [Option<f64>; VARIANCE_LAGS.len()],
    /// Share of the intervals that are shorter than the pixel's mean interval rounded down.
    pub early_interval_share: f64,
    /// Share of the intervals that are longer than the pixel's mean interval rounded up.
    pub late_interval_share: f64,
    /// Quantiles of the dark rates in spikes per readout. 1 %, 50 %, 99 %, 99.99 % and 100 % of the pixels do not exceed
    /// them. `None` without a map of dark rates.
    pub dark_rate_quantiles: Option<[f64; DARK_QUANTILES.len()]>,
}

impl RecordingStatistics {
    /// Returns the mean statistics of the recordings of one camera. Only pixels whose entry of `used` is true count.
    pub(super) fn from_recordings(
        name: &str,
        recordings: &[SpikeTimes],
        used: &[bool],
        dark: Option<[f64; DARK_QUANTILES.len()]>,
    ) -> Self {
        let all: Vec<[f64; VARIANCE_LAGS.len() + 2]> =
            recordings.iter().map(|times| measure(times, &times.fit_rates(), used)).collect();
        let mean = |i: usize| all.iter().map(|m| m[i]).sum::<f64>() / all.len() as f64;
        Self {
            name: name.to_owned(),
            lag_variance: std::array::from_fn(|i| Some(mean(i)).filter(|d| d.is_finite())),
            early_interval_share: mean(VARIANCE_LAGS.len()),
            late_interval_share: mean(VARIANCE_LAGS.len() + 1),
            dark_rate_quantiles: dark,
        }
    }

    /// Returns the statistics as a row of a text table.
    #[must_use]
    pub fn table_row(&self) -> String {
        let d: String = self.lag_variance.iter().map(|d| format!("{:>8}", format_variance(*d))).collect();
        let flips =
            format!("{:>8.0}{:>8.0}", 1e6 * self.early_interval_share, 1e6 * self.late_interval_share);
        let dark = self.dark_rate_quantiles.iter().flatten().map(|r| format!("{r:>8.4}")).collect::<String>();
        format!("{:<16}{d}{flips}{dark}", self.name)
    }

    /// Returns the header for a text table of such rows.
    #[must_use]
    pub fn table_header(&self) -> String {
        let d: String = VARIANCE_LAGS.iter().map(|n| format!("{:>8}", format!("D({n})"))).collect();
        let dark = if self.dark_rate_quantiles.is_some() {
            "   dark rates: 1 %, median, 99 %, 99.99 %, highest"
        } else {
            ""
        };
        format!("{:<16}{d}{:>8}{:>8}{dark}", "", "early", "late")
    }
}

/// Returns a variance as text, or `none`.
pub(super) fn format_variance(d: Option<f64>) -> String {
    d.map_or("none".to_owned(), |d| format!("{d:.4}"))
}

fn measure(times: &SpikeTimes, lines: &[RateFit], used: &[bool]) -> [f64; VARIANCE_LAGS.len() + 2] {
    let mut sums = [[0.0; 2]; VARIANCE_LAGS.len() + 2];
    for p in (0..lines.len()).filter(|p| used[*p] && lines[*p].rate.is_finite() && lines[*p].rate <= 1.0) {
        let (spikes, mean) = (times.pixel_times(p), 1.0 / lines[p].rate);
        for (sum, n) in sums
            .iter_mut()
            .zip(VARIANCE_LAGS)
            .filter(|(_, n)| 2 * spikes.len() > 3 * n && spikes.len() > n + 1)
        {
            let square = |run: &[u32]| (f64::from(run[n] - run[0]) - n as f64 * mean).powi(2);
            sum[0] += spikes.windows(n + 1).map(square).sum::<f64>() / (spikes.len() - n) as f64;
            sum[1] += 1.0;
        }
        for pair in spikes.windows(2) {
            let interval = f64::from(pair[1] - pair[0]);
            sums[VARIANCE_LAGS.len()][0] += f64::from(u8::from(interval < mean.floor()));
            sums[VARIANCE_LAGS.len() + 1][0] += f64::from(u8::from(interval > mean.ceil()));
            sums[VARIANCE_LAGS.len()][1] += 1.0;
            sums[VARIANCE_LAGS.len() + 1][1] += 1.0;
        }
    }
    // If there are no intervals, the shares are 0 and the variances are NaN. The caller omits NaN.
    let mean = |i: usize| {
        if i >= VARIANCE_LAGS.len() && sums[i][1] == 0.0 { 0.0 } else { sums[i][0] / sums[i][1] }
    };
    std::array::from_fn(mean)
}

/// Returns the [`DARK_QUANTILES`] of the dark rates of a camera, including the camera's fixed pattern.
pub(super) fn dark_rate_quantiles(camera: &Camera, seeds: Seeds) -> Result<[f64; DARK_QUANTILES.len()]> {
    let model = camera.model(seeds)?;
    let rate = |p: usize| {
        let law = model.law(p);
        law.dark / law.threshold
    };
    Ok(quantiles((0..model.circuit.pixels()).map(rate).collect()))
}

/// Returns the [`DARK_QUANTILES`] of `values`.
pub(super) fn quantiles(mut values: Vec<f64>) -> [f64; DARK_QUANTILES.len()] {
    values.sort_by(f64::total_cmp);
    let last = values.len().saturating_sub(1);
    DARK_QUANTILES.map(|share| {
        values.get(((share * last as f64).round() as usize).min(last)).copied().unwrap_or(f64::NAN)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use spikelane::spikes::Geometry;

    #[test]
    fn regular_spikes_have_no_variance_and_one_that_comes_late_is_counted() {
        let geometry = Geometry::new(8, 1).unwrap();
        // Both pixels fire at every fifth readout, but one spike of the second pixel is a readout late.
        let bit = |t: usize, late: usize| u8::from(t.is_multiple_of(5) && t != 50 || t == 50 + late);
        let packed: Vec<u8> = (0..100).map(|t| bit(t, 0) | bit(t, 1) << 1).collect();
        let times = SpikeTimes::from_packed(geometry, &packed).unwrap();
        let only = |p: usize| (0..8).map(|q| q == p).collect::<Vec<_>>();
        let first =
            RecordingStatistics::from_recordings("first", std::slice::from_ref(&times), &only(0), None);
        assert!(
            first.lag_variance[0].unwrap() < 1e-20
                && first.early_interval_share == 0.0
                && first.late_interval_share == 0.0,
            "{first:?}"
        );
        let second =
            RecordingStatistics::from_recordings("second", std::slice::from_ref(&times), &only(1), None);
        // Because of the late spike, one of nineteen intervals has six readouts and the next interval has four. The slope of
        // the fitted line is close to five.
        assert!((second.lag_variance[0].unwrap() - 2.0 / 19.0).abs() < 0.01, "{second:?}");
        assert!(second.early_interval_share + second.late_interval_share >= 1.0 / 19.0, "{second:?}");
    }

    #[test]
    fn quantiles_are_values_of_the_pixels() {
        let quantile_values = quantiles((0..10_001).rev().map(f64::from).collect());
        assert_eq!(quantile_values, [100.0, 5000.0, 9900.0, 9999.0, 10_000.0]);
    }
}
