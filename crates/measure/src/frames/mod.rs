//! Statistics of whole readouts: spike totals, distances between successive readouts, and covariances between the
//! halves of rows and of columns.

mod halves;
mod pair_sums;

use super::block::Block;
use super::estimate::Estimate;
use super::frame_popcount;
use super::options::MeasureOptions;
use halves::{ColumnHalves, RowHalves};
use pair_sums::PairSums;
use spikelane::spikes::Geometry;

/// An extreme value of a series, and the first readout that has this value.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[non_exhaustive]
pub struct ExtremeReadout {
    /// Readout number. The first readout is 0.
    pub readout: u32,
    /// The value at this readout.
    pub value: u32,
}

/// Statistics of whole readouts.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct FrameStatistics {
    geometry: Geometry,
    readouts: u32,
    /// Spikes in each of the first [`super::MeasureOptions::series_readouts`] readouts.
    pub totals: Vec<u32>,
    /// Hamming distances. Entry `i` is the number of pixels in which readout `i + 1` differs from readout `i`. The
    /// distances cover the same readouts as [`Self::totals`].
    pub distances: Vec<u32>,
    sums: PairSums,
    min_distance: Option<ExtremeReadout>,
    max_distance: Option<ExtremeReadout>,
    rows: Vec<PairSums>,
    columns: Vec<PairSums>,
    left_right: PairSums,
    top_bottom: PairSums,
}

/// Accumulates the sums of the readouts that were added so far.
pub(super) struct FrameAccumulator {
    result: FrameStatistics,
    series_readouts: usize,
    halves: Option<(RowHalves, ColumnHalves)>,
}

impl FrameAccumulator {
    pub(super) fn new(geometry: Geometry, options: &MeasureOptions, block: &Block) -> Self {
        let halves = || {
            let rows = RowHalves::new(geometry, block.stride());
            (rows, ColumnHalves::new(geometry, block.stride()))
        };
        Self {
            result: FrameStatistics {
                geometry,
                readouts: 0,
                totals: Vec::new(),
                distances: Vec::new(),
                sums: PairSums::default(),
                min_distance: None,
                max_distance: None,
                rows: Vec::new(),
                columns: Vec::new(),
                left_right: PairSums::default(),
                top_bottom: PairSums::default(),
            },
            series_readouts: options.series_readouts,
            halves: options.line_covariances.then(halves),
        }
    }

    /// Adds the latest readout of the block while the readout is in the CPU cache. `total` is the number of spikes of
    /// this readout.
    pub(super) fn push(&mut self, block: &Block, total: u32) {
        let slot = block.slot(block.len());
        let words = block.latest_words();
        let result = &mut self.result;
        if let Some((rows, columns)) = &mut self.halves {
            let (left, right) = rows.add(words);
            result.left_right.add(left, right);
            let (top, bottom) = columns.add(slot);
            result.top_bottom.add(top, bottom);
        }
        result.sums.add(total.into(), total.into());
        if result.totals.len() < self.series_readouts {
            result.totals.push(total);
        }
        if result.readouts > 0 {
            let before = &block.slot(block.len() - 1)[..block.band_words()];
            self.update_extremes(frame_popcount::count_changes(before, words));
        }
        self.result.readouts += 1;
    }

    fn update_extremes(&mut self, value: u32) {
        let result = &mut self.result;
        if result.distances.len() + 1 < self.series_readouts {
            result.distances.push(value);
        }
        let here = ExtremeReadout { readout: result.readouts, value };
        if result.min_distance.is_none_or(|e| value < e.value) {
            result.min_distance = Some(here);
        }
        if result.max_distance.is_none_or(|e| value > e.value) {
            result.max_distance = Some(here);
        }
    }

    pub(super) fn finish(mut self) -> FrameStatistics {
        if let Some((rows, columns)) = self.halves {
            self.result.rows = rows.finish();
            self.result.columns = columns.finish();
        }
        self.result
    }
}

impl FrameStatistics {
    /// Number of readouts that were measured.
    #[must_use]
    pub const fn readouts(&self) -> u32 {
        self.readouts
    }

    /// Returns the unbiased variance of the totals, in spikes squared.
    ///
    /// The standard error is `sqrt(2 / (T - 1))` times the variance, for `T` readouts. It is valid for normal and
    /// independent totals. Totals of regular pixels are correlated. [`super::statistics()`] reports a valid error for
    /// correlated totals.
    #[must_use]
    pub fn total_variance(&self) -> Estimate {
        let value = self.sums.covariance(self.readouts);
        Estimate {
            value,
            error: value * (2.0 / (f64::from(self.readouts) - 1.0)).sqrt(),
            samples: self.readouts as usize,
        }
    }

    /// The smallest distance between two successive readouts of the whole stream, with the number of the later readout.
    ///
    /// If a readout was written twice, the distance is zero or far below all other distances.
    #[must_use]
    pub const fn min_distance(&self) -> Option<ExtremeReadout> {
        self.min_distance
    }

    /// The largest distance between two successive readouts of the whole stream, with the number of the later readout.
    #[must_use]
    pub const fn max_distance(&self) -> Option<ExtremeReadout> {
        self.max_distance
    }

    /// Returns the mean covariance between the left and the right half of the same row, minus the mean covariance
    /// between halves of different rows. The unit is spikes squared.
    ///
    /// A covariance is computed over all readouts. Flicker and drift cause covariance between different rows. Noise of
    /// single rows does not. If the width is odd, the middle column is excluded. The standard error comes from the
    /// scatter of the rows, `sd / sqrt(rows)`. The result is NaN without [`MeasureOptions::line_covariances`].
    #[must_use]
    pub fn row_covariance(&self) -> Estimate {
        covariance_excess(&self.rows, self.left_right, self.readouts)
    }

    /// Returns the mean covariance between the upper and the lower half of the same column, minus the mean covariance
    /// between halves of different columns. The unit is spikes squared.
    #[must_use]
    pub fn column_covariance(&self) -> Estimate {
        covariance_excess(&self.columns, self.top_bottom, self.readouts)
    }

    /// Returns, for each row, the covariance between its left and its right half, in spikes squared.
    #[must_use]
    pub fn row_covariances(&self) -> Vec<f64> {
        self.rows.iter().map(|r| r.covariance(self.readouts)).collect()
    }

    /// Returns, for each column, the covariance between its upper and its lower half, in spikes squared.
    #[must_use]
    pub fn column_covariances(&self) -> Vec<f64> {
        self.columns.iter().map(|c| c.covariance(self.readouts)).collect()
    }

    /// Returns `a / b - 1`, where `a` is the mean total of the first `window` readouts and `b` is the mean total of the
    /// later readouts.
    ///
    /// A significant value shows that the start phases are not uniform, or that the camera is warming up. The readouts
    /// after the first `window` readouts are divided into windows of `window` readouts. The standard error combines the
    /// scatter of one window with the error of the mean of these windows. Returns `None` if there are fewer than three
    /// of these windows.
    #[must_use]
    pub fn start_transient(&self, window: usize) -> Option<Estimate> {
        let mut windows =
            self.totals.chunks_exact(window.max(1)).map(|w| w.iter().map(|n| f64::from(*n)).sum::<f64>());
        let first = windows.next()?;
        let rest = Estimate::mean(windows);
        (rest.samples >= 3).then(|| Estimate {
            value: first / rest.value - 1.0,
            error: rest.error * (rest.samples as f64 + 1.0).sqrt() / rest.value,
            samples: rest.samples + 1,
        })
    }

    /// Geometry of the sensor.
    #[must_use]
    pub const fn geometry(&self) -> Geometry {
        self.geometry
    }
}

/// Returns the mean covariance between the halves of the same line, minus the mean covariance between halves of
/// different lines.
///
/// `sums` are the pair sums of all `n` lines together, and `C` is their covariance. `W` is the mean covariance between
/// halves of the same line, and `B` is the mean covariance between halves of different lines. Then
/// `C = n W + n (n - 1) B`.
fn covariance_excess(lines: &[PairSums], sums: PairSums, readouts: u32) -> Estimate {
    let within = Estimate::mean(lines.iter().map(|line| line.covariance(readouts)));
    let n = lines.len() as f64;
    if lines.len() < 2 {
        return within;
    }
    let between = (sums.covariance(readouts) - n * within.value) / (n * (n - 1.0));
    Estimate { value: within.value - between, ..within }
}
