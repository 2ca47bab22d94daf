//! The mapping from readouts to frames.
//!
//! Frames and readouts have different rates. Readout `i` is at `i / readout_rate` seconds, and frame `k` is at `k /
//! frame_rate` seconds. Both rates are fractions of integers, so their ratio is exact. The mapping therefore has no
//! drift, regardless of the length of the video. (A ratio in floats would select wrong frames after about a minute of
//! 30000/1001 frames per second at 40 kHz.)

use std::sync::Arc;

use crate::count::Count;
use crate::error::{Result, bail, error};
use crate::light::rate::{Rate, gcd};
use crate::variants::named_variants;

/// The method that computes the light between two frames.
///
/// # Examples
/// ```
/// use spikelane::light::Interpolation;
/// assert_eq!("linear".parse::<Interpolation>()?, Interpolation::Linear);
/// assert_eq!(Interpolation::default().to_string(), "hold");
/// let error = "cubic".parse::<Interpolation>().unwrap_err();
/// assert_eq!(error.to_string(), "frame interpolation: found `cubic`, expected hold, linear or flow");
/// # Ok::<(), spikelane::Error>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Interpolation {
    /// The light of the previous frame, without change.
    #[default]
    Hold,
    /// Linear interpolation to the next frame.
    Linear,
    /// Interpolation along the estimated motion between the two frames ([`crate::light::FlowInterpolator`]).
    Flow,
}

named_variants!(Interpolation, "frame interpolation" { Hold = "hold", Linear = "linear", Flow = "flow" });

/// The position of a readout between frame `frame` and the next frame.
///
/// # Examples
/// ```
/// use spikelane::light::{Interpolation, Timeline};
/// let timeline = Timeline::from_readouts_per_frame(4, Interpolation::Linear)?;
/// let position = timeline.position(11);
/// // Readout 11 is three quarters of the way from frame 2 to frame 3.
/// assert_eq!((position.frame, position.numerator, position.denominator), (2, 3, 4));
/// assert_eq!(position.weight(), 0.75);
/// # Ok::<(), spikelane::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct FramePosition {
    /// Index of the frame at or before the readout.
    pub frame: u64,
    /// Numerator of the position between the two frames; 0 for [`Interpolation::Hold`].
    pub numerator: u64,
    /// Denominator of the position between the two frames. It is at least 1.
    pub denominator: u64,
}

impl FramePosition {
    /// Returns the weight of the next frame, 0 to 1.
    #[must_use]
    pub fn weight(self) -> f32 {
        // The largest fractions are rounded to 1.0, which is a valid weight too.
        (self.numerator as f64 / self.denominator as f64) as f32
    }
}

/// The mapping from readouts to frames.
///
/// Readout `i` is at frame position `i * num / den`. If the frames have individual start times, the frame position
/// follows from the start times instead.
///
/// # Examples
/// ```
/// use spikelane::light::{Interpolation, Rate, Timeline};
/// // A video of 25 frames per second and a camera of 20,000 readouts per second.
/// let timeline = Timeline::from_rates(Rate::new(25, 1)?, Rate::new(20_000, 1)?, Interpolation::Hold)?;
/// assert_eq!(timeline.readouts(10), Some(8000));
/// assert_eq!(timeline.position(799).frame, 0);
/// assert_eq!(timeline.first_readout(1), Some(800));
/// # Ok::<(), spikelane::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Timeline {
    num: u64,
    den: u64,
    interpolation: Interpolation,
    /// Start time in nanoseconds, or first readout, of each frame. If present, readout `i` is at `i * num / den` in this
    /// unit.
    starts: Option<Arc<[u64]>>,
}

impl Timeline {
    /// Returns a timeline that shows the first frame at every readout.
    ///
    /// # Examples
    /// ```
    /// use spikelane::light::Timeline;
    /// let timeline = Timeline::first_frame();
    /// assert_eq!(timeline.position(1_000_000).frame, 0);
    /// assert_eq!(timeline.first_readout(1), None);
    /// ```
    #[must_use]
    pub const fn first_frame() -> Self {
        Self { num: 0, den: 1, interpolation: Interpolation::Hold, starts: None }
    }

    /// Returns a timeline that shows each frame for `readouts` readouts.
    ///
    /// # Examples
    /// ```
    /// use spikelane::light::{Interpolation, Timeline};
    /// let timeline = Timeline::from_readouts_per_frame(20, Interpolation::Linear)?;
    /// let moment = timeline.position(30);
    /// assert_eq!((moment.frame, moment.weight()), (1, 0.5));
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    ///
    /// # Errors
    /// Returns [`ErrorKind::Usage`](crate::ErrorKind::Usage) if `readouts` is zero.
    pub fn from_readouts_per_frame(readouts: u64, interpolation: Interpolation) -> Result<Self> {
        if readouts == 0 {
            bail!(Usage, "readouts per frame"; found "0"; expected "at least 1");
        }
        Ok(Self { num: 1, den: readouts, interpolation, starts: None })
    }

    /// Returns the timeline for `source` frames per second and `readout` readouts per second.
    ///
    /// If the source has more frames than readouts per second, no readout shows some of the frames.
    ///
    /// # Examples
    /// ```
    /// use spikelane::light::{Interpolation, Rate, Timeline};
    /// let (ntsc, readout) = ("29.97".parse()?, Rate::new(40_000, 1)?);
    /// let timeline = Timeline::from_rates(ntsc, readout, Interpolation::Linear)?;
    /// // 30,000 frames last exactly 1,001 seconds.
    /// assert_eq!(timeline.readouts(30_000), Some(1001 * 40_000));
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    ///
    /// # Errors
    /// Returns [`ErrorKind::Usage`](crate::ErrorKind::Usage) if the ratio of the two rates does not fit in 64-bit integers.
    pub fn from_rates(source: Rate, readout: Rate, interpolation: Interpolation) -> Result<Self> {
        let num = u128::from(source.num) * u128::from(readout.den);
        let den = u128::from(source.den) * u128::from(readout.num);
        let divisor = gcd(num, den);
        match (u64::try_from(num / divisor), u64::try_from(den / divisor)) {
            (Ok(num), Ok(den)) => Ok(Self { num, den, interpolation, starts: None }),
            _ => Err(error!(Usage, "frame and readout rates"; found "{source} and {readout} per second";
                expected "a ratio of two 64-bit numbers"; remedy "round one of the rates")),
        }
    }

    /// Returns the timeline on which frame `k` starts at `starts[k]` nanoseconds, with `readout` readouts per second.
    ///
    /// The first readout is at 0. The duration of the last frame equals the duration of the frame before the last.
    ///
    /// # Examples
    /// ```
    /// use spikelane::light::{Interpolation, Rate, Timeline};
    /// // Frames at 0 ms, 1 ms and 3 ms, and a readout every millisecond.
    /// let readout = Rate::new(1000, 1)?;
    /// let timeline = Timeline::from_times(&[0, 1_000_000, 3_000_000], readout, Interpolation::Linear)?;
    /// let position = timeline.position(2);
    /// assert_eq!((position.frame, position.weight()), (1, 0.5));
    ///
    /// let error = Timeline::from_times(&[5, 3], readout, Interpolation::Linear).unwrap_err();
    /// assert_eq!(error.kind(), spikelane::ErrorKind::Input);
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    ///
    /// # Errors
    /// Returns [`ErrorKind::Input`](crate::ErrorKind::Input) if there are fewer than two start times, if the first start time is not 0, if the
    /// start times do not increase, or if a start time exceeds 11 days.
    pub fn from_times(starts: &[u64], readout: Rate, interpolation: Interpolation) -> Result<Self> {
        const MAX_NANOSECONDS: u64 = 1_000_000_000_000_000;
        let rises = starts.windows(2).all(|w| w[0] < w[1]);
        if starts.len() < 2 || starts[0] != 0 || !rises || starts[starts.len() - 1] > MAX_NANOSECONDS {
            bail!(Input, "times of frames"; found "{}", Count(starts.len(), "time");
                expected "at least two times that start at 0 and increase, at most 11 days");
        }
        let ratio = Self::from_rates(Rate::new(1_000_000_000, 1)?, readout, interpolation)?;
        Ok(Self { starts: Some(starts.into()), ..ratio })
    }

    /// Returns the timeline on which frame `k` starts at readout `first_readouts[k]`.
    ///
    /// # Examples
    /// ```
    /// use spikelane::light::{Interpolation, Timeline};
    /// let timeline = Timeline::from_first_readouts(&[0, 4, 10], Interpolation::Linear)?;
    /// let position = timeline.position(7);
    /// assert_eq!((position.frame, position.weight()), (1, 0.5));
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    ///
    /// # Errors
    /// Returns the errors of [`Timeline::from_times`].
    pub fn from_first_readouts(first_readouts: &[u64], interpolation: Interpolation) -> Result<Self> {
        let readout = Rate::new(1_000_000_000, 1)?;
        Self::from_times(first_readouts, readout, interpolation)
    }

    /// Returns the start time of frame `frame` in nanoseconds. Frames after the last frame have the duration of the last
    /// interval.
    fn frame_start(starts: &[u64], frame: u64) -> u128 {
        let last = starts.len() - 1;
        let index = usize::try_from(frame).unwrap_or(usize::MAX);
        match starts.get(index) {
            Some(&start) => start.into(),
            None => {
                let gap = u128::from(starts[last] - starts[last - 1]);
                u128::from(starts[last]) + u128::from(frame - last as u64) * gap
            }
        }
    }

    /// Implements [`Timeline::position`] for frames with individual start times.
    fn position_at_time(&self, starts: &[u64], readout: u64) -> FramePosition {
        let (time, den) = (u128::from(readout) * u128::from(self.num), u128::from(self.den));
        let last = starts.len() as u64 - 1;
        let mut frame = starts.partition_point(|&s| u128::from(s) * den <= time) as u64 - 1;
        if frame == last {
            let gap = u128::from(starts[last as usize] - starts[last as usize - 1]) * den;
            frame += u64::try_from((time - u128::from(starts[last as usize]) * den) / gap)
                .unwrap_or(u64::MAX - last);
        }
        let from = Self::frame_start(starts, frame) * den;
        let (mut part, mut duration) =
            (time - from, Self::frame_start(starts, frame.saturating_add(1)) * den - from);
        while duration > u128::from(u64::MAX) {
            (part, duration) = (part >> 1, duration >> 1);
        }
        let part = if self.interpolation == Interpolation::Hold { 0 } else { part as u64 };
        FramePosition { frame, numerator: part, denominator: (duration as u64).max(1) }
    }

    /// Returns whether the frames have individual start times.
    #[must_use]
    pub const fn has_frame_times(&self) -> bool {
        self.starts.is_some()
    }

    /// Returns the interpolation between frames.
    #[must_use]
    pub const fn interpolation(&self) -> Interpolation {
        self.interpolation
    }

    /// Returns the frame position of readout `readout`.
    ///
    /// This function assumes that the frames never end. If the last frame of the source persists, use
    /// [`Timeline::position_within`].
    #[must_use]
    pub fn position(&self, readout: u64) -> FramePosition {
        if let Some(starts) = &self.starts {
            return self.position_at_time(starts, readout);
        }
        let position = u128::from(readout) * u128::from(self.num);
        let den = u128::from(self.den);
        // A position of more than 2^64 frames cannot occur in practice, so the index may saturate.
        let frame = u64::try_from(position / den).unwrap_or(u64::MAX);
        let part = match self.interpolation {
            Interpolation::Hold => 0,
            Interpolation::Linear | Interpolation::Flow => (position % den) as u64,
        };
        FramePosition { frame, numerator: part, denominator: self.den }
    }

    /// Returns the frame position of readout `readout` for a source of `frames` frames whose last frame persists.
    ///
    /// # Examples
    /// ```
    /// use spikelane::light::{Interpolation, Timeline};
    /// let timeline = Timeline::from_readouts_per_frame(20, Interpolation::Linear)?;
    /// // The last of three frames persists.
    /// assert_eq!(timeline.position_within(1000, 3)?.frame, 2);
    /// assert_eq!(timeline.position(1000).frame, 50);
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    ///
    /// # Errors
    /// Returns [`ErrorKind::Input`](crate::ErrorKind::Input) if `frames` is zero.
    pub fn position_within(&self, readout: u64, frames: u64) -> Result<FramePosition> {
        let last = frames
            .checked_sub(1)
            .ok_or_else(|| error!(Input, "frames of light"; found "none"; expected "at least one frame"))?;
        let moment = self.position(readout);
        Ok(if moment.frame >= last {
            FramePosition { frame: last, numerator: 0, denominator: moment.denominator }
        } else {
            moment
        })
    }

    /// Returns the first readout at or after the start of frame `frame`.
    ///
    /// Returns `None` if the timeline never reaches `frame` ([`Timeline::first_frame`]), or if the index of the readout
    /// exceeds 64 bits.
    #[must_use]
    pub fn first_readout(&self, frame: u64) -> Option<u64> {
        if frame == 0 {
            return Some(0);
        }
        if self.num == 0 {
            return None;
        }
        if let Some(starts) = &self.starts {
            let at = (Self::frame_start(starts, frame) * u128::from(self.den)).div_ceil(u128::from(self.num));
            return u64::try_from(at).ok();
        }
        let at = (u128::from(frame) * u128::from(self.den)).div_ceil(u128::from(self.num));
        u64::try_from(at).ok()
    }

    /// Returns the number of readouts during `frames` frames.
    ///
    /// The last frame is assumed to last as long as the frame before it.
    ///
    /// Returns `None` if the number is unlimited ([`Timeline::first_frame`]).
    #[must_use]
    pub fn readouts(&self, frames: u64) -> Option<u64> {
        self.first_readout(frames)
    }
}
