//! A frame of linear light, and the trait of its sources.

use std::sync::Arc;

use super::rate::Rate;
use super::samples::Samples;
use crate::count::Count;
use crate::error::{Error, Result, bail, error};
use crate::sensor::{FrontEnd, FullScale, Transfer};
use crate::spikes::{Geometry, MAX_PIXELS};

/// The light of the pixels of a frame as linear samples, row-major, top row first.
///
/// A sample is proportional to the light. Full scale is 255, 65535 or 1.0. Only `F32` can store light above full scale.
///
/// # Examples
/// ```
/// use spikelane::light::OwnedSamples;
/// use spikelane::simulate::Samples;
/// let samples = OwnedSamples::U8(vec![0, 128, 255]);
/// assert_eq!(samples.len(), 3);
/// assert_eq!(samples.as_samples(), Samples::U8(&[0, 128, 255]));
/// ```
#[derive(Clone, Debug, PartialEq)]
pub enum OwnedSamples {
    /// Full scale is 255.
    U8(Vec<u8>),
    /// Full scale is 65535.
    U16(Vec<u16>),
    /// Full scale is 1.0; the values of a [`Frame`] are finite and not negative.
    F32(Vec<f32>),
}

impl OwnedSamples {
    /// Returns the number of samples.
    #[must_use]
    pub fn len(&self) -> usize {
        match self {
            Self::U8(v) => v.len(),
            Self::U16(v) => v.len(),
            Self::F32(v) => v.len(),
        }
    }

    /// Returns whether there are no samples.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Borrows the samples in the form that kernels read.
    #[must_use]
    pub fn as_samples(&self) -> Samples<'_> {
        match self {
            Self::U8(v) => Samples::U8(v),
            Self::U16(v) => Samples::U16(v),
            Self::F32(v) => Samples::F32(v),
        }
    }
}

/// A frame of linear light. Its samples have been validated.
///
/// # Examples
/// ```
/// use spikelane::Geometry;
/// use spikelane::light::{Frame, OwnedSamples};
/// let frame = Frame::new(Geometry::new(2, 1)?, OwnedSamples::U8(vec![51, 255]))?;
/// assert_eq!((frame.get(0, 0), frame.max()), (0.2, 1.0));
/// assert_eq!(frame.to_f32(), [0.2, 1.0]);
///
/// let negative = Frame::new(Geometry::new(2, 1)?, OwnedSamples::F32(vec![0.5, -0.5])).unwrap_err();
/// assert_eq!(negative.subject(), "pixel row 0, col 1");
/// # Ok::<(), spikelane::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    geometry: Geometry,
    samples: OwnedSamples,
    /// Linear red, green and blue of every pixel, if the frame has color.
    rgb: Option<Arc<[f32]>>,
}

impl Frame {
    /// Returns a frame of `geometry` with `samples`.
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
    /// Returns [`ErrorKind::Input`](crate::ErrorKind::Input) if the number of samples differs from the number of pixels, or if a float is
    /// negative or not finite. The error names the first pixel with an invalid float.
    pub fn new(geometry: Geometry, samples: OwnedSamples) -> Result<Self> {
        if samples.len() != geometry.pixels() {
            bail!(Input, "frame of light"; found "{}", Count(samples.len(), "sample");
                expected "{} for {geometry}", geometry.pixels(); remedy "check width and height");
        }
        if let OwnedSamples::F32(values) = &samples
            && let Some(p) = invalid_light(values)
        {
            return Err(invalid_light_error(geometry, p, values[p]));
        }
        Ok(Self { geometry, samples, rgb: None })
    }

    /// Returns this frame with the colors `rgb`: linear red, green and blue of every pixel in units of full scale,
    /// row-major. The samples remain the light of the pixels.
    ///
    /// # Examples
    /// ```
    /// use spikelane::Geometry;
    /// use spikelane::light::{Frame, OwnedSamples};
    /// let gray = Frame::new(Geometry::new(1, 1)?, OwnedSamples::F32(vec![0.25]))?;
    /// let colored = gray.with_rgb(vec![0.5, 0.2, 0.1])?;
    /// assert_eq!((colored.get(0, 0), colored.rgb()), (0.25, Some(&[0.5, 0.2, 0.1][..])));
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    ///
    /// # Errors
    /// Returns [`ErrorKind::Input`](crate::ErrorKind::Input) if the number of values is not three times the number of pixels, or if a value is
    /// negative or not finite.
    pub fn with_rgb(self, rgb: Vec<f32>) -> Result<Self> {
        if rgb.len() != 3 * self.geometry.pixels() {
            bail!(Input, "colors of a frame"; found "{}", Count(rgb.len(), "value");
                expected "{}, three for each pixel of {}", 3 * self.geometry.pixels(), self.geometry);
        }
        if let Some(i) = invalid_light(&rgb) {
            return Err(invalid_light_error(self.geometry, i / 3, rgb[i]));
        }
        Ok(Self { rgb: Some(rgb.into()), ..self })
    }

    /// Returns a frame with other samples and the colors of this frame.
    pub(crate) fn with_samples(&self, samples: OwnedSamples) -> Result<Self> {
        Ok(Self { rgb: self.rgb.clone(), ..Self::new(self.geometry, samples)? })
    }

    /// Returns linear red, green and blue of every pixel, row-major, or `None` for a gray frame.
    #[must_use]
    pub fn rgb(&self) -> Option<&[f32]> {
        self.rgb.as_deref()
    }

    /// Returns the values of an image of this frame: red, green and blue of every pixel if the frame has colors, else the
    /// light of every pixel.
    ///
    /// # Examples
    /// ```
    /// use spikelane::{Geometry, light::Frame};
    /// let gray = Frame::dark(Geometry::new(2, 1)?);
    /// assert_eq!(gray.image_values(), [0.0; 2]);
    /// assert_eq!(gray.with_rgb(vec![0.5; 6])?.image_values(), [0.5; 6]);
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    #[must_use]
    pub fn image_values(&self) -> Vec<f32> {
        self.rgb().map_or_else(|| self.to_f32(), <[f32]>::to_vec)
    }

    /// Returns a frame without light, for example as the first argument of [`Source::next_frame`].
    ///
    /// # Examples
    /// ```
    /// use spikelane::{Geometry, light::Frame};
    /// let frame = Frame::dark(Geometry::new(64, 48)?);
    /// assert_eq!((frame.samples().len(), frame.max()), (64 * 48, 0.0));
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    #[must_use]
    pub fn dark(geometry: Geometry) -> Self {
        Self { geometry, samples: OwnedSamples::U8(vec![0; geometry.pixels()]), rgb: None }
    }

    /// Returns width and height.
    #[must_use]
    pub const fn geometry(&self) -> Geometry {
        self.geometry
    }

    /// Returns the samples.
    #[must_use]
    pub const fn samples(&self) -> &OwnedSamples {
        &self.samples
    }

    /// Consumes the frame and returns its samples.
    #[must_use]
    pub fn into_samples(self) -> OwnedSamples {
        self.samples
    }

    /// Returns the light of pixel `(row, col)`, 1.0 at full scale.
    ///
    /// # Panics
    /// If `row * width + col` is not the index of a pixel.
    #[must_use]
    pub fn get(&self, row: usize, col: usize) -> f32 {
        let p = row * self.geometry.width() + col;
        match &self.samples {
            OwnedSamples::U8(v) => f32::from(v[p]) / 255.0,
            OwnedSamples::U16(v) => f32::from(v[p]) / 65535.0,
            OwnedSamples::F32(v) => v[p],
        }
    }

    /// Returns the brightest sample, 1.0 at full scale.
    #[must_use]
    pub fn max(&self) -> f32 {
        match &self.samples {
            OwnedSamples::U8(v) => f32::from(v.iter().copied().max().unwrap_or(0)) / 255.0,
            OwnedSamples::U16(v) => f32::from(v.iter().copied().max().unwrap_or(0)) / 65535.0,
            OwnedSamples::F32(v) => v.iter().copied().fold(0.0, f32::max),
        }
    }

    /// Returns all samples as floats, 1.0 at full scale.
    #[must_use]
    pub fn to_f32(&self) -> Vec<f32> {
        match &self.samples {
            OwnedSamples::U8(v) => v.iter().map(|&x| f32::from(x) / 255.0).collect(),
            OwnedSamples::U16(v) => v.iter().map(|&x| f32::from(x) / 65535.0).collect(),
            OwnedSamples::F32(v) => v.clone(),
        }
    }

    /// Returns the interpolated frame `a + weight (b - a)`. It equals `a` at `weight` 0 and `b` at `weight` 1.
    ///
    /// If both frames have integer samples, the result has 16-bit samples, rounded to nearest. Otherwise it has floats.
    /// The result has colors if both frames have colors.
    ///
    /// # Examples
    /// ```
    /// use spikelane::Geometry;
    /// use spikelane::light::{Frame, OwnedSamples};
    /// let geometry = Geometry::new(2, 1)?;
    /// let dark = Frame::dark(geometry);
    /// let bright = Frame::new(geometry, OwnedSamples::F32(vec![1.0, 2.0]))?;
    /// assert_eq!(Frame::blend(&dark, &bright, 0.25)?.to_f32(), [0.25, 0.5]);
    /// assert_eq!(Frame::blend(&dark, &bright, 1.5).unwrap_err().kind(), spikelane::ErrorKind::Usage);
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    ///
    /// # Errors
    /// Returns [`ErrorKind::Usage`](crate::ErrorKind::Usage) if the sizes differ or if `weight` is outside 0 to 1.
    pub fn blend(a: &Self, b: &Self, weight: f32) -> Result<Self> {
        if a.geometry != b.geometry || !(0.0..=1.0).contains(&weight) {
            bail!(Usage, "interpolated frame"; found "{} and {} at weight {weight}", a.geometry, b.geometry;
                expected "two frames of one size and a weight from 0 to 1");
        }
        let mix = |x: f32, y: f32| x + weight * (y - x);
        let samples = if let (Some(x), Some(y)) = (a.to_u16(), b.to_u16()) {
            OwnedSamples::U16(zip(&x, &y, |x, y| (mix(f32::from(x), f32::from(y)) + 0.5) as u16))
        } else {
            // Rounding can make a value near zero negative, but the light of a frame must not be negative.
            OwnedSamples::F32(zip(&a.to_f32(), &b.to_f32(), |x, y| mix(x, y).max(0.0)))
        };
        let rgb = a.rgb().zip(b.rgb()).map(|(x, y)| zip(x, y, |x, y| mix(x, y).max(0.0)).into());
        Ok(Self { geometry: a.geometry, samples, rgb })
    }

    /// Returns integer samples scaled to 16 bits, or `None` for floats.
    fn to_u16(&self) -> Option<Vec<u16>> {
        match &self.samples {
            OwnedSamples::U8(v) => Some(v.iter().map(|&x| u16::from(x) * 257).collect()),
            OwnedSamples::U16(v) => Some(v.clone()),
            OwnedSamples::F32(_) => None,
        }
    }
}

/// Returns the geometry that a file declares for its images.
///
/// # Errors
/// Returns [`ErrorKind::Input`](crate::ErrorKind::Input) if the size is not a valid geometry. The kind is not `Usage`, because the invalid size
/// comes from the file and not from the caller.
pub fn declared_geometry(width: u64, height: u64, name: &str) -> Result<Geometry> {
    let side = |n: u64| u32::try_from(n).unwrap_or(u32::MAX);
    Geometry::new(side(width), side(height)).map_err(
        |_| error!(Input, "{name}"; found "images of {width}x{height}"; expected "1 to {MAX_PIXELS} pixels"),
    )
}

fn zip<T: Copy>(a: &[T], b: &[T], f: impl Fn(T, T) -> T) -> Vec<T> {
    a.iter().zip(b).map(|(&x, &y)| f(x, y)).collect()
}

/// Returns the index of the first value that is negative or not finite.
fn invalid_light(values: &[f32]) -> Option<usize> {
    let is_light = |v: &f32| (0.0..=f32::MAX).contains(v);
    // Without a branch in the loop, the compiler uses vector instructions.
    let all_valid = values.iter().fold(true, |valid, v| valid & is_light(v));
    if all_valid { None } else { values.iter().position(|v| !is_light(v)) }
}

fn invalid_light_error(geometry: Geometry, pixel: usize, value: f32) -> Error {
    let (row, col) = (pixel / geometry.width(), pixel % geometry.width());
    error!(Input, "pixel row {row}, col {col}"; found "{value}";
        expected "light that is finite and not negative";
        remedy "replace the invalid values before you simulate")
}

/// A sequence of frames of linear light at the camera's size.
///
/// If the sample type of the input changes from frame to frame, the sample type of the returned frames changes too.
///
/// # Examples
/// ```
/// use spikelane::light::{Frame, OwnedSamples, Rate, Source};
/// use spikelane::{Geometry, Result};
///
/// /// A flash: one bright frame, then darkness.
/// struct Flash(u64);
///
/// impl Source for Flash {
///     fn geometry(&self) -> Geometry {
///         Geometry::new(4, 2).expect("a valid size")
///     }
///     fn frames(&self) -> Option<u64> {
///         None
///     }
///     fn next_frame(&mut self, into: &mut Frame) -> Result<bool> {
///         let light = if self.0 == 0 { 1.0 } else { 0.0 };
///         *into = Frame::new(self.geometry(), OwnedSamples::F32(vec![light; self.geometry().pixels()]))?;
///         self.0 += 1;
///         Ok(true)
///     }
///     fn rate(&self) -> Option<Rate> {
///         None
///     }
///     fn describe(&self) -> String {
///         "a flash".into()
///     }
/// }
///
/// let (mut flash, mut frame) = (Flash(0), Frame::dark(Geometry::new(4, 2)?));
/// let light: Vec<f32> = (0..3).map(|_| flash.next_frame(&mut frame).map(|_| frame.max())).collect::<Result<_>>()?;
/// assert_eq!(light, [1.0, 0.0, 0.0]);
/// # Ok::<(), spikelane::Error>(())
/// ```
pub trait Source: Send {
    /// Returns width and height of every frame.
    fn geometry(&self) -> Geometry;

    /// Returns the number of frames, or `None` if the number is unknown before the end of the input (a pipe).
    fn frames(&self) -> Option<u64>;

    /// Returns the number of frames that the input declares. The number may be wrong.
    ///
    /// Estimates and progress reports use this number.
    fn announced_frames(&self) -> Option<u64> {
        self.frames()
    }

    /// Replaces `into` with the next frame and returns `true`.
    ///
    /// After the last frame it returns `false` and does not change `into`.
    ///
    /// # Errors
    /// Returns an error if the input cannot be read; each source documents its errors.
    fn next_frame(&mut self, into: &mut Frame) -> Result<bool>;

    /// Returns the frames per second, or `None` if the input does not contain a rate.
    fn rate(&self) -> Option<Rate>;

    /// Returns the conversion from stored values to light. [`FrontEnd::transfer`] is `Some`, even if the file type
    /// determines the tone curve.
    ///
    /// The default implementation is for drawn frames and floats, because both contain linear light.
    fn front_end(&self) -> FrontEnd {
        FrontEnd { transfer: Some(Transfer::Linear), ..FrontEnd::default() }
    }

    /// Returns the stored value that corresponds to light 1.0, in the units of the input. An input of 16 bits whose
    /// largest code is light 1.0 returns 65535.
    ///
    /// The default implementation returns the full scale of [`Source::front_end`].
    fn full_scale(&self) -> FullScale {
        self.front_end().full_scale
    }

    /// Returns one line of text with the name, the size and the number of frames of the input.
    fn describe(&self) -> String;

    /// Returns width and height of the stored frames, or `None` if the frames are drawn at the camera's size.
    fn stored_geometry(&self) -> Option<Geometry> {
        None
    }

    /// Returns the instant of each frame after the first frame, in nanoseconds.
    ///
    /// Returns `None` if the input has a constant rate or contains no instants.
    fn frame_times(&self) -> Option<&[u64]> {
        None
    }

    /// Returns warnings for the user, one line each, for example about skipped or missing parts of the input.
    fn notes(&self) -> Vec<String> {
        Vec::new()
    }
}
