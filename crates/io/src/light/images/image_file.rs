//! Reads one image file as a frame of linear light. The frame has the size of the image.
//!
//! Alpha is ignored, because the sensor receives the stored color and not a blend with a background. Embedded color
//! profiles are also ignored, and the declared transfer function is used instead.

use std::io::{self, BufReader};
use std::path::Path;

use image::metadata::Orientation;
use image::{DynamicImage, ImageDecoder, ImageError, ImageFormat, ImageReader, Limits};

use spikelane::error::{Error, ErrorKind, Result};
use spikelane::light::{Frame, OwnedSamples};
use spikelane::light::{ToneCurve, Transfer};
use spikelane::sensor::FrontEnd;
use spikelane::spikes::Geometry;
use spikelane::unstable::inputs::{self, InputFile, InputReader};
use spikelane::unstable::light::declared_geometry;

/// File extensions of images.
pub const EXTENSIONS: [&str; 12] =
    ["png", "jpg", "jpeg", "tif", "tiff", "exr", "bmp", "pgm", "ppm", "pnm", "pbm", "webp"];

/// The conversion of codes to light. It consists of a transfer function for integers, a transfer function for floats,
/// and the conversion of color to gray.
#[derive(Debug)]
pub struct Linearization {
    integers: ToneCurve,
    floats: Transfer,
    weights: [f32; 3],
    gray_codes: bool,
    front_end: FrontEnd,
}

impl Linearization {
    /// Uses the declared transfer function. If `declared` is `None`, integers are sRGB and floats are linear.
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
        let transfer = declared.or(front_end.transfer).unwrap_or(Transfer::Srgb);
        Self {
            integers: ToneCurve::new(transfer),
            floats: declared.unwrap_or(Transfer::Linear),
            weights: front_end.luminance.map(|w| w as f32),
            gray_codes: front_end.gray_codes,
            front_end: FrontEnd { transfer: Some(transfer), ..*front_end },
        }
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
}

/// Returns whether the file name has one of the [`EXTENSIONS`].
#[must_use]
pub fn is_image(path: &Path) -> bool {
    path.extension()
        .and_then(|e| e.to_str())
        .is_some_and(|e| EXTENSIONS.iter().any(|x| e.eq_ignore_ascii_case(x)))
}

/// The properties in the header of an image file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct ImageHeader {
    /// Width and height of the displayed image. The orientation of the image is already applied.
    pub size: Geometry,
    /// Whether the pixels are floats.
    pub has_float_pixels: bool,
}

/// Reads the header of an image file.
///
/// # Errors
/// As [`read`].
pub fn read_header(path: &Path) -> Result<ImageHeader> {
    let mut decoder = reader(InputFile::open(path)?)?.into_decoder().map_err(|e| decode_error(path, e))?;
    let (mut width, mut height) = decoder.dimensions();
    if swaps_axes(orientation(&mut decoder)) {
        (width, height) = (height, width);
    }
    let kind = decoder.color_type();
    let floats = kind.bytes_per_pixel() / kind.channel_count() == 4;
    let size = declared_geometry(width.into(), height.into(), &path.display().to_string())?;
    Ok(ImageHeader { size, has_float_pixels: floats })
}

/// Returns the orientation in which the image is displayed, from EXIF or the TIFF tag.
///
/// If the metadata cannot be read, the image is not rotated. The decoder reports later whether the image can be read.
fn orientation(decoder: &mut impl ImageDecoder) -> Orientation {
    decoder.orientation().unwrap_or(Orientation::NoTransforms)
}

/// Returns whether the orientation exchanges rows and columns.
const fn swaps_axes(orientation: Orientation) -> bool {
    matches!(
        orientation,
        Orientation::Rotate90
            | Orientation::Rotate270
            | Orientation::Rotate90FlipH
            | Orientation::Rotate270FlipH
    )
}

/// Decodes and linearizes an image file, and applies the orientation of the image. The format is determined from the
/// content of the file, not from its name.
///
/// The sample type of linear gray images of 8 or 16 bits does not change. Other 8-bit images are converted to 16-bit
/// samples. All other images are converted to floats.
///
/// # Errors
/// * [`ErrorKind::Io`] if the file cannot be read.
/// * [`ErrorKind::Input`] if the file is not an image, is damaged, or contains negative or non-finite light.
pub fn read(path: &Path, linear: &Linearization) -> Result<Frame> {
    read_file(InputFile::open(path)?, linear)
}

/// Does the same as [`read`] with an open file, such as a member of a tar.
///
/// # Errors
/// As [`read`].
pub fn read_file(file: InputFile, linear: &Linearization) -> Result<Frame> {
    let path = file.path().to_owned();
    let decoded = decode(file)?;
    linearize(decoded, linear).map_err(|e| e.with_context(path.display()))
}

type Reader = ImageReader<BufReader<InputReader<InputFile>>>;

fn decode(file: InputFile) -> Result<DynamicImage> {
    let path = &file.path().to_owned();
    let refused = |e| decode_error(path, e);
    let reader = reader(file)?;
    let mut decoder = reader.into_decoder().map_err(refused)?;
    limits().reserve(decoder.total_bytes()).map_err(refused)?;
    // If an allocation fails, the decoder and the conversion abort the process. The decoder and the conversion
    // together allocate at most twice the decoded bytes, so this amount is checked first.
    inputs::check_memory(path.display(), 2 * decoder.total_bytes() as usize)?;
    let turn = orientation(&mut decoder);
    let mut image = DynamicImage::from_decoder(decoder).map_err(refused)?;
    image.apply_orientation(turn);
    Ok(image)
}

/// Returns the memory limits of the decoder.
fn limits() -> Limits {
    let mut limits = Limits::default();
    limits.max_alloc = Some(inputs::MAX_PICTURE_BYTES);
    limits
}

fn reader(file: InputFile) -> Result<Reader> {
    let path = &file.path().to_owned();
    let mut reader = ImageReader::new(BufReader::new(file.into_reader()));
    reader.limits(limits());
    if let Ok(format) = ImageFormat::from_path(path) {
        reader.set_format(format);
    }
    let reader = reader.with_guessed_format().map_err(|e| Error::io(path.display(), e))?;
    let exr = reader.format() == Some(ImageFormat::OpenExr);
    Error::require_feature(
        format_args!("{}: EXR images", path.display()),
        "exr",
        !exr || cfg!(feature = "exr"),
    )?;
    Ok(reader)
}

fn decode_error(path: &Path, error: ImageError) -> Error {
    match error {
        ImageError::IoError(e)
            if !matches!(e.kind(), io::ErrorKind::UnexpectedEof | io::ErrorKind::InvalidData) =>
        {
            Error::io(path.display(), e)
        }
        other => Error::new(ErrorKind::Input, path.display())
            .found(other)
            .expected("a complete PNG, JPEG, TIFF, EXR, BMP, PNM or WEBP image")
            .remedy("open it in a viewer to check whether it is damaged"),
    }
}

/// Converts a decoded image to linear gray light.
///
/// * [`ErrorKind::Input`] if a light value is negative or not finite.
/// * [`ErrorKind::Input`] if the pixel type is not supported.
pub fn linearize(image: DynamicImage, linear: &Linearization) -> Result<Frame> {
    let geometry = declared_geometry(image.width().into(), image.height().into(), "image")?;
    let is_linear = linear.integers.transfer() == Transfer::Linear;
    let samples = match image {
        DynamicImage::ImageLuma8(i) => gray8(i.into_raw(), linear, is_linear),
        DynamicImage::ImageLumaA8(i) => {
            let gray = i.as_raw().iter().step_by(2).copied().collect();
            gray8(gray, linear, is_linear)
        }
        DynamicImage::ImageRgb8(i) => color8::<3>(i.as_raw(), linear),
        DynamicImage::ImageRgba8(i) => color8::<4>(i.as_raw(), linear),
        DynamicImage::ImageLuma16(i) => gray16(i.into_raw(), linear, is_linear),
        DynamicImage::ImageLumaA16(i) => {
            let gray = i.as_raw().iter().step_by(2).copied().collect();
            gray16(gray, linear, is_linear)
        }
        DynamicImage::ImageRgb16(i) => color16::<3>(i.as_raw(), linear),
        DynamicImage::ImageRgba16(i) => color16::<4>(i.as_raw(), linear),
        DynamicImage::ImageRgb32F(i) => color32::<3>(i.as_raw(), linear),
        DynamicImage::ImageRgba32F(i) => color32::<4>(i.as_raw(), linear),
        other => {
            return Err(Error::new(ErrorKind::Input, "pixel type")
                .found(format_args!(
                    "pixels of {} channels and {} bits",
                    other.color().channel_count(),
                    other.color().bits_per_pixel()
                ))
                .expected("gray or RGB of 8 or 16 bits or 32-bit float"));
        }
    };
    Frame::new(geometry, samples)
}

fn gray8(codes: Vec<u8>, linear: &Linearization, is_linear: bool) -> OwnedSamples {
    if is_linear {
        return OwnedSamples::U8(codes);
    }
    let table = linear.integers.table8();
    OwnedSamples::U16(codes.iter().map(|&c| table[usize::from(c)]).collect())
}

fn gray16(codes: Vec<u16>, linear: &Linearization, is_linear: bool) -> OwnedSamples {
    if is_linear {
        return OwnedSamples::U16(codes);
    }
    let table = linear.integers.table16();
    OwnedSamples::F32(codes.iter().map(|&c| table[usize::from(c)]).collect())
}

fn color8<const N: usize>(codes: &[u8], linear: &Linearization) -> OwnedSamples {
    let table = linear.integers.table8().map(f32::from);
    let light = |p: &[u8; N]| linear.light([0, 1, 2].map(|c| f32::from(p[c])), [1.0, 255.0], |c| table[c]);
    let (pixels, _) = codes.as_chunks::<N>();
    OwnedSamples::U16(pixels.iter().map(|p| (light(p) + 0.5) as u16).collect())
}

fn color16<const N: usize>(codes: &[u16], linear: &Linearization) -> OwnedSamples {
    let table = linear.integers.table16();
    let light = |p: &[u16; N]| linear.light([0, 1, 2].map(|c| f32::from(p[c])), [1.0, 65535.0], |c| table[c]);
    let (pixels, _) = codes.as_chunks::<N>();
    OwnedSamples::F32(pixels.iter().map(light).collect())
}

fn color32<const N: usize>(codes: &[f32], linear: &Linearization) -> OwnedSamples {
    let decode = |code: f32| match linear.floats {
        Transfer::Linear => code,
        curve => curve.light(f64::from(code)) as f32,
    };
    let [r, g, b] = linear.weights;
    let light = |p: &[f32; N]| r * decode(p[0]) + g * decode(p[1]) + b * decode(p[2]);
    let (pixels, _) = codes.as_chunks::<N>();
    OwnedSamples::F32(pixels.iter().map(light).collect())
}
