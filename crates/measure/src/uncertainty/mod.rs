//! Statistics of a recording with two kinds of errors.
//!
//! The recording error and the sensor error are standard deviations. The interval from the value minus two errors to
//! the value plus two errors covers the truth in 95 of 100 cases. If an error is estimated from few samples, it is
//! widened with Student's distribution.
//! * The recording error is the standard deviation between recordings of the same scene and length by the same sensor.
//! * The sensor error is the standard deviation between sensors of the same kind. It includes the pattern and the noise
//!   of each sensor.
//!
//! `docs/reference/measure.md` defines the errors. `docs/why/measure-coverage.md` lists how often the errors cover the
//! truth.

mod clusters;
mod measured_recording;
mod measurement_report;
mod pattern;
mod quantity;
mod scatter;
mod scene_motion;
mod totals;

use crate::statistics::statistics_with_summary;
use crate::{Estimate, NeighborPair, Statistic, Summary, summarize};
use spikelane::error::Result;
use spikelane::unstable::threads;

use clusters::{NORMAL_QUANTILE_975, clustered_variance, widen_error};
pub use measured_recording::{MeasuredRecording, RecordingAccumulator};
pub use measurement_report::MeasurementReport;
use pattern::{PATTERN_KEYS, PatternStatistic, SPREAD_COUNT, pattern_statistics};
use quantity::Quantity;
pub use scene_motion::SceneMotion;
pub use scene_motion::detect_motion;
pub(crate) use totals::variance_error;

/// Explanation of the errors for the head of a report.
pub const ERROR_MEANING: &str = "First +-: standard deviation between recordings of the same sensor, scene and length (<=: upper limit). Second +-: standard deviation between sensors of this kind, where this deviation differs from the first. A range of two standard deviations around the value covers about 95 % of the cases.";

/// Quantile 0.95 of the normal distribution, for one-sided limits.
const ONE_SIDED_QUANTILE_95: f64 = 1.645;

/// A statistic of a recording with its errors. A value that was not determined is absent.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
#[non_exhaustive]
pub struct ReportedStatistic {
    /// Short name, as in [`crate::statistics()`].
    pub key: String,
    /// Description with the unit.
    pub description: String,
    /// The value. Absent if nothing was measured, or if only [`Self::upper_limit`] is known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub value: Option<f64>,
    /// Upper limit of a value that may be 0, with 95 % confidence.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub upper_limit: Option<f64>,
    /// Standard deviation between recordings by this sensor.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub recording_error: Option<f64>,
    /// Whether the recording error is only an upper bound. It is a bound if the halves of the recording are too short
    /// for a comparison.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub recording_error_is_bound: bool,
    /// Standard deviation between sensors of this kind.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sensor_error: Option<f64>,
    /// Number of samples (pixels, pairs, rows, readouts).
    pub samples: usize,
}

impl ReportedStatistic {
    fn new(key: &str, words: &str, value: f64, samples: usize) -> Self {
        Self {
            key: key.to_owned(),
            description: words.to_owned(),
            value: Some(value).filter(|v| v.is_finite()),
            upper_limit: None,
            recording_error: None,
            recording_error_is_bound: false,
            sensor_error: None,
            samples,
        }
    }

    /// Sets the recording error and the sensor error. An error that is not finite is omitted. If the value is absent,
    /// both errors are omitted.
    fn with_errors(mut self, recording: f64, sensor: f64) -> Self {
        let finite = |e: f64| Some(e).filter(|e| e.is_finite() && self.value.is_some());
        (self.recording_error, self.sensor_error) = (finite(recording), finite(sensor));
        self
    }
}

impl MeasuredRecording {
    /// Returns every statistic of a recording of a static scene, with its errors.
    ///
    /// # Errors
    /// Those of [`summarize`].
    pub fn reported_statistics(&self) -> Result<Vec<ReportedStatistic>> {
        Ok(self.report_statistics(&summarize(&self.statistics)?))
    }

    fn report_statistics(&self, summary: &Summary) -> Vec<ReportedStatistic> {
        let mut rates = self.statistics.counts.as_ref().map(|c| c.rate_by_time()).unwrap_or_default();
        let d = &summary.defects;
        for p in [&d.dead, &d.stuck, &d.hot, &d.weak].into_iter().flatten() {
            rates[*p] = f64::NAN;
        }
        let finite = rates.iter().filter(|r| r.is_finite()).count();
        let temporal = summary.temporal_rate_sd.powi(2);
        let noise = self.scatter.sample(Quantity::Signal, finite);
        let width = self.statistics.geometry.width();
        let of_patterns = || match finite {
            0..2 => Vec::new(),
            _ => pattern_statistics(&rates, width, if temporal.is_finite() { temporal } else { 0.0 }, &noise),
        };
        let (found, all) = threads::join(of_patterns, || statistics_with_summary(summary, &self.statistics));
        let quantities = Quantity::all(self.statistics.intervals.as_ref().map_or(&[1], |i| i.lags()));
        let one = |named: Statistic| {
            let (key, words, e) = (named.key.as_str(), named.description.as_str(), named.estimate);
            if let Some(i) = PATTERN_KEYS.iter().position(|k| *k == key) {
                let nothing =
                    PatternStatistic { value: f64::NAN, recording_error: f64::NAN, sensor_error: f64::NAN };
                // `least` is the sampling error of the temporal variance. The temporal variance is subtracted from the
                // variance of the pattern.
                let least = temporal * (2.0 / e.samples.max(1) as f64).sqrt();
                return pattern_statistic(named.clone(), i, *found.get(i).unwrap_or(&nothing), least);
            }
            match quantities.iter().find(|q| q.key() == key) {
                Some(quantity) => self.pixel_statistic(*quantity, words, e, &rates),
                None => self.readout_statistic(key, words, e),
            }
        };
        threads::map(all, one)
    }

    /// Returns whether the scene moved between the halves of the recording.
    #[must_use]
    pub fn scene_motion(&self) -> SceneMotion {
        // A rate computed from the spike times of n readouts has the error f sqrt(1/6) / n. The difference of two such rates
        // has the error f sqrt(1/3) / n.
        let rate = self.statistics.counts.as_ref().map_or(0.0, |c| quantity::mean(&c.rate()));
        let half = scatter::half_readouts(self.statistics.readouts as usize).max(1);
        let sd = rate / half as f64 / 3.0_f64.sqrt();
        scene_motion::detect_motion(&self.scatter.rates, self.statistics.geometry.width(), sd, half)
    }

    /// Returns the report of a statistic that is a mean or a share over pixels. For [`Quantity::Signal`], only pixels
    /// with a finite entry in `rates` are included.
    fn pixel_statistic(
        &self,
        quantity: Quantity,
        words: &str,
        e: Estimate,
        rates: &[f64],
    ) -> ReportedStatistic {
        let (mut map, _) = quantity.pixel_shares(&self.statistics, false);
        if quantity == Quantity::Signal {
            map.iter_mut().zip(rates).filter(|(_, r)| !r.is_finite()).for_each(|(x, _)| *x = f64::NAN);
        }
        let pixels = map.iter().filter(|x| x.is_finite()).count();
        let reported = ReportedStatistic::new(&quantity.key(), words, e.value, pixels);
        let shares =
            matches!(quantity, Quantity::OffLattice | Quantity::ShortIntervals | Quantity::LongIntervals);
        if shares && e.value == 0.0 {
            return self.zero_limit(reported);
        }
        let sensor = clustered_variance(&map, self.statistics.geometry.width())
            .map_or(f64::NAN, |c| widen_error(c.variance.sqrt() / pixels as f64, c.degrees_of_freedom));
        let recording = match quantity {
            Quantity::MeanRate => self.count_rate_error(pixels, e.value),
            _ => self.scatter.error(quantity, pixels),
        };
        match recording {
            // A statistic differs between sensors because of recording noise and because of the pattern.
            Some(recording) => reported.with_errors(recording, sensor.max(recording)),
            None => {
                ReportedStatistic { recording_error_is_bound: true, ..reported.with_errors(sensor, sensor) }
            }
        }
    }

    /// Returns the error of the mean rate computed from counts. It combines the error of the rate computed from spike
    /// times with the counting error at both ends of the recording.
    ///
    /// The count of a pixel that fires at regular intervals misses a fraction of a spike at each end of the recording.
    /// The variance of the two fractions is `1/6` in total. The error of the rate `f` computed from spike times already
    /// includes `f^2 / 6` of this variance. The difference between the halves of the recording does not show the
    /// counting error. The boundary between the halves adds to one half the fraction that it removes from the other
    /// half.
    fn count_rate_error(&self, pixels: usize, rate: f64) -> Option<f64> {
        let timed = self.scatter.error(Quantity::Signal, pixels)?;
        let readouts = f64::from(self.statistics.readouts);
        let ends = (1.0 - rate * rate).max(0.0) / (6.0 * readouts * readouts * pixels as f64);
        Some(timed.hypot(ends.sqrt()))
    }

    /// Returns the upper limit of the share of a kind of interval that never occurred. The limit is 3 divided by the number
    /// of intervals, because 3 is the 95 % limit of a Poisson count of 0.
    fn zero_limit(&self, reported: ReportedStatistic) -> ReportedStatistic {
        let total = self.statistics.intervals.as_ref().map_or(0, |i| i.histogram().total());
        ReportedStatistic {
            value: None,
            upper_limit: (total > 0).then(|| (3.0 / total as f64).min(1.0)),
            ..reported
        }
    }

    /// Returns the report of a statistic of whole readouts or of pixel pairs. The report has only a recording error.
    /// For pixel pairs, the phases are independent in every recording, so recordings scatter as much as sensors.
    fn readout_statistic(&self, key: &str, words: &str, e: Estimate) -> ReportedStatistic {
        let reported = ReportedStatistic::new(key, words, e.value, e.samples);
        let pair = NeighborPair::ALL.into_iter().find(|p| p.key() == key);
        if let (Some(pair), Some(counts)) = (pair, &self.statistics.counts) {
            let map = counts.correlation_map(pair);
            let n = map.iter().filter(|x| x.is_finite()).count() as f64;
            let error = clustered_variance(&map, self.statistics.geometry.width())
                .map_or(f64::NAN, |c| widen_error(c.variance.sqrt() / n, c.degrees_of_freedom));
            return reported.with_errors(error, f64::NAN);
        }
        match key {
            // The error of the total variance already accounts for the correlation of readouts.
            "total-variance" => reported.with_errors(e.error, f64::NAN),
            _ => reported.with_errors(widen_error(e.error, e.samples.saturating_sub(1) as f64), f64::NAN),
        }
    }
}

/// Returns the report of a statistic of the pattern.
///
/// For a spread (a standard deviation), `pattern` contains the square of the spread. The error of this square is at
/// least `error_floor`. If a spread is not significantly above 0, the report contains only an upper limit.
fn pattern_statistic(
    statistic: Statistic,
    i: usize,
    pattern: PatternStatistic,
    error_floor: f64,
) -> ReportedStatistic {
    let (key, words, samples) =
        (statistic.key.as_str(), statistic.description.as_str(), statistic.estimate.samples);
    if i >= SPREAD_COUNT {
        let reported = ReportedStatistic::new(key, words, pattern.value, samples);
        return reported
            .with_errors(pattern.recording_error, pattern.sensor_error.max(pattern.recording_error));
    }
    let reported = ReportedStatistic::new(key, words, pattern.value.max(0.0).sqrt(), samples);
    if !pattern.value.is_finite() || !pattern.sensor_error.is_finite() {
        return ReportedStatistic { value: None, ..reported };
    }
    let also = |e: f64| if e.is_finite() { e } else { 0.0 };
    let sensor = pattern.sensor_error.hypot(also(pattern.recording_error)).hypot(also(error_floor));
    if pattern.value <= NORMAL_QUANTILE_975 * sensor {
        let below = (pattern.value.max(0.0) + ONE_SIDED_QUANTILE_95 * sensor).sqrt();
        return ReportedStatistic { value: None, upper_limit: Some(below).filter(|b| *b > 0.0), ..reported };
    }
    let slope = 2.0 * pattern.value.sqrt();
    reported.with_errors(pattern.recording_error / slope, sensor / slope)
}
