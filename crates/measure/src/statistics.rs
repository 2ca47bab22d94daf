//! The list of statistics of a recording. Reports, comparisons of cameras and tests use this list.

use super::{Estimate, FrameStatistics, Intervals, NeighborPair, Statistics, Summary, summarize};
use spikelane::error::Result;

/// A statistic with its name and uncertainty.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
#[non_exhaustive]
pub struct Statistic {
    /// Short name without spaces.
    pub key: String,
    /// Description of the statistic with its unit.
    pub description: String,
    /// Value and standard error.
    pub estimate: Estimate,
}

/// Number of readouts at the start of a recording that [`FrameStatistics::start_transient`] compares with the later
/// readouts.
const START_READOUTS: usize = 64;

/// Returns the statistics of a recording of a static scene. A statistic is omitted if its input was not measured.
///
/// The errors of means and shares come from the scatter of the pixels. They treat the pixels as independent draws from a
/// population. Reports use [`crate::MeasuredRecording::reported_statistics`] instead, which distinguishes errors between
/// recordings from errors between sensors.
///
/// # Errors
/// Those of [`summarize`].
pub fn statistics(statistics: &Statistics) -> Result<Vec<Statistic>> {
    Ok(statistics_with_summary(&summarize(statistics)?, statistics))
}

/// Returns the list of [`statistics`]. `summary` must be the summary of `statistics`.
pub(super) fn statistics_with_summary(summary: &Summary, statistics: &Statistics) -> Vec<Statistic> {
    let mut all = rate_statistics(summary);
    all.extend(
        statistics
            .counts
            .iter()
            .flat_map(|c| NeighborPair::ALL.map(|pair| coincidence_statistic(pair, c.correlation(pair)))),
    );
    all.extend(statistics.intervals.iter().flat_map(interval_statistics));
    all.extend(statistics.frames.iter().flat_map(frame_statistics));
    all
}

fn statistic(key: &str, words: &str, estimate: Estimate) -> Statistic {
    Statistic { key: key.to_owned(), description: words.to_owned(), estimate }
}

fn rate_statistics(s: &Summary) -> Vec<Statistic> {
    let [first_column, last_column, first_row, last_row] = s.border_excess;
    vec![
        statistic("mean-rate", "mean rate (spikes per readout)", s.mean_rate),
        statistic("signal", "signal: mean rate without defect pixels", s.signal),
        statistic(
            "nonuniformity",
            "non-uniformity (DSNU of a dark recording, PRNU of a flat field)",
            s.nonuniformity,
        ),
        statistic(
            "local-nonuniformity",
            "local non-uniformity (5x5 high-pass, robust)",
            s.local_nonuniformity,
        ),
        statistic("row-nonuniformity", "row non-uniformity", s.row_nonuniformity),
        statistic("column-nonuniformity", "column non-uniformity", s.column_nonuniformity),
        statistic("correlation-right", "pattern correlation with the right neighbor", s.correlations.right),
        statistic("correlation-lower", "pattern correlation with the lower neighbor", s.correlations.lower),
        statistic("correlation-diagonal", "pattern correlation along the diagonal", s.correlations.diagonal),
        statistic(
            "correlation-antidiagonal",
            "pattern correlation across the diagonal",
            s.correlations.antidiagonal,
        ),
        statistic("first-column", "first column relative to its neighbors, minus 1", first_column),
        statistic("last-column", "last column relative to its neighbors, minus 1", last_column),
        statistic("first-row", "first row relative to its neighbors, minus 1", first_row),
        statistic("last-row", "last row relative to its neighbors, minus 1", last_row),
    ]
}

fn coincidence_statistic(pair: NeighborPair, estimate: Estimate) -> Statistic {
    let words = match pair {
        NeighborPair::Right => "bit correlation with the right neighbor",
        NeighborPair::Lower => "bit correlation with the lower neighbor",
        NeighborPair::RightAfter => "bit correlation with the right neighbor, one readout later",
        NeighborPair::LowerAfter => "bit correlation with the lower neighbor, one readout later",
        NeighborPair::RightBefore => "bit correlation with the right neighbor, one readout earlier",
        NeighborPair::LowerBefore => "bit correlation with the lower neighbor, one readout earlier",
    };
    statistic(pair.key(), words, estimate)
}

fn interval_statistics(intervals: &Intervals) -> Vec<Statistic> {
    let variance = |lag: &u32| {
        statistic(
            &format!("interval-variance-{lag}"),
            &format!("interval variance D({lag}) (readouts squared)"),
            intervals.lag_variance(*lag, None),
        )
    };
    let mut all: Vec<Statistic> = intervals.lags().iter().map(variance).collect();
    let noise = intervals.decompose(None);
    let (short, long) = intervals.short_and_long_shares(None);
    all.extend([
        statistic("phase-noise", "growth of D per spike (readouts squared)", noise.per_spike),
        statistic("quantization", "constant part of D (readouts squared)", noise.constant),
        statistic(
            "autocovariance-1",
            "covariance of successive intervals (readouts squared)",
            intervals.autocovariance(1, None),
        ),
        statistic(
            "autocovariance-2",
            "covariance of intervals two apart (readouts squared)",
            intervals.autocovariance(2, None),
        ),
        statistic(
            "off-lattice",
            "share of intervals other than the two whole numbers around the mean",
            intervals.off_lattice_share(None),
        ),
        statistic("short-intervals", "share of intervals below 0.6 of the mean", short),
        statistic("long-intervals", "share of intervals above 1.6 of the mean", long),
    ]);
    all
}

fn frame_statistics(frames: &FrameStatistics) -> Vec<Statistic> {
    let mut all = vec![
        statistic("total-variance", "variance of a readout's total (spikes squared)", total_variance(frames)),
        statistic("row-covariance", "covariance of the halves of a row", frames.row_covariance()),
        statistic("column-covariance", "covariance of the halves of a column", frames.column_covariance()),
    ];
    all.extend(frames.start_transient(START_READOUTS).map(|e| {
        statistic("start-transient", "mean of the first 64 readouts relative to the rest, minus 1", e)
    }));
    all
}

/// Returns the variance of the totals. Its error is also valid for correlated totals. Pixels that fire at regular
/// intervals cause correlated totals.
fn total_variance(frames: &FrameStatistics) -> Estimate {
    let variance = frames.total_variance();
    // A long stream stores only its first totals. The error of the stored totals is scaled to the whole stream.
    let stored_share = frames.totals.len() as f64 / f64::from(frames.readouts().max(1));
    Estimate { error: super::uncertainty::variance_error(&frames.totals) * stored_share.sqrt(), ..variance }
}
