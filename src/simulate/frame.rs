use std::borrow::Cow;

use crate::error::{Error, Kind, Result};
use crate::kernels::Samples;
use crate::spikes::Geometry;

/// A borrowed frame of linear light: rows from top to bottom, `stride` samples apart.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameRef<'a> {
    samples: Samples<'a>,
    stride: usize,
}

impl<'a> FrameRef<'a> {
    /// A frame whose rows follow each other without a gap.
    #[must_use]
    pub fn dense(samples: Samples<'a>, geometry: Geometry) -> Self {
        Self { samples, stride: geometry.width() }
    }

    /// A frame whose rows start `stride` samples apart.
    #[must_use]
    pub fn strided(samples: Samples<'a>, stride: usize) -> Self {
        Self { samples, stride }
    }

    /// 8-bit samples without gaps; 255 is full scale.
    ///
    /// # Examples
    /// ```
    /// use spikelane::{Geometry, simulate::FrameRef};
    /// let grey = vec![128u8; 6];
    /// let frame = FrameRef::u8(&grey, Geometry::new(3, 2)?);
    /// # let _ = frame;
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    #[must_use]
    pub fn u8(samples: &'a [u8], geometry: Geometry) -> Self {
        Self::dense(Samples::U8(samples), geometry)
    }

    /// 16-bit samples without gaps; 65535 is full scale.
    #[must_use]
    pub fn u16(samples: &'a [u16], geometry: Geometry) -> Self {
        Self::dense(Samples::U16(samples), geometry)
    }

    /// Floats without gaps; 1.0 is full scale.
    #[must_use]
    pub fn f32(samples: &'a [f32], geometry: Geometry) -> Self {
        Self::dense(Samples::F32(samples), geometry)
    }

    /// The samples as they were given.
    #[must_use]
    pub fn samples(self) -> Samples<'a> {
        self.samples
    }

    /// The samples without gaps, checked.
    pub(super) fn checked(self, geometry: Geometry) -> Result<Dense<'a>> {
        let (width, height) = (geometry.width(), geometry.height());
        let needed = self.stride.saturating_mul(height - 1).saturating_add(width);
        if self.stride < width || self.samples.len() < needed {
            return Err(Error::new(Kind::Input, "light frame")
                .found(format_args!("{} samples with a stride of {}", self.samples.len(), self.stride))
                .expected(format_args!("{geometry} samples"))
                .remedy("check the stride and the size of the frame"));
        }
        let dense = match self.samples {
            Samples::U8(s) => Dense::U8(gathered(s, self.stride, geometry)),
            Samples::U16(s) => Dense::U16(gathered(s, self.stride, geometry)),
            Samples::F32(s) => Dense::F32(gathered(s, self.stride, geometry)),
        };
        dense.check(geometry)?;
        Ok(dense)
    }
}

/// Samples without gaps.
pub(super) enum Dense<'a> {
    U8(Cow<'a, [u8]>),
    U16(Cow<'a, [u16]>),
    F32(Cow<'a, [f32]>),
}

impl Dense<'_> {
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
        Err(Error::new(Kind::Input, format_args!("light at row {row}, col {col}"))
            .found(s[p])
            .expected("a finite number, zero or more"))
    }
}

fn gathered<T: Copy>(samples: &[T], stride: usize, geometry: Geometry) -> Cow<'_, [T]> {
    if stride == geometry.width() {
        return Cow::Borrowed(&samples[..geometry.pixels()]);
    }
    let rows = samples.chunks(stride).take(geometry.height());
    Cow::Owned(rows.flat_map(|row| &row[..geometry.width()]).copied().collect())
}
