//! Options of a measurement.

use std::ops::Range;

use super::intervals::MAX_LAG_INTERVALS;
use spikelane::error::{Error, ErrorKind, Result};
use spikelane::spikes::Geometry;
use spikelane::unstable::Count;

/// Selects the statistics to measure, and their parameters.
///
/// # Examples
/// ```
/// use spikelane::Geometry;
/// use spikelane_measure::{Accumulator, MeasureOptions};
/// let options = MeasureOptions::default().with_lags(vec![1, 2, 100]);
/// let error = Accumulator::new(Geometry::new(8, 1)?, &options).err().expect("lags are 1 to 64");
/// assert_eq!(error.kind(), spikelane::ErrorKind::Usage);
/// # Ok::<(), spikelane::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MeasureOptions {
    /// Whether to measure [`Counts`](super::Counts).
    pub counts: bool,
    /// Whether to measure [`FrameStatistics`](super::FrameStatistics). They need all rows of the sensor.
    pub frames: bool,
    /// Whether [`FrameStatistics`](super::FrameStatistics) include the halves of rows and of columns.
    pub line_covariances: bool,
    /// Whether to measure [`Intervals`](super::Intervals).
    pub intervals: bool,
    /// Lags of `D(n)` in intervals, 1 to 64. Lag 1 is always measured.
    pub lags: Vec<u32>,
    /// Longest interval, in readouts, that has its own bin in the histogram.
    pub longest_bin: u32,
    /// Number of the readout at which the second half begins. `None` disables [`Statistics::counts_before_split`](super::Statistics::counts_before_split).
    pub split: Option<u32>,
    /// Number of readouts in the per-readout series. Each readout needs 24 bytes.
    pub series_readouts: usize,
    /// The rows to measure. `None` selects all rows.
    pub rows: Option<Range<usize>>,
}

spikelane::unstable::with_methods!(MeasureOptions {
    with_counts: counts: bool,
    with_frames: frames: bool,
    with_line_covariances: line_covariances: bool,
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
            line_covariances: true,
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
    /// Returns options that select only per-pixel counts and frame statistics. Measuring is then several times faster.
    #[must_use]
    pub fn without_intervals() -> Self {
        Self { intervals: false, ..Self::default() }
    }

    /// Returns options that select only statistics of whole readouts.
    #[must_use]
    pub fn frames_only() -> Self {
        Self { counts: false, ..Self::without_intervals() }
    }

    /// Returns the rows to measure and the sorted lags.
    ///
    /// # Errors
    /// [`ErrorKind::Usage`] if an option is out of range.
    pub(super) fn validate(&self, geometry: Geometry) -> Result<(Range<usize>, Vec<u32>)> {
        let all = 0..geometry.height();
        let rows = self.rows.clone().unwrap_or(all.clone());
        if rows.is_empty() || rows.end > all.end {
            return Err(Error::new(ErrorKind::Usage, "rows to measure")
                .found(format_args!("{}..{}", rows.start, rows.end))
                .expected(format_args!("a range within 0..{}", all.end)));
        }
        if self.frames && rows != all {
            return Err(Error::new(ErrorKind::Usage, "rows to measure")
                .found(format_args!("{}..{}", rows.start, rows.end))
                .expected("all rows, because whole-readout statistics are enabled")
                .remedy("measure frames in a separate accumulator"));
        }
        let mut lags = self.lags.clone();
        lags.push(1);
        lags.sort_unstable();
        lags.dedup();
        if let Some(bad) = lags.iter().find(|l| !(1..=MAX_LAG_INTERVALS).contains(*l)) {
            return Err(Error::new(ErrorKind::Usage, "lag of the interval variance")
                .found(bad)
                .expected(format_args!("1 to {MAX_LAG_INTERVALS} intervals")));
        }
        if !(1..=1 << 20).contains(&self.longest_bin) {
            return Err(Error::new(ErrorKind::Usage, "longest bin of the interval histogram")
                .found(self.longest_bin)
                .expected(format_args!("1 to {}", Count(1 << 20, "readout"))));
        }
        Ok((rows, lags))
    }
}
