//! Statistics of whole readouts: totals, distances of successive readouts,
//! and how the two halves of rows and columns vary together.

mod halves;
mod pair_sums;

use super::block::Block;
use super::estimate::Estimate;
use super::newest;
use super::options::MeasureOptions;
use halves::{ColumnHalves, RowHalves};
use pair_sums::PairSums;
use spikelane::spikes::Geometry;

/// A number and the readout where it was seen first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[non_exhaustive]
pub struct Extreme {
    /// Readout, from 0.
    pub readout: u32,
    /// The value there.
    pub value: u32,
}

/// Statistics of whole readouts.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Frames {
    geometry: Geometry,
    readouts: u32,
    /// Spikes in each readout; of a longer stream the first
    /// [`super::MeasureOptions::series_readouts`] only.
    pub totals: Vec<u32>,
    /// Pixels in which readout `i + 1` differs from readout `i` (Hamming
    /// distance), kept as long as the totals.
    pub distances: Vec<u32>,
    sums: PairSums,
    nearest: Option<Extreme>,
    farthest: Option<Extreme>,
    rows: Vec<PairSums>,
    columns: Vec<PairSums>,
    left_right: PairSums,
    top_bottom: PairSums,
}

/// What is kept while frames come in.
pub(super) struct State {
    result: Frames,
    kept: usize,
    halves: Option<(RowHalves, ColumnHalves)>,
}

impl State {
    pub(super) fn new(geometry: Geometry, options: &MeasureOptions, block: &Block) -> Self {
        let halves = || {
            let rows = RowHalves::new(geometry, block.stride());
            (rows, ColumnHalves::new(geometry, block.stride()))
        };
        Self {
            result: Frames {
                geometry,
                readouts: 0,
                totals: Vec::new(),
                distances: Vec::new(),
                sums: PairSums::default(),
                nearest: None,
                farthest: None,
                rows: Vec::new(),
                columns: Vec::new(),
                left_right: PairSums::default(),
                top_bottom: PairSums::default(),
            },
            kept: options.series_readouts,
            halves: options.halves.then(halves),
        }
    }

    /// Takes the newest readout of the block, while it is in the cache; it holds `total` spikes.
    pub(super) fn push(&mut self, block: &Block, total: u32) {
        let slot = block.slot(block.len());
        let words = block.newest();
        let result = &mut self.result;
        if let Some((rows, columns)) = &mut self.halves {
            let (left, right) = rows.add(words);
            result.left_right.add(left, right);
            let (top, bottom) = columns.add(slot);
            result.top_bottom.add(top, bottom);
        }
        result.sums.add(total.into(), total.into());
        if result.totals.len() < self.kept {
            result.totals.push(total);
        }
        if result.readouts > 0 {
            let before = &block.slot(block.len() - 1)[..block.band_words()];
            self.compare(newest::changes(before, words));
        }
        self.result.readouts += 1;
    }

    fn compare(&mut self, value: u32) {
        let result = &mut self.result;
        if result.distances.len() + 1 < self.kept {
            result.distances.push(value);
        }
        let here = Extreme { readout: result.readouts, value };
        if result.nearest.is_none_or(|e| value < e.value) {
            result.nearest = Some(here);
        }
        if result.farthest.is_none_or(|e| value > e.value) {
            result.farthest = Some(here);
        }
    }

    pub(super) fn finish(mut self) -> Frames {
        if let Some((rows, columns)) = self.halves {
            self.result.rows = rows.finish();
            self.result.columns = columns.finish();
        }
        self.result
    }
}

impl Frames {
    /// Readouts that were seen.
    #[must_use]
    pub const fn readouts(&self) -> u32 {
        self.readouts
    }

    /// Mean number of spikes per readout. Standard error: `sd / sqrt(T)`, as if
    /// readouts were independent; regular spiking makes totals anticorrelated
    /// and the true error smaller.
    #[must_use]
    pub fn mean_total(&self) -> Estimate {
        let n = f64::from(self.readouts);
        Estimate {
            value: self.sums.a as f64 / n,
            error: (self.sums.covariance(self.readouts) / n).sqrt(),
            samples: self.readouts as usize,
        }
    }

    /// Unbiased variance of the totals, in spikes squared. Standard error
    /// `sqrt(2 / (T - 1))` of the value, for normal and independent totals: those of regular pixels are not, and
    /// [`super::list`] states the error of correlated ones.
    #[must_use]
    pub fn total_variance(&self) -> Estimate {
        let value = self.sums.covariance(self.readouts);
        Estimate {
            value,
            error: value * (2.0 / (f64::from(self.readouts) - 1.0)).sqrt(),
            samples: self.readouts as usize,
        }
    }

    /// The readout most like the one before it, over the whole stream. A
    /// distance of zero, or far below all others, is a readout written twice.
    #[must_use]
    pub const fn nearest(&self) -> Option<Extreme> {
        self.nearest
    }

    /// The readout least like the one before it, over the whole stream.
    #[must_use]
    pub const fn farthest(&self) -> Option<Extreme> {
        self.farthest
    }

    /// The kept readouts that differ from the one before in fewer pixels than
    /// `share` of the median distance. Independent pixels spread by less than
    /// `sqrt(distance)`, so a share of one half is far outside chance for more
    /// than a few hundred spikes per readout.
    #[must_use]
    pub fn nearly_equal(&self, share: f64) -> Vec<u32> {
        let mut sorted: Vec<f64> = self.distances.iter().map(|d| f64::from(*d)).collect();
        let limit = share * super::estimate::median(&mut sorted);
        let close = |(_, d): &(usize, &u32)| f64::from(**d) < limit;
        let found = self.distances.iter().enumerate().filter(close);
        found.map(|(i, _)| i as u32 + 1).collect()
    }

    /// Covariance over readouts of the spikes in the left and the right half of
    /// a row, mean over rows, less the covariance of *different* rows (which
    /// flicker and drift cause, and noise of single rows does not), in spikes
    /// squared. The middle column of an odd width is left out. Standard error:
    /// spread over rows, `sd / sqrt(rows)`. NaN without [`MeasureOptions::halves`].
    #[must_use]
    pub fn row_covariance(&self) -> Estimate {
        excess(&self.rows, self.left_right, self.readouts)
    }

    /// The same for the upper and lower halves of columns.
    #[must_use]
    pub fn column_covariance(&self) -> Estimate {
        excess(&self.columns, self.top_bottom, self.readouts)
    }

    /// Covariance of the halves of each row, in spikes squared.
    #[must_use]
    pub fn row_covariances(&self) -> Vec<f64> {
        self.rows.iter().map(|r| r.covariance(self.readouts)).collect()
    }

    /// Covariance of the halves of each column, in spikes squared.
    #[must_use]
    pub fn column_covariances(&self) -> Vec<f64> {
        self.columns.iter().map(|c| c.covariance(self.readouts)).collect()
    }

    /// Mean total of the first `window` readouts relative to the rest, less 1:
    /// what a start phase that is not uniform, or a camera that wakes up, shows.
    /// Standard error: the spread of the means of the later windows of the same
    /// length, for one window and for the mean of the rest together. `None`
    /// with fewer than three later windows among the kept readouts.
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

    /// The sensor.
    #[must_use]
    pub const fn geometry(&self) -> Geometry {
        self.geometry
    }
}

/// Mean covariance within lines, less the mean covariance between lines: the
/// covariance of the halves' sums holds both.
fn excess(lines: &[PairSums], sums: PairSums, readouts: u32) -> Estimate {
    let within = Estimate::mean(lines.iter().map(|line| line.covariance(readouts)));
    let n = lines.len() as f64;
    if lines.len() < 2 {
        return within;
    }
    let between = (sums.covariance(readouts) - n * within.value) / (n * (n - 1.0));
    Estimate { value: within.value - between, ..within }
}
