//! The list of statistics of a recording: the one place that reports, comparisons of
//! cameras and tests take them from.

use super::{Estimate, Frames, Intervals, Pair, Statistics, Summary, summarise};
use spikelane::error::Result;

/// A statistic with its name and uncertainty.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
#[non_exhaustive]
pub struct Named {
    /// Short name without spaces.
    pub key: String,
    /// What it is, with its unit.
    pub words: String,
    /// Value and standard error.
    pub estimate: Estimate,
}

/// Readouts of the start that [`Frames::start_transient`] looks at.
const START: usize = 64;

/// Every statistic that can be told of a recording of a static scene, with what was measured.
///
/// Errors of means and shares are the spread of pixels, as if these were independent draws of a population. What a report
/// states is `Recording::told`, whose errors say which repetition they speak of.
///
/// # Errors
/// As [`summarise`].
pub fn list(statistics: &Statistics) -> Result<Vec<Named>> {
    Ok(list_with(&summarise(statistics)?, statistics))
}

/// The same, of statistics that have been summarised.
pub(super) fn list_with(summary: &Summary, statistics: &Statistics) -> Vec<Named> {
    let mut all = of_rates(summary);
    all.extend(
        statistics.counts.iter().flat_map(|c| Pair::ALL.map(|pair| coincidence(pair, c.correlation(pair)))),
    );
    all.extend(statistics.intervals.iter().flat_map(of_intervals));
    all.extend(statistics.frames.iter().flat_map(of_frames));
    all
}

fn named(key: &str, words: &str, estimate: Estimate) -> Named {
    Named { key: key.to_owned(), words: words.to_owned(), estimate }
}

fn of_rates(s: &Summary) -> Vec<Named> {
    let [first_column, last_column, first_row, last_row] = s.borders;
    vec![
        named("mean-rate", "mean rate (spikes per readout)", s.mean_rate),
        named("signal", "signal: rate without defect pixels", s.signal),
        named("nonuniformity", "non-uniformity (DSNU of a dark, PRNU of a flat)", s.nonuniformity),
        named("local-nonuniformity", "local non-uniformity (5x5 high-pass, robust)", s.local_nonuniformity),
        named("row-nonuniformity", "row non-uniformity", s.row_nonuniformity),
        named("column-nonuniformity", "column non-uniformity", s.column_nonuniformity),
        named("correlation-right", "correlation of pattern with right neighbour", s.correlations.right),
        named("correlation-lower", "correlation of pattern with lower neighbour", s.correlations.lower),
        named("correlation-diagonal", "correlation of pattern along the diagonal", s.correlations.diagonal),
        named("correlation-antidiagonal", "correlation of pattern across it", s.correlations.antidiagonal),
        named("first-column", "first column over its neighbours, less 1", first_column),
        named("last-column", "last column over its neighbours, less 1", last_column),
        named("first-row", "first row over its neighbours, less 1", first_row),
        named("last-row", "last row over its neighbours, less 1", last_row),
    ]
}

fn coincidence(pair: Pair, estimate: Estimate) -> Named {
    let words = match pair {
        Pair::Right => "correlation of bits with the right neighbour",
        Pair::Lower => "correlation of bits with the lower neighbour",
        Pair::RightAfter | Pair::LowerAfter => "the same, the neighbour one readout later",
        Pair::RightBefore | Pair::LowerBefore => "the same, the neighbour one readout earlier",
    };
    named(pair.key(), words, estimate)
}

fn of_intervals(intervals: &Intervals) -> Vec<Named> {
    let variance = |lag: &u32| {
        named(
            &format!("interval-variance-{lag}"),
            &format!("interval variance D({lag}) (readouts squared)"),
            intervals.lag_variance(*lag, None),
        )
    };
    let mut all: Vec<Named> = intervals.lags().iter().map(variance).collect();
    let noise = intervals.decompose(None);
    let (short, long) = intervals.short_and_long(None);
    all.extend([
        named("phase-noise", "growth of D per spike (readouts squared)", noise.per_spike),
        named("quantisation", "constant part of D (readouts squared)", noise.constant),
        named(
            "autocovariance-1",
            "covariance of successive intervals (readouts squared)",
            intervals.autocovariance(1, None),
        ),
        named("autocovariance-2", "covariance of intervals two apart", intervals.autocovariance(2, None)),
        named("off-lattice", "share of intervals off floor and ceiling", intervals.off_lattice(None)),
        named("short-intervals", "share of intervals below 0.6 of the mean", short),
        named("long-intervals", "share of intervals above 1.6 of the mean", long),
    ]);
    all
}

fn of_frames(frames: &Frames) -> Vec<Named> {
    let mut all = vec![
        named("total-variance", "variance of a readout's total (spikes squared)", total_variance(frames)),
        named("row-covariance", "covariance of the halves of a row", frames.row_covariance()),
        named("column-covariance", "covariance of the halves of a column", frames.column_covariance()),
    ];
    all.extend(
        frames
            .start_transient(START)
            .map(|e| named("start-transient", "first 64 readouts over the rest, less 1", e)),
    );
    all
}

/// With the error of totals that go together, as those of pixels that fire regularly do.
fn total_variance(frames: &Frames) -> Estimate {
    let found = frames.total_variance();
    // Of a longer stream only the first totals are kept.
    let kept = frames.totals.len() as f64 / f64::from(frames.readouts().max(1));
    Estimate { error: super::errors::variance_error(&frames.totals) * kept.sqrt(), ..found }
}
