//! Statistics of bit-packed spike streams.
//!
//! An [`Accumulator`] accepts packed frames in batches of any size and updates integer sums. Its memory does not grow
//! with the number of readouts, except for the first [`MeasureOptions::series_readouts`] entries of the per-readout
//! series. [`Accumulator::finish`] returns [`Statistics`]. The methods of [`Statistics`] and of its fields return maps,
//! or an [`Estimate`], which is a value with its standard error.
//!
//! Each of the three families of statistics can be switched off:
//! * [`Counts`]: per-pixel counts, first and last spikes, and coincidences of neighbors;
//! * [`FrameStatistics`]: totals of readouts, distances between successive readouts, and halves of rows and columns;
//! * [`Intervals`]: statistics of inter-spike intervals.
//!
//! **Threads.** Counts and intervals are computed per pixel. Accumulators for bands of rows ([`MeasureOptions::rows`])
//! can therefore process the same frames in parallel. [`Statistics::join`] joins their results. Frame statistics need
//! whole readouts, so measure them in another accumulator with [`MeasureOptions::frames_only`].
//!
//! Results are bit-identical for all batch sizes and bands.

mod block;
mod counts;
mod dead_pixels;
mod estimate;
mod frame_popcount;
mod frames;
pub mod image_noise;
mod image_spectrum;
mod intervals;
mod join;
mod light_clock;
mod light_course;
mod maps;
mod mosaic;
mod options;
mod patch_moments;
mod pattern_spectrum;
pub mod report;
mod spectrum;
mod statistics;
mod stream;
mod summary;
mod uncertainty;

use std::ops::Range;
use std::sync::Arc;

use block::Block;
use spikelane::error::{Error, ErrorKind, Result};
use spikelane::spikes::{Geometry, SpikeFramesRef};
use spikelane::unstable::Count;

pub use counts::NO_SPIKE;
pub use counts::{Counts, NeighborPair};
pub use dead_pixels::is_dead_if_silent;
pub use estimate::Estimate;
pub use estimate::{finite_values, median, median_and_spread, tiled_mean};
pub use frames::{ExtremeReadout, FrameStatistics};
pub use image_spectrum::spectral_slope;
pub use intervals::{IntervalHistogram, Intervals, PhaseNoise, PixelIntervals, total_variation};
pub use light_clock::LightClock;
pub use light_course::{FlickerLine, LightCourse};
pub use maps::line_structure;
pub use maps::{Correlations, LineStructure, high_pass};
pub use maps::{box_means, map_correlations, pattern_correlations, select_uniform};
pub use mosaic::{CellSummary, detect_mosaic, summarize_cells, summarize_mosaic};
pub use options::MeasureOptions;
pub use pattern_spectrum::{map_histogram, pattern_spectra};
pub use spectrum::{FrameTotalLine, SpectralLine, Spectrum};
pub use spectrum::{frame_total_lines, spectrum};
pub use statistics::{Statistic, statistics};
pub use stream::{measure_intervals_by_light, measure_stream};
pub use summary::border_excess;
pub use summary::dsnu_prnu;
pub use summary::{Defects, Summary, summarize};
pub use uncertainty::detect_motion;
pub use uncertainty::{ERROR_MEANING, RecordingAccumulator, SceneMotion};
pub use uncertainty::{MeasuredRecording, MeasurementReport, ReportedStatistic};
pub use {estimate::upper_median, spectrum::squared_magnitudes};

/// Largest number of readouts of a stream. It ensures that sums of squares fit into 64 bits.
pub(crate) const MAX_READOUTS: u32 = 1 << 28;

/// Accumulates the sums of statistics over the frames of a stream.
///
/// # Examples
/// ```
/// use spikelane::{Geometry, SpikeFramesRef};
/// use spikelane_measure::{Accumulator, MeasureOptions};
/// let geometry = Geometry::new(8, 1)?;
/// let mut whole = Accumulator::new(geometry, &MeasureOptions::default())?;
/// whole.push(SpikeFramesRef::new(geometry, &[1, 0, 1, 0])?)?;
/// // The size of the batches does not change the result.
/// let mut parts = Accumulator::new(geometry, &MeasureOptions::default())?;
/// parts.push(SpikeFramesRef::new(geometry, &[1])?)?;
/// parts.push(SpikeFramesRef::new(geometry, &[0, 1, 0])?)?;
/// assert_eq!(parts.finish(), whole.finish());
/// # Ok::<(), spikelane::Error>(())
/// ```
pub struct Accumulator {
    geometry: Geometry,
    rows: Range<usize>,
    split: Option<u32>,
    block: Block,
    /// Number of readouts before the block.
    start: u32,
    counts: Option<counts::CountAccumulator>,
    frames: Option<frames::FrameAccumulator>,
    intervals: Option<intervals::IntervalAccumulator>,
    early_counts: Option<Vec<u32>>,
}

impl Accumulator {
    /// Returns an empty accumulator for a sensor.
    ///
    /// The accumulator buffers up to 1984 readouts of its rows, in at most 64 MiB. The counts need 40 bytes per pixel.
    /// The intervals need about 320 bytes per pixel at six lags.
    ///
    /// # Examples
    /// ```
    /// use spikelane_measure::{Accumulator, MeasureOptions};
    /// use spikelane::{Geometry, SpikeFramesRef};
    /// let geometry = Geometry::new(8, 1)?;
    /// let mut sums = Accumulator::new(geometry, &MeasureOptions::without_intervals())?;
    /// sums.push(SpikeFramesRef::new(geometry, &[1, 0, 1, 0])?)?;
    /// let statistics = sums.finish();
    /// assert_eq!(statistics.readouts, 4);
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    ///
    /// # Errors
    /// [`ErrorKind::Usage`] if the rows, a lag or the histogram length are out of range, or if frame statistics are
    /// requested for a band of rows.
    pub fn new(geometry: Geometry, options: &MeasureOptions) -> Result<Self> {
        let (rows, lags) = options.validate(geometry)?;
        let block = match options.counts || options.intervals {
            true => Block::new(geometry, rows.clone()),
            false => Block::new_short(geometry, rows.clone()),
        };
        let counts = options.counts.then(|| counts::CountAccumulator::new(geometry, rows.clone(), &block));
        let frames = options.frames.then(|| frames::FrameAccumulator::new(geometry, options, &block));
        let bin = options.longest_bin;
        let intervals =
            options.intervals.then(|| intervals::IntervalAccumulator::new(geometry, rows.clone(), lags, bin));
        Ok(Self {
            geometry,
            rows,
            split: options.split,
            block,
            start: 0,
            counts,
            frames,
            intervals,
            early_counts: None,
        })
    }

    /// Measures intervals by the integrated light of `clock`. `rows` of the accumulator are rows of the clock's sensor.
    pub(crate) fn with_clock(mut self, clock: &Arc<LightClock>) -> Self {
        let first = self.rows.start * self.geometry.width();
        if let Some(state) = &mut self.intervals {
            state.set_clock(Arc::clone(clock), first);
        }
        self
    }

    /// Returns two sizes in bytes per pixel: the spike history, and the sums.
    pub(crate) fn bytes_per_pixel(geometry: Geometry, options: &MeasureOptions) -> Result<[usize; 2]> {
        let (_, lags) = options.validate(geometry)?;
        let counts = if options.counts { counts::CountAccumulator::BYTES_PER_PIXEL } else { 0 };
        let [history, sums] =
            if options.intervals { intervals::IntervalAccumulator::bytes_per_pixel(&lags) } else { [0; 2] };
        Ok([history, counts + sums])
    }

    /// Adds the next readouts of the stream.
    ///
    /// # Errors
    /// [`ErrorKind::Input`] if the frames have another geometry than the accumulator, or if the stream becomes longer than
    /// 2^28 readouts. In both cases no frame of the batch is added.
    pub fn push(&mut self, frames: SpikeFramesRef<'_>) -> Result<()> {
        if frames.geometry() != self.geometry {
            return Err(Error::new(ErrorKind::Input, "frames to measure")
                .found(frames.geometry())
                .expected(self.geometry));
        }
        let total = self.start as usize + self.block.len() + frames.readouts();
        if total > MAX_READOUTS as usize {
            return Err(Error::new(ErrorKind::Input, "length of the stream")
                .found(format_args!("at least {}", Count(total, "readout")))
                .expected(format_args!("at most {MAX_READOUTS}"))
                .remedy("measure parts of the stream"));
        }
        for frame in frames {
            self.block.append(frame.as_bytes());
            if let Some(state) = &mut self.frames {
                state.push(&self.block, frame_popcount::count_spikes(self.block.latest_words()));
            }
            let next = self.start + self.block.len() as u32;
            if self.block.len() == self.block.capacity() || self.split == Some(next) {
                self.process();
            }
        }
        Ok(())
    }

    fn process(&mut self) {
        self.block.clear_rest();
        if let Some(state) = &mut self.counts {
            state.process(&self.block, self.start);
        }
        if let Some(state) = &mut self.intervals {
            state.process(&self.block, self.start);
        }
        self.start += self.block.len() as u32;
        self.block.recycle();
        if self.split == Some(self.start) {
            self.early_counts = self.counts.as_ref().map(counts::CountAccumulator::snapshot);
        }
    }

    /// Returns the statistics of all readouts that were pushed.
    #[must_use]
    pub fn finish(mut self) -> Statistics {
        if self.block.len() > 0 {
            self.process();
        }
        Statistics {
            geometry: self.geometry,
            rows: self.rows,
            readouts: self.start,
            counts: self.counts.map(counts::CountAccumulator::finish),
            frames: self.frames.map(frames::FrameAccumulator::finish),
            intervals: self.intervals.map(intervals::IntervalAccumulator::finish),
            counts_before_split: self.early_counts,
        }
    }
}

/// Statistics of a stream or of a band of its rows. A family that was not measured is `None`.
///
/// # Examples
/// ```
/// use spikelane::{Geometry, SpikeFramesRef};
/// use spikelane_measure::{Accumulator, MeasureOptions};
/// let geometry = Geometry::new(8, 1)?;
/// let mut sums = Accumulator::new(geometry, &MeasureOptions::frames_only())?;
/// sums.push(SpikeFramesRef::new(geometry, &[0b11, 0b1, 0b111])?)?;
/// let statistics = sums.finish();
/// // Spikes in each readout, and pixels that differ between successive readouts.
/// let frames = statistics.frames.expect("the options select frame statistics");
/// assert_eq!((frames.totals, frames.distances), (vec![2, 1, 3], vec![1, 2]));
/// assert!(statistics.counts.is_none());
/// # Ok::<(), spikelane::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Statistics {
    /// Geometry of the sensor.
    pub geometry: Geometry,
    /// The rows that were measured.
    pub rows: Range<usize>,
    /// Number of readouts.
    pub readouts: u32,
    /// Per-pixel counts.
    pub counts: Option<Counts>,
    /// Statistics of whole readouts.
    pub frames: Option<FrameStatistics>,
    /// Inter-spike intervals.
    pub intervals: Option<Intervals>,
    /// Number of spikes of each pixel before [`MeasureOptions::split`]. `None` if no split was set, or if the stream ended
    /// before the split.
    pub counts_before_split: Option<Vec<u32>>,
}
