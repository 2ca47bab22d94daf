//! Portable float maps (`.pfm`).
//!
//! The header has the lines `Pf` (gray) or `PF` (color), width and height, and a scale. A negative scale means
//! little-endian samples. The rows are stored from bottom to top.

use std::io::{BufRead, Read};
use std::path::Path;

use image::{DynamicImage, ImageBuffer};
use spikelane::error::{Error, ErrorKind, Result};
use spikelane::spikes::Geometry;
use spikelane::unstable::Count;
use spikelane::unstable::inputs::{self, MAX_PICTURE_BYTES};
use spikelane::unstable::light::declared_geometry;

use super::linearization::Pixels;

/// Maximum length of a word of the header in bytes.
const MAX_WORD_BYTES: usize = 32;

/// Returns whether a file with these first bytes is a portable float map.
pub(super) fn is_pfm(start: &[u8]) -> bool {
    matches!(start, [b'P', b'F' | b'f', space, ..] if space.is_ascii_whitespace())
}

/// The header of a portable float map.
#[derive(Clone, Copy, Debug)]
pub(super) struct PfmHeader {
    pub size: Geometry,
    channels: usize,
    is_big_endian: bool,
    /// The factor from samples to radiance.
    pub scale: f64,
}

/// Reads the header up to the first sample.
///
/// # Errors
/// [`ErrorKind::Input`] if the header is damaged or the picture is too large.
pub(super) fn read_header(file: &mut impl BufRead, path: &Path) -> Result<PfmHeader> {
    let name = path.display().to_string();
    let bad = |found: &str| {
        Error::new(ErrorKind::Input, &name)
            .found(found)
            .expected("a header `Pf` or `PF`, width, height and scale")
            .remedy("save the picture again")
    };
    let mut words: [String; 4] = Default::default();
    for word in &mut words {
        for byte in file.bytes() {
            let byte = byte.map_err(|e| Error::io(&name, e))?;
            match (byte.is_ascii_whitespace(), word.is_empty()) {
                (true, true) => {}
                (true, false) => break,
                (false, _) if word.len() == MAX_WORD_BYTES => return Err(bad("a longer word")),
                (false, _) => word.push(char::from(byte)),
            }
        }
    }
    let side = |i: usize| words[i].parse::<u64>().map_err(|_| bad("an invalid size"));
    let size = declared_geometry(side(1)?, side(2)?, &name)?;
    let scale: f64 = words[3].parse().map_err(|_| bad("an invalid scale"))?;
    let channels = if words[0] == "PF" { 3 } else { 1 };
    if size.pixels() as u64 * 4 * channels as u64 > MAX_PICTURE_BYTES {
        return Err(bad("too many pixels").expected(format_args!("at most {MAX_PICTURE_BYTES} bytes")));
    }
    Ok(PfmHeader { size, channels, is_big_endian: scale > 0.0, scale: scale.abs() })
}

/// Reads the samples. The top row of the result is the first row.
///
/// # Errors
/// [`ErrorKind::Input`] if the file is truncated.
pub(super) fn read(file: &mut impl BufRead, path: &Path) -> Result<Pixels> {
    let header = read_header(file, path)?;
    let name = path.display();
    let samples = header.size.pixels() * header.channels;
    inputs::check_memory(&name, 8 * samples)?;
    let mut bytes = Vec::new();
    file.take(4 * samples as u64).read_to_end(&mut bytes).map_err(|e| Error::io(&name, e))?;
    if bytes.len() < 4 * samples {
        return Err(Error::new(ErrorKind::Input, &name)
            .found(format_args!("{} of samples", Count(bytes.len(), "byte")))
            .expected(Count(4 * samples, "byte"))
            .remedy("save the image again, because the file is truncated"));
    }
    let order = if header.is_big_endian { f32::from_be_bytes } else { f32::from_le_bytes };
    let rows = bytes.chunks_exact(4 * header.size.width() * header.channels).rev();
    let values: Vec<f32> = rows.flat_map(|row| row.as_chunks().0.iter().map(|b| order(*b))).collect();
    Ok(if header.channels == 1 {
        Pixels::GrayFloats { size: header.size, values }
    } else {
        let (width, height) = (header.size.width() as u32, header.size.height() as u32);
        let image = ImageBuffer::from_raw(width, height, values).expect("a color has three samples");
        Pixels::Image(DynamicImage::ImageRgb32F(image))
    })
}
