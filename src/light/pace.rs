//! How long the frames of a source last.

use super::frame::Source;
use super::rate::Rate;
use super::timeline::{Insertion, Timeline};
use crate::error::Result;

/// Readouts of a frame of a source that states neither times nor a rate: a millisecond at 20 kHz, in which what moves
/// by 1,000 pixels a second moves by one.
pub const READOUTS_PER_FRAME: u64 = 20;

/// What the user says of it; what is `None` is as the source states.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Pace {
    /// Readouts of each frame.
    pub readouts_per_frame: Option<u64>,
    /// Frames per second, in place of the source's own.
    pub source: Option<Rate>,
}

impl Pace {
    /// Whether neither the user nor the source says anything.
    #[must_use]
    pub fn is_guessed(&self, source: &dyn Source) -> bool {
        let said = self.readouts_per_frame.is_some() || self.source.is_some();
        !said && source.times().is_none() && source.rate().is_none()
    }

    /// The timeline: readouts per frame, a rate, the source's times, its rate, or 20 readouts for each frame, whichever is
    /// there first.
    ///
    /// # Errors
    /// As [`Timeline::per_frame`], [`Timeline::rates`] and [`Timeline::times`].
    pub fn timeline(&self, source: &dyn Source, readout: Rate, insertion: Insertion) -> Result<Timeline> {
        if let Some(readouts) = self.readouts_per_frame {
            return Timeline::per_frame(readouts, insertion);
        }
        match (self.source, source.times(), source.rate()) {
            (None, Some(times), _) if times.len() > 1 => Timeline::times(times, readout, insertion),
            (Some(rate), ..) | (None, _, Some(rate)) => Timeline::rates(rate, readout, insertion),
            _ => Timeline::per_frame(READOUTS_PER_FRAME, insertion),
        }
    }
}
