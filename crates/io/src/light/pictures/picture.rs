//! One image file to one frame of linear light at the file's own size.
//!
//! Alpha is ignored: a sensor sees the colour that is stored, not what a viewer
//! would blend it with. Embedded colour profiles are ignored too; the declared
//! transfer function decides.

use std::io::{BufReader, ErrorKind};
use std::path::Path;

use image::metadata::Orientation;
use image::{DynamicImage, ImageDecoder, ImageError, ImageFormat, ImageReader, Limits};

use spikelane::error::{Error, Kind, Result};
use spikelane::light::{Curve, Transfer};
use spikelane::light::{Frame, OwnedSamples};
use spikelane::sensor::FrontEnd;
use spikelane::spikes::Geometry;
use spikelane::unstable::inputs::{self, Cursor, InputFile};
use spikelane::unstable::light::stored_size;

/// File name endings that are taken for images.
pub const EXTENSIONS: [&str; 12] =
    ["png", "jpg", "jpeg", "tif", "tiff", "exr", "bmp", "pgm", "ppm", "pnm", "pbm", "webp"];

/// How codes become light: one curve for integers, one for floats, and how colour becomes grey.
#[derive(Debug)]
pub struct Linear {
    integers: Curve,
    floats: Transfer,
    weights: [f32; 3],
    grey_codes: bool,
    front_end: FrontEnd,
}

impl Linear {
    /// The declared transfer function, or sRGB for integers and linear for floats.
    #[must_use]
    pub fn new(declared: Option<Transfer>) -> Self {
        Self::of(&FrontEnd::default(), declared)
    }

    /// As a camera's front end has it, unless `declared` says another transfer function. The front end's is for
    /// integer codes, a declared one for floats too.
    #[must_use]
    pub fn of(front_end: &FrontEnd, declared: Option<Transfer>) -> Self {
        let transfer = declared.or(front_end.transfer).unwrap_or(Transfer::Srgb);
        Self {
            integers: Curve::new(transfer),
            floats: declared.unwrap_or(Transfer::Linear),
            weights: front_end.luminance.map(|w| w as f32),
            grey_codes: front_end.grey_codes,
            front_end: FrontEnd { transfer: Some(transfer), ..*front_end },
        }
    }

    /// How integer codes are read, or floats: with nothing left to the kind of file.
    #[must_use]
    pub fn used(&self, floats: bool) -> FrontEnd {
        if !floats {
            return self.front_end;
        }
        let light = FrontEnd { transfer: Some(self.floats), ..FrontEnd::default() };
        FrontEnd { luminance: self.front_end.luminance, ..light }
    }

    /// Light of a colour of these codes, where `linear` knows those up to `top`; a whole grey code is `unit` of them.
    pub(in crate::light) fn light(
        &self,
        codes: [f32; 3],
        [unit, top]: [f32; 2],
        linear: impl Fn(usize) -> f32,
    ) -> f32 {
        let [r, g, b] = self.weights;
        let sum = |[x, y, z]: [f32; 3]| r * x + g * y + b * z;
        if self.grey_codes {
            // In f32 the sum of 8-bit codes with weights of at most 16 binary places is exact.
            let grey = (sum(codes) / unit + 0.5).floor() * unit;
            return linear(grey.min(top) as usize);
        }
        sum(codes.map(|c| linear(c as usize)))
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

/// What the header of an image file says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Header {
    /// Width and height as the picture is shown, its orientation obeyed.
    pub size: Geometry,
    /// Whether its pixels are floats.
    pub floats: bool,
}

/// Reads the header of an image file.
///
/// # Errors
/// As [`read`].
pub fn header(path: &Path) -> Result<Header> {
    let mut decoder = reader(path)?.into_decoder().map_err(|e| undecodable(path, e))?;
    let (mut width, mut height) = decoder.dimensions();
    if is_turned(orientation(&mut decoder)) {
        (width, height) = (height, width);
    }
    let kind = decoder.color_type();
    let floats = kind.bytes_per_pixel() / kind.channel_count() == 4;
    let size = stored_size(width.into(), height.into(), &path.display().to_string())?;
    Ok(Header { size, floats })
}

/// How the picture is to be turned when it is shown (EXIF, or TIFF's own tag).
///
/// Metadata that cannot be read turn nothing: whether the picture can be is found out when it is decoded.
fn orientation(decoder: &mut impl ImageDecoder) -> Orientation {
    decoder.orientation().unwrap_or(Orientation::NoTransforms)
}

/// Whether rows become columns.
const fn is_turned(orientation: Orientation) -> bool {
    matches!(
        orientation,
        Orientation::Rotate90
            | Orientation::Rotate270
            | Orientation::Rotate90FlipH
            | Orientation::Rotate270FlipH
    )
}

/// Decodes and linearises an image file. The content decides the format, not the name. The picture is turned as
/// its orientation says.
///
/// Grey 8-bit linear pictures stay 8-bit; other 8-bit pictures give 16 bits, and so
/// do grey 16-bit linear ones; all else gives floats.
///
/// # Errors
/// [`Kind::Io`] when the file cannot be read, [`Kind::Input`] when it is no image, is damaged, or holds light
/// that is negative or not finite.
pub fn read(path: &Path, linear: &Linear) -> Result<Frame> {
    let decoded = decode(path)?;
    linearise(decoded, linear).map_err(|e| e.within(path.display()))
}

type Reader = ImageReader<BufReader<Cursor<InputFile>>>;

fn decode(path: &Path) -> Result<DynamicImage> {
    let refused = |e| undecodable(path, e);
    let reader = reader(path)?;
    let mut decoder = reader.into_decoder().map_err(refused)?;
    limits().reserve(decoder.total_bytes()).map_err(refused)?;
    // The decoder and the conversion to at most twice its bytes abort the process where memory is missing.
    inputs::check_memory(path.display(), 2 * decoder.total_bytes() as usize)?;
    let turn = orientation(&mut decoder);
    let mut image = DynamicImage::from_decoder(decoder).map_err(refused)?;
    image.apply_orientation(turn);
    Ok(image)
}

/// What a picture may take while it is decoded.
fn limits() -> Limits {
    let mut limits = Limits::default();
    limits.max_alloc = Some(inputs::MAX_PICTURE_BYTES);
    limits
}

fn reader(path: &Path) -> Result<Reader> {
    let mut reader = ImageReader::new(BufReader::new(InputFile::open(path)?.into_reader()));
    reader.limits(limits());
    if let Ok(format) = ImageFormat::from_path(path) {
        reader.set_format(format);
    }
    let reader = reader.with_guessed_format().map_err(|e| Error::io(path.display(), e))?;
    let exr = reader.format() == Some(ImageFormat::OpenExr);
    Error::require(format_args!("{}: EXR pictures", path.display()), "exr", !exr || cfg!(feature = "exr"))?;
    Ok(reader)
}

fn undecodable(path: &Path, error: ImageError) -> Error {
    match error {
        ImageError::IoError(e) if !matches!(e.kind(), ErrorKind::UnexpectedEof | ErrorKind::InvalidData) => {
            Error::io(path.display(), e)
        }
        other => Error::new(Kind::Input, path.display())
            .found(other)
            .expected("a whole PNG, JPEG, TIFF, EXR, BMP, PNM or WEBP image")
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
                .found(format_args!(
                    "pixels of {} channels and {} bits",
                    other.color().channel_count(),
                    other.color().bits_per_pixel()
                ))
                .expected("grey or RGB of 8 or 16 bits or 32-bit float"));
        }
    };
    Frame::new(geometry, samples)
}

fn grey8(codes: Vec<u8>, linear: &Linear, plain: bool) -> OwnedSamples {
    if plain {
        return OwnedSamples::U8(codes);
    }
    let table = linear.integers.table8();
    OwnedSamples::U16(codes.iter().map(|&c| table[usize::from(c)]).collect())
}

fn grey16(codes: Vec<u16>, linear: &Linear, plain: bool) -> OwnedSamples {
    if plain {
        return OwnedSamples::U16(codes);
    }
    let table = linear.integers.table16();
    OwnedSamples::F32(codes.iter().map(|&c| table[usize::from(c)]).collect())
}

fn colour8<const N: usize>(codes: &[u8], linear: &Linear) -> OwnedSamples {
    let table = linear.integers.table8().map(f32::from);
    let light = |p: &[u8; N]| linear.light([0, 1, 2].map(|c| f32::from(p[c])), [1.0, 255.0], |c| table[c]);
    let (pixels, _) = codes.as_chunks::<N>();
    OwnedSamples::U16(pixels.iter().map(|p| (light(p) + 0.5) as u16).collect())
}

fn colour16<const N: usize>(codes: &[u16], linear: &Linear) -> OwnedSamples {
    let table = linear.integers.table16();
    let light = |p: &[u16; N]| linear.light([0, 1, 2].map(|c| f32::from(p[c])), [1.0, 65535.0], |c| table[c]);
    let (pixels, _) = codes.as_chunks::<N>();
    OwnedSamples::F32(pixels.iter().map(light).collect())
}

fn colour32<const N: usize>(codes: &[f32], linear: &Linear) -> OwnedSamples {
    let decode = |code: f32| match linear.floats {
        Transfer::Linear => code,
        curve => curve.light(f64::from(code)) as f32,
    };
    let [r, g, b] = linear.weights;
    let light = |p: &[f32; N]| r * decode(p[0]) + g * decode(p[1]) + b * decode(p[2]);
    let (pixels, _) = codes.as_chunks::<N>();
    OwnedSamples::F32(pixels.iter().map(light).collect())
}
