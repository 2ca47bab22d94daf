use std::borrow::Cow;

use crate::count::Count;
use crate::error::{Result, error};
use crate::kernels::Samples;
use crate::light::Frame;
use crate::spikes::Geometry;

/// A borrowed frame of linear light, row-major, top row first.
///
/// The type of the samples determines full scale: 255 for `u8`, 65,535 for `u16`, and 1.0 for `f32`.
///
/// # Examples
/// ```
/// use spikelane::FrameRef;
/// let samples = vec![128u8; 6];
/// let frame = FrameRef::new(&samples);
///
/// // Rows of a 3x2 image that start four samples apart.
/// let padded = [1.0f32, 0.5, 0.25, 0.0, 1.0, 0.5, 0.25, 0.0];
/// let frame_with_padding = FrameRef::with_stride(&padded, 4);
/// # let _ = (frame, frame_with_padding);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameRef<'a> {
    samples: Samples<'a>,
    /// Distance between the starts of two rows in samples. With `None`, the rows have no gaps.
    stride: Option<usize>,
}

impl<'a> FrameRef<'a> {
    /// Returns a frame without gaps between rows. It needs as many samples as the sensor has pixels.
    ///
    /// # Examples
    /// ```
    /// use spikelane::FrameRef;
    /// use spikelane::simulate::Samples;
    /// let light = vec![0u16, 65535];
    /// assert_eq!(FrameRef::new(&light).samples(), Samples::U16(&[0, 65535]));
    /// ```
    #[must_use]
    pub fn new(samples: impl Into<Samples<'a>>) -> Self {
        Self { samples: samples.into(), stride: None }
    }

    /// Returns a frame whose rows start `stride` samples apart.
    ///
    /// # Examples
    /// ```
    /// use spikelane::{Camera, FrameRef, Seeds, Sensor, Simulator};
    /// let mut simulator = Simulator::new(&Camera::ideal(Sensor::new(3, 2, 20_000.0)?), Seeds::default())?;
    /// // Three pixels of each row, and one sample of padding that is not light.
    /// let padded = [255u8, 0, 0, 99, 0, 0, 255, 99];
    /// let spikes = simulator.run(FrameRef::with_stride(&padded, 4), 1)?;
    /// assert_eq!(spikes.to_dense(), [1, 0, 0, 0, 0, 1]);
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    #[must_use]
    pub fn with_stride(samples: impl Into<Samples<'a>>, stride: usize) -> Self {
        Self { samples: samples.into(), stride: Some(stride) }
    }

    /// Returns the samples that were passed, including gaps.
    #[must_use]
    pub fn samples(self) -> Samples<'a> {
        self.samples
    }

    /// Returns the samples without gaps after checking size and values.
    pub(super) fn validate(self, geometry: Geometry) -> Result<DenseFrame<'a>> {
        let (width, height) = (geometry.width(), geometry.height());
        let len = self.samples.len();
        let error = |found: std::fmt::Arguments<'_>, expected: std::fmt::Arguments<'_>| error!(Input, "frame of light"; found "{found}"; expected "{expected}");
        let Some(stride) = self.stride else {
            if len != geometry.pixels() {
                return Err(error(
                    format_args!("{}", Count(len, "sample")),
                    format_args!("{} samples, one for each of {geometry} pixels", geometry.pixels()),
                )
                .remedy(
                    "check the frame size; pass a stride if rows have gaps, and convert colors to light",
                ));
            }
            return self.gather(width, geometry);
        };
        let needed = stride.saturating_mul(height - 1).saturating_add(width);
        if stride < width || len < needed {
            return Err(error(
                format_args!("{} with a stride of {stride}", Count(len, "sample")),
                format_args!("a stride of at least {width}, and {}", Count(height, "row")),
            )
            .remedy("check the stride and the size of the frame"));
        }
        self.gather(stride, geometry)
    }

    fn gather(self, stride: usize, geometry: Geometry) -> Result<DenseFrame<'a>> {
        let dense = match self.samples {
            Samples::U8(s) => DenseFrame::U8(gather_rows(s, stride, geometry)),
            Samples::U16(s) => DenseFrame::U16(gather_rows(s, stride, geometry)),
            Samples::F32(s) => DenseFrame::F32(gather_rows(s, stride, geometry)),
        };
        dense.check(geometry)?;
        Ok(dense)
    }
}

impl<'a> From<Samples<'a>> for FrameRef<'a> {
    fn from(samples: Samples<'a>) -> Self {
        Self::new(samples)
    }
}

impl<'a, T: ?Sized> From<&'a T> for FrameRef<'a>
where
    &'a T: Into<Samples<'a>>,
{
    fn from(samples: &'a T) -> Self {
        Self::new(samples)
    }
}

impl<'a> From<&'a Frame> for Samples<'a> {
    fn from(frame: &'a Frame) -> Self {
        frame.samples().as_samples()
    }
}

macro_rules! from_samples {
    ($($variant:ident $sample:ty),*) => {$(
        impl<'a> From<&'a [$sample]> for Samples<'a> {
            fn from(samples: &'a [$sample]) -> Self {
                Self::$variant(samples)
            }
        }

        impl<'a> From<&'a Vec<$sample>> for Samples<'a> {
            fn from(samples: &'a Vec<$sample>) -> Self {
                Self::$variant(samples)
            }
        }

        impl<'a, const N: usize> From<&'a [$sample; N]> for Samples<'a> {
            fn from(samples: &'a [$sample; N]) -> Self {
                Self::$variant(samples)
            }
        }
    )*};
}

from_samples!(U8 u8, U16 u16, F32 f32);

/// Samples without gaps between rows.
pub(super) enum DenseFrame<'a> {
    U8(Cow<'a, [u8]>),
    U16(Cow<'a, [u16]>),
    F32(Cow<'a, [f32]>),
}

impl DenseFrame<'_> {
    pub(crate) fn samples(&self) -> Samples<'_> {
        match self {
            Self::U8(s) => Samples::U8(s),
            Self::U16(s) => Samples::U16(s),
            Self::F32(s) => Samples::F32(s),
        }
    }

    fn check(&self, geometry: Geometry) -> Result<()> {
        let Self::F32(s) = self else { return Ok(()) };
        let good = |v: &f32| v.is_finite() && *v >= 0.0;
        let Some(p) = s.iter().position(|v| !good(v)) else { return Ok(()) };
        let (row, col) = (p / geometry.width(), p % geometry.width());
        Err(error!(Input, "light at row {row}, col {col}"; found "{}", s[p];
            expected "a finite number, zero or more"))
    }
}

fn gather_rows<T: Copy>(samples: &[T], stride: usize, geometry: Geometry) -> Cow<'_, [T]> {
    if stride == geometry.width() {
        return Cow::Borrowed(&samples[..geometry.pixels()]);
    }
    let rows = samples.chunks(stride).take(geometry.height());
    Cow::Owned(rows.flat_map(|row| &row[..geometry.width()]).copied().collect())
}
