//! Which frame a readout sees.
//!
//! Frames come at one rate and readouts at another. Readout `i` happens at time
//! `i / readout_rate` and frame `k` at `k / frame_rate`; both rates are
//! fractions, so the ratio is one too, and no readout drifts however long the
//! video is. (Floats go wrong after about a minute of 30000/1001 at 40 kHz.)

use std::str::FromStr;
use std::sync::Arc;

use crate::error::{Error, Kind, Result};
use crate::light::rate::Rate;

/// What the light does between two frames.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Insertion {
    /// It stays what the last frame was.
    #[default]
    Hold,
    /// It goes in a straight line to the next frame.
    Linear,
    /// It moves to the next frame along an estimated motion ([`crate::light::Between`]).
    Flow,
}

impl FromStr for Insertion {
    type Err = Error;

    /// `hold`, `linear` or `flow`.
    fn from_str(text: &str) -> Result<Self> {
        match text {
            "hold" => Ok(Self::Hold),
            "linear" => Ok(Self::Linear),
            "flow" => Ok(Self::Flow),
            _ => Err(Error::new(Kind::Usage, "frame insertion")
                .found(format_args!("`{text}`"))
                .expected("hold, linear or flow")),
        }
    }
}

impl std::fmt::Display for Insertion {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Hold => "hold",
            Self::Linear => "linear",
            Self::Flow => "flow",
        })
    }
}

/// The light of one readout: between frame `frame` and the one after it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Moment {
    /// Index of the frame at or before the readout.
    pub frame: u64,
    /// How far on towards the next frame, in units of `1 / of`; 0 for [`Insertion::Hold`].
    pub part: u64,
    /// The denominator of `part`; at least 1.
    pub of: u64,
}

impl Moment {
    /// Weight of the next frame, 0 up to but not including 1.
    #[must_use]
    pub fn weight(self) -> f32 {
        // The largest fractions round up to 1.0; that is a valid weight too.
        (self.part as f64 / self.of as f64) as f32
    }
}

/// Maps readouts to frames: readout `i` is at frame position `i * num / den`, or where the times of the frames say.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Timeline {
    num: u64,
    den: u64,
    insertion: Insertion,
    /// Nanoseconds of each frame after the first; readout `i` is then at `i * num / den` nanoseconds.
    starts: Option<Arc<[u64]>>,
}

impl Timeline {
    /// The first frame for every readout, however many.
    #[must_use]
    pub const fn still() -> Self {
        Self { num: 0, den: 1, insertion: Insertion::Hold, starts: None }
    }

    /// Each frame for `readouts` readouts.
    ///
    /// # Examples
    /// ```
    /// use spikelane::light::{Insertion, Timeline};
    /// let timeline = Timeline::per_frame(20, Insertion::Linear)?;
    /// let moment = timeline.at(30);
    /// assert_eq!((moment.frame, moment.weight()), (1, 0.5));
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    ///
    /// # Errors
    /// [`Kind::Usage`] for zero.
    pub fn per_frame(readouts: u64, insertion: Insertion) -> Result<Self> {
        if readouts == 0 {
            return Err(Error::new(Kind::Usage, "readouts per frame").found(0).expected("at least 1"));
        }
        Ok(Self { num: 1, den: readouts, insertion, starts: None })
    }

    /// Frames at `source` per second, readouts at `readout` per second. A
    /// source faster than the readouts has frames that no readout sees.
    ///
    /// # Errors
    /// [`Kind::Usage`] when the ratio of the two does not fit 64-bit integers.
    pub fn rates(source: Rate, readout: Rate, insertion: Insertion) -> Result<Self> {
        let num = u128::from(source.num) * u128::from(readout.den);
        let den = u128::from(source.den) * u128::from(readout.num);
        let g = gcd128(num, den);
        match (u64::try_from(num / g), u64::try_from(den / g)) {
            (Ok(num), Ok(den)) => Ok(Self { num, den, insertion, starts: None }),
            _ => Err(Error::new(Kind::Usage, "frame and readout rates")
                .found(format_args!("{source} and {readout} per second"))
                .expected("a ratio of two 64-bit numbers")
                .remedy("round one of them")),
        }
    }

    /// Frame `k` at `starts[k]` nanoseconds, readouts at `readout` per second, both from 0 on. The last frame lasts as
    /// long as the one before it.
    ///
    /// # Errors
    /// [`Kind::Input`] for fewer than two frames, times that do not begin at 0 and rise, or beyond 11 days.
    pub fn times(starts: &[u64], readout: Rate, insertion: Insertion) -> Result<Self> {
        const MOST: u64 = 1_000_000_000_000_000;
        let rises = starts.windows(2).all(|w| w[0] < w[1]);
        if starts.len() < 2 || starts[0] != 0 || !rises || starts[starts.len() - 1] > MOST {
            return Err(Error::new(Kind::Input, "times of frames")
                .found(format_args!("{} times", starts.len()))
                .expected("two or more that rise from 0, at most 11 days"));
        }
        let ratio = Self::rates(Rate::new(1_000_000_000, 1)?, readout, insertion)?;
        Ok(Self { starts: Some(starts.into()), ..ratio })
    }

    /// The time of frame `frame` in nanoseconds; frames beyond the last go on as the last two did.
    fn start(starts: &[u64], frame: u64) -> u128 {
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

    /// As [`Timeline::at`], of frames that come when they come.
    fn at_time(&self, starts: &[u64], readout: u64) -> Moment {
        let (time, den) = (u128::from(readout) * u128::from(self.num), u128::from(self.den));
        let last = starts.len() as u64 - 1;
        let mut frame = starts.partition_point(|&s| u128::from(s) * den <= time) as u64 - 1;
        if frame == last {
            let gap = u128::from(starts[last as usize] - starts[last as usize - 1]) * den;
            frame += u64::try_from((time - u128::from(starts[last as usize]) * den) / gap)
                .unwrap_or(u64::MAX - last);
        }
        let from = Self::start(starts, frame) * den;
        let (mut part, mut of) = (time - from, Self::start(starts, frame.saturating_add(1)) * den - from);
        while of > u128::from(u64::MAX) {
            (part, of) = (part >> 1, of >> 1);
        }
        let part = if self.insertion == Insertion::Hold { 0 } else { part as u64 };
        Moment { frame, part, of: (of as u64).max(1) }
    }

    /// How frames are filled in.
    #[must_use]
    pub const fn insertion(&self) -> Insertion {
        self.insertion
    }

    /// The frame, and the way on to the next, of readout `readout`.
    ///
    /// Where the next frame does not exist, the last one stays: see [`Moment::frame`]
    /// and [`Timeline::at_end`].
    #[must_use]
    pub fn at(&self, readout: u64) -> Moment {
        if let Some(starts) = &self.starts {
            return self.at_time(starts, readout);
        }
        let position = u128::from(readout) * u128::from(self.num);
        let den = u128::from(self.den);
        // Beyond 2^64 frames the last one stays; nothing is that long.
        let frame = u64::try_from(position / den).unwrap_or(u64::MAX);
        let part = match self.insertion {
            Insertion::Hold => 0,
            Insertion::Linear | Insertion::Flow => (position % den) as u64,
        };
        Moment { frame, part, of: self.den }
    }

    /// As [`Timeline::at`], for a source of `frames` frames whose last one stays.
    ///
    /// # Errors
    /// [`Kind::Input`] when there are no frames.
    pub fn at_end(&self, readout: u64, frames: u64) -> Result<Moment> {
        let last = frames.checked_sub(1).ok_or_else(|| {
            Error::new(Kind::Input, "frames of light").found("none").expected("at least one frame")
        })?;
        let moment = self.at(readout);
        Ok(if moment.frame >= last { Moment { frame: last, part: 0, of: moment.of } } else { moment })
    }

    /// The first readout at or after `frame`; `None` when it never comes
    /// ([`Timeline::still`]) or lies beyond 64 bits.
    #[must_use]
    pub fn first_readout(&self, frame: u64) -> Option<u64> {
        if frame == 0 {
            return Some(0);
        }
        if self.num == 0 {
            return None;
        }
        if let Some(starts) = &self.starts {
            let at = (Self::start(starts, frame) * u128::from(self.den)).div_ceil(u128::from(self.num));
            return u64::try_from(at).ok();
        }
        let at = (u128::from(frame) * u128::from(self.den)).div_ceil(u128::from(self.num));
        u64::try_from(at).ok()
    }

    /// How many readouts `frames` frames last, the last one as long as any; `None` when
    /// nothing limits them ([`Timeline::still`]).
    #[must_use]
    pub fn readouts(&self, frames: u64) -> Option<u64> {
        self.first_readout(frames)
    }
}

fn gcd128(a: u128, b: u128) -> u128 {
    if b == 0 { a } else { gcd128(b, a % b) }
}
