//! A single image as one frame, or as the frames of a camera motion across the image.

use std::path::{Path, PathBuf};

use super::image_file::ImageFile;
use super::linearization::Linearization;
use crate::light::camera_motion::CameraMotion;
use crate::light::resize_mode::FullImage;
use crate::light::resize_mode::ResizeMode;
use spikelane::error::{Error, ErrorKind, Result};
use spikelane::light::Rate;
use spikelane::light::{Frame, Source};
use spikelane::sensor::{FrontEnd, FullScale};
use spikelane::spikes::Geometry;
use spikelane::unstable::Count;

/// A camera motion and the full image across which the camera moves.
#[derive(Debug)]
struct MotionView {
    image: FullImage,
    motion: CameraMotion,
    rate: Rate,
}

/// A single image, optionally with a camera motion.
#[derive(Debug)]
pub struct StillImage {
    path: PathBuf,
    size: Geometry,
    camera: Geometry,
    /// The image that the camera shows at its rest position.
    frame_at_rest: Frame,
    motion_view: Option<MotionView>,
    front_end: FrontEnd,
    full_scale: FullScale,
    /// The part of the description that names full scale.
    full_scale_text: String,
    notes: Vec<String>,
    frames: u64,
    next: u64,
}

impl StillImage {
    /// Reads the first page of an image file as a single frame.
    ///
    /// # Errors
    /// As [`super::image_file::read`] and [`ResizeMode::apply`].
    pub fn open(
        path: &Path,
        camera: Geometry,
        resize_mode: ResizeMode,
        linear: &Linearization,
    ) -> Result<Self> {
        Self::from_file(ImageFile::open(path)?, camera, resize_mode, linear).map(|(still, _)| still)
    }

    /// Reads the first page of `file`. Also returns the frame at the size of the image.
    pub(in crate::light) fn from_file(
        mut file: ImageFile,
        camera: Geometry,
        resize_mode: ResizeMode,
        linear: &Linearization,
    ) -> Result<(Self, Frame)> {
        let mut damage = Vec::new();
        let pixels = file.read_page(0, &mut damage)?;
        file.notes.extend(damage);
        file.complete_notes(linear, std::slice::from_ref(&pixels), "of the image");
        let linear = linear.for_encoding(&file.encoding);
        let full = file.light(pixels, &linear)?;
        let frame =
            resize_mode.apply(full.clone(), camera).map_err(|e| e.with_context(file.path().display()))?;
        let still = Self {
            path: file.path().to_owned(),
            size: file.size,
            camera,
            frame_at_rest: frame,
            motion_view: None,
            front_end: linear.front_end_for(file.has_float_pixels()),
            full_scale: linear.full_scale(),
            full_scale_text: linear.full_scale_text(),
            notes: file.named_notes(),
            frames: 1,
            next: 0,
        };
        Ok((still, full))
    }

    /// Reads an image across which the camera moves. The motion has `frames` frames at the rate `rate`.
    ///
    /// # Errors
    /// As [`StillImage::open`]. Also [`ErrorKind::Usage`] if `frames` is 0.
    pub fn open_moving(
        path: &Path,
        camera: Geometry,
        resize_mode: ResizeMode,
        linear: &Linearization,
        motion: (CameraMotion, Rate, u64),
    ) -> Result<Self> {
        Self::moving(ImageFile::open(path)?, camera, resize_mode, linear, motion)
    }

    /// Reads an image across which the camera moves from `file`.
    pub(in crate::light) fn moving(
        file: ImageFile,
        camera: Geometry,
        resize_mode: ResizeMode,
        linear: &Linearization,
        (motion, rate, frames): (CameraMotion, Rate, u64),
    ) -> Result<Self> {
        if frames == 0 {
            return Err(Error::new(ErrorKind::Usage, "frames of motion").found(0).expected("at least 1"));
        }
        let (still, full) = Self::from_file(file, camera, resize_mode, linear)?;
        let image = FullImage::new(full, camera, resize_mode);
        let image = image.map_err(|e| e.with_context(still.path.display()))?;
        Ok(Self { motion_view: Some(MotionView { image, motion, rate }), frames, ..still })
    }
}

impl Source for StillImage {
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
        *into = match &self.motion_view {
            Some(m) if !m.motion.is_at_rest(m.rate, self.next) => {
                m.motion.view(&m.image, self.camera, m.rate, self.next)?
            }
            _ => self.frame_at_rest.clone(),
        };
        self.next += 1;
        Ok(true)
    }

    fn stored_geometry(&self) -> Option<Geometry> {
        Some(self.size)
    }

    fn rate(&self) -> Option<Rate> {
        self.motion_view.as_ref().map(|m| m.rate)
    }

    fn front_end(&self) -> FrontEnd {
        self.front_end
    }

    fn full_scale(&self) -> FullScale {
        self.full_scale
    }

    fn describe(&self) -> String {
        let path = self.path.display();
        match &self.motion_view {
            None => format!("{path}: one image of {}{}", self.size, self.full_scale_text),
            Some(MotionView { rate, .. }) => format!(
                "{path}: motion over an image of {}, {} at {rate} per second{}",
                self.size,
                Count(self.frames, "frame"),
                self.full_scale_text,
            ),
        }
    }

    fn notes(&self) -> Vec<String> {
        self.notes.clone()
    }
}
