//! Animated PNG with 16-bit samples.
//!
//! The `image` crate decodes only animations of 8 bits. The `png` crate decodes the frames, and this module draws the
//! frames on the canvas as the APNG specification describes.

use std::io::{BufRead, Seek};
use std::path::{Path, PathBuf};

use image::imageops::{overlay, replace};
use image::{DynamicImage, ImageBuffer, ImageError, Rgba};
use png::{BlendOp, ColorType, Decoder, DecodingError, DisposeOp, Reader, Transformations};
use spikelane::error::Result;
use spikelane::unstable::inputs::MAX_PICTURE_BYTES;

use super::decoding::decode_error;
use super::linearization::Pixels;

type Canvas = ImageBuffer<Rgba<u16>, Vec<u16>>;

/// The frames of an animation in their order.
pub(super) struct DeepApng<R: BufRead + Seek> {
    path: PathBuf,
    reader: Reader<R>,
    canvas: Canvas,
    /// The canvas to which the next frame is drawn, if it differs from `canvas`.
    next_canvas: Option<Canvas>,
    remaining: u32,
}

impl<R: BufRead + Seek> DeepApng<R> {
    /// Reads the header of the animation.
    ///
    /// # Errors
    /// [`spikelane::error::ErrorKind::Input`] if the file is damaged.
    pub(super) fn new(file: R, path: &Path) -> Result<Self> {
        let limits = png::Limits { bytes: MAX_PICTURE_BYTES as usize };
        let mut decoder = Decoder::new_with_limits(file, limits);
        decoder.set_transformations(Transformations::EXPAND);
        let reader = decoder.read_info().map_err(|e| png_error(path, e))?;
        let info = reader.info();
        let remaining = info.animation_control().map_or(0, |control| control.num_frames);
        let has_separate_image = info.frame_control().is_none();
        let (width, height) = info.size();
        let mut frames = Self {
            path: path.to_owned(),
            canvas: Canvas::new(width, height),
            reader,
            next_canvas: None,
            remaining,
        };
        if has_separate_image {
            frames.decode().map_err(|e| png_error(path, e))?;
        }
        Ok(frames)
    }

    /// Decodes the next stored frame, which can be smaller than the canvas.
    fn decode(&mut self) -> std::result::Result<Canvas, DecodingError> {
        let bytes = self.reader.output_buffer_size().ok_or(DecodingError::LimitsExceeded)?;
        let mut samples = vec![0; bytes];
        let frame = self.reader.next_frame(&mut samples)?;
        let codes: Vec<u16> =
            samples[..frame.buffer_size()].as_chunks().0.iter().map(|b| u16::from_be_bytes(*b)).collect();
        let (width, height) = (frame.width, frame.height);
        let image = match frame.color_type {
            ColorType::Grayscale => {
                ImageBuffer::from_raw(width, height, codes).map(DynamicImage::ImageLuma16)
            }
            ColorType::GrayscaleAlpha => {
                ImageBuffer::from_raw(width, height, codes).map(DynamicImage::ImageLumaA16)
            }
            ColorType::Rgb => ImageBuffer::from_raw(width, height, codes).map(DynamicImage::ImageRgb16),
            _ => ImageBuffer::from_raw(width, height, codes).map(DynamicImage::ImageRgba16),
        };
        image.map(DynamicImage::into_rgba16).ok_or(DecodingError::LimitsExceeded)
    }

    fn draw_next(&mut self) -> std::result::Result<Pixels, DecodingError> {
        let frame = self.decode()?;
        let Some(control) = self.reader.info().frame_control().copied() else {
            return Ok(Pixels::Image(frame.into()));
        };
        let (x, y) = (i64::from(control.x_offset), i64::from(control.y_offset));
        let mut canvas = self.next_canvas.take().unwrap_or_else(|| self.canvas.clone());
        let before = (control.dispose_op == DisposeOp::Previous).then(|| canvas.clone());
        match control.blend_op {
            BlendOp::Source => replace(&mut canvas, &frame, x, y),
            BlendOp::Over => overlay(&mut canvas, &frame, x, y),
        }
        self.next_canvas = match control.dispose_op {
            DisposeOp::None => None,
            DisposeOp::Previous => before,
            DisposeOp::Background => {
                let mut cleared = canvas.clone();
                replace(&mut cleared, &Canvas::new(control.width, control.height), x, y);
                Some(cleared)
            }
        };
        self.canvas = canvas;
        Ok(Pixels::Image(self.canvas.clone().into()))
    }
}

impl<R: BufRead + Seek> Iterator for DeepApng<R> {
    type Item = Result<Pixels>;

    fn next(&mut self) -> Option<Self::Item> {
        self.remaining = self.remaining.checked_sub(1)?;
        Some(self.draw_next().map_err(|e| png_error(&self.path, e)))
    }
}

fn png_error(path: &Path, error: DecodingError) -> spikelane::Error {
    match error {
        DecodingError::IoError(e) => decode_error(path, ImageError::IoError(e)),
        other => decode_error(
            path,
            ImageError::Decoding(image::error::DecodingError::new(image::ImageFormat::Png.into(), other)),
        ),
    }
}
