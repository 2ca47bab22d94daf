//! A recording measured whole, in halves and in quarters.
//!
//! Two halves are two recordings by the same sensor: pixel by pixel everything fixed is gone from their difference, and what
//! is left is what another recording would change. Parts end a sixteenth of the recording before the next one starts, so that a pixel's phase
//! at the start of the next is as good as drawn anew: side by side, the last spike of one would tell where the first one of the next falls
//! on the readouts, and the difference would scatter by too little or too much, as the interval is an odd or a whole number of them.

use rayon::prelude::*;

use super::scatter::{Scatter, gap};
use super::values::Quantity;
use crate::error::Result;
use crate::formats::Reader;
use crate::measure::stream::{bands, joined};
use crate::measure::{Accumulator, MeasureOptions, Statistics};
use crate::spikes::{Geometry, Packed};

/// Readouts read at a time.
const BATCH: usize = 496;

/// A recording, and how its statistics scatter between its parts.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Recording {
    /// The whole.
    pub statistics: Statistics,
    pub(super) scatter: Scatter,
}

/// Takes the readouts of a recording of known length.
pub struct Recorder {
    geometry: Geometry,
    of_parts: MeasureOptions,
    at: usize,
    quarter: usize,
    whole: Vec<Accumulator>,
    half: Vec<Accumulator>,
    part: Vec<Accumulator>,
    scatter: Scatter,
}

impl Recorder {
    /// A recorder for `readouts` readouts of a sensor, measured as by default.
    ///
    /// # Errors
    /// As [`Accumulator::new`].
    pub fn new(geometry: Geometry, readouts: usize) -> Result<Self> {
        let options = MeasureOptions::default();
        let (whole, quarter) = (bands(geometry, &options)?, readouts / 4);
        let quantities = Quantity::all(&options.lags);
        Ok(Self {
            geometry,
            at: 0,
            quarter,
            whole,
            half: Vec::new(),
            part: Vec::new(),
            scatter: Scatter::new(quantities, geometry, readouts),
            of_parts: MeasureOptions { frames: false, ..options },
        })
    }

    /// Takes the next readouts.
    ///
    /// # Errors
    /// As [`Accumulator::push`].
    pub fn push(&mut self, frames: Packed<'_>) -> Result<()> {
        let size = self.geometry.frame_bytes();
        let mut rest = frames.bytes();
        let kept = self.quarter - gap(self.quarter);
        while !rest.is_empty() && self.at < 4 * self.quarter {
            let within = self.at % self.quarter;
            let end = if within < kept { kept } else { self.quarter };
            let here = (end - within).min(rest.len() / size);
            let (now, later) = rest.split_at(here * size);
            self.push_all(Packed::new(self.geometry, now)?, within < kept)?;
            self.at += here;
            rest = later;
            self.end_parts()?;
        }
        push(&mut self.whole, &mut [], &mut [], Packed::new(self.geometry, rest)?)
    }

    /// Gives the whole, and the part and the half that are open, what is theirs of readouts that lie in a gap or not.
    fn push_all(&mut self, now: Packed<'_>, kept: bool) -> Result<()> {
        if self.at.is_multiple_of(self.quarter) {
            self.part = bands(self.geometry, &self.of_parts)?;
        }
        if self.at.is_multiple_of(2 * self.quarter) {
            self.half = bands(self.geometry, &self.of_parts)?;
        }
        // The first gap of a half is within it.
        let half =
            if kept || (self.at / self.quarter).is_multiple_of(2) { &mut self.half[..] } else { &mut [] };
        let part = if kept { &mut self.part[..] } else { &mut [] };
        push(&mut self.whole, half, part, now)
    }

    fn end_parts(&mut self) -> Result<()> {
        if self.at.is_multiple_of(self.quarter) {
            self.scatter.add_quarter(&joined(std::mem::take(&mut self.part))?);
        }
        if self.at.is_multiple_of(2 * self.quarter) {
            self.scatter.add_half(&joined(std::mem::take(&mut self.half))?);
        }
        Ok(())
    }

    /// What was recorded.
    ///
    /// # Errors
    /// As [`Statistics::join`].
    pub fn finish(self) -> Result<Recording> {
        Ok(Recording { statistics: joined(self.whole)?, scatter: self.scatter })
    }
}

/// Gives readouts to the accumulators of the whole, of a half and of a part, all side by side.
fn push(
    whole: &mut [Accumulator],
    half: &mut [Accumulator],
    part: &mut [Accumulator],
    frames: Packed<'_>,
) -> Result<()> {
    match whole.len() {
        0..=2 => whole.iter_mut().chain(half).chain(part).try_for_each(|a| a.push(frames)),
        _ => {
            let parts = half.par_iter_mut().chain(part.par_iter_mut());
            whole.par_iter_mut().chain(parts).with_max_len(1).try_for_each(|a| a.push(frames))
        }
    }
}

impl Recording {
    /// Measures a whole stream. `tell` hears how many readouts are done.
    ///
    /// # Errors
    /// When the stream cannot be read, or is too long.
    pub fn of_stream(reader: &Reader, tell: &mut dyn FnMut(usize)) -> Result<Self> {
        let geometry = reader.geometry();
        let mut recorder = Recorder::new(geometry, reader.readouts())?;
        let mut buffer = vec![0; BATCH * geometry.frame_bytes()];
        let mut at = 0;
        while at < reader.readouts() {
            let now = BATCH.min(reader.readouts() - at);
            let bytes = &mut buffer[..now * geometry.frame_bytes()];
            reader.read_frames(at, bytes)?;
            recorder.push(Packed::new(geometry, bytes)?)?;
            reader.release(at..at + now);
            at += now;
            tell(at);
        }
        recorder.finish()
    }

    /// Measures packed readouts in memory.
    ///
    /// # Errors
    /// As [`Accumulator::push`].
    pub fn of_packed(frames: Packed<'_>) -> Result<Self> {
        let mut recorder = Recorder::new(frames.geometry(), frames.readouts())?;
        recorder.push(frames)?;
        recorder.finish()
    }
}
