//! Resizing of images to the camera's size, in linear light.
//!
//! Images are linearized before they are resized, because averaging stored codes would darken fine bright details.
//! The filter is the triangle filter of the `image` crate. The filter width is proportional to the reduction factor,
//! so a reduced pixel is the average of its area, and the filter never rings. Sharper filters have negative lobes,
//! which can produce negative light.

use std::str::FromStr;

use image::imageops::{FilterType, resize};
use image::{ImageBuffer, Luma, Pixel, Rgb};

use super::images::linearization::with_colors;
use spikelane::error::{Error, ErrorKind, Result, Setting};
use spikelane::light::{Frame, OwnedSamples};
use spikelane::spikes::Geometry;

/// How an image is converted to the camera's size.
///
/// # Examples
/// ```
/// use spikelane::Geometry;
/// use spikelane_io::light::{Frame, OwnedSamples, ResizeMode};
/// let wide = Frame::new(Geometry::new(4, 1)?, OwnedSamples::F32(vec![0.0, 0.5, 0.5, 1.0]))?;
/// let small = Geometry::new(2, 1)?;
/// // A crop keeps the pixels in the middle.
/// assert_eq!(ResizeMode::Crop.apply(wide, small)?.to_f32(), [0.5, 0.5]);
/// assert_eq!("cover".parse::<ResizeMode>()?, ResizeMode::default());
/// # Ok::<(), spikelane::Error>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ResizeMode {
    /// The largest centered part of the image with the aspect ratio of the camera, scaled to the camera's size.
    #[default]
    Cover,
    /// The whole image, scaled to the camera's size. The horizontal and the vertical scale can differ.
    Stretch,
    /// The centered part that has the camera's size, without scaling.
    Crop,
}

impl FromStr for ResizeMode {
    type Err = Error;

    /// Parses `cover`, `stretch` or `crop`.
    fn from_str(text: &str) -> Result<Self> {
        match text {
            "cover" => Ok(Self::Cover),
            "stretch" => Ok(Self::Stretch),
            "crop" => Ok(Self::Crop),
            _ => Err(Error::new(ErrorKind::Usage, "resize_mode")
                .found(format_args!("`{text}`"))
                .expected("cover, stretch or crop")),
        }
    }
}

impl std::fmt::Display for ResizeMode {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Cover => "cover",
            Self::Stretch => "stretch",
            Self::Crop => "crop",
        })
    }
}

impl ResizeMode {
    /// Returns `frame` at the size of `camera`.
    ///
    /// If `frame` already has the size of `camera`, `frame` is returned unchanged. Cropping does not change the sample
    /// type. Scaling converts 8-bit samples to 16-bit samples.
    ///
    /// # Errors
    /// [`ErrorKind::Input`] if the mode is [`ResizeMode::Crop`] and the image is smaller than the camera.
    pub fn apply(self, frame: Frame, camera: Geometry) -> Result<Frame> {
        let from = frame.geometry();
        if from == camera {
            return Ok(frame);
        }
        self.check(from, camera)?;
        let part = crop(frame, self.shown_part(from, camera)?)?;
        scale(part, camera)
    }

    /// Returns the size of the part that [`ResizeMode::apply`] selects from an image of size `from`.
    fn shown_part(self, from: Geometry, camera: Geometry) -> Result<Geometry> {
        match self {
            Self::Cover => largest_part(from, camera),
            Self::Stretch => Ok(from),
            Self::Crop => Ok(camera),
        }
    }

    /// Returns the fraction of the pixels of an image that [`ResizeMode::apply`] selects.
    #[must_use]
    pub fn shown_share(self, picture: Geometry, camera: Geometry) -> f64 {
        let part = self.shown_part(picture, camera).map_or(0, Geometry::pixels);
        (part as f64 / picture.pixels() as f64).min(1.0)
    }

    /// Returns a note for the user if the resize mode shows less than 90 % of the pixels of an image.
    #[must_use]
    pub fn crop_note(self, picture: Geometry, camera: Geometry) -> Option<String> {
        const MIN_UNREPORTED_SHARE: f64 = 0.9;
        let share = self.shown_share(picture, camera);
        (share < MIN_UNREPORTED_SHARE).then(|| {
            let modes = if self == Self::Crop { "cover or stretch" } else { "stretch" };
            format!(
                "the camera's {camera} shows {:.0} % of each {picture} image; to show more, set {} to {modes}, or set {}",
                100.0 * share,
                Setting("resize_mode"),
                Setting("size_from_input")
            )
        })
    }

    /// Checks that the image is large enough for a crop.
    ///
    /// # Errors
    /// [`ErrorKind::Input`] if the mode is [`ResizeMode::Crop`] and the image is smaller than the camera.
    pub fn check(self, picture: Geometry, camera: Geometry) -> Result<()> {
        let small = picture.width() < camera.width() || picture.height() < camera.height();
        if self == Self::Crop && small {
            return Err(Error::new(ErrorKind::Input, "image to crop")
                .found(picture)
                .expected(format_args!("an image of at least {camera}"))
                .remedy("choose a smaller camera, or resize instead of cropping"));
        }
        Ok(())
    }
}

/// A full image at nearly the scale of the camera, with the rest position of the camera in the image.
///
/// The width and height are rounded to whole pixels, so the scale of the image differs slightly from the scale of the
/// camera. `origin` and `step` compensate for this difference.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct FullImage {
    /// The image.
    pub image: Frame,
    /// Image coordinates (x, y) of the upper left corner of the camera's view at the rest position. Pixel edges have
    /// integer coordinates.
    pub origin: [f64; 2],
    /// Number of image pixels per camera pixel, in x and y.
    pub step: [f64; 2],
}

impl FullImage {
    /// Scales the whole `frame` by the factor with which [`ResizeMode::apply`] scales the selected part of `frame`.
    ///
    /// # Errors
    /// As [`ResizeMode::apply`]. Also an error if the scaled image exceeds the largest sensor.
    pub fn new(frame: Frame, camera: Geometry, resize_mode: ResizeMode) -> Result<Self> {
        let from = frame.geometry();
        resize_mode.check(from, camera)?;
        let part = resize_mode.shown_part(from, camera)?;
        let picture = scale(
            frame,
            Geometry::new(
                divide_rounded(from.width(), camera.width(), part.width()),
                divide_rounded(from.height(), camera.height(), part.height()),
            )?,
        )?;
        let to = picture.geometry();
        let axis = |from: usize, part: usize, camera: usize, to: usize| {
            let scale = to as f64 / from as f64;
            (((from - part) / 2) as f64 * scale, part as f64 / camera as f64 * scale)
        };
        let x = axis(from.width(), part.width(), camera.width(), to.width());
        let y = axis(from.height(), part.height(), camera.height(), to.height());
        Ok(Self { image: picture, origin: [x.0, y.0], step: [x.1, y.1] })
    }
}

/// Returns `a * b / c`, rounded to the nearest integer. The result is at least 1.
fn divide_rounded(a: usize, b: usize, c: usize) -> u32 {
    let (a, b, c) = (a as u64, b as u64, c as u64);
    u32::try_from(((2 * a * b + c) / (2 * c)).max(1)).unwrap_or(u32::MAX)
}

/// Returns the largest part of `from` with the aspect ratio of `camera`, rounded to whole pixels.
fn largest_part(from: Geometry, camera: Geometry) -> Result<Geometry> {
    let (w, h) = (from.width(), from.height());
    if w as u64 * camera.height() as u64 >= h as u64 * camera.width() as u64 {
        let width = divide_rounded(h, camera.width(), camera.height());
        Geometry::new(width.min(w as u32), h as u32)
    } else {
        let height = divide_rounded(w, camera.height(), camera.width());
        Geometry::new(w as u32, height.min(h as u32))
    }
}

/// Returns the centered `part` of a frame. If a margin is odd, the additional pixel is at the bottom or on the right.
fn crop(frame: Frame, part: Geometry) -> Result<Frame> {
    let from = frame.geometry();
    if from == part {
        return Ok(frame);
    }
    let colors = frame.rgb().map(|rgb| centered_samples(rgb.as_chunks::<3>().0, from, part));
    let samples = match frame.into_samples() {
        OwnedSamples::U8(v) => OwnedSamples::U8(centered_samples(&v, from, part)),
        OwnedSamples::U16(v) => OwnedSamples::U16(centered_samples(&v, from, part)),
        OwnedSamples::F32(v) => OwnedSamples::F32(centered_samples(&v, from, part)),
    };
    with_colors(Frame::new(part, samples)?, colors.map(|colors| colors.concat()))
}

fn centered_samples<T: Copy>(all: &[T], from: Geometry, part: Geometry) -> Vec<T> {
    let top = (from.height() - part.height()) / 2;
    let left = (from.width() - part.width()) / 2;
    all.chunks_exact(from.width())
        .skip(top)
        .take(part.height())
        .flat_map(|row| &row[left..left + part.width()])
        .copied()
        .collect()
}

fn scale(frame: Frame, to: Geometry) -> Result<Frame> {
    let from = frame.geometry();
    if from == to {
        return Ok(frame);
    }
    let colors = frame.rgb().map(|rgb| resize_floats::<Rgb<f32>>(rgb.to_vec(), from, to));
    let samples = match frame.into_samples() {
        OwnedSamples::U8(v) => {
            let wide = v.iter().map(|&x| u16::from(x) * 257).collect();
            OwnedSamples::U16(resize_samples::<Luma<u16>>(wide, from, to))
        }
        OwnedSamples::U16(v) => OwnedSamples::U16(resize_samples::<Luma<u16>>(v, from, to)),
        OwnedSamples::F32(v) => OwnedSamples::F32(resize_floats::<Luma<f32>>(v, from, to)),
    };
    with_colors(Frame::new(to, samples)?, colors)
}

/// Resizes light, which can exceed 1.0.
fn resize_floats<P>(mut light: Vec<f32>, from: Geometry, to: Geometry) -> Vec<f32>
where
    P: Pixel<Subpixel = f32> + 'static,
{
    // The `image` crate clips floats at 1.0, but light can exceed 1.0. The light is therefore divided by the peak before
    // resizing.
    let over = light.iter().copied().fold(1.0, f32::max);
    light.iter_mut().for_each(|x| *x /= over);
    let mut light = resize_samples::<P>(light, from, to);
    light.iter_mut().for_each(|x| *x = (*x * over).max(0.0));
    light
}

fn resize_samples<P>(samples: Vec<P::Subpixel>, from: Geometry, to: Geometry) -> Vec<P::Subpixel>
where
    P: Pixel + 'static,
    P::Subpixel: 'static,
{
    let picture: ImageBuffer<P, Vec<P::Subpixel>> =
        ImageBuffer::from_raw(from.width() as u32, from.height() as u32, samples)
            .expect("a frame has the samples of all pixels");
    let (w, h) = (to.width() as u32, to.height() as u32);
    resize(&picture, w, h, FilterType::Triangle).into_raw()
}
