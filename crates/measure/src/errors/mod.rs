//! What is said of a recording, and how sure it is.
//!
//! Two errors, each a standard deviation; twice either covers the truth in 95 of 100 cases (where a spread is known from few
//! samples it is widened by Student's law). What another recording by the same sensor, of the same scene and length, would
//! differ by; and what another sensor of the same kind would differ by, its own pattern and noise included.
//! `docs/reference/measure.md` says how each comes about, `docs/why/measure-coverage.md` how often they hold.

mod clusters;
mod json;
mod motion;
mod part;
mod parts;
mod pattern;
mod scatter;
mod totals;
mod values;

use crate::list::list_with;
use crate::{Estimate, Named, Pair, Summary, summarise};
use spikelane::error::Result;
use spikelane::unstable::threads;

use clusters::{NORMAL, clustered, widened};
pub use json::Said;
pub use motion::Motion;
pub use motion::motion;
pub use parts::{Recorder, Recording};
use pattern::{KEYS, Pattern, SPREADS, patterns};
pub(crate) use totals::variance_error;
use values::Quantity;

/// What the errors mean, for the head of a report.
pub const MEANING: &str = "First +-: one standard deviation of what another recording of this sensor, this scene and this \
length would give (<=: at most). Second +-: of what another sensor of this kind would give; none where that makes no \
difference. Twice either covers 95 in 100.";

/// One-sided 95 %.
const BELOW: f64 = 1.645;

/// A statistic of a recording with its errors. What cannot be told is absent.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
#[non_exhaustive]
pub struct Told {
    /// Short name, as in [`crate::list`].
    pub key: String,
    /// What it is, with its unit.
    pub words: String,
    /// The value; absent where nothing was measured, or it is told by `below`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub value: Option<f64>,
    /// The value is below this with 95 % confidence, and may be 0.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub below: Option<f64>,
    /// Standard deviation between recordings by this sensor.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub recording_error: Option<f64>,
    /// Whether that is only known to be no larger: the recording is too short to be compared with itself.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub at_most: bool,
    /// Standard deviation between sensors of this kind.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sensor_error: Option<f64>,
    /// Samples (pixels, pairs, rows, readouts) that went in.
    pub samples: usize,
}

impl Told {
    fn new(key: &str, words: &str, value: f64, samples: usize) -> Self {
        Self {
            key: key.to_owned(),
            words: words.to_owned(),
            value: Some(value).filter(|v| v.is_finite()),
            below: None,
            recording_error: None,
            at_most: false,
            sensor_error: None,
            samples,
        }
    }

    /// With errors; one that is not finite is left out, and any of a value that is not there.
    fn with(mut self, recording: f64, sensor: f64) -> Self {
        let finite = |e: f64| Some(e).filter(|e| e.is_finite() && self.value.is_some());
        (self.recording_error, self.sensor_error) = (finite(recording), finite(sensor));
        self
    }
}

impl Recording {
    /// Every statistic that can be told of a recording of a static scene.
    ///
    /// # Errors
    /// As [`summarise`].
    pub fn told(&self) -> Result<Vec<Told>> {
        Ok(self.told_with(&summarise(&self.statistics)?))
    }

    fn told_with(&self, summary: &Summary) -> Vec<Told> {
        let mut rates = self.statistics.counts.as_ref().map(|c| c.rate_by_time()).unwrap_or_default();
        let d = &summary.defects;
        for p in [&d.dead, &d.stuck, &d.hot, &d.weak].into_iter().flatten() {
            rates[*p] = f64::NAN;
        }
        let told = rates.iter().filter(|r| r.is_finite()).count();
        let temporal = summary.temporal_of_rate.powi(2);
        let noise = self.scatter.sample(Quantity::Signal, told);
        let width = self.statistics.geometry.width();
        let of_patterns = || match told {
            0..2 => Vec::new(),
            _ => patterns(&rates, width, if temporal.is_finite() { temporal } else { 0.0 }, &noise),
        };
        let (found, all) = threads::join(of_patterns, || list_with(summary, &self.statistics));
        let quantities = Quantity::all(self.statistics.intervals.as_ref().map_or(&[1], |i| i.lags()));
        let one = |named: Named| {
            let (key, words, e) = (named.key.as_str(), named.words.as_str(), named.estimate);
            if let Some(i) = KEYS.iter().position(|k| *k == key) {
                let nothing = Pattern { value: f64::NAN, recording: f64::NAN, sensor: f64::NAN };
                // Noise is taken off a spread; how much of it is known as well as so many samples tell.
                let least = temporal * (2.0 / e.samples.max(1) as f64).sqrt();
                return of_pattern(named.clone(), i, *found.get(i).unwrap_or(&nothing), least);
            }
            match quantities.iter().find(|q| q.key() == key) {
                Some(quantity) => self.of_pixels(*quantity, words, e, &rates),
                None => self.of_readouts(key, words, e),
            }
        };
        threads::map(all, one)
    }

    /// Whether the scene moved between the halves of the recording.
    #[must_use]
    pub fn motion(&self) -> Motion {
        // A rate over n readouts is known to f sqrt(1/6) / n, and there are two of them.
        let rate = self.statistics.counts.as_ref().map_or(0.0, |c| values::mean(&c.rate()));
        let half = scatter::half_readouts(self.statistics.readouts as usize).max(1);
        let sd = rate / half as f64 / 3.0_f64.sqrt();
        motion::motion(&self.scatter.rates, self.statistics.geometry.width(), sd, half)
    }

    /// A mean or a share over pixels; of the signal only over pixels with `rates`.
    fn of_pixels(&self, quantity: Quantity, words: &str, e: Estimate, rates: &[f64]) -> Told {
        let (mut map, _) = quantity.of(&self.statistics, false);
        if quantity == Quantity::Signal {
            map.iter_mut().zip(rates).filter(|(_, r)| !r.is_finite()).for_each(|(x, _)| *x = f64::NAN);
        }
        let pixels = map.iter().filter(|x| x.is_finite()).count();
        let told = Told::new(&quantity.key(), words, e.value, pixels);
        let shares = matches!(quantity, Quantity::OffLattice | Quantity::Short | Quantity::Long);
        if shares && e.value == 0.0 {
            return self.never(told);
        }
        let sensor = clustered(&map, self.statistics.geometry.width())
            .map_or(f64::NAN, |c| widened(c.variance.sqrt() / pixels as f64, c.freedom));
        let recording = match quantity {
            Quantity::MeanRate => self.of_counts(pixels, e.value),
            _ => self.scatter.error(quantity, pixels),
        };
        match recording {
            // Between sensors a statistic scatters by the noise of recordings and by the pattern.
            Some(recording) => told.with(recording, sensor.max(recording)),
            None => Told { at_most: true, ..told.with(sensor, sensor) },
        }
    }

    /// Error of the mean rate by counts: that of the rate by time, and what a count cuts off at both ends.
    ///
    /// A regular pixel's count scatters by the fraction of a spike at either end, `1/6` together, of which the time-based rate
    /// `f` has only `f^2 / 6`. Halves cannot tell it: the cut between them adds to one what it takes from the other.
    fn of_counts(&self, pixels: usize, rate: f64) -> Option<f64> {
        let timed = self.scatter.error(Quantity::Signal, pixels)?;
        let readouts = f64::from(self.statistics.readouts);
        let ends = (1.0 - rate * rate).max(0.0) / (6.0 * readouts * readouts * pixels as f64);
        Some(timed.hypot(ends.sqrt()))
    }

    /// What was not seen among all intervals: three of them are the limit of 95 % (Poisson).
    fn never(&self, told: Told) -> Told {
        let total = self.statistics.intervals.as_ref().map_or(0, |i| i.lengths().total());
        Told { value: None, below: (total > 0).then(|| (3.0 / total as f64).min(1.0)), ..told }
    }

    /// What is told by readouts or by pairs of pixels whose phases are drawn anew in every recording.
    fn of_readouts(&self, key: &str, words: &str, e: Estimate) -> Told {
        let told = Told::new(key, words, e.value, e.samples);
        let pair = Pair::ALL.into_iter().find(|p| p.key() == key);
        if let (Some(pair), Some(counts)) = (pair, &self.statistics.counts) {
            let map = counts.correlation_map(pair);
            let n = map.iter().filter(|x| x.is_finite()).count() as f64;
            let error = clustered(&map, self.statistics.geometry.width())
                .map_or(f64::NAN, |c| widened(c.variance.sqrt() / n, c.freedom));
            return told.with(error, f64::NAN);
        }
        match key {
            // Its error was made for the readouts' correlation already.
            "total-variance" => told.with(e.error, f64::NAN),
            _ => told.with(widened(e.error, e.samples.saturating_sub(1) as f64), f64::NAN),
        }
    }
}

/// A statistic of the pattern; spreads, which come as squares known to `least` at best, may be below what can be told.
fn of_pattern(named: Named, i: usize, found: Pattern, least: f64) -> Told {
    let (key, words, samples) = (named.key.as_str(), named.words.as_str(), named.estimate.samples);
    if i >= SPREADS {
        let told = Told::new(key, words, found.value, samples);
        return told.with(found.recording, found.sensor.max(found.recording));
    }
    let told = Told::new(key, words, found.value.max(0.0).sqrt(), samples);
    if !found.value.is_finite() || !found.sensor.is_finite() {
        return Told { value: None, ..told };
    }
    let also = |e: f64| if e.is_finite() { e } else { 0.0 };
    let sensor = found.sensor.hypot(also(found.recording)).hypot(also(least));
    if found.value <= NORMAL * sensor {
        let below = (found.value.max(0.0) + BELOW * sensor).sqrt();
        return Told { value: None, below: Some(below).filter(|b| *b > 0.0), ..told };
    }
    let slope = 2.0 * found.value.sqrt();
    told.with(found.recording / slope, sensor / slope)
}
