//! A recording measured whole, in halves and in quarters.
//!
//! Two halves are two recordings by the same sensor: pixel by pixel everything fixed is gone from their difference, and what
//! is left is what another recording would change. Parts end a sixteenth of the recording before the next one starts, so that a pixel's phase
//! at the start of the next is as good as drawn anew: side by side, the last spike of one would tell where the first one of the next falls
//! on the readouts, and the difference would scatter by too little or too much, as the interval is an odd or a whole number of them.

use super::part::{self, Part};
use super::scatter::{Scatter, gap};
use super::values::Quantity;
use crate::stream::{bands, joined};
use crate::{Accumulator, MeasureOptions, Statistics};
use spikelane::error::Result;
use spikelane::spikes::{Geometry, Packed};
use spikelane::unstable::inputs;
use spikelane::unstable::threads;
use spikelane_io::formats::Reader;

/// Readouts read at a time.
const BATCH: usize = 248;

/// A recording, and how its statistics scatter between its parts.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Recording {
    /// The whole, without the deviations of single readouts ([`Intervals::deviations`](crate::Intervals::deviations)).
    pub statistics: Statistics,
    pub(super) scatter: Scatter,
}

/// Takes the readouts of a recording of known length.
pub struct Recorder {
    geometry: Geometry,
    at: usize,
    quarter: usize,
    whole: Vec<Accumulator>,
    scatter: Scatter,
}

impl Recorder {
    /// A recorder for `readouts` readouts of a sensor, measured as by default but for the deviations of single readouts.
    ///
    /// # Errors
    /// As [`Accumulator::new`].
    pub fn new(geometry: Geometry, readouts: usize) -> Result<Self> {
        let options = MeasureOptions::default();
        // Nobody is told of each readout's intervals, which took a third of the time.
        let of_pixels = MeasureOptions { frames: false, series_readouts: 0, ..options.clone() };
        let of_frames = MeasureOptions { counts: false, intervals: false, ..options.clone() };
        let mut whole = bands(geometry, &of_pixels)?;
        whole.push(Accumulator::new(geometry, &of_frames)?);
        let scatter = Scatter::new(Quantity::all(&options.lags), geometry, readouts);
        Ok(Self { geometry, at: 0, quarter: readouts / 4, whole, scatter })
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
            if within == 0 {
                self.begin_parts();
            }
            let end = if within < kept { kept } else { self.quarter };
            let here = (end - within).min(rest.len() / size);
            let (now, later) = rest.split_at(here * size);
            self.push_all(Packed::new(self.geometry, now)?)?;
            self.at += here;
            rest = later;
            if within + here == kept {
                self.end_parts()?;
            }
        }
        self.push_all(Packed::new(self.geometry, rest)?)
    }

    /// Gives readouts to all accumulators, side by side.
    fn push_all(&mut self, frames: Packed<'_>) -> Result<()> {
        match self.whole.len() {
            0..=2 => self.whole.iter_mut().try_for_each(|a| a.push(frames)),
            _ => threads::try_map(&mut self.whole, |a| a.push(frames)).map(drop),
        }
    }

    /// Begins a quarter, and with every other one a half, which goes on in the gap within it.
    fn begin_parts(&mut self) {
        let half = self.at.is_multiple_of(2 * self.quarter);
        threads::map(&mut self.whole, |a| {
            part::begin(a, Part::Quarter);
            if half {
                part::begin(a, Part::Half);
            }
        });
    }

    /// Ends a quarter, and with every other one a half.
    fn end_parts(&mut self) -> Result<()> {
        let quarter = self.ended(Part::Quarter)?;
        self.scatter.add_quarter(&quarter);
        if !((self.at - 1) / self.quarter).is_multiple_of(2) {
            let half = self.ended(Part::Half)?;
            self.scatter.add_half(&half);
        }
        Ok(())
    }

    fn ended(&mut self, part: Part) -> Result<Statistics> {
        let parts: Vec<_> = threads::map(&mut self.whole, |a| part::end(a, part));
        Statistics::join(parts.into_iter().flatten().collect())
    }

    /// What was recorded.
    ///
    /// # Errors
    /// As [`Statistics::join`].
    pub fn finish(self) -> Result<Recording> {
        Ok(Recording { statistics: joined(self.whole)?, scatter: self.scatter })
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
        let size = geometry.frame_bytes();
        let all = reader.readouts();
        let room = || inputs::zeroed(reader.name(), BATCH.min(all) * size);
        let (mut now, mut next) = (room()?, room()?);
        let batch = |at: usize| at..(at + BATCH).min(all);
        reader.read_frames(0, &mut now[..batch(0).len() * size])?;
        let mut at = 0;
        while at < all {
            // One core reads on while others measure.
            let (here, then) = (batch(at), batch((at + BATCH).min(all)));
            let measured = || recorder.push(Packed::new(geometry, &now[..here.len() * size])?);
            let read = || reader.read_frames(then.start, &mut next[..then.len() * size]);
            let (measured, read) = threads::join(measured, read);
            measured.and(read)?;
            std::mem::swap(&mut now, &mut next);
            at = here.end;
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
