//! The duration of the frames of a source.

use super::frame::Source;
use super::rate::Rate;
use super::timeline::{Interpolation, Timeline};
use crate::error::Result;

/// Number of readouts per frame for a source without frame times and without a rate.
///
/// At 20 kHz, 20 readouts last 1 ms. Motion at 1,000 pixels per second moves one pixel in 1 ms.
pub const DEFAULT_READOUTS_PER_FRAME: u64 = 20;

/// The frame timing that the user requests. A field that is `None` uses the timing of the source.
///
/// # Examples
/// ```
/// use spikelane::Geometry;
/// use spikelane::light::{Chart, FrameTiming, Interpolation, Rate};
/// let chart = Chart::new(Geometry::new(64, 48)?, Rate::new(1000, 1)?, None)?;
/// let readout = Rate::new(20_000, 1)?;
/// let readouts_per_frame = |timing: FrameTiming| {
///     Ok::<_, spikelane::Error>(timing.timeline(&chart, readout, Interpolation::Linear)?.first_readout(1))
/// };
/// // By default the source determines the rate: 1,000 frames per second.
/// assert_eq!(readouts_per_frame(FrameTiming::default())?, Some(20));
/// let slow = FrameTiming { frame_rate: Some(Rate::new(50, 1)?), ..FrameTiming::default() };
/// assert_eq!(readouts_per_frame(slow)?, Some(400));
/// # Ok::<(), spikelane::Error>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FrameTiming {
    /// Number of readouts per frame.
    pub readouts_per_frame: Option<u64>,
    /// Frames per second. This rate replaces the rate of the source.
    pub frame_rate: Option<Rate>,
}

impl FrameTiming {
    /// Returns whether neither the user nor the source states a timing.
    #[must_use]
    pub fn is_guessed(&self, source: &dyn Source) -> bool {
        let has_explicit_rate = self.readouts_per_frame.is_some() || self.frame_rate.is_some();
        !has_explicit_rate && source.frame_times().is_none() && source.rate().is_none()
    }

    /// Returns the timeline. The first present item of this list determines the timing:
    ///
    /// 1. the readouts per frame that the user requests,
    /// 2. the frame rate that the user requests,
    /// 3. the frame times of the source,
    /// 4. the frame rate of the source,
    /// 5. the default [`DEFAULT_READOUTS_PER_FRAME`].
    ///
    /// # Errors
    /// Returns the errors of [`Timeline::from_readouts_per_frame`], [`Timeline::from_rates`] and [`Timeline::from_times`].
    pub fn timeline(
        &self,
        source: &dyn Source,
        readout: Rate,
        interpolation: Interpolation,
    ) -> Result<Timeline> {
        if let Some(readouts) = self.readouts_per_frame {
            return Timeline::from_readouts_per_frame(readouts, interpolation);
        }
        match (self.frame_rate, source.frame_times(), source.rate()) {
            (None, Some(times), _) if times.len() > 1 => Timeline::from_times(times, readout, interpolation),
            (Some(rate), ..) | (None, _, Some(rate)) => Timeline::from_rates(rate, readout, interpolation),
            _ => Timeline::from_readouts_per_frame(DEFAULT_READOUTS_PER_FRAME, interpolation),
        }
    }
}
