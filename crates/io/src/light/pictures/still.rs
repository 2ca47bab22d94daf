//! One image: a single frame, or a set motion over it.

use std::path::{Path, PathBuf};

use super::picture;
use super::picture::Linear;
use crate::light::fit::Fit;
use crate::light::fit::Whole;
use crate::light::motion::Motion;
use spikelane::error::{Error, Kind, Result};
use spikelane::light::Rate;
use spikelane::light::{Frame, Source};
use spikelane::sensor::FrontEnd;
use spikelane::spikes::Geometry;

/// A motion, and the whole picture over which it goes.
#[derive(Debug)]
struct Moving {
    whole: Whole,
    motion: Motion,
    rate: Rate,
}

/// One picture and how the camera moves over it.
#[derive(Debug)]
pub struct Still {
    path: PathBuf,
    size: Geometry,
    camera: Geometry,
    /// The picture as the camera sees it at rest.
    picture: Frame,
    moving: Option<Moving>,
    front_end: FrontEnd,
    frames: u64,
    next: u64,
}

impl Still {
    /// Reads a picture that gives one frame.
    ///
    /// # Errors
    /// As [`picture::read`] and [`Fit::apply`].
    pub fn open(path: &Path, camera: Geometry, fit: Fit, linear: &Linear) -> Result<Self> {
        let read = picture::read(path, linear)?;
        let (size, floats) = (read.geometry(), picture::header(path)?.floats);
        let picture = fit.apply(read, camera).map_err(|e| e.within(path.display()))?;
        let path = path.to_owned();
        let front_end = linear.used(floats);
        Ok(Self { path, size, camera, picture, moving: None, front_end, frames: 1, next: 0 })
    }

    /// Reads a picture over which the camera moves for `frames` frames at `rate`.
    ///
    /// # Errors
    /// As [`Still::open`]; [`Kind::Usage`] for no frames.
    pub fn open_moving(
        path: &Path,
        camera: Geometry,
        fit: Fit,
        linear: &Linear,
        (motion, rate, frames): (Motion, Rate, u64),
    ) -> Result<Self> {
        if frames == 0 {
            return Err(Error::new(Kind::Usage, "frames of motion").found(0).expected("at least 1"));
        }
        let still = Self::open(path, camera, fit, linear)?;
        let whole = Whole::new(picture::read(path, linear)?, camera, fit);
        let whole = whole.map_err(|e| e.within(path.display()))?;
        Ok(Self { moving: Some(Moving { whole, motion, rate }), frames, ..still })
    }
}

impl Source for Still {
    fn geometry(&self) -> Geometry {
        self.camera
    }

    fn frames(&self) -> Option<u64> {
        Some(self.frames)
    }

    fn next_frame(&mut self, into: &mut Frame) -> Result<bool> {
        if self.next == self.frames {
            return Ok(false);
        }
        *into = match &self.moving {
            Some(m) if !m.motion.is_at_rest(m.rate, self.next) => {
                m.motion.view(&m.whole, self.camera, m.rate, self.next)?
            }
            _ => self.picture.clone(),
        };
        self.next += 1;
        Ok(true)
    }

    fn stored(&self) -> Option<Geometry> {
        Some(self.size)
    }

    fn rate(&self) -> Option<Rate> {
        self.moving.as_ref().map(|m| m.rate)
    }

    fn front_end(&self) -> FrontEnd {
        self.front_end
    }

    fn describe(&self) -> String {
        let path = self.path.display();
        match &self.moving {
            None => format!("{path}: one image of {}", self.size),
            Some(Moving { rate, .. }) => format!(
                "{path}: motion over an image of {}, {} frames at {rate} per second",
                self.size, self.frames
            ),
        }
    }
}
