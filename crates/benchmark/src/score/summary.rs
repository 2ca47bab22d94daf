//! Means over sequences, and the cost of a run.

use std::cell::RefCell;
use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use spikelane::error::Result;

use super::boxes::{Counts, detection_metrics, tracking_metrics};
use super::{Evaluation, OVERALL, SequenceScore};
use crate::aggregate::{Bootstrap, Interval, Summary, ValueWithInterval, bootstrap, summarize};
use crate::detection::{ImageMatches, detection_scores};
use crate::generated::GeneratedSuite;
use crate::run::SequenceResult;
use crate::suite::CurvePoint;
use crate::tracking::TrackingCounts;

/// A value with its 95 % bootstrap interval over sequences.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Serialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct ScoreInterval {
    /// The value.
    pub value: f64,
    /// Ends of the interval, or `None` if there are fewer than two sequences.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub interval: Option<[f64; 2]>,
}

impl std::fmt::Display for ScoreInterval {
    /// Writes the value with four decimals, and the interval in parentheses.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:.4}", self.value)?;
        match self.interval {
            Some([low, high]) => write!(f, " ({low:.4} to {high:.4})"),
            None => Ok(()),
        }
    }
}

/// The means of a metric.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Serialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct MetricSummary {
    /// The score of all outputs together: the mean, or the statistic of all boxes for detection and tracking.
    pub pooled: ScoreInterval,
    /// Mean of the means of the sequences.
    pub sequence_mean: ScoreInterval,
}

/// The means of a group.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct GroupSummary {
    /// Name of the group, or [`OVERALL`] for all scored splits.
    pub group: String,
    /// The point of a curve.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub point: Option<CurvePoint>,
    /// Number of sequences.
    pub sequences: u64,
    /// Number of sequences that have the scores of the trivial answer.
    pub faults: u64,
    /// The means of each metric.
    pub metrics: BTreeMap<String, MetricSummary>,
}

/// Time and memory of a run.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Serialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct Cost {
    /// Outputs per second. The time of reading a stream and of starting a command counts.
    pub outputs_per_second: f64,
    /// Percentiles 50, 95 and 99 of the time for one output, in seconds.
    pub latency_seconds: [f64; 3],
    /// Largest resident memory of a process in bytes. `None` if the system does not report it, and for baselines.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub memory_peak_bytes: Option<u64>,
}

impl Cost {
    /// Returns the cost of a run, or `None` without times.
    pub(super) fn from_results(results: &[&SequenceResult]) -> Option<Self> {
        let mut seconds: Vec<f64> = results.iter().map(|r| r.seconds).collect();
        let total: f64 = seconds.iter().sum();
        if !(total.is_finite() && total > 0.0) {
            return None;
        }
        seconds.sort_by(f64::total_cmp);
        // The nearest rank: the smallest time that at least this share of the outputs does not exceed.
        let percentile = |share: f64| {
            let rank = (share * seconds.len() as f64).ceil() as usize;
            seconds[rank.clamp(1, seconds.len()) - 1]
        };
        Some(Self {
            outputs_per_second: seconds.len() as f64 / total,
            latency_seconds: [0.5, 0.95, 0.99].map(percentile),
            memory_peak_bytes: results.iter().filter_map(|r| r.memory_peak_bytes).max(),
        })
    }
}

impl From<ValueWithInterval> for ScoreInterval {
    fn from(value: ValueWithInterval) -> Self {
        let interval = value.interval.map(|Interval { low, high }| [low, high]);
        Self { value: value.value, interval }
    }
}

impl From<Summary> for MetricSummary {
    fn from(summary: Summary) -> Self {
        Self { pooled: summary.pooled.into(), sequence_mean: summary.sequence_mean.into() }
    }
}

/// Returns the summaries of all scored splits together, of each split and of each point of a curve.
pub(super) fn summarize_groups(
    data: &GeneratedSuite,
    scored: &[(SequenceScore, Evaluation)],
) -> Result<Vec<GroupSummary>> {
    let is_split = |name: &str| data.groups.iter().any(|g| g.name.as_str() == name && g.point.is_none());
    let mut summaries = vec![summarize_group(data, OVERALL, None, scored, &|s| is_split(s.group.as_str()))?];
    for group in data.groups.iter().filter(|group| group.is_scored) {
        let point = group.point.clone();
        summaries
            .push(summarize_group(data, group.name.as_str(), point, scored, &|s| s.group == group.name)?);
    }
    Ok(summaries)
}

fn summarize_group(
    data: &GeneratedSuite,
    name: &str,
    point: Option<CurvePoint>,
    scored: &[(SequenceScore, Evaluation)],
    is_in: &dyn Fn(&SequenceScore) -> bool,
) -> Result<GroupSummary> {
    let chosen: Vec<&(SequenceScore, Evaluation)> = scored.iter().filter(|(s, _)| is_in(s)).collect();
    let mut metrics = BTreeMap::new();
    let pooled = pooled_statistics(&chosen);
    for metric in &data.suite.metrics {
        // The reference alone determines which sequences have no score, so all methods have the same sequences.
        let scores: Vec<Vec<f64>> =
            chosen.iter().filter_map(|(_, e)| Some(vec![*e.scores.get(metric.name)?])).collect();
        if scores.is_empty() {
            continue;
        }
        let mut summary: MetricSummary = summarize(&scores, Bootstrap::default())?.into();
        if let Some(statistics) = &pooled {
            let value = |chosen: &[usize]| statistics(chosen).get(metric.name).copied().unwrap_or(0.0);
            summary.pooled = bootstrap(chosen.len(), Bootstrap::default(), value)?.into();
        }
        metrics.insert(metric.name.to_owned(), summary);
    }
    let faults = chosen.iter().filter(|(s, _)| s.fault.is_some()).count() as u64;
    Ok(GroupSummary { group: name.to_owned(), point, sequences: chosen.len() as u64, faults, metrics })
}

/// The scores of a selection of sequences.
type Statistics<'a> = Box<dyn Fn(&[usize]) -> BTreeMap<&'static str, f64> + 'a>;

/// Returns a function that scores a selection of sequences together, or `None` if the scores are means over sequences.
fn pooled_statistics<'a>(chosen: &'a [&(SequenceScore, Evaluation)]) -> Option<Statistics<'a>> {
    let detections: Vec<&ImageMatches> = chosen
        .iter()
        .filter_map(|(_, e)| match &e.counts {
            Counts::Detection(matches) => Some(matches),
            _ => None,
        })
        .collect();
    let tracks: Vec<&TrackingCounts> = chosen
        .iter()
        .filter_map(|(_, e)| match &e.counts {
            Counts::Tracking(counts) => Some(&**counts),
            _ => None,
        })
        .collect();
    // Each metric draws the same resamples, so their scores are computed once.
    let cache: RefCell<BTreeMap<Vec<usize>, BTreeMap<&'static str, f64>>> = RefCell::default();
    let cached = move |chosen: &[usize], compute: &dyn Fn() -> BTreeMap<&'static str, f64>| {
        cache.borrow_mut().entry(chosen.to_vec()).or_insert_with(compute).clone()
    };
    if !detections.is_empty() && detections.len() == chosen.len() {
        return Some(Box::new(move |chosen| {
            cached(chosen, &|| {
                let scores = detection_scores(chosen.iter().map(|i| detections[*i]));
                detection_metrics(&scores).into_iter().filter_map(|(name, v)| Some((name, v?))).collect()
            })
        }));
    }
    if !tracks.is_empty() && tracks.len() == chosen.len() {
        return Some(Box::new(move |chosen| {
            cached(chosen, &|| {
                let counts = TrackingCounts::combine(chosen.iter().map(|i| tracks[*i]));
                tracking_metrics(&counts.scores()).into()
            })
        }));
    }
    None
}
