//! JPEG files whose data are incomplete or damaged.
//!
//! The `image` crate fills the missing part of a JPEG with gray and reports no error. This module decodes a JPEG in the
//! strict mode of the `zune-jpeg` crate, which the `image` crate uses too, and requires the end marker. libjpeg ends a
//! JPEG without the end marker with a warning, and Pillow rejects such a file.

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
    let complete = if has_end_marker(bytes) {
        decode_strictly(bytes)
    } else {
        Err("the end of the file before the end marker of the JPEG".to_owned())
    };
    match complete {
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

/// Returns whether the end marker (EOI) follows the header and the scans.
fn has_end_marker(bytes: &[u8]) -> bool {
    const STUFFING: u8 = 0x00;
    const TEM: u8 = 0x01;
    const RESTART: std::ops::RangeInclusive<u8> = 0xD0..=0xD8;
    const END: u8 = 0xD9;
    let mut at = 0;
    // Bytes between two segments are the data of a scan, or padding.
    while let Some(next) = bytes.get(at..).and_then(|rest| rest.iter().position(|byte| *byte == 0xFF)) {
        at += next + 1;
        match bytes.get(at) {
            Some(&END) => return true,
            // A byte 0xFF in front of a marker is padding.
            Some(0xFF) => {}
            Some(&(STUFFING | TEM)) => at += 1,
            Some(code) if RESTART.contains(code) => at += 1,
            Some(_) => {
                let Some(len) = bytes.get(at + 1..at + 3) else { return false };
                at += 1 + usize::from(u16::from_be_bytes([len[0], len[1]]));
            }
            None => return false,
        }
    }
    false
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_end_marker_is_found_outside_segments() {
        // A comment with the bytes of an end marker, a scan with stuffing and a restart, and padding.
        let segments = [
            &b"\xFF\xD8\xFF\xFE\0\x04\xFF\xD9"[..],
            b"\xFF\xDA\0\x02\x12\xFF\0\x34\xFF\xD0\x56",
            b"\xFF\xFF\xD9\0\0",
        ]
        .concat();
        assert!(has_end_marker(&segments));
        for len in 0..segments.len() - 2 {
            assert!(!has_end_marker(&segments[..len]), "{len}");
        }
    }
}
