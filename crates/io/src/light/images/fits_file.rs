//! Images in FITS files (FITS standard 4.0).
//!
//! A file is a list of units. A unit has a header of 80-byte cards in blocks of 2,880 bytes, and big-endian samples. The
//! first unit with an image is read. Its third axis counts frames. The first row is the bottom row, unless the card
//! ROWORDER states another order.

use spikelane::unstable::Count;
use spikelane::unstable::npy;
use std::path::Path;

use image::{DynamicImage, ImageBuffer};
use spikelane::error::{Error, ErrorKind, Result, Setting};
use spikelane::light::Transfer;
use spikelane::spikes::Geometry;
use spikelane::unstable::inputs::{self, InputFile, MAX_PICTURE_BYTES};
use spikelane::unstable::light::declared_geometry;

use super::encoding::Encoding;
use super::linearization::Pixels;

const BLOCK_BYTES: u64 = 2880;
const CARD_BYTES: usize = 80;

/// Maximum number of blocks in all headers of a file.
const MAX_HEADER_BLOCKS: u64 = 1000;

/// Returns whether a file with these first bytes is a FITS file.
pub(super) fn is_fits(start: &[u8]) -> bool {
    start.starts_with(b"SIMPLE  =")
}

/// The image of a FITS file, and what its header states.
#[derive(Clone, Debug)]
pub(super) struct FitsFile {
    pub size: Geometry,
    pub pages: u64,
    pub encoding: Encoding,
    pub notes: Vec<String>,
    /// Offset of the first sample.
    data_offset: u64,
    /// The number of bits of a sample. It is negative for floats.
    bits: i64,
    /// The value of a stored sample is `zero + scale * sample`.
    scale: f64,
    zero: f64,
    /// The integer that marks an undefined pixel.
    blank: Option<i64>,
    is_top_down: bool,
}

/// The cards of a header with a value, without the end card.
struct Header(Vec<(String, String)>);

impl Header {
    /// Reads the header at `offset`. Returns also the offset of the data.
    fn read(file: &InputFile, mut offset: u64, blocks: &mut u64) -> Result<(Self, u64)> {
        let mut cards = Vec::new();
        loop {
            *blocks += 1;
            if *blocks > MAX_HEADER_BLOCKS || offset + BLOCK_BYTES > file.len() {
                let found = format!("no END card within {}", Count(offset, "byte"));
                return Err(damaged_error(file.path(), found));
            }
            let mut block = [0; BLOCK_BYTES as usize];
            file.read_at(offset, &mut block)?;
            offset += BLOCK_BYTES;
            for card in block.chunks_exact(CARD_BYTES) {
                let card = String::from_utf8_lossy(card);
                let (keyword, rest) = card.split_at_checked(8).unwrap_or((&card, ""));
                if keyword.trim_end() == "END" {
                    return Ok((Self(cards), offset));
                }
                if let Some(value) = rest.strip_prefix("= ") {
                    cards.push((keyword.trim_end().to_owned(), plain_value(value).to_owned()));
                }
            }
        }
    }

    fn text(&self, keyword: &str) -> Option<&str> {
        self.0.iter().find(|(name, _)| name == keyword).map(|(_, value)| value.as_str())
    }

    /// Returns the number of a card, or `default` if the header does not contain the card.
    fn number<T: std::str::FromStr>(&self, path: &Path, keyword: &str, default: Option<T>) -> Result<T> {
        let wrong = |found: &str| damaged_error(path, format!("the value `{found}` of {keyword}"));
        match (self.text(keyword), default) {
            // Fortran writes the exponent of a double as D.
            (Some(text), _) => text.replace(['D', 'd'], "E").parse().map_err(|_| wrong(text)),
            (None, Some(default)) => Ok(default),
            (None, None) => Err(wrong("")),
        }
    }

    /// Returns the lengths of the axes.
    fn axes(&self, path: &Path) -> Result<Vec<u64>> {
        let count = self.number(path, "NAXIS", None)?;
        if count > 999 {
            return Err(damaged_error(path, format!("the number of axes {count}")));
        }
        (1..=count).map(|i: u64| self.number(path, &format!("NAXIS{i}"), None)).collect()
    }
}

/// Returns the value of a card without quotation marks and comment.
fn plain_value(text: &str) -> &str {
    match text.trim_start().strip_prefix('\'') {
        Some(quoted) => quoted.split('\'').next().unwrap_or_default().trim_end(),
        None => text.split('/').next().unwrap_or_default().trim(),
    }
}

/// Reads the headers up to the first image.
///
/// # Errors
/// [`ErrorKind::Input`] if the file is damaged, contains no image, or contains an image that is not supported.
pub(super) fn read_header(path: &Path) -> Result<FitsFile> {
    let file = InputFile::open(path)?;
    let (mut offset, mut blocks) = (0, 0);
    let mut skipped = Vec::new();
    while offset < file.len() {
        let (header, data_offset) = Header::read(&file, offset, &mut blocks)?;
        let axes = header.axes(path)?;
        let bits: i64 = header.number(path, "BITPIX", None)?;
        let kind = header.text("XTENSION").unwrap_or("IMAGE");
        let is_compressed = header.text("ZIMAGE") == Some("T");
        if kind == "IMAGE" && axes.len() > 1 && axes.iter().all(|n| *n > 0) {
            return image_of(&file, &header, &axes, data_offset, &skipped);
        }
        if is_compressed {
            return Err(Error::new(ErrorKind::Input, path.display())
                .found("a compressed image")
                .expected("an image that is not compressed")
                .remedy("decompress the file, for example with funpack"));
        }
        if !axes.is_empty() {
            skipped.push(kind.to_owned());
        }
        let parameters: u64 = header.number(path, "PCOUNT", Some(0))?;
        let groups: u64 = header.number(path, "GCOUNT", Some(1))?;
        let samples = axes.iter().try_fold(u64::from(!axes.is_empty()), |all, n| all.checked_mul(*n));
        let bytes = samples.and_then(|n| {
            n.checked_add(parameters)?.checked_mul(groups)?.checked_mul(bits.unsigned_abs() / 8)
        });
        let next = bytes.and_then(|n| data_offset.checked_add(n)?.checked_next_multiple_of(BLOCK_BYTES));
        offset = next.ok_or_else(|| damaged_error(path, "a unit of more than 2^64 bytes".to_owned()))?;
    }
    Err(Error::new(ErrorKind::Input, path.display())
        .found("no image")
        .expected("an image of two or three axes")
        .remedy("save the image as a primary image or as an image extension"))
}

/// Returns the image whose samples begin at `data_offset`.
fn image_of(
    file: &InputFile,
    header: &Header,
    axes: &[u64],
    data_offset: u64,
    skipped: &[String],
) -> Result<FitsFile> {
    let path = file.path();
    let frames = match axes[2..].iter().position(|n| *n != 1) {
        None => 1,
        Some(i) if axes[3 + i..].iter().all(|n| *n == 1) => axes[2 + i],
        Some(_) => {
            return Err(Error::new(ErrorKind::Input, path.display())
                .found(format_args!("axes of the lengths {}", npy::shape_text(axes)))
                .expected("width, height and, optionally, frames")
                .remedy("save an image of two or three axes"));
        }
    };
    let size = declared_geometry(axes[0], axes[1], &path.display().to_string())?;
    let bits: i64 = header.number(path, "BITPIX", None)?;
    if !matches!(bits, 8 | 16 | 32 | 64 | -32 | -64) {
        return Err(damaged_error(path, format!("samples of {bits} bits")));
    }
    let scale: f64 = header.number(path, "BSCALE", Some(1.0))?;
    let zero: f64 = header.number(path, "BZERO", Some(0.0))?;
    let largest_code = match (bits, scale, zero) {
        (8, 1.0, 0.0) => Some(255.0),
        // Unsigned samples are stored as signed samples.
        (16, 1.0, 32768.0) => Some(65535.0),
        _ => None,
    };
    let mut notes = Vec::new();
    if matches!(frames, 3 | 4) {
        notes.push(format!("the {frames} planes of the third axis are read as frames, not as colors"));
    }
    if let Some(level) = header.text("SATURATE") {
        notes.push(format!(
            "SATURATE {level} in the header is not used; to choose full scale, set {}",
            Setting("full_scale")
        ));
    }
    if !skipped.is_empty() {
        notes.push(format!("other units before the image are not used: {}", skipped.join(", ")));
    }
    let found = FitsFile {
        size,
        pages: frames,
        encoding: Encoding {
            transfer: largest_code.map(|_| Transfer::Linear),
            largest_code,
            ..Encoding::default()
        },
        notes,
        data_offset,
        bits,
        scale,
        zero,
        blank: header.text("BLANK").filter(|_| bits > 0).and_then(|text| text.parse().ok()),
        is_top_down: header.text("ROWORDER").is_some_and(|text| text.eq_ignore_ascii_case("TOP-DOWN")),
    };
    let wanted = found.page_bytes().checked_mul(frames).and_then(|n| n.checked_add(data_offset));
    if found.page_bytes() > MAX_PICTURE_BYTES {
        return Err(damaged_error(
            path,
            format!("frames of {size} and {}", Count(found.page_bytes(), "byte")),
        ));
    }
    match wanted {
        Some(wanted) if wanted <= file.len() => Ok(found),
        _ => Err(damaged_error(path, Count(file.len(), "byte").to_string())
            .expected(format_args!("{} of {size} and {} bits", Count(frames, "frame"), bits.abs()))
            .remedy("the file is truncated; save the image again")),
    }
}

impl FitsFile {
    const fn page_bytes(&self) -> u64 {
        self.size.pixels() as u64 * self.bits.unsigned_abs() / 8
    }

    /// Reads page `page`. The top row of the result is the first row.
    ///
    /// # Errors
    /// [`ErrorKind::Input`] if a pixel is undefined.
    pub(super) fn read_page(&self, path: &Path, page: usize) -> Result<Pixels> {
        let name = path.display();
        // The values have four bytes per pixel, and codes have at most two.
        inputs::check_memory(&name, self.page_bytes() as usize + 6 * self.size.pixels())?;
        let mut bytes = inputs::zeroed_vec(&name, self.page_bytes() as usize)?;
        InputFile::open(path)?.read_at(self.data_offset + page as u64 * self.page_bytes(), &mut bytes)?;
        let values = match self.bits {
            8 => self.values::<1>(path, &bytes, |b| b[0].into()),
            16 => self.values::<2>(path, &bytes, |b| i16::from_be_bytes(b).into()),
            32 => self.values::<4>(path, &bytes, |b| i32::from_be_bytes(b).into()),
            64 => self.values::<8>(path, &bytes, i64::from_be_bytes),
            -32 => Ok(self.top_down(bytes.as_chunks().0, |b| f32::from_be_bytes(b).into())),
            _ => Ok(self.top_down(bytes.as_chunks().0, f64::from_be_bytes)),
        }?;
        let (width, height) = (self.size.width() as u32, self.size.height() as u32);
        let codes = || values.iter().map(|v| *v as u16);
        let image = match self.encoding.largest_code {
            None => None,
            Some(255.0) => {
                let codes = codes().map(|code| code as u8).collect();
                ImageBuffer::from_raw(width, height, codes).map(DynamicImage::ImageLuma8)
            }
            Some(_) => ImageBuffer::from_raw(width, height, codes().collect()).map(DynamicImage::ImageLuma16),
        };
        Ok(image.map_or(Pixels::GrayFloats { size: self.size, values }, Pixels::Image))
    }

    /// Converts integers to values.
    fn values<const N: usize>(
        &self,
        path: &Path,
        bytes: &[u8],
        integer: impl Fn([u8; N]) -> i64,
    ) -> Result<Vec<f32>> {
        let samples = bytes.as_chunks().0;
        if let Some(blank) = self.blank
            && let Some(at) = samples.iter().position(|b| integer(*b) == blank)
        {
            let (row, col) = (at / self.size.width(), at % self.size.width());
            return Err(Error::new(ErrorKind::Input, path.display())
                .found(format_args!("an undefined pixel (BLANK) at stored row {row}, col {col}"))
                .expected("light in every pixel")
                .remedy("replace undefined pixels before the simulation"));
        }
        Ok(self.top_down(samples, |b| integer(b) as f64))
    }

    /// Converts samples to values from the top row to the bottom row.
    fn top_down<const N: usize>(&self, samples: &[[u8; N]], sample: impl Fn([u8; N]) -> f64) -> Vec<f32> {
        let (width, height) = (self.size.width(), self.size.height());
        let mut values = Vec::with_capacity(samples.len());
        for row in 0..height {
            let stored = if self.is_top_down { row } else { height - 1 - row };
            let samples = &samples[stored * width..(stored + 1) * width];
            values.extend(samples.iter().map(|b| (self.zero + self.scale * sample(*b)) as f32));
        }
        values
    }
}

fn damaged_error(path: &Path, found: String) -> Error {
    Error::new(ErrorKind::Input, path.display())
        .found(found)
        .expected("a complete FITS file")
        .remedy("open the image in a viewer to check whether the file is damaged")
}
