//! What is measured.

use std::ops::Range;

use super::intervals::LONGEST_LAG;
use spikelane::error::{Error, Kind, Result};
use spikelane::spikes::Geometry;

/// What to measure.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MeasureOptions {
    /// Measure [`Counts`](super::Counts).
    pub counts: bool,
    /// Measure [`Frames`](super::Frames); needs all rows.
    pub frames: bool,
    /// Whether [`Frames`](super::Frames) holds the halves of rows and columns.
    pub halves: bool,
    /// Measure [`Intervals`](super::Intervals).
    pub intervals: bool,
    /// Lags of `D(n)` in intervals, 1 to 64; 1 is always there.
    pub lags: Vec<u32>,
    /// The longest interval with a bin of its own in the histogram.
    pub longest_bin: u32,
    /// The readout at which the second half begins, for statistics by halves.
    pub split: Option<u32>,
    /// Readouts of which per-readout series are kept (20 bytes each).
    pub series_readouts: usize,
    /// The rows to measure; `None` is all of them.
    pub rows: Option<Range<usize>>,
}

spikelane::unstable::with_methods!(MeasureOptions {
    with_counts: counts: bool,
    with_frames: frames: bool,
    with_halves: halves: bool,
    with_intervals: intervals: bool,
    with_lags: lags: Vec<u32>,
    with_longest_bin: longest_bin: u32,
    with_split: split: Option<u32>,
    with_series_readouts: series_readouts: usize,
    with_rows: rows: Option<Range<usize>>,
});

impl Default for MeasureOptions {
    fn default() -> Self {
        Self {
            counts: true,
            frames: true,
            halves: true,
            intervals: true,
            lags: vec![1, 4, 8, 16, 24, 32],
            longest_bin: 1023,
            split: None,
            series_readouts: 1 << 20,
            rows: None,
        }
    }
}

impl MeasureOptions {
    /// Only per-pixel counts and frame statistics: several times faster.
    #[must_use]
    pub fn without_intervals() -> Self {
        Self { intervals: false, ..Self::default() }
    }

    /// Only whole readouts.
    #[must_use]
    pub fn only_frames() -> Self {
        Self { counts: false, ..Self::without_intervals() }
    }

    /// The rows that are measured and the lags in order, or what is wrong with the options.
    pub(super) fn checked(&self, geometry: Geometry) -> Result<(Range<usize>, Vec<u32>)> {
        let all = 0..geometry.height();
        let rows = self.rows.clone().unwrap_or(all.clone());
        if rows.is_empty() || rows.end > all.end {
            return Err(Error::new(Kind::Usage, "rows to measure")
                .found(format_args!("{}..{}", rows.start, rows.end))
                .expected(format_args!("a range within 0..{}", all.end)));
        }
        if self.frames && rows != all {
            return Err(Error::new(Kind::Usage, "rows to measure")
                .found(format_args!("{}..{}", rows.start, rows.end))
                .expected("all rows for statistics of whole readouts")
                .remedy("measure frames in an accumulator of their own"));
        }
        let mut lags = self.lags.clone();
        lags.push(1);
        lags.sort_unstable();
        lags.dedup();
        if let Some(bad) = lags.iter().find(|l| !(1..=LONGEST_LAG).contains(*l)) {
            return Err(Error::new(Kind::Usage, "lag of the interval variance")
                .found(bad)
                .expected(format_args!("1 to {LONGEST_LAG} intervals")));
        }
        if !(1..=1 << 20).contains(&self.longest_bin) {
            return Err(Error::new(Kind::Usage, "longest bin of the interval histogram")
                .found(self.longest_bin)
                .expected(format_args!("1 to {} readouts", 1 << 20)));
        }
        Ok((rows, lags))
    }
}
