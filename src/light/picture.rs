//! One image file to one frame of linear light at the file's own size.
//!
//! Alpha is ignored: a sensor sees the colour that is stored, not what a viewer
//! would blend it with. Embedded colour profiles are ignored too; the declared
//! transfer function decides.

use std::io::ErrorKind;
use std::path::Path;

use image::{DynamicImage, ImageError, ImageReader};

use crate::error::{Error, Kind, Result};
use crate::light::{Curve, Frame, Samples, Transfer, luminance, stored_size};
use crate::spikes::Geometry;

/// File name endings that are taken for images.
pub const EXTENSIONS: [&str; 6] = ["png", "jpg", "jpeg", "tif", "tiff", "exr"];

/// How codes become light: one curve for integers, one for floats.
#[derive(Debug)]
pub struct Linear {
    integers: Curve,
    floats: Transfer,
}

impl Linear {
    /// The declared transfer function, or sRGB for integers and linear for floats.
    #[must_use]
    pub fn new(declared: Option<Transfer>) -> Self {
        Self {
            integers: Curve::new(declared.unwrap_or(Transfer::Srgb)),
            floats: declared.unwrap_or(Transfer::Linear),
        }
    }

    /// The curve of integer codes.
    #[must_use]
    pub const fn integers(&self) -> &Curve {
        &self.integers
    }
}

/// Whether the name ends like an image's.
#[must_use]
pub fn is_picture(path: &Path) -> bool {
    path.extension()
        .and_then(|e| e.to_str())
        .is_some_and(|e| EXTENSIONS.iter().any(|x| e.eq_ignore_ascii_case(x)))
}

/// Width and height of an image file, from its header.
///
/// # Errors
/// As [`read`].
pub fn size(path: &Path) -> Result<Geometry> {
    let (width, height) = reader(path)?.into_dimensions().map_err(|e| undecodable(path, e))?;
    let name = path.display().to_string();
    stored_size(width.into(), height.into(), &name)
}

/// Decodes and linearises an image file. The content decides the format, not the name.
///
/// Grey 8-bit linear pictures stay 8-bit; other 8-bit pictures give 16 bits, and so
/// do grey 16-bit linear ones; all else gives floats.
///
/// # Errors
/// [`Kind::Io`] when the file cannot be read, [`Kind::Input`] when it is no image, is damaged, or holds light
/// that is negative or not finite.
pub fn read(path: &Path, linear: &Linear) -> Result<Frame> {
    let decoded = reader(path)?.decode().map_err(|e| undecodable(path, e))?;
    linearise(decoded, linear).map_err(|e| e.within(path.display()))
}

fn reader(path: &Path) -> Result<ImageReader<std::io::BufReader<std::fs::File>>> {
    ImageReader::open(path)
        .and_then(ImageReader::with_guessed_format)
        .map_err(|e| Error::io(path.display(), e))
}

fn undecodable(path: &Path, error: ImageError) -> Error {
    match error {
        ImageError::IoError(e) if !matches!(e.kind(), ErrorKind::UnexpectedEof | ErrorKind::InvalidData) => {
            Error::io(path.display(), e)
        }
        other => Error::new(Kind::Input, path.display())
            .found(other)
            .expected("a whole PNG, JPEG, TIFF or EXR image")
            .remedy("open it in a viewer to see whether it is damaged"),
    }
}

/// A decoded image as linear grey light.
///
/// # Errors
/// [`Kind::Input`] for light that is negative or not finite, and for pixel types that are not known here.
pub fn linearise(image: DynamicImage, linear: &Linear) -> Result<Frame> {
    let geometry = stored_size(image.width().into(), image.height().into(), "image")?;
    let plain = linear.integers.transfer() == Transfer::Linear;
    let samples = match image {
        DynamicImage::ImageLuma8(i) => grey8(i.into_raw(), linear, plain),
        DynamicImage::ImageLumaA8(i) => {
            let grey = i.as_raw().iter().step_by(2).copied().collect();
            grey8(grey, linear, plain)
        }
        DynamicImage::ImageRgb8(i) => colour8::<3>(i.as_raw(), linear),
        DynamicImage::ImageRgba8(i) => colour8::<4>(i.as_raw(), linear),
        DynamicImage::ImageLuma16(i) => grey16(i.into_raw(), linear, plain),
        DynamicImage::ImageLumaA16(i) => {
            let grey = i.as_raw().iter().step_by(2).copied().collect();
            grey16(grey, linear, plain)
        }
        DynamicImage::ImageRgb16(i) => colour16::<3>(i.as_raw(), linear),
        DynamicImage::ImageRgba16(i) => colour16::<4>(i.as_raw(), linear),
        DynamicImage::ImageRgb32F(i) => colour32::<3>(i.as_raw(), linear),
        DynamicImage::ImageRgba32F(i) => colour32::<4>(i.as_raw(), linear),
        other => {
            return Err(Error::new(Kind::Input, "pixel type")
                .found(format_args!("{:?}", other.color()))
                .expected("grey or RGB of 8 or 16 bits or 32-bit float"));
        }
    };
    Frame::new(geometry, samples)
}

fn grey8(codes: Vec<u8>, linear: &Linear, plain: bool) -> Samples {
    if plain {
        return Samples::U8(codes);
    }
    let table = linear.integers.table8();
    Samples::U16(codes.iter().map(|&c| table[usize::from(c)]).collect())
}

fn grey16(codes: Vec<u16>, linear: &Linear, plain: bool) -> Samples {
    if plain {
        return Samples::U16(codes);
    }
    let table = linear.integers.table16();
    Samples::F32(codes.iter().map(|&c| table[usize::from(c)]).collect())
}

fn colour8<const N: usize>(codes: &[u8], linear: &Linear) -> Samples {
    let table = linear.integers.table8().map(f32::from);
    let light = |p: &[u8; N]| luminance([0, 1, 2].map(|c| table[usize::from(p[c])]));
    let (pixels, _) = codes.as_chunks::<N>();
    Samples::U16(pixels.iter().map(|p| (light(p) + 0.5) as u16).collect())
}

fn colour16<const N: usize>(codes: &[u16], linear: &Linear) -> Samples {
    let table = linear.integers.table16();
    let light = |p: &[u16; N]| luminance([0, 1, 2].map(|c| table[usize::from(p[c])]));
    let (pixels, _) = codes.as_chunks::<N>();
    Samples::F32(pixels.iter().map(light).collect())
}

fn colour32<const N: usize>(codes: &[f32], linear: &Linear) -> Samples {
    let decode = |code: f32| match linear.floats {
        Transfer::Linear => code,
        curve => curve.light(f64::from(code)) as f32,
    };
    let light = |p: &[f32; N]| luminance([0, 1, 2].map(|c| decode(p[c])));
    let (pixels, _) = codes.as_chunks::<N>();
    Samples::F32(pixels.iter().map(light).collect())
}
