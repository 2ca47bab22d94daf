//! The pages of a TIFF.
//!
//! The `image` crate decodes the first page of a TIFF only. To decode another page, this module changes the offset of
//! the first page in the header while the file is read. Sample types that the `image` crate does not support, such as
//! gray floats, are decoded by the `tiff` crate. The `tiff` crate does not decode packed samples of 9 to 15 bits.
//! Therefore, this module changes the tags of a page of packed samples to those of gray samples of 8 bits, and unpacks
//! the decoded bytes.

use std::io::{BufReader, Read, Seek};
use std::path::Path;

use image::codecs::tiff::TiffDecoder;
use image::metadata::Orientation;
use image::{DynamicImage, ImageBuffer, ImageDecoder};
use spikelane::error::{Error, ErrorKind, Result};
use spikelane::light::Rate;
use spikelane::unstable::Count;
use spikelane::unstable::inputs::{self, InputFile, MAX_PICTURE_BYTES};
use spikelane::unstable::light::declared_geometry;
use tiff::decoder::ifd::Value;
use tiff::decoder::{Decoder, DecodingResult, Limits};
use tiff::tags::{SampleFormat, Tag};
use tiff::{ColorType, TiffError};

use super::decoding::{decode_error, limits};
use super::encoding::{Encoding, store_transfer, transfer_from_icc};
use super::linearization::Pixels;
use super::patched_reader::PatchedReader;

/// The tag TransferFunction of TIFF 6.0.
const TRANSFER_FUNCTION: Tag = Tag::Unknown(301);

/// Returns whether a file with these first bytes is a TIFF or a BigTIFF.
pub(super) fn is_tiff(start: &[u8]) -> bool {
    [b"II*\0", b"MM\0*", b"II+\0", b"MM\0+"].iter().any(|magic| start.starts_with(*magic))
}

/// The pages of a TIFF that are pictures, and what the file states about the first page.
#[derive(Clone, Debug)]
pub(super) struct TiffFile {
    /// Offsets of the directories of the pages.
    pub pages: Vec<u64>,
    pub dimensions: (u32, u32),
    pub encoding: Encoding,
    pub orientation: Orientation,
    /// The rate of the pages that ImageJ writes.
    pub rate: Option<Rate>,
    /// Pixels per unit of length in x and y.
    pub densities: [f64; 2],
    pub notes: Vec<String>,
}

/// The storage of the samples of a page.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Storage {
    /// The `image` crate decodes the page. The value is the largest code of integers.
    Common(Option<f64>),
    /// Integers of 1 to 15 bits, without padding between the samples of a row.
    PackedCodes { bits: u32, channels: usize },
    /// Floats or other integers. The value is the number of channels.
    Values(usize),
}

fn storage<R: Read + Seek>(decoder: &mut Decoder<R>) -> tiff::TiffResult<Option<Storage>> {
    let color = decoder.colortype()?;
    let formats = decoder.find_tag_unsigned_vec::<u16>(Tag::SampleFormat)?.unwrap_or_default();
    let format = formats.first().map_or(SampleFormat::Uint, |f| SampleFormat::from_u16_exhaustive(*f));
    let (bits, channels) = match color {
        ColorType::Gray(n) => (n, 1),
        ColorType::GrayA(n) => (n, 2),
        ColorType::RGB(n) => (n, 3),
        ColorType::RGBA(n) => (n, 4),
        ColorType::CMYK(n @ (8 | 16)) if format == SampleFormat::Uint => (n, 4),
        _ => return Ok(None),
    };
    Ok(match (format, bits) {
        (SampleFormat::Uint, 8) => Some(Storage::Common(Some(255.0))),
        (SampleFormat::Uint, 1) if channels == 1 => Some(Storage::Common(Some(255.0))),
        (SampleFormat::Uint, 16) => Some(Storage::Common(Some(65535.0))),
        (SampleFormat::Uint, 1..8 | 9..16) if channels == 1 || channels == 3 => {
            Some(Storage::PackedCodes { bits: bits.into(), channels })
        }
        (SampleFormat::IEEEFP, 32) if channels >= 3 => Some(Storage::Common(None)),
        (SampleFormat::IEEEFP, 16 | 32 | 64) | (SampleFormat::Uint | SampleFormat::Int, 8 | 16 | 32 | 64) => {
            Some(Storage::Values(channels))
        }
        _ => None,
    })
}

/// Reads the directories of all pages.
///
/// Pages with another size than the first page, thumbnails and masks are not frames. A note states their number.
///
/// # Errors
/// [`ErrorKind::Input`] if the file is damaged, or if its first page has a sample type that is not supported.
pub(super) fn read_header(path: &Path) -> Result<TiffFile> {
    let refused = |e| tiff_error(path, e);
    let file = BufReader::new(InputFile::open(path)?.into_reader());
    let mut decoder = Decoder::new(file).map_err(refused)?;
    let dimensions = decoder.dimensions().map_err(refused)?;
    let kept = storage(&mut decoder).map_err(refused)?.ok_or_else(|| storage_error(path, &mut decoder))?;
    let mut notes = Vec::new();
    let mut encoding = Encoding { largest_code: largest_code(kept), ..Encoding::default() };
    if let Storage::PackedCodes { bits, .. } = kept {
        encoding.white_code = Some(f64::from((1_u32 << bits) - 1));
    } else if let Some(largest) = encoding.largest_code {
        let stated = decoder.find_tag_unsigned_vec::<u64>(Tag::MaxSampleValue).ok().flatten();
        match stated.and_then(|all| all.into_iter().max()) {
            Some(max) if max as f64 == largest => {}
            Some(max @ (511 | 1023 | 2047 | 4095 | 8191 | 16383 | 32767)) if largest == 65535.0 => {
                encoding.white_code = Some(max as f64);
            }
            Some(max) => notes.push(format!(
                "the tag MaxSampleValue {max} is not the largest code of a bit depth, so full scale remains {largest}"
            )),
            None => {}
        }
    }
    if encoding.largest_code.is_some() {
        if let Ok(profile) = decoder.get_tag_u8_vec(Tag::IccProfile) {
            store_transfer(&mut encoding, &mut notes, transfer_from_icc(&profile));
        } else if decoder.find_tag(TRANSFER_FUNCTION).is_ok_and(|t| t.is_some()) {
            store_transfer(&mut encoding, &mut notes, Err("a tag TransferFunction".to_owned()));
        }
    }
    let density = |decoder: &mut Decoder<_>, tag| match decoder.find_tag(tag) {
        Ok(Some(Value::Rational(num, den))) => f64::from(num) / f64::from(den),
        _ => 1.0,
    };
    let densities = [density(&mut decoder, Tag::XResolution), density(&mut decoder, Tag::YResolution)];
    let orientation = decoder.find_tag_unsigned::<u8>(Tag::Orientation).ok().flatten();
    let description = decoder.get_tag_ascii_string(Tag::ImageDescription).unwrap_or_default();
    let mut pages = Vec::new();
    let mut others = 0;
    loop {
        // Bit 0 marks a reduced picture, and bit 2 marks a mask.
        let kind = decoder.find_tag_unsigned::<u32>(Tag::NewSubfileType).ok().flatten().unwrap_or(0);
        let is_frame = pages.is_empty() || (kind & 5 == 0 && decoder.dimensions().ok() == Some(dimensions));
        match decoder.ifd_pointer() {
            Some(offset) if is_frame => pages.push(offset.0),
            _ => others += 1,
        }
        if !decoder.more_images() {
            break;
        }
        // A page of a type that the decoder does not support is not a frame.
        while let Err(error) = decoder.next_image() {
            others += 1;
            if !matches!(error, TiffError::UnsupportedError(_)) || !decoder.more_images() {
                return Err(refused(error).with_context(format_args!("page {}", pages.len() + others)));
            }
        }
    }
    if others > 0 {
        notes.push(format!("not used: {} (thumbnails, masks or another size)", Count(others, "page")));
    }
    let imagej = ImageJ::parse(&description);
    if let Some(stated) = imagej.images.filter(|n| *n != pages.len() as u64) {
        notes.push(format!(
            "the description states {}, but the file has {}",
            Count(stated, "image"),
            Count(pages.len(), "page"),
        ));
    }
    Ok(TiffFile {
        pages,
        dimensions,
        encoding,
        orientation: orientation.and_then(Orientation::from_exif).unwrap_or(Orientation::NoTransforms),
        rate: imagej.rate,
        densities,
        notes,
    })
}

fn largest_code(kept: Storage) -> Option<f64> {
    match kept {
        Storage::Common(code) => code,
        Storage::PackedCodes { .. } => Some(65535.0),
        Storage::Values(_) => None,
    }
}

/// What ImageJ writes into the image description.
#[derive(Debug, Default, PartialEq)]
struct ImageJ {
    images: Option<u64>,
    rate: Option<Rate>,
}

impl ImageJ {
    fn parse(description: &str) -> Self {
        if !description.starts_with("ImageJ=") {
            return Self::default();
        }
        let value = |key: &str| {
            description
                .lines()
                .filter_map(|l| l.split_once('='))
                .find(|(k, _)| *k == key)
                .map(|(_, v)| v.trim())
        };
        let seconds = value("finterval").and_then(|v| v.parse::<f64>().ok()).filter(|s| *s > 0.0);
        let hz = seconds.map(|s| 1.0 / s).or_else(|| value("fps").and_then(|v| v.parse().ok()));
        let unit = value("tunit").is_none_or(|u| matches!(u, "s" | "sec" | "seconds"));
        let rate = hz.filter(|hz: &f64| hz.is_finite() && *hz > 0.0 && unit);
        Self {
            images: value("images").and_then(|v| v.parse().ok()),
            rate: rate.and_then(|hz| Rate::new((hz * 1e6).round() as u64, 1_000_000).ok()),
        }
    }
}

/// Decodes the page whose directory is at `offset`.
///
/// # Errors
/// [`ErrorKind::Input`] if the page is damaged or has a sample type that is not supported.
pub(super) fn read_page(path: &Path, offset: u64) -> Result<Pixels> {
    let refused = |e| tiff_error(path, e);
    let open = || open_page(path, offset, Vec::new());
    let mut decoder = Decoder::new(open()?).map_err(refused)?;
    let (width, height) = decoder.dimensions().map_err(refused)?;
    let name = path.display().to_string();
    let size = declared_geometry(width.into(), height.into(), &name)?;
    let kept = storage(&mut decoder).map_err(refused)?.ok_or_else(|| storage_error(path, &mut decoder))?;
    // A sample has at most 8 bytes.
    let bytes = size.pixels() as u64 * 8 * 4;
    let bytes = usize::try_from(bytes.min(MAX_PICTURE_BYTES)).unwrap_or(usize::MAX);
    let channels = match kept {
        Storage::Common(_) => {
            let mut decoder = TiffDecoder::new(open()?).map_err(|e| decode_error(path, e))?;
            limits().reserve(decoder.total_bytes()).map_err(|e| decode_error(path, e))?;
            decoder.set_limits(limits()).map_err(|e| decode_error(path, e))?;
            inputs::check_memory(&name, 2 * decoder.total_bytes() as usize)?;
            let image = DynamicImage::from_decoder(decoder).map_err(|e| decode_error(path, e))?;
            return Ok(Pixels::Image(image));
        }
        Storage::PackedCodes { bits, channels } => {
            inputs::check_memory(&name, bytes)?;
            return read_packed(path, offset, &mut decoder, bits, channels);
        }
        Storage::Values(channels) => channels,
    };
    inputs::check_memory(&name, bytes)?;
    let values = floats(decode_samples(path, decoder)?);
    if values.len() != size.pixels() * channels {
        return Err(unsupported_error(path, "too few samples"));
    }
    let colors = |used: usize| -> Vec<f32> {
        values.chunks_exact(channels).flat_map(|p| p[..used].iter().copied()).collect()
    };
    Ok(if channels < 3 {
        Pixels::GrayFloats { size, values: colors(1) }
    } else {
        let image = ImageBuffer::from_raw(width, height, colors(3)).expect("a color has three samples");
        Pixels::Image(DynamicImage::ImageRgb32F(image))
    })
}

fn decode_samples<R: Read + Seek>(path: &Path, decoder: Decoder<R>) -> Result<DecodingResult> {
    let mut limits = Limits::default();
    limits.decoding_buffer_size = MAX_PICTURE_BYTES as usize;
    limits.intermediate_buffer_size = MAX_PICTURE_BYTES as usize;
    let mut result = DecodingResult::U8(Vec::new());
    let layout = decoder.with_limits(limits).read_image_to_buffer(&mut result);
    if layout.map_err(|e| tiff_error(path, e))?.planes > 1 {
        return Err(unsupported_error(
            path,
            "separate planes of samples that are not integers of 8 or 16 bits",
        ));
    }
    Ok(result)
}

/// Decodes a page of packed samples, whose tags `decoder` has read.
fn read_packed<R: Read + Seek>(
    path: &Path,
    offset: u64,
    decoder: &mut Decoder<R>,
    bits: u32,
    channels: usize,
) -> Result<Pixels> {
    let (width, height) = decoder.dimensions().map_err(|e| tiff_error(path, e))?;
    let mut tag = |tag: Tag| decoder.find_tag_unsigned::<u32>(tag).ok().flatten();
    // Other compressions and the predictor depend on the number of bits.
    for (name, value, supported) in [
        ("compression", tag(Tag::Compression), &[1, 5, 8, 32773, 32946][..]),
        ("predictor", tag(Tag::Predictor), &[1]),
        ("fill order", tag(Tag::FillOrder), &[1]),
        ("planar configuration", tag(Tag::PlanarConfiguration), &[1]),
    ] {
        if let Some(value) = value.filter(|value| !supported.contains(value)) {
            let found = format!("packed samples of {bits} bits with the {name} {value}");
            return Err(unsupported_error(path, &found));
        }
    }
    let is_inverted = tag(Tag::PhotometricInterpretation) == Some(0);
    let bytes_of = |pixels: u32| (u64::from(pixels) * channels as u64 * u64::from(bits)).div_ceil(8);
    let row_bytes = bytes_of(width);
    // The width of a tile is a multiple of 16, so a row of a tile has no unused bits.
    let tile_bytes = tag(Tag::TileWidth).map(bytes_of);
    let patches = packed_patches(path, offset, row_bytes, tile_bytes)?;
    let decoder = Decoder::new(open_page(path, offset, patches)?).map_err(|e| tiff_error(path, e))?;
    let DecodingResult::U8(bytes) = decode_samples(path, decoder)? else {
        return Err(unsupported_error(path, "packed samples that are not unsigned integers"));
    };
    let samples = width as usize * channels;
    let rows = bytes.chunks_exact(row_bytes as usize);
    let mut codes: Vec<u16> = rows.flat_map(|row| unpacked(row, bits, samples)).collect();
    if is_inverted {
        let largest = ((1_u32 << bits) - 1) as u16;
        codes.iter_mut().for_each(|code| *code = largest - *code);
    }
    let image = if channels == 1 {
        ImageBuffer::from_raw(width, height, codes).map(DynamicImage::ImageLuma16)
    } else {
        ImageBuffer::from_raw(width, height, codes).map(DynamicImage::ImageRgb16)
    };
    image.map(Pixels::Image).ok_or_else(|| unsupported_error(path, "too few packed samples"))
}

/// Returns new bytes for the directory at `offset`, which then describes the bytes of packed samples as gray samples.
fn packed_patches(
    path: &Path,
    offset: u64,
    row_bytes: u64,
    tile_bytes: Option<u64>,
) -> Result<Vec<(u64, u8)>> {
    const SHORT: u64 = 3;
    const LONG: u64 = 4;
    let file = InputFile::open(path)?;
    let form = Form::read(&file)?;
    let word = if form.is_big { 8 } else { 4 };
    let (count_bytes, entry_bytes) = if form.is_big { (8, 20) } else { (2, 12) };
    let mut count = [0; 8];
    file.read_at(offset, &mut count[..count_bytes])?;
    let entries = form.number(&count[..count_bytes]).min(u16::MAX.into());
    let mut patches = Vec::new();
    for i in 0..entries {
        let at = offset + count_bytes as u64 + i * entry_bytes;
        let mut tag = [0; 2];
        file.read_at(at, &mut tag)?;
        let (kind, value) = match (Tag::from_u16_exhaustive(form.number(&tag) as u16), tile_bytes) {
            (Tag::ImageWidth, _) => (LONG, row_bytes),
            (Tag::TileWidth, Some(bytes)) => (LONG, bytes),
            (Tag::BitsPerSample, _) => (SHORT, 8),
            (Tag::SamplesPerPixel | Tag::PhotometricInterpretation, _) => (SHORT, 1),
            _ => continue,
        };
        let mut stored = form.bytes(value, if kind == SHORT { 2 } else { 4 });
        stored.resize(word, 0);
        let entry = [form.bytes(kind, 2), form.bytes(1, word), stored].concat();
        patches.extend((at + 2..).zip(entry));
    }
    Ok(patches)
}

/// The byte order of a TIFF, and whether it is a BigTIFF.
#[derive(Clone, Copy)]
struct Form {
    is_big_endian: bool,
    is_big: bool,
}

impl Form {
    fn read(file: &InputFile) -> Result<Self> {
        let mut header = [0; 4];
        file.read_at(0, &mut header)?;
        Ok(Self { is_big_endian: header.starts_with(b"MM"), is_big: header[2..].contains(&43) })
    }

    /// Returns the lowest `len` bytes of a number in the byte order of the file.
    fn bytes(self, value: u64, len: usize) -> Vec<u8> {
        if self.is_big_endian {
            value.to_be_bytes()[8 - len..].to_vec()
        } else {
            value.to_le_bytes()[..len].to_vec()
        }
    }

    fn number(self, bytes: &[u8]) -> u64 {
        let join = |all: u64, byte: &u8| all << 8 | u64::from(*byte);
        if self.is_big_endian { bytes.iter().fold(0, join) } else { bytes.iter().rev().fold(0, join) }
    }
}

/// Returns the codes of a row of packed samples. The first bit of a sample is its highest bit.
fn unpacked(row: &[u8], bits: u32, samples: usize) -> Vec<u16> {
    let (mut pending, mut available) = (0_u32, 0);
    let mut bytes = row.iter();
    (0..samples)
        .map(|_| {
            while available < bits {
                pending = pending << 8 | u32::from(bytes.next().copied().unwrap_or(0));
                available += 8;
            }
            available -= bits;
            (pending >> available & ((1 << bits) - 1)) as u16
        })
        .collect()
}

fn floats(result: DecodingResult) -> Vec<f32> {
    match result {
        DecodingResult::U8(v) => v.into_iter().map(f32::from).collect(),
        DecodingResult::U16(v) => v.into_iter().map(f32::from).collect(),
        DecodingResult::U32(v) => v.into_iter().map(|x| x as f32).collect(),
        DecodingResult::U64(v) => v.into_iter().map(|x| x as f32).collect(),
        DecodingResult::I8(v) => v.into_iter().map(f32::from).collect(),
        DecodingResult::I16(v) => v.into_iter().map(f32::from).collect(),
        DecodingResult::I32(v) => v.into_iter().map(|x| x as f32).collect(),
        DecodingResult::I64(v) => v.into_iter().map(|x| x as f32).collect(),
        DecodingResult::F16(v) => v.into_iter().map(|x| x.to_f32()).collect(),
        DecodingResult::F32(v) => v,
        DecodingResult::F64(v) => v.into_iter().map(|x| x as f32).collect(),
    }
}

fn storage_error<R: Read + Seek>(path: &Path, decoder: &mut Decoder<R>) -> Error {
    let found = decoder.colortype().map_or_else(
        |e| e.to_string(),
        |kind| {
            format!("pixels of {} with {} bits each", Count(kind.num_samples(), "sample"), kind.bit_depth())
        },
    );
    unsupported_error(path, &found)
}

fn unsupported_error(path: &Path, found: &str) -> Error {
    Error::new(ErrorKind::Input, path.display())
        .found(found)
        .expected("gray or RGB, with or without alpha, of integers or floats")
        .remedy("save it with 8-bit or 16-bit samples")
}

fn tiff_error(path: &Path, error: TiffError) -> Error {
    match error {
        TiffError::IoError(e) => decode_error(path, image::ImageError::IoError(e)),
        other => Error::new(ErrorKind::Input, path.display())
            .found(other)
            .expected("a complete TIFF image of a supported type")
            .remedy(
                "open the image in a viewer to check whether the file is damaged, or save the image with 8-bit or 16-bit samples",
            ),
    }
}

/// Opens a TIFF in whose header the first page is the page at the offset `page`. `patches` replaces bytes after the
/// header.
fn open_page(path: &Path, page: u64, patches: Vec<(u64, u8)>) -> Result<BufReader<PatchedReader>> {
    let form = Form::read(&InputFile::open(path)?)?;
    let (at, len) = if form.is_big { (8, 8) } else { (4, 4) };
    let header = (at..).zip(form.bytes(page, len));
    PatchedReader::open(path, header.chain(patches).collect()).map(BufReader::new)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn packed_samples_are_unpacked_from_the_highest_bit() {
        assert_eq!(unpacked(&[0b1011_0001], 2, 3), [2, 3, 0]);
        assert_eq!(unpacked(&[0x1F], 4, 2), [1, 15]);
    }

    #[test]
    fn the_rate_of_imagej_is_read() {
        let rate = |text: &str| ImageJ::parse(text).rate.map(Rate::hz);
        assert_eq!(rate("ImageJ=1.53\nimages=4\nfinterval=0.05\n"), Some(20.0));
        assert_eq!(rate("ImageJ=1.53\nfps=25\n"), Some(25.0));
        assert_eq!(rate("ImageJ=1.53\nfinterval=0\n"), None);
        assert_eq!(rate("finterval=0.05"), None);
        assert_eq!(ImageJ::parse("ImageJ=1.53\nimages=4\n").images, Some(4));
    }
}
