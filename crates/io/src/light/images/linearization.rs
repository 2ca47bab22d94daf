//! The conversion of decoded pixels to linear gray light.

use image::DynamicImage;
use image::metadata::Orientation;

use spikelane::error::{Error, ErrorKind, Result, Setting};
use spikelane::light::{Frame, OwnedSamples, ToneCurve, Transfer};
use spikelane::sensor::{FrontEnd, FullScale};
use spikelane::spikes::Geometry;
use spikelane::unstable::Count;
use spikelane::unstable::light::declared_geometry;

use super::encoding::Encoding;
use crate::light::full_scale::{check_float_light, check_full_scale};

/// The conversion of codes to light. It consists of a transfer function for integers, a transfer function for floats,
/// and the conversion of color to gray.
#[derive(Debug)]
pub struct Linearization {
    integers: ToneCurve,
    floats: Transfer,
    weights: [f32; 3],
    /// Whether frames of color images keep their colors.
    keeps_color: bool,
    gray_codes: bool,
    front_end: FrontEnd,
    /// Whether neither the caller nor the camera states a transfer function for integer codes.
    is_default: bool,
    /// The code or the float value that the caller states as full scale.
    stated_full_scale: Option<f64>,
    /// The code or the float value of full scale, if it is not the largest code or 1.0.
    full_scale: Option<f64>,
    /// Full scale in the units of the file.
    stored_full_scale: FullScale,
    /// The light of each 16-bit code, if full scale is not the largest code.
    scaled_table: Option<Vec<f32>>,
}

impl Linearization {
    /// Uses the declared transfer function. If `declared` is `None`, the transfer function of the file applies. If the
    /// file states none, integers are sRGB and floats are linear.
    #[must_use]
    pub fn new(declared: Option<Transfer>) -> Self {
        Self::from_front_end(&FrontEnd::default(), declared)
    }

    /// Uses the conversion of a camera's front end. The transfer function `declared` overrides the transfer function
    /// of the front end.
    ///
    /// The transfer function of the front end applies only to integer codes. The transfer function `declared` also
    /// applies to floats.
    #[must_use]
    pub fn from_front_end(front_end: &FrontEnd, declared: Option<Transfer>) -> Self {
        let stated = declared.or(front_end.transfer);
        let transfer = stated.unwrap_or(Transfer::Srgb);
        Self {
            integers: ToneCurve::new(transfer),
            floats: declared.unwrap_or(Transfer::Linear),
            weights: front_end.luminance.map(|w| w as f32),
            keeps_color: false,
            gray_codes: front_end.gray_codes,
            front_end: FrontEnd { transfer: Some(transfer), ..*front_end },
            is_default: stated.is_none(),
            stated_full_scale: None,
            full_scale: None,
            stored_full_scale: front_end.full_scale,
            scaled_table: None,
        }
    }

    /// Sets the code or the float value of full scale. If `full_scale` is `None`, full scale is the code that the file
    /// states, the largest code, or 1.0 for floats.
    ///
    /// # Errors
    /// [`ErrorKind::Usage`] if `full_scale` is not finite and positive.
    pub fn with_full_scale(mut self, full_scale: Option<f64>) -> Result<Self> {
        full_scale.map(check_full_scale).transpose()?;
        self.stated_full_scale = full_scale;
        Ok(self)
    }

    /// Sets whether frames of color images keep their colors ([`Frame::rgb`]).
    #[must_use]
    pub fn with_color(mut self, keeps_color: bool) -> Self {
        self.keeps_color = keeps_color;
        self
    }

    /// Returns whether frames of color images keep their colors.
    pub(in crate::light) const fn keeps_color(&self) -> bool {
        self.keeps_color
    }

    /// Returns the conversion of a file with `encoding`. A statement of the caller or of the camera overrides a
    /// statement of the file.
    pub(in crate::light) fn for_encoding(&self, encoding: &Encoding) -> Self {
        let file = encoding.transfer.filter(|_| self.is_default);
        let transfer = file.unwrap_or(self.integers.transfer());
        let (full_scale, scaled_table) = match encoding.largest_code {
            None => (self.stated_full_scale, None),
            Some(largest) => {
                let white = self.stated_full_scale.or(encoding.white_code).filter(|w| *w != largest);
                let light = |white: f64| {
                    let step = largest / 65535.0;
                    (0..=u16::MAX).map(|c| transfer.light(f64::from(c) * step / white) as f32).collect()
                };
                (white, white.map(light))
            }
        };
        Self {
            integers: ToneCurve::new(transfer),
            front_end: FrontEnd { transfer: Some(transfer), ..self.front_end },
            full_scale,
            stored_full_scale: match encoding.largest_code {
                None => FullScale::Code(full_scale.unwrap_or(1.0)),
                Some(largest) => self.front_end.full_scale.in_units_of(full_scale.unwrap_or(largest)),
            },
            scaled_table,
            ..*self
        }
    }

    /// Returns whether the caller or the camera states which code is full scale.
    pub(in crate::light) fn has_full_scale(&self) -> bool {
        self.stated_full_scale.is_some() || self.front_end.full_scale != FullScale::MAX_CODE
    }

    /// Returns the note about a transfer function of HDR pictures, or `None` for other transfer functions.
    ///
    /// The code of diffuse white is that of ITU-R BT.2408-7, table 1.
    pub(in crate::light) fn hdr_note(&self, encoding: &Encoding) -> Option<String> {
        let transfer = encoding.transfer.filter(|t| t.is_high_dynamic_range())?;
        let name = transfer.to_string().to_uppercase();
        if !self.is_default {
            let used = self.integers.transfer();
            return Some(format!("the file states the curve {name}, but the curve {used} is used"));
        }
        if self.has_full_scale() {
            return None;
        }
        let (peak, white) = match transfer {
            Transfer::Pq => ("10,000 cd/m2", transfer.code(203.0 / 1e4)),
            _ => ("the nominal peak", 0.75),
        };
        let code = (white * encoding.largest_code.unwrap_or(255.0)).round();
        Some(format!(
            "the curve {name} of the file is inverted, and full scale is {peak}; to make diffuse white (203 cd/m2, BT.2408) full scale, set {} to {code}",
            Setting("full_scale")
        ))
    }

    /// Returns full scale in the units of the file.
    pub(in crate::light) const fn full_scale(&self) -> FullScale {
        self.stored_full_scale
    }

    /// Returns a part of a description that names a full scale other than the largest code or 1.0.
    pub(in crate::light) fn full_scale_text(&self) -> String {
        self.full_scale.map_or(String::new(), |s| format!(", full scale at {s}"))
    }

    /// Returns the front end that is used for float or integer codes. Its transfer function is always set.
    #[must_use]
    pub fn front_end_for(&self, floats: bool) -> FrontEnd {
        if !floats {
            return self.front_end;
        }
        let light = FrontEnd { transfer: Some(self.floats), ..FrontEnd::default() };
        FrontEnd { luminance: self.front_end.luminance, ..light }
    }

    /// Returns the light of a pixel with the color `codes`. `linear` converts a code between 0 and `top` to light.
    /// Gray codes are rounded to multiples of `unit`.
    pub(in crate::light) fn light(
        &self,
        codes: [f32; 3],
        [unit, top]: [f32; 2],
        linear: impl Fn(usize) -> f32,
    ) -> f32 {
        let [r, g, b] = self.weights;
        let sum = |[x, y, z]: [f32; 3]| r * x + g * y + b * z;
        if self.gray_codes {
            // The f32 sum of 8-bit codes is exact if each weight has at most 16 binary places.
            let gray = (sum(codes) / unit + 0.5).floor() * unit;
            return linear(gray.min(top) as usize);
        }
        sum(codes.map(|c| linear(c as usize)))
    }

    /// Returns the transfer function of integer codes.
    #[must_use]
    pub const fn integers(&self) -> &ToneCurve {
        &self.integers
    }

    /// Returns the light of every 16-bit code. If full scale is not the largest code, light can exceed 1.
    pub(in crate::light) fn table16(&self) -> &[f32] {
        self.scaled_table.as_deref().unwrap_or_else(|| self.integers.table16())
    }

    /// Returns whether the light of 8-bit codes requires floats.
    ///
    /// 16-bit samples cannot contain light above full scale, and lose the dark codes of the HDR curves.
    pub(in crate::light) fn requires_floats(&self) -> bool {
        self.scaled_table.is_some() || self.integers.transfer().is_high_dynamic_range()
    }

    /// Returns whether light is proportional to codes, and the largest code is full scale.
    fn is_identity(&self) -> bool {
        self.integers.transfer() == Transfer::Linear && self.scaled_table.is_none()
    }

    fn float_light(&self, code: f32) -> f32 {
        match (self.full_scale, self.floats) {
            (None, Transfer::Linear) => code,
            (scale, curve) => curve.light(f64::from(code) / scale.unwrap_or(1.0)) as f32,
        }
    }
}

/// The decoded pixels of a page.
pub(in crate::light) enum Pixels {
    /// Gray or color codes, or color floats.
    Image(DynamicImage),
    /// Gray floats, row by row.
    GrayFloats { size: Geometry, values: Vec<f32> },
}

impl Pixels {
    /// Converts the pixels to linear gray light, and applies the orientation.
    pub(in crate::light) fn into_light(
        self,
        linear: &Linearization,
        orientation: Orientation,
    ) -> Result<Frame> {
        let frame = match self {
            Self::Image(image) => linearize(image, linear)?,
            Self::GrayFloats { size, values } => {
                let samples = float_samples(&values, 1, linear, |p| linear.float_light(p[0]))?;
                Frame::new(size, samples)?
            }
        };
        turn(frame, orientation)
    }

    /// Returns the color samples of 16-bit pixels, without alpha. Returns `None` for other pixels.
    pub(in crate::light) fn codes16(&self) -> Option<Box<dyn Iterator<Item = u16> + '_>> {
        fn colors(samples: &[u16], channels: usize) -> Box<dyn Iterator<Item = u16> + '_> {
            Box::new(samples.chunks_exact(channels).flat_map(move |p| p[..channels - 1].iter().copied()))
        }
        match self {
            Self::Image(DynamicImage::ImageLuma16(i)) => Some(Box::new(i.as_raw().iter().copied())),
            Self::Image(DynamicImage::ImageRgb16(i)) => Some(Box::new(i.as_raw().iter().copied())),
            Self::Image(DynamicImage::ImageLumaA16(i)) => Some(colors(i.as_raw(), 2)),
            Self::Image(DynamicImage::ImageRgba16(i)) => Some(colors(i.as_raw(), 4)),
            _ => None,
        }
    }

    /// Returns whether a pixel is at least partly transparent.
    pub(in crate::light) fn is_transparent(&self) -> bool {
        match self {
            Self::Image(DynamicImage::ImageLumaA8(i)) => i.pixels().any(|p| p[1] < u8::MAX),
            Self::Image(DynamicImage::ImageRgba8(i)) => i.pixels().any(|p| p[3] < u8::MAX),
            Self::Image(DynamicImage::ImageLumaA16(i)) => i.pixels().any(|p| p[1] < u16::MAX),
            Self::Image(DynamicImage::ImageRgba16(i)) => i.pixels().any(|p| p[3] < u16::MAX),
            Self::Image(DynamicImage::ImageRgba32F(i)) => i.pixels().any(|p| p[3] < 1.0),
            _ => false,
        }
    }
}

/// Returns whether the orientation exchanges rows and columns.
pub(super) const fn swaps_axes(orientation: Orientation) -> bool {
    matches!(
        orientation,
        Orientation::Rotate90
            | Orientation::Rotate270
            | Orientation::Rotate90FlipH
            | Orientation::Rotate270FlipH
    )
}

/// Returns `frame` in the orientation in which it is displayed.
fn turn(frame: Frame, orientation: Orientation) -> Result<Frame> {
    if orientation == Orientation::NoTransforms {
        return Ok(frame);
    }
    let from = frame.geometry();
    let to = if swaps_axes(orientation) {
        Geometry::new(from.height() as u32, from.width() as u32)?
    } else {
        from
    };
    let colors = frame.rgb().map(|rgb| turned_samples(rgb.as_chunks::<3>().0, from, to, orientation));
    let samples = match frame.into_samples() {
        OwnedSamples::U8(v) => OwnedSamples::U8(turned_samples(&v, from, to, orientation)),
        OwnedSamples::U16(v) => OwnedSamples::U16(turned_samples(&v, from, to, orientation)),
        OwnedSamples::F32(v) => OwnedSamples::F32(turned_samples(&v, from, to, orientation)),
    };
    with_colors(Frame::new(to, samples)?, colors.map(|colors| colors.concat()))
}

/// Returns `frame` with the colors `rgb`, or without colors if `rgb` is `None`.
pub(in crate::light) fn with_colors(frame: Frame, rgb: Option<Vec<f32>>) -> Result<Frame> {
    match rgb {
        Some(rgb) => frame.with_rgb(rgb),
        None => Ok(frame),
    }
}

fn turned_samples<T: Copy>(all: &[T], from: Geometry, to: Geometry, orientation: Orientation) -> Vec<T> {
    let (right, bottom) = (from.width() - 1, from.height() - 1);
    let stored = |row: usize, col: usize| match orientation {
        Orientation::NoTransforms => (row, col),
        Orientation::FlipHorizontal => (row, right - col),
        Orientation::FlipVertical => (bottom - row, col),
        Orientation::Rotate180 => (bottom - row, right - col),
        Orientation::Rotate90 => (bottom - col, row),
        Orientation::Rotate270 => (col, right - row),
        Orientation::Rotate90FlipH => (col, row),
        Orientation::Rotate270FlipH => (bottom - col, right - row),
    };
    (0..to.height())
        .flat_map(|row| (0..to.width()).map(move |col| (row, col)))
        .map(|(row, col)| {
            let (y, x) = stored(row, col);
            all[y * from.width() + x]
        })
        .collect()
}

/// Converts a decoded image to linear gray light.
///
/// * [`ErrorKind::Input`] if a light value is negative or not finite, or if a float is above 32 and no full scale is
///   stated.
/// * [`ErrorKind::Input`] if the pixel type is not supported.
pub fn linearize(image: DynamicImage, linear: &Linearization) -> Result<Frame> {
    let geometry = declared_geometry(image.width().into(), image.height().into(), "image")?;
    let colors = if linear.keeps_color { colors(&image, linear) } else { None };
    let samples = match image {
        DynamicImage::ImageLuma8(i) => gray8(i.into_raw(), linear),
        DynamicImage::ImageLumaA8(i) => gray8(i.as_raw().iter().step_by(2).copied().collect(), linear),
        DynamicImage::ImageRgb8(i) => color8::<3>(i.as_raw(), linear),
        DynamicImage::ImageRgba8(i) => color8::<4>(i.as_raw(), linear),
        DynamicImage::ImageLuma16(i) => gray16(i.into_raw(), linear),
        DynamicImage::ImageLumaA16(i) => gray16(i.as_raw().iter().step_by(2).copied().collect(), linear),
        DynamicImage::ImageRgb16(i) => color16::<3>(i.as_raw(), linear),
        DynamicImage::ImageRgba16(i) => color16::<4>(i.as_raw(), linear),
        DynamicImage::ImageRgb32F(i) => color32::<3>(i.as_raw(), linear)?,
        DynamicImage::ImageRgba32F(i) => color32::<4>(i.as_raw(), linear)?,
        other => {
            return Err(Error::new(ErrorKind::Input, "pixel type")
                .found(format_args!(
                    "pixels of {} and {} bits",
                    Count(other.color().channel_count(), "channel"),
                    other.color().bits_per_pixel(),
                ))
                .expected("gray or RGB of 8 or 16 bits or 32-bit float"));
        }
    };
    with_colors(Frame::new(geometry, samples)?, colors)
}

/// Returns linear red, green and blue of a color image, or `None` for a gray image. Negative light, which describes a
/// color outside the gamut of sRGB, is 0.
fn colors(image: &DynamicImage, linear: &Linearization) -> Option<Vec<f32>> {
    fn convert<T: Copy>(samples: &[T], channels: usize, light: impl Fn(T) -> f32) -> Vec<f32> {
        let is_color = |i: usize| channels == 3 || i % channels != channels - 1;
        let colors = samples.iter().enumerate().filter(|(i, _)| is_color(*i));
        colors.map(|(_, x)| light(*x)).collect()
    }
    let table8: [f32; 256] = if linear.requires_floats() {
        std::array::from_fn(|code| linear.table16()[257 * code])
    } else {
        linear.integers.table8().map(|light| f32::from(light) / 65535.0)
    };
    let light8 = |code: u8| table8[usize::from(code)];
    let light16 = |code: u16| linear.table16()[usize::from(code)];
    // `f32::max` would replace NaN by 0.
    let light32 = |code: f32| match linear.float_light(code) {
        light if light < 0.0 => 0.0,
        light => light,
    };
    match image {
        DynamicImage::ImageRgb8(i) => Some(convert(i.as_raw(), 3, light8)),
        DynamicImage::ImageRgba8(i) => Some(convert(i.as_raw(), 4, light8)),
        DynamicImage::ImageRgb16(i) => Some(convert(i.as_raw(), 3, light16)),
        DynamicImage::ImageRgba16(i) => Some(convert(i.as_raw(), 4, light16)),
        DynamicImage::ImageRgb32F(i) => Some(convert(i.as_raw(), 3, light32)),
        DynamicImage::ImageRgba32F(i) => Some(convert(i.as_raw(), 4, light32)),
        _ => None,
    }
}

fn gray8(codes: Vec<u8>, linear: &Linearization) -> OwnedSamples {
    if linear.is_identity() {
        return OwnedSamples::U8(codes);
    }
    if linear.requires_floats() {
        let table = linear.table16();
        return OwnedSamples::F32(codes.iter().map(|&c| table[usize::from(c) * 257]).collect());
    }
    let table = linear.integers.table8();
    OwnedSamples::U16(codes.iter().map(|&c| table[usize::from(c)]).collect())
}

fn gray16(codes: Vec<u16>, linear: &Linearization) -> OwnedSamples {
    if linear.is_identity() {
        return OwnedSamples::U16(codes);
    }
    let table = linear.table16();
    OwnedSamples::F32(codes.iter().map(|&c| table[usize::from(c)]).collect())
}

fn color8<const N: usize>(codes: &[u8], linear: &Linearization) -> OwnedSamples {
    let (pixels, _) = codes.as_chunks::<N>();
    let colors = |p: &[u8; N]| [0, 1, 2].map(|c| f32::from(p[c]));
    if linear.requires_floats() {
        let table = linear.table16();
        let light = |p| linear.light(colors(p), [1.0, 255.0], |c| table[c * 257]);
        return OwnedSamples::F32(pixels.iter().map(light).collect());
    }
    let table = linear.integers.table8().map(f32::from);
    let light = |p| linear.light(colors(p), [1.0, 255.0], |c| table[c]);
    OwnedSamples::U16(pixels.iter().map(|p| (light(p) + 0.5) as u16).collect())
}

fn color16<const N: usize>(codes: &[u16], linear: &Linearization) -> OwnedSamples {
    let table = linear.table16();
    let light = |p: &[u16; N]| linear.light([0, 1, 2].map(|c| f32::from(p[c])), [1.0, 65535.0], |c| table[c]);
    let (pixels, _) = codes.as_chunks::<N>();
    OwnedSamples::F32(pixels.iter().map(light).collect())
}

fn color32<const N: usize>(codes: &[f32], linear: &Linearization) -> Result<OwnedSamples> {
    let [r, g, b] = linear.weights;
    float_samples(codes, N, linear, |p| {
        let [x, y, z] = [0, 1, 2].map(|c| linear.float_light(p[c]));
        r * x + g * y + b * z
    })
}

/// Converts float pixels of `channels` samples with `light`.
fn float_samples(
    values: &[f32],
    channels: usize,
    linear: &Linearization,
    light: impl Fn(&[f32]) -> f32,
) -> Result<OwnedSamples> {
    let samples: Vec<f32> = values.chunks_exact(channels).map(light).collect();
    if linear.full_scale.is_none() {
        check_float_light(&samples, "image", "")?;
    }
    Ok(OwnedSamples::F32(samples))
}
