//! YUV4MPEG2 video (`.y4m`), from a file or a pipe.
//!
//! Luminance is a sum of *linear* colours, and Y' is a sum of coded ones, so
//! a colour frame goes Y'CbCr -> R'G'B' -> linear -> luminance; the shortcut
//! from Y' alone is wrong by a third on saturated colours. Subsampled chroma is
//! repeated, not interpolated. Mono frames have only Y'.
//!
//! The header may say `XCOLORRANGE=FULL` or `LIMITED`; without it colour is limited
//! (16 to 235) and mono is full, as ffmpeg treats them. It never says which
//! matrix was used: see [`Matrix`]. R'G'B' outside 0 to 1 is clipped.

use std::io::Read;
use std::path::Path;

use super::yuv::Known;
use crate::light::fit::Fit;
use crate::light::pictures::picture::Linear;
use spikelane::error::{Error, Kind, Result};
use spikelane::light::Rate;
use spikelane::light::{Frame, Source};
use spikelane::sensor::FrontEnd;
use spikelane::spikes::Geometry;
use spikelane::unstable::inputs::InputFile;

pub use super::y4m_reader::{MAGIC, Reader};
pub use super::yuv::Matrix;

/// A `.y4m` video as frames at the camera's size.
pub struct Video {
    reader: Reader<Box<dyn Read + Send>>,
    frames: Option<u64>,
    linear: Linear,
    fit: Fit,
    camera: Geometry,
}

impl Video {
    /// Opens a file and counts its frames by their headers alone.
    ///
    /// # Errors
    /// As [`Reader::new`]; [`Kind::Input`] too when the last frame is cut short or there is none.
    pub fn open(path: &Path, camera: Geometry, fit: Fit, linear: Linear) -> Result<Self> {
        let name = path.display().to_string();
        let input = Box::new(InputFile::open(path)?.into_reader());
        let mut video = Self::from_reader(input, &name, camera, fit, linear)?;
        let frames = video.reader.count(&InputFile::open(path)?)?;
        if frames == 0 {
            return Err(Error::new(Kind::Input, name).found("no frame").expected("at least one frame"));
        }
        video.frames = Some(frames);
        Ok(video)
    }

    /// Reads a stream; `name` stands for it in errors.
    ///
    /// # Errors
    /// As [`Reader::new`], and when [`Fit::Crop`] finds the video too small.
    pub fn from_reader(
        reader: Box<dyn Read + Send>,
        name: &str,
        camera: Geometry,
        fit: Fit,
        linear: Linear,
    ) -> Result<Self> {
        Self::with_known_codes(reader, name, camera, fit, linear, Known::default())
    }

    pub(in crate::light) fn with_known_codes(
        reader: Box<dyn Read + Send>,
        name: &str,
        camera: Geometry,
        fit: Fit,
        linear: Linear,
        known: Known,
    ) -> Result<Self> {
        let reader = Reader::with_known(reader, name, known)?;
        fit.check(reader.geometry(), camera).map_err(|e| e.within(name))?;
        Ok(Self { reader, frames: None, linear, fit, camera })
    }
}

impl Source for Video {
    fn geometry(&self) -> Geometry {
        self.camera
    }

    fn stored(&self) -> Option<Geometry> {
        Some(self.reader.geometry())
    }

    fn frames(&self) -> Option<u64> {
        self.frames
    }

    fn next_frame(&mut self, into: &mut Frame) -> Result<bool> {
        let Some(frame) = self.reader.next_light(&self.linear)? else {
            return Ok(false);
        };
        *into = self.fit.apply(frame, self.camera)?;
        Ok(true)
    }

    fn rate(&self) -> Option<Rate> {
        self.reader.rate()
    }

    fn front_end(&self) -> FrontEnd {
        self.linear.used(false)
    }

    fn describe(&self) -> String {
        let count = self.frames.map_or("frames".to_owned(), |n| format!("{n} frames"));
        let rate = self.rate().map_or(String::new(), |r| format!(" at {r} per second"));
        let (name, size) = (&self.reader.name, self.reader.geometry);
        format!("{name}: video of {size}, {count}{rate}")
    }
}
