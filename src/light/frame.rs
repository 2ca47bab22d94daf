//! One picture of linear light, and whatever yields a row of them.

use super::rate::Rate;
use crate::error::{Error, Kind, Result};
use crate::kernels;
use crate::sensor::{FrontEnd, Transfer};
use crate::spikes::Geometry;
use crate::spikes::MAX_PIXELS;

/// Linear light of the pixels of a frame, row-major, top row first.
///
/// Twice the number is twice the light. Full scale is 255, 65535 or 1.0; only
/// `F32` can hold light beyond it.
#[derive(Clone, Debug, PartialEq)]
pub enum OwnedSamples {
    /// Full scale is 255.
    U8(Vec<u8>),
    /// Full scale is 65535.
    U16(Vec<u16>),
    /// Full scale is 1.0; finite and not negative.
    F32(Vec<f32>),
}

impl OwnedSamples {
    /// Number of samples.
    #[must_use]
    pub fn len(&self) -> usize {
        match self {
            Self::U8(v) => v.len(),
            Self::U16(v) => v.len(),
            Self::F32(v) => v.len(),
        }
    }

    /// Whether there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The samples as kernels take them.
    #[must_use]
    pub fn borrowed(&self) -> kernels::Samples<'_> {
        match self {
            Self::U8(v) => kernels::Samples::U8(v),
            Self::U16(v) => kernels::Samples::U16(v),
            Self::F32(v) => kernels::Samples::F32(v),
        }
    }
}

/// A frame of linear light whose samples are known to be valid.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    geometry: Geometry,
    samples: OwnedSamples,
}

impl Frame {
    /// A frame of `geometry` from `samples`.
    ///
    /// # Examples
    /// ```
    /// use spikelane::Geometry;
    /// use spikelane::light::{Frame, OwnedSamples};
    /// let frame = Frame::new(Geometry::new(2, 1)?, OwnedSamples::F32(vec![0.25, 1.0]))?;
    /// assert_eq!(frame.get(0, 1), 1.0);
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    ///
    /// # Errors
    /// [`Kind::Input`] when the number of samples differs from the number of
    /// pixels, or a float is negative or not finite; the error names the first
    /// such pixel.
    pub fn new(geometry: Geometry, samples: OwnedSamples) -> Result<Self> {
        if samples.len() != geometry.pixels() {
            return Err(Error::new(Kind::Input, "frame of light")
                .found(format_args!("{} samples", samples.len()))
                .expected(format_args!("{} for {geometry}", geometry.pixels()))
                .remedy("check width and height"));
        }
        if let OwnedSamples::F32(values) = &samples {
            check_light(geometry, values)?;
        }
        Ok(Self { geometry, samples })
    }

    /// A frame without light; the thing to hand to [`Source::next_frame`] first.
    #[must_use]
    pub fn dark(geometry: Geometry) -> Self {
        Self { geometry, samples: OwnedSamples::U8(vec![0; geometry.pixels()]) }
    }

    /// Width and height.
    #[must_use]
    pub const fn geometry(&self) -> Geometry {
        self.geometry
    }

    /// The samples.
    #[must_use]
    pub const fn samples(&self) -> &OwnedSamples {
        &self.samples
    }

    /// The samples, for good.
    #[must_use]
    pub fn into_samples(self) -> OwnedSamples {
        self.samples
    }

    /// Light of pixel `(row, col)`, 1.0 at full scale.
    ///
    /// # Panics
    /// When the pixel lies outside the frame.
    #[must_use]
    pub fn get(&self, row: usize, col: usize) -> f32 {
        let p = row * self.geometry.width() + col;
        match &self.samples {
            OwnedSamples::U8(v) => f32::from(v[p]) / 255.0,
            OwnedSamples::U16(v) => f32::from(v[p]) / 65535.0,
            OwnedSamples::F32(v) => v[p],
        }
    }

    /// The brightest sample, 1.0 at full scale.
    #[must_use]
    pub fn max(&self) -> f32 {
        match &self.samples {
            OwnedSamples::U8(v) => f32::from(v.iter().copied().max().unwrap_or(0)) / 255.0,
            OwnedSamples::U16(v) => f32::from(v.iter().copied().max().unwrap_or(0)) / 65535.0,
            OwnedSamples::F32(v) => v.iter().copied().fold(0.0, f32::max),
        }
    }

    /// All samples as floats, 1.0 at full scale.
    #[must_use]
    pub fn to_f32(&self) -> Vec<f32> {
        match &self.samples {
            OwnedSamples::U8(v) => v.iter().map(|&x| f32::from(x) / 255.0).collect(),
            OwnedSamples::U16(v) => v.iter().map(|&x| f32::from(x) / 65535.0).collect(),
            OwnedSamples::F32(v) => v.clone(),
        }
    }

    /// The light between `a` (at `weight` 0) and `b` (at 1): `a + weight (b - a)`.
    ///
    /// Two integer frames give 16 bits (rounded to nearest), anything with a
    /// float gives floats.
    ///
    /// # Errors
    /// [`Kind::Usage`] when the sizes differ or `weight` is outside 0 to 1.
    pub fn blend(a: &Self, b: &Self, weight: f32) -> Result<Self> {
        if a.geometry != b.geometry || !(0.0..=1.0).contains(&weight) {
            return Err(Error::new(Kind::Usage, "interpolated frame")
                .found(format_args!("{} and {} at weight {weight}", a.geometry, b.geometry))
                .expected("two frames of one size and a weight from 0 to 1"));
        }
        let mix = |x: f32, y: f32| x + weight * (y - x);
        let samples = if let (Some(x), Some(y)) = (a.wide(), b.wide()) {
            OwnedSamples::U16(zip(&x, &y, |x, y| (mix(f32::from(x), f32::from(y)) + 0.5) as u16))
        } else {
            // Rounding may carry a value of nearly zero below it; light is not negative.
            OwnedSamples::F32(zip(&a.to_f32(), &b.to_f32(), |x, y| mix(x, y).max(0.0)))
        };
        Ok(Self { geometry: a.geometry, samples })
    }

    /// Integer samples at 16 bits.
    fn wide(&self) -> Option<Vec<u16>> {
        match &self.samples {
            OwnedSamples::U8(v) => Some(v.iter().map(|&x| u16::from(x) * 257).collect()),
            OwnedSamples::U16(v) => Some(v.clone()),
            OwnedSamples::F32(_) => None,
        }
    }
}

/// The size that a file claims for its pictures; an impossible one is the file's mistake.
pub fn stored_size(width: u64, height: u64, name: &str) -> Result<Geometry> {
    let side = |n: u64| u32::try_from(n).unwrap_or(u32::MAX);
    Geometry::new(side(width), side(height)).map_err(|_| {
        Error::new(Kind::Input, name)
            .found(format_args!("pictures of {width}x{height}"))
            .expected(format_args!("1 to {MAX_PIXELS} pixels"))
    })
}

fn zip<T: Copy>(a: &[T], b: &[T], f: impl Fn(T, T) -> T) -> Vec<T> {
    a.iter().zip(b).map(|(&x, &y)| f(x, y)).collect()
}

fn check_light(geometry: Geometry, values: &[f32]) -> Result<()> {
    let Some(p) = values.iter().position(|v| !(v.is_finite() && *v >= 0.0)) else {
        return Ok(());
    };
    let (row, col) = (p / geometry.width(), p % geometry.width());
    Err(Error::new(Kind::Input, format_args!("pixel row {row}, col {col}"))
        .found(values[p])
        .expected("light that is finite and not negative")
        .remedy("clean the input before it is simulated"))
}

/// Frames of linear light at the camera's size, one after the other.
///
/// The kind of samples may change from frame to frame where the input's does.
pub trait Source: Send {
    /// Width and height of every frame.
    fn geometry(&self) -> Geometry;

    /// How many frames there are in all; `None` when only the end will tell (a pipe).
    fn frames(&self) -> Option<u64>;

    /// How many frames there are by the input's own word, which may be off: for a forecast, and for the share that
    /// is done.
    fn announced_frames(&self) -> Option<u64> {
        self.frames()
    }

    /// Replaces `into` by the next frame. `false` after the last one, and then
    /// `into` is left alone.
    ///
    /// # Errors
    /// What the input says when it is read: see the sources.
    fn next_frame(&mut self, into: &mut Frame) -> Result<bool>;

    /// Frames per second, when the input states it.
    fn rate(&self) -> Option<Rate>;

    /// How its numbers became light, with nothing left to the kind of file. What is drawn is linear light, and so
    /// are floats.
    fn front_end(&self) -> FrontEnd {
        FrontEnd { transfer: Some(Transfer::Linear), ..FrontEnd::default() }
    }

    /// One line for people: what is read, its own size, how many frames.
    fn describe(&self) -> String;

    /// Width and height of the frames as they are stored; `None` when they are drawn at the camera's size.
    fn stored(&self) -> Option<Geometry> {
        None
    }

    /// Nanoseconds of each frame after the first, when the input says and they come at no one rate.
    fn times(&self) -> Option<&[u64]> {
        None
    }

    /// What the user should know of it, one line each: what was left out, what is missing.
    fn notes(&self) -> Vec<String> {
        Vec::new()
    }
}
