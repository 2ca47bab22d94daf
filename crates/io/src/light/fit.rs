//! From a picture's size to the camera's, in linear light.
//!
//! Averaging stored codes would darken fine bright detail, so pictures are
//! linearised before they come here. The filter is the tent of the `image`
//! crate, widened by the reduction: it averages over area when it shrinks, and
//! never rings. Sharper filters have negative lobes, and there is no negative light.

use std::str::FromStr;

use image::imageops::{FilterType, resize};
use image::{ImageBuffer, Luma, Primitive};

use spikelane::error::{Error, Kind, Result};
use spikelane::light::{Frame, OwnedSamples};
use spikelane::spikes::Geometry;

/// How a picture is brought to the camera's size.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Fit {
    /// The largest centred part of the camera's aspect, scaled to fill it.
    #[default]
    Resize,
    /// All of it, scaled on each axis by itself.
    Stretch,
    /// The centred part of the camera's size, pixel by pixel.
    Crop,
}

impl FromStr for Fit {
    type Err = Error;

    /// `resize`, `stretch` or `crop`.
    fn from_str(text: &str) -> Result<Self> {
        match text {
            "resize" => Ok(Self::Resize),
            "stretch" => Ok(Self::Stretch),
            "crop" => Ok(Self::Crop),
            _ => Err(Error::new(Kind::Usage, "fit")
                .found(format_args!("`{text}`"))
                .expected("resize, stretch or crop")),
        }
    }
}

impl std::fmt::Display for Fit {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Resize => "resize",
            Self::Stretch => "stretch",
            Self::Crop => "crop",
        })
    }
}

impl Fit {
    /// `frame` at the size of `camera`.
    ///
    /// A frame of that size already is returned as it is. Cropping keeps the kind of
    /// samples; scaling makes 16 bits of 8.
    ///
    /// # Errors
    /// [`Kind::Input`] when [`Fit::Crop`] finds the picture smaller than the camera.
    pub fn apply(self, frame: Frame, camera: Geometry) -> Result<Frame> {
        let from = frame.geometry();
        if from == camera {
            return Ok(frame);
        }
        self.check(from, camera)?;
        let part = crop(frame, self.part(from, camera)?)?;
        scale(part, camera)
    }

    /// The part of a picture of size `from` that [`Fit::apply`] shows.
    fn part(self, from: Geometry, camera: Geometry) -> Result<Geometry> {
        match self {
            Self::Resize => widest(from, camera),
            Self::Stretch => Ok(from),
            Self::Crop => Ok(camera),
        }
    }

    /// The share of a picture's pixels that [`Fit::apply`] shows.
    #[must_use]
    pub fn kept(self, picture: Geometry, camera: Geometry) -> f64 {
        let part = self.part(picture, camera).map_or(0, Geometry::pixels);
        (part as f64 / picture.pixels() as f64).min(1.0)
    }

    /// A line for the user when less than 90 % of a picture is shown.
    #[must_use]
    pub fn note(self, picture: Geometry, camera: Geometry) -> Option<String> {
        const MOST: f64 = 0.9;
        let kept = self.kept(picture, camera);
        (kept < MOST).then(|| {
            let other = if self == Self::Crop { "--fit resize or " } else { "" };
            format!(
                "the camera's {camera} shows {:.0} % of each {picture} picture; {other}--fit stretch or --size input \
                 show more",
                100.0 * kept
            )
        })
    }

    /// Refuses a crop that is larger than the picture.
    ///
    /// # Errors
    /// [`Kind::Input`], as said.
    pub fn check(self, picture: Geometry, camera: Geometry) -> Result<()> {
        let small = picture.width() < camera.width() || picture.height() < camera.height();
        if self == Self::Crop && small {
            return Err(Error::new(Kind::Input, "picture to crop")
                .found(picture)
                .expected(format_args!("at least {camera}"))
                .remedy("choose a smaller camera, or resize instead of cropping"));
        }
        Ok(())
    }
}

/// All of a picture near the camera's scale, and where in it the camera at rest sees.
///
/// Sides are whole pixels, so the scale is only near the camera's; origin and step make up for it.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Whole {
    /// The picture.
    pub picture: Frame,
    /// Its column and row under the upper left corner of the camera at rest, pixel edges at whole numbers.
    pub origin: [f64; 2],
    /// Its columns and rows for a pixel of the camera.
    pub step: [f64; 2],
}

impl Whole {
    /// All of `frame` for a camera that [`Fit::apply`] would show its part of.
    ///
    /// # Errors
    /// As [`Fit::apply`], and when the whole would be beyond the largest sensor.
    pub fn new(frame: Frame, camera: Geometry, fit: Fit) -> Result<Self> {
        let from = frame.geometry();
        fit.check(from, camera)?;
        let part = fit.part(from, camera)?;
        let picture = scale(
            frame,
            Geometry::new(
                rounded(from.width(), camera.width(), part.width()),
                rounded(from.height(), camera.height(), part.height()),
            )?,
        )?;
        let to = picture.geometry();
        let axis = |from: usize, part: usize, camera: usize, to: usize| {
            let scale = to as f64 / from as f64;
            (((from - part) / 2) as f64 * scale, part as f64 / camera as f64 * scale)
        };
        let x = axis(from.width(), part.width(), camera.width(), to.width());
        let y = axis(from.height(), part.height(), camera.height(), to.height());
        Ok(Self { picture, origin: [x.0, y.0], step: [x.1, y.1] })
    }
}

/// `a * b / c` to the nearest whole number, at least 1.
fn rounded(a: usize, b: usize, c: usize) -> u32 {
    let (a, b, c) = (a as u64, b as u64, c as u64);
    u32::try_from(((2 * a * b + c) / (2 * c)).max(1)).unwrap_or(u32::MAX)
}

/// The largest part of `from` with the aspect of `camera`, to the nearest pixel.
fn widest(from: Geometry, camera: Geometry) -> Result<Geometry> {
    let (w, h) = (from.width(), from.height());
    if w as u64 * camera.height() as u64 >= h as u64 * camera.width() as u64 {
        let width = rounded(h, camera.width(), camera.height());
        Geometry::new(width.min(w as u32), h as u32)
    } else {
        let height = rounded(w, camera.height(), camera.width());
        Geometry::new(w as u32, height.min(h as u32))
    }
}

/// The centred `part` of a frame; an odd margin leaves its extra pixel below and on the right.
fn crop(frame: Frame, part: Geometry) -> Result<Frame> {
    let from = frame.geometry();
    if from == part {
        return Ok(frame);
    }
    let samples = match frame.into_samples() {
        OwnedSamples::U8(v) => OwnedSamples::U8(middle(&v, from, part)),
        OwnedSamples::U16(v) => OwnedSamples::U16(middle(&v, from, part)),
        OwnedSamples::F32(v) => OwnedSamples::F32(middle(&v, from, part)),
    };
    Frame::new(part, samples)
}

fn middle<T: Copy>(all: &[T], from: Geometry, part: Geometry) -> Vec<T> {
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
    let peak = frame.max();
    let samples = match frame.into_samples() {
        OwnedSamples::U8(v) => {
            let wide = v.iter().map(|&x| u16::from(x) * 257).collect();
            OwnedSamples::U16(resized(wide, from, to))
        }
        OwnedSamples::U16(v) => OwnedSamples::U16(resized(v, from, to)),
        OwnedSamples::F32(mut v) => {
            // The image crate clips floats at 1.0, and light may lie beyond.
            let over = peak.max(1.0);
            v.iter_mut().for_each(|x| *x /= over);
            let mut v: Vec<f32> = resized(v, from, to);
            v.iter_mut().for_each(|x| *x = (*x * over).max(0.0));
            OwnedSamples::F32(v)
        }
    };
    Frame::new(to, samples)
}

fn resized<T>(samples: Vec<T>, from: Geometry, to: Geometry) -> Vec<T>
where
    T: Primitive + 'static,
    Luma<T>: image::Pixel<Subpixel = T>,
{
    let picture: ImageBuffer<Luma<T>, Vec<T>> =
        ImageBuffer::from_raw(from.width() as u32, from.height() as u32, samples)
            .expect("a frame has one sample per pixel");
    let (w, h) = (to.width() as u32, to.height() as u32);
    resize(&picture, w, h, FilterType::Triangle).into_raw()
}
