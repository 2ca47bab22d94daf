//! Statistics of bit-packed spike streams, without an opinion on them.
//!
//! An [`Accumulator`] takes packed frames in batches of any size and keeps
//! integer sums; memory does not grow with the number of readouts (apart from
//! the first [`MeasureOptions::series_readouts`] entries of the per-readout series).
//! [`Accumulator::finish`] gives [`Statistics`], whose parts answer with an
//! [`Estimate`], a value and its standard error, or with maps.
//!
//! Three families, each of which can be left out:
//! * [`Counts`]: per-pixel counts, first and last spikes, coincidences of neighbours;
//! * [`Frames`]: totals of readouts, distance of successive readouts, halves of
//!   rows and columns;
//! * [`Intervals`]: everything about inter-spike intervals.
//!
//! **Threads.** Counts and intervals belong to pixels, so accumulators of bands
//! of rows ([`MeasureOptions::rows`]) can run side by side on the same frames, and
//! [`Statistics::join`] puts them together. Frames need whole readouts: run
//! them as one more accumulator with [`MeasureOptions::only_frames`].
//!
//! Results are the same bits for every batching and banding.

mod block;
mod counts;
mod errors;
mod estimate;
mod frames;
mod intervals;
mod join;
mod list;
mod maps;
mod newest;
mod options;
pub mod picture_noise;
pub mod report;
mod silence;
mod spectrum;
mod stream;
mod summary;

use std::ops::Range;

use block::Block;
use spikelane::error::{Error, Kind, Result};
use spikelane::spikes::{Geometry, Packed};

pub use counts::NEVER;
pub use counts::{Counts, Pair};
pub use errors::motion;
pub use errors::{MEANING, Motion, Recorder};
pub use errors::{Recording, Said, Told};
pub use estimate::Estimate;
pub use estimate::{bootstrap, finite, median, median_and_spread, tiled_mean, trimmed_mean};
pub use frames::{Extreme, Frames};
pub use intervals::{Deviation, Halves, Intervals, Lengths, PhaseNoise, PixelIntervals};
pub use list::{Named, list};
pub use maps::line_structure;
pub use maps::{Correlations, LineStructure, high_pass};
pub use maps::{box_means, map_correlations, pattern_correlations, select_rate, select_smooth};
pub use options::MeasureOptions;
pub use silence::silence_is_impossible;
pub use spectrum::{Line, Spectrum, TotalsLine};
pub use spectrum::{frame_total_lines, spectrum};
pub use stream::of_stream;
pub use summary::borders;
pub use summary::dsnu_prnu;
pub use summary::{Defects, Summary, summarise};
pub use {estimate::upper_median, spectrum::squared_magnitudes};

/// Most readouts of a stream: sums of squares stay within 64 bits.
pub(crate) const MAX_READOUTS: u32 = 1 << 28;

/// Takes frames and keeps their sums.
pub struct Accumulator {
    geometry: Geometry,
    rows: Range<usize>,
    split: Option<u32>,
    block: Block,
    /// Readouts before the block.
    start: u32,
    counts: Option<counts::State>,
    frames: Option<frames::State>,
    intervals: Option<intervals::State>,
    early: Option<Vec<u32>>,
}

impl Accumulator {
    /// An accumulator for a sensor.
    ///
    /// Buffers the last 1984 readouts of its rows (fewer above 64 MB), and
    /// keeps 40 bytes per pixel for counts and 330 for intervals at six lags.
    ///
    /// # Examples
    /// ```
    /// use spikelane_measure::{Accumulator, MeasureOptions};
    /// use spikelane::{Geometry, Packed};
    /// let geometry = Geometry::new(8, 1)?;
    /// let mut sums = Accumulator::new(geometry, &MeasureOptions::without_intervals())?;
    /// sums.push(Packed::new(geometry, &[1, 0, 1, 0])?)?;
    /// let statistics = sums.finish();
    /// assert_eq!(statistics.readouts, 4);
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    ///
    /// # Errors
    /// When the rows, a lag or the histogram's length are out of range, or
    /// frames are asked for in a band.
    pub fn new(geometry: Geometry, options: &MeasureOptions) -> Result<Self> {
        let (rows, lags) = options.checked(geometry)?;
        let block = match options.counts || options.intervals {
            true => Block::new(geometry, rows.clone()),
            false => Block::short(geometry, rows.clone()),
        };
        let counts = options.counts.then(|| counts::State::new(geometry, rows.clone(), &block));
        let frames = options.frames.then(|| frames::State::new(geometry, options, &block));
        let (bin, series) = (options.longest_bin, options.series_readouts);
        let intervals =
            options.intervals.then(|| intervals::State::new(geometry, rows.clone(), lags, bin, series));
        Ok(Self {
            geometry,
            rows,
            split: options.split,
            block,
            start: 0,
            counts,
            frames,
            intervals,
            early: None,
        })
    }

    /// The memory of one pixel in bytes: its history of spikes, and its sums.
    pub(crate) fn bytes_per_pixel(geometry: Geometry, options: &MeasureOptions) -> Result<[usize; 2]> {
        let (_, lags) = options.checked(geometry)?;
        let counts = if options.counts { counts::State::BYTES_PER_PIXEL } else { 0 };
        let [history, sums] =
            if options.intervals { intervals::State::bytes_per_pixel(&lags) } else { [0; 2] };
        Ok([history, counts + sums])
    }

    /// Takes the next readouts, in order.
    ///
    /// # Errors
    /// When the frames are of another size, or the stream becomes longer than
    /// 2^28 readouts; nothing of the batch is taken then.
    pub fn push(&mut self, frames: Packed<'_>) -> Result<()> {
        if frames.geometry() != self.geometry {
            return Err(Error::new(Kind::Input, "frames to measure")
                .found(frames.geometry())
                .expected(self.geometry));
        }
        let total = self.start as usize + self.block.len() + frames.readouts();
        if total > MAX_READOUTS as usize {
            return Err(Error::new(Kind::Input, "length of the stream")
                .found(format_args!("{total} readouts or more"))
                .expected(format_args!("at most {MAX_READOUTS}"))
                .remedy("measure parts of it"));
        }
        for frame in frames.frames() {
            self.block.append(frame);
            let wanted =
                self.frames.is_some() || self.intervals.as_ref().is_some_and(intervals::State::wants_totals);
            let spikes = if wanted { newest::spikes(self.block.newest()) } else { 0 };
            if let Some(state) = &mut self.frames {
                state.push(&self.block, spikes);
            }
            if let Some(state) = &mut self.intervals {
                state.push(self.block.len() - 1, spikes);
            }
            let next = self.start + self.block.len() as u32;
            if self.block.len() == self.block.capacity() || self.split == Some(next) {
                self.process();
            }
        }
        Ok(())
    }

    fn process(&mut self) {
        self.block.silence_rest();
        if let Some(state) = &mut self.counts {
            state.process(&self.block, self.start);
        }
        if let Some(state) = &mut self.intervals {
            state.process(&self.block, self.start);
        }
        self.start += self.block.len() as u32;
        self.block.recycle();
        if self.split == Some(self.start) {
            self.early = self.counts.as_ref().map(counts::State::snapshot);
            if let Some(state) = &mut self.intervals {
                state.split();
            }
        }
    }

    /// The statistics of everything that was pushed.
    #[must_use]
    pub fn finish(mut self) -> Statistics {
        if self.block.len() > 0 {
            self.process();
        }
        Statistics {
            geometry: self.geometry,
            rows: self.rows,
            readouts: self.start,
            counts: self.counts.map(counts::State::finish),
            frames: self.frames.map(frames::State::finish),
            intervals: self.intervals.map(intervals::State::finish),
            early_count: self.early,
        }
    }
}

/// Everything that was asked for.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Statistics {
    /// The sensor.
    pub geometry: Geometry,
    /// The rows that were measured.
    pub rows: Range<usize>,
    /// Readouts.
    pub readouts: u32,
    /// Per-pixel counts.
    pub counts: Option<Counts>,
    /// Whole readouts.
    pub frames: Option<Frames>,
    /// Inter-spike intervals.
    pub intervals: Option<Intervals>,
    /// Spikes per pixel before [`MeasureOptions::split`], when it was set and reached.
    pub early_count: Option<Vec<u32>>,
}
