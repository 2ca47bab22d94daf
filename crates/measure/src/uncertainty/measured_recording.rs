//! Measures a whole recording, its halves and its quarters.
//!
//! The two halves of a recording are like two recordings by the same sensor. In each pixel, the difference between the
//! halves contains no fixed pattern. The difference therefore shows the scatter between recordings.
//!
//! Each part (half or quarter) ends before the next part starts. The gap between two parts is a sixteenth of the
//! recording. Because of the gap, the phase of a pixel at the start of a part is practically independent of the
//! preceding part. Without the gap, the last spike of one part would determine the first spike of the next part. The
//! difference between the parts would then scatter too little or too much, depending on the length of the interval in
//! readouts.

use super::quantity::Quantity;
use super::scatter::{Scatter, gap_readouts};
use crate::stream::{band_accumulators, join_accumulators};
use crate::{Accumulator, Counts, Intervals, MeasureOptions, Statistics};
use spikelane::error::Result;
use spikelane::spikes::{Geometry, SpikeFramesRef};
use spikelane::unstable::inputs;
use spikelane::unstable::threads;
use spikelane_io::formats::StreamReader;

/// Number of readouts per read.
const BUFFER_READOUTS: usize = 248;

/// The statistics of a recording, and the scatter of these statistics between parts of the recording.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct MeasuredRecording {
    /// Statistics of the whole recording.
    pub statistics: Statistics,
    pub(super) scatter: Scatter,
}

/// Accumulates the statistics of a recording whose length is known in advance.
pub struct RecordingAccumulator {
    geometry: Geometry,
    readouts_pushed: usize,
    quarter: usize,
    accumulators: Vec<Accumulator>,
    scatter: Scatter,
}

impl RecordingAccumulator {
    /// Returns an empty accumulator for `readouts` readouts of a sensor.
    ///
    /// The accumulator uses the default options.
    ///
    /// # Errors
    /// Those of [`Accumulator::new`].
    pub fn new(geometry: Geometry, readouts: usize) -> Result<Self> {
        let options = MeasureOptions::default();
        let of_pixels = MeasureOptions { frames: false, ..options.clone() };
        let of_frames = MeasureOptions { counts: false, intervals: false, ..options.clone() };
        let mut accumulators = band_accumulators(geometry, &of_pixels)?;
        accumulators.push(Accumulator::new(geometry, &of_frames)?);
        let scatter = Scatter::new(Quantity::all(&options.lags), geometry, readouts);
        Ok(Self { geometry, readouts_pushed: 0, quarter: readouts / 4, accumulators, scatter })
    }

    /// Adds the next readouts.
    ///
    /// # Errors
    /// Those of [`Accumulator::push`].
    pub fn push(&mut self, frames: SpikeFramesRef<'_>) -> Result<()> {
        let size = self.geometry.frame_bytes();
        let mut rest = frames.as_bytes();
        let used_readouts = self.quarter - gap_readouts(self.quarter);
        while !rest.is_empty() && self.readouts_pushed < 4 * self.quarter {
            let within = self.readouts_pushed % self.quarter;
            if within == 0 {
                self.begin_parts();
            }
            let end = if within < used_readouts { used_readouts } else { self.quarter };
            let here = (end - within).min(rest.len() / size);
            let (now, later) = rest.split_at(here * size);
            self.push_all(SpikeFramesRef::new(self.geometry, now)?)?;
            self.readouts_pushed += here;
            rest = later;
            if within + here == used_readouts {
                self.end_parts()?;
            }
        }
        self.push_all(SpikeFramesRef::new(self.geometry, rest)?)
    }

    /// Adds readouts to all accumulators in parallel.
    fn push_all(&mut self, frames: SpikeFramesRef<'_>) -> Result<()> {
        match self.accumulators.len() {
            0..=2 => self.accumulators.iter_mut().try_for_each(|a| a.push(frames)),
            _ => threads::try_map(&mut self.accumulators, |a| a.push(frames)).map(drop),
        }
    }

    /// Begins a quarter. At every second quarter it also begins a half. A half includes the gap between its quarters.
    fn begin_parts(&mut self) {
        let half = self.readouts_pushed.is_multiple_of(2 * self.quarter);
        threads::map(&mut self.accumulators, |a| {
            begin_part(a, RecordingPart::Quarter);
            if half {
                begin_part(a, RecordingPart::Half);
            }
        });
    }

    /// Ends a quarter. At every second quarter it also ends a half.
    fn end_parts(&mut self) -> Result<()> {
        let quarter = self.end_part(RecordingPart::Quarter)?;
        self.scatter.add_quarter(&quarter);
        if !((self.readouts_pushed - 1) / self.quarter).is_multiple_of(2) {
            let half = self.end_part(RecordingPart::Half)?;
            self.scatter.add_half(&half);
        }
        Ok(())
    }

    fn end_part(&mut self, part: RecordingPart) -> Result<Statistics> {
        let parts: Vec<_> = threads::map(&mut self.accumulators, |a| end_part(a, part));
        Statistics::join(parts.into_iter().flatten().collect())
    }

    /// Returns the measured recording.
    ///
    /// # Errors
    /// Those of [`Statistics::join`].
    pub fn finish(self) -> Result<MeasuredRecording> {
        Ok(MeasuredRecording { statistics: join_accumulators(self.accumulators)?, scatter: self.scatter })
    }
}

/// Kinds of parts. At most one part of each kind can be open at a time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum RecordingPart {
    Half,
    Quarter,
}

/// Begins a part of the recording at the next readout. The function has no effect if `accumulator` does not measure
/// intervals.
fn begin_part(accumulator: &mut Accumulator, part: RecordingPart) {
    flush(accumulator);
    if let Some(state) = &mut accumulator.intervals {
        state.begin_part(part as usize);
    }
}

/// Ends a part at the last readout that was pushed. Returns `None` if the part never began.
///
/// The result contains the intervals of the part, without the histogram of lengths and without the extremes. It also
/// contains the counts of the part, without coincidences.
fn end_part(accumulator: &mut Accumulator, part: RecordingPart) -> Option<Statistics> {
    flush(accumulator);
    let intervals = accumulator.intervals.as_mut()?.end_part(part as usize)?;
    Some(Statistics {
        geometry: accumulator.geometry,
        rows: accumulator.rows.clone(),
        readouts: intervals.readouts(),
        counts: Some(interval_counts(&intervals)),
        frames: None,
        intervals: Some(intervals),
        counts_before_split: None,
    })
}

fn flush(accumulator: &mut Accumulator) {
    if accumulator.intervals.is_some() && accumulator.block.len() > 0 {
        accumulator.process();
    }
}

/// Returns the counts that can be computed from the intervals.
fn interval_counts(intervals: &Intervals) -> Counts {
    let (first, last) = intervals.first_and_last_spikes().unzip();
    Counts {
        geometry: intervals.geometry,
        rows: intervals.rows.clone(),
        readouts: intervals.readouts(),
        count: intervals.spikes().collect(),
        first_spike: first,
        last_spike: last,
        coincidences: Default::default(),
    }
}

impl MeasuredRecording {
    /// Measures a whole stream. Calls `progress` with the number of readouts measured so far.
    ///
    /// # Errors
    /// Returns an error if the stream cannot be read, or if the stream is longer than an [`Accumulator`] accepts.
    pub fn from_stream(reader: &StreamReader, progress: &mut dyn FnMut(usize)) -> Result<Self> {
        let geometry = reader.geometry();
        let mut recorder = RecordingAccumulator::new(geometry, reader.readouts())?;
        let size = geometry.frame_bytes();
        let all = reader.readouts();
        let room = || inputs::zeroed_vec(reader.name(), BUFFER_READOUTS.min(all) * size);
        let (mut now, mut next) = (room()?, room()?);
        let batch = |at: usize| at..(at + BUFFER_READOUTS).min(all);
        reader.read_frames(0, &mut now[..batch(0).len() * size])?;
        let mut at = 0;
        while at < all {
            // One thread reads the next batch while the other threads measure the current batch.
            let (here, then) = (batch(at), batch((at + BUFFER_READOUTS).min(all)));
            let measured = || recorder.push(SpikeFramesRef::new(geometry, &now[..here.len() * size])?);
            let read = || reader.read_frames(then.start, &mut next[..then.len() * size]);
            let (measured, read) = threads::join(measured, read);
            measured.and(read)?;
            std::mem::swap(&mut now, &mut next);
            at = here.end;
            progress(at);
        }
        recorder.finish()
    }

    /// Measures packed readouts in memory.
    ///
    /// # Errors
    /// Those of [`Accumulator::push`].
    pub fn from_frames(frames: SpikeFramesRef<'_>) -> Result<Self> {
        let mut recorder = RecordingAccumulator::new(frames.geometry(), frames.readouts())?;
        recorder.push(frames)?;
        recorder.finish()
    }
}
