//! JPEG files whose data are incomplete or damaged.
//!
//! The `image` crate fills the missing part of a JPEG with gray and reports no error. This module decodes a JPEG in the
//! strict mode of the `zune-jpeg` crate, which the `image` crate uses too, and requires complete scans and the end marker.
//! libjpeg ends a JPEG without the end marker with a warning, and Pillow rejects such a file.

use std::io::Cursor;
use std::path::Path;

use image::codecs::jpeg::JpegDecoder;
use image::{DynamicImage, ImageBuffer, ImageDecoder, ImageError};
use spikelane::error::{Error, ErrorKind, Result};
use spikelane::unstable::inputs;
use zune_jpeg::zune_core::bytestream::ZCursor;
use zune_jpeg::zune_core::colorspace::ColorSpace;
use zune_jpeg::zune_core::options::DecoderOptions;

use super::decoding::{DamagePolicy, decode_error, limits};
use super::jpeg_scan;

/// Decodes the JPEG in `bytes`. If damage is accepted, it is added to `notes`, and missing parts are gray.
///
/// # Errors
/// [`ErrorKind::Input`] if the file is not a JPEG, or if it is damaged and damage is not accepted.
pub(super) fn decode(
    bytes: &[u8],
    path: &Path,
    policy: DamagePolicy,
    notes: &mut Vec<String>,
) -> Result<DynamicImage> {
    let refused = |e: ImageError| decode_error(path, e);
    let mut decoder = JpegDecoder::new(Cursor::new(bytes)).map_err(refused)?;
    decoder.set_limits(limits()).map_err(refused)?;
    limits().reserve(decoder.total_bytes()).map_err(refused)?;
    // If an allocation fails, the decoder and the conversion abort the process. The decoder and the conversion
    // together allocate at most twice the decoded bytes, so this amount is checked first.
    inputs::check_memory(path.display(), 2 * decoder.total_bytes() as usize)?;
    match jpeg_scan::check(bytes).and_then(|()| decode_strictly(bytes)) {
        Ok(image) => Ok(image),
        Err(damage) if policy == DamagePolicy::Accept => {
            notes.push(format!("damaged: found {damage}; missing parts of the image are gray"));
            DynamicImage::from_decoder(decoder).map_err(refused)
        }
        Err(damage) => Err(Error::new(ErrorKind::Input, path.display())
            .found(damage)
            .expected("a complete JPEG")
            .remedy(policy.remedy())),
    }
}

/// Decodes a JPEG, with an error at the first invalid code or marker.
fn decode_strictly(bytes: &[u8]) -> std::result::Result<DynamicImage, String> {
    let options = DecoderOptions::default().set_max_width(usize::MAX).set_max_height(usize::MAX);
    let mut decoder =
        zune_jpeg::JpegDecoder::new_with_options(ZCursor::new(bytes), options.set_strict_mode(false));
    // Some programs write bytes between the segments of the header, which decoders skip. Only the data of the image are
    // decoded strictly.
    decoder.decode_headers().map_err(|e| e.to_string())?;
    let color = match decoder.input_colorspace() {
        Some(ColorSpace::Luma) => ColorSpace::Luma,
        _ => ColorSpace::RGB,
    };
    decoder.set_options(options.jpeg_set_out_colorspace(color).set_strict_mode(true));
    let samples = decoder.decode().map_err(|e| e.to_string())?;
    let (width, height) = decoder.dimensions().unwrap_or_default();
    let (width, height) = (width as u32, height as u32);
    let image = if color == ColorSpace::Luma {
        ImageBuffer::from_raw(width, height, samples).map(DynamicImage::ImageLuma8)
    } else {
        ImageBuffer::from_raw(width, height, samples).map(DynamicImage::ImageRgb8)
    };
    image.ok_or_else(|| "too few samples".to_owned())
}

/// Returns the pixels per unit of length in x and y in the header of JFIF. `start` are the first 18 bytes of the file.
pub(super) fn densities(start: &[u8]) -> Option<[f64; 2]> {
    let is_jfif = start.starts_with(b"\xFF\xD8\xFF\xE0") && start.get(6..11) == Some(b"JFIF\0");
    let density = |at: usize| Some(u16::from_be_bytes([*start.get(at)?, *start.get(at + 1)?]).into());
    is_jfif.then(|| Some([density(14)?, density(16)?]))?
}
