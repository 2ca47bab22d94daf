//! One image: a single frame, or a set motion over it.

use std::path::{Path, PathBuf};

use crate::error::{Error, Kind, Result};
use crate::light::picture::{self, Linear};
use crate::light::{Fit, Frame, Motion, Rate, Source, Transfer};
use crate::spikes::Geometry;

/// One picture and how the camera moves over it.
#[derive(Debug)]
pub struct Still {
    path: PathBuf,
    size: Geometry,
    camera: Geometry,
    picture: Frame,
    moving: Option<(Motion, Rate)>,
    frames: u64,
    next: u64,
}

impl Still {
    /// Reads a picture that gives one frame.
    ///
    /// # Errors
    /// As [`picture::read`] and [`Fit::apply`].
    pub fn open(path: &Path, camera: Geometry, fit: Fit, transfer: Option<Transfer>) -> Result<Self> {
        let read = picture::read(path, &Linear::new(transfer))?;
        let size = read.geometry();
        let picture = fit.apply(read, camera).map_err(|e| e.within(path.display()))?;
        Ok(Self { path: path.to_owned(), size, camera, picture, moving: None, frames: 1, next: 0 })
    }

    /// Reads a picture over which the camera moves for `frames` frames at `rate`.
    ///
    /// # Errors
    /// As [`Still::open`]; [`Kind::Usage`] for no frames.
    pub fn open_moving(
        path: &Path,
        camera: Geometry,
        fit: Fit,
        transfer: Option<Transfer>,
        (motion, rate, frames): (Motion, Rate, u64),
    ) -> Result<Self> {
        if frames == 0 {
            return Err(Error::new(Kind::Usage, "frames of motion").found(0).expected("at least 1"));
        }
        let read = picture::read(path, &Linear::new(transfer))?;
        let size = read.geometry();
        let picture = fit.whole(read, camera).map_err(|e| e.within(path.display()))?;
        Ok(Self {
            path: path.to_owned(),
            size,
            camera,
            picture,
            moving: Some((motion, rate)),
            frames,
            next: 0,
        })
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
            None => self.picture.clone(),
            Some((motion, rate)) => motion.view(&self.picture, self.camera, *rate, self.next)?,
        };
        self.next += 1;
        Ok(true)
    }

    fn rate(&self) -> Option<Rate> {
        self.moving.map(|(_, rate)| rate)
    }

    fn describe(&self) -> String {
        let path = self.path.display();
        match &self.moving {
            None => format!("{path}: one image of {}", self.size),
            Some((_, rate)) => format!(
                "{path}: motion over an image of {}, {} frames at {rate} per second",
                self.size, self.frames
            ),
        }
    }
}
