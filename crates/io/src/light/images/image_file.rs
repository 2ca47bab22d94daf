//! Reads image files as frames of linear light. A frame has the size of the image.
//!
//! Alpha is ignored, because the sensor receives the stored color and not a blend with a background. The tone curve of
//! an embedded color profile is used if no transfer function is declared, and its primaries are ignored.

use std::io::{self, BufReader, Read};
use std::path::{Path, PathBuf};

use image::codecs::hdr::SIGNATURE as HDR_MAGIC;
use image::codecs::png::PngDecoder;
use image::codecs::webp::WebPDecoder;
use image::metadata::Orientation;
use image::{
    AnimationDecoder, ColorType, DynamicImage, ImageDecoder, ImageError, ImageFormat, ImageReader,
    ImageResult,
};

use spikelane::error::{Error, ErrorKind, Result};
use spikelane::light::Frame;
use spikelane::spikes::Geometry;
use spikelane::unstable::Count;
use spikelane::unstable::inputs::{self, InputFile, InputReader};
use spikelane::unstable::light::declared_geometry;

use super::decoding::{DamagePolicy, decode_error, limits};
use super::deep_apng::DeepApng;
use super::encoding::{CodeScan, Encoding, store_transfer, transfer_from_icc};
#[cfg(feature = "exr")]
use super::exr_file;
use super::fits_file::{self, FitsFile};
use super::linearization::{Pixels, swaps_axes};
use super::page_timing::PageTiming;
use super::patched_reader::PatchedReader;
use super::tiff_file::TiffFile;
use super::{jpeg_file, pfm, png_chunks, tiff_file, webp_chunks};
use crate::light::pixel_aspect::PixelAspect;

pub use super::linearization::{Linearization, linearize};
pub use super::names::{EXTENSIONS, is_image};

/// The first bytes of every OpenEXR file.
const EXR_MAGIC: &[u8] = b"\x76\x2f\x31\x01";

/// Size limit in bytes of the text header of a Radiance HDR picture.
const MAX_HDR_HEADER_BYTES: u64 = 1 << 16;

/// The properties in the header of an image file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct ImageHeader {
    /// Width and height of the displayed image. The orientation of the image is already applied.
    pub size: Geometry,
    /// Whether the pixels are floats.
    pub has_float_pixels: bool,
    /// Number of pages of the same size: directories of a TIFF, or frames of an animated PNG or WebP.
    pub pages: u64,
}

/// Reads the header of an image file.
///
/// # Errors
/// As [`read`].
pub fn read_header(path: &Path) -> Result<ImageHeader> {
    let file = ImageFile::open(path)?;
    Ok(ImageHeader { size: file.size, has_float_pixels: file.has_float_pixels(), pages: file.pages })
}

/// Decodes and linearizes the first page of an image file, and applies the orientation of the image. The format is
/// determined from the content of the file, not from its name.
///
/// The sample type of linear gray images of 8 or 16 bits does not change. Other 8-bit images are converted to 16-bit
/// samples. All other images are converted to floats.
///
/// # Errors
/// * [`ErrorKind::Io`] if the file cannot be read.
/// * [`ErrorKind::Input`] if the file is not an image, is damaged, or contains negative or non-finite light.
pub fn read(path: &Path, linear: &Linearization) -> Result<Frame> {
    let file = ImageFile::open(path)?;
    file.light(file.read_page(0, &mut Vec::new())?, &linear.for_encoding(&file.encoding))
}

/// Decodes and linearizes an open image that this program wrote, such as the reference image in a packed sequence.
///
/// Statements of the file about its transfer function, bit depth and orientation are not read.
///
/// # Errors
/// As [`read`].
pub fn read_written(file: InputFile, linear: &Linearization) -> Result<Frame> {
    let path = file.path().to_owned();
    let reader = with_format(BufReader::new(file.into_reader()), &path)?;
    linearize(decode(reader, &path, DamagePolicy::Reject, &mut Vec::new())?, linear)
        .map_err(|e| e.with_context(path.display()))
}

/// How the pages of a file are decoded.
#[derive(Clone, Debug)]
enum Container {
    Tiff(TiffFile),
    #[cfg(feature = "exr")]
    Exr(exr_file::ExrPicture),
    Fits(FitsFile),
    Pfm,
    /// The `image` crate decodes the file. `animation` is the format of a file with several pages.
    Common {
        animation: Option<Animation>,
    },
}

/// An animation that the `image` crate decodes.
#[derive(Clone, Debug)]
enum Animation {
    Png,
    /// Samples of 16 bits.
    DeepPng,
    /// The value replaces bytes of the file, as [`webp_chunks::WebpChunks::opaque_flags`].
    WebP(Vec<(u64, u8)>),
}

/// An image file and what its header states.
#[derive(Clone, Debug)]
pub(in crate::light) struct ImageFile {
    path: PathBuf,
    container: Container,
    /// Width and height of the displayed image.
    pub size: Geometry,
    pub encoding: Encoding,
    orientation: Orientation,
    pub pages: u64,
    pub timing: Option<PageTiming>,
    /// Notes about statements of the file that are not used.
    pub notes: Vec<String>,
    damage_policy: DamagePolicy,
}

impl ImageFile {
    /// Reads the header of a file.
    pub(in crate::light) fn open(path: &Path) -> Result<Self> {
        // The header of JFIF has 18 bytes.
        let mut start = [0; 18];
        let mut file = buffered(path)?;
        let read = file.read(&mut start).map_err(|e| Error::io(path.display(), e))?;
        let start = &start[..read];
        if start.starts_with(EXR_MAGIC) {
            return Self::open_exr(path);
        }
        if tiff_file::is_tiff(start) {
            return Self::open_tiff(path);
        }
        if fits_file::is_fits(start) {
            let fits = fits_file::read_header(path)?;
            return Ok(Self {
                encoding: fits.encoding,
                pages: fits.pages,
                notes: fits.notes.clone(),
                ..Self::of_floats(path, fits.size, Container::Fits(fits))
            });
        }
        if pfm::is_pfm(start) {
            let header = pfm::read_header(&mut buffered(path)?, path)?;
            let note = format!("the scale {} in the header is not used", header.scale);
            let notes = if header.scale == 1.0 { Vec::new() } else { vec![note] };
            return Ok(Self { notes, ..Self::of_floats(path, header.size, Container::Pfm) });
        }
        Self::open_common(path, start)
    }

    /// Returns a file of floats with one page.
    fn of_floats(path: &Path, size: Geometry, container: Container) -> Self {
        Self {
            path: path.to_owned(),
            container,
            size,
            encoding: Encoding::default(),
            orientation: Orientation::NoTransforms,
            pages: 1,
            timing: None,
            notes: Vec::new(),
            damage_policy: DamagePolicy::Reject,
        }
    }

    /// Sets whether the decoded part of a damaged image is used. Otherwise, damage is an error.
    pub(in crate::light) fn with_accept_damage(self, accept_damage: bool) -> Self {
        let damage_policy = if accept_damage { DamagePolicy::Accept } else { DamagePolicy::RejectBySetting };
        Self { damage_policy, ..self }
    }

    #[cfg(feature = "exr")]
    fn open_exr(path: &Path) -> Result<Self> {
        let picture = exr_file::read_header(buffered(path)?, path)?;
        let layers = picture.ignored_layers.join(", ");
        let mut notes: Vec<String> =
            PixelAspect::new(picture.pixel_aspect, 1.0).unused_note(picture.size).into_iter().collect();
        if !layers.is_empty() {
            notes.push(format!("other pictures in the file are not used: {layers}"));
        }
        Ok(Self { notes, ..Self::of_floats(path, picture.size, Container::Exr(picture)) })
    }

    #[cfg(not(feature = "exr"))]
    fn open_exr(path: &Path) -> Result<Self> {
        let missing = Error::require_feature(format_args!("{}: EXR images", path.display()), "exr", false);
        missing.and_then(|()| Self::open_common(path, EXR_MAGIC))
    }

    fn open_tiff(path: &Path) -> Result<Self> {
        let tiff = tiff_file::read_header(path)?;
        let (width, height) = tiff.dimensions;
        let size = displayed_size(width, height, tiff.orientation, path)?;
        let mut notes = tiff.notes.clone();
        notes.extend(density_note(tiff.densities, tiff.orientation, size));
        Ok(Self {
            path: path.to_owned(),
            size,
            encoding: tiff.encoding,
            orientation: tiff.orientation,
            pages: tiff.pages.len() as u64,
            timing: tiff.rate.map(PageTiming::Uniform).filter(|_| tiff.pages.len() > 1),
            notes,
            container: Container::Tiff(tiff),
            damage_policy: DamagePolicy::Reject,
        })
    }

    /// Reads the header of a format that the `image` crate decodes.
    fn open_common(path: &Path, start: &[u8]) -> Result<Self> {
        let refused = |e: ImageError| decode_error(path, e);
        let mut decoder = reader(path)?.into_decoder().map_err(refused)?;
        let (width, height) = decoder.dimensions();
        // If the metadata cannot be read, the image is not rotated. The decoder reports later whether the image can be
        // read.
        let orientation = decoder.orientation().unwrap_or(Orientation::NoTransforms);
        let kind = decoder.color_type();
        let largest = match kind.bytes_per_pixel() / kind.channel_count() {
            1 => Some(255.0),
            2 => Some(65535.0),
            _ => None,
        };
        let mut encoding = Encoding { largest_code: largest, ..Encoding::default() };
        let mut notes = Vec::new();
        let profile = decoder.icc_profile().ok().flatten().map(|p| transfer_from_icc(&p));
        let (mut pages, mut timing, mut animation) = (1, None, None);
        let (mut transfer, mut densities) = (profile, None);
        if start.starts_with(png_chunks::MAGIC) {
            let chunks = png_chunks::read(buffered(path)?).map_err(|e| Error::io(path.display(), e))?;
            if !chunks.is_profile_preferred {
                transfer = chunks.transfer;
            }
            encoding.significant_bits = chunks.significant_bits.filter(|_| largest == Some(65535.0));
            (pages, timing, densities) = (chunks.pages, chunks.timing, chunks.densities);
            animation = Some(if largest == Some(65535.0) { Animation::DeepPng } else { Animation::Png });
        } else if webp_chunks::is_webp(start) {
            let chunks = webp_chunks::read(buffered(path)?).map_err(|e| Error::io(path.display(), e))?;
            // Without its last frames the animation is a valid file, except for the stated size.
            if chunks.is_truncated_animation {
                return Err(refused(std::io::Error::from(std::io::ErrorKind::UnexpectedEof).into()));
            }
            (pages, timing) = (chunks.pages, chunks.timing);
            animation = Some(Animation::WebP(chunks.opaque_flags));
        } else if start.starts_with(&HDR_MAGIC[..2]) {
            notes.extend(hdr_exposure_note(path)?);
        } else {
            densities = jpeg_file::densities(start);
        }
        let size = displayed_size(width, height, orientation, path)?;
        notes.extend(densities.and_then(|densities| density_note(densities, orientation, size)));
        if largest.is_some()
            && let Some(stated) = transfer
        {
            store_transfer(&mut encoding, &mut notes, stated);
        }
        let animation = animation.filter(|_| pages > 1);
        if animation.is_some() && timing.is_none() {
            notes.push("the durations of the frames are missing or 0, and are not used".to_owned());
        }
        Ok(Self {
            path: path.to_owned(),
            container: Container::Common { animation },
            size,
            encoding,
            orientation,
            pages: pages.into(),
            timing: timing.filter(|_| pages > 1),
            notes,
            damage_policy: DamagePolicy::Reject,
        })
    }

    /// Returns whether the pixels are floats.
    pub(in crate::light) const fn has_float_pixels(&self) -> bool {
        self.encoding.largest_code.is_none()
    }

    /// Returns the path of the file.
    pub(in crate::light) fn path(&self) -> &Path {
        &self.path
    }

    /// Returns whether a page can be read without the pages before it.
    pub(in crate::light) const fn has_random_access(&self) -> bool {
        !matches!(self.container, Container::Common { animation: Some(_) })
    }

    /// Decodes page `page`. Of an animation, only the first page can be read. Accepted damage is added to `notes`.
    pub(in crate::light) fn read_page(&self, page: usize, notes: &mut Vec<String>) -> Result<Pixels> {
        match &self.container {
            Container::Tiff(tiff) => tiff_file::read_page(&self.path, tiff.pages[page]),
            #[cfg(feature = "exr")]
            Container::Exr(picture) => exr_file::read(buffered(&self.path)?, &self.path, picture),
            Container::Fits(fits) => fits.read_page(&self.path, page),
            Container::Pfm => pfm::read(&mut buffered(&self.path)?, &self.path),
            Container::Common { animation: Some(_) } => match self.animation()?.next() {
                Some(pixels) => pixels,
                None => Err(missing_page_error(&self.path, 0, self.pages)),
            },
            Container::Common { animation: None } => {
                decode(reader(&self.path)?, &self.path, self.damage_policy, notes).map(Pixels::Image)
            }
        }
    }

    /// Starts decoding the frames of an animation.
    pub(in crate::light) fn animation(&self) -> Result<Box<dyn Iterator<Item = Result<Pixels>>>> {
        let refused = |e| decode_error(&self.path, e);
        let Container::Common { animation: Some(animation) } = &self.container else {
            return Err(missing_page_error(&self.path, 1, self.pages));
        };
        // The canvas and the frame each have up to eight bytes per pixel, and the decoder keeps up to four of them.
        let sample_bytes = if matches!(animation, Animation::DeepPng) { 2 } else { 1 };
        inputs::check_memory(self.path.display(), 16 * sample_bytes * self.size.pixels())?;
        let frames = match animation {
            Animation::DeepPng => {
                return Ok(Box::new(DeepApng::new(buffered(&self.path)?, &self.path)?));
            }
            Animation::WebP(flags) => {
                let file = BufReader::new(PatchedReader::open(&self.path, flags.clone())?);
                let mut decoder = WebPDecoder::new(file).map_err(refused)?;
                decoder.set_limits(limits()).map_err(refused)?;
                decoder.into_frames()
            }
            Animation::Png => {
                let decoder = PngDecoder::with_limits(buffered(&self.path)?, limits());
                decoder.and_then(PngDecoder::apng).map_err(refused)?.into_frames()
            }
        };
        let path = self.path.clone();
        Ok(Box::new(frames.map(move |frame| {
            let buffer = frame.map_err(|e| decode_error(&path, e))?.into_buffer();
            Ok(Pixels::Image(DynamicImage::ImageRgba8(buffer)))
        })))
    }

    /// Converts decoded pixels to light in the displayed orientation.
    pub(in crate::light) fn light(&self, pixels: Pixels, linear: &Linearization) -> Result<Frame> {
        pixels.into_light(linear, self.orientation).map_err(|e| e.with_context(self.path.display()))
    }

    /// Returns the indices of the frames whose pixels [`ImageFile::complete_notes`] requires, of `frames` frames: the
    /// first, the middle and the last frame for 16-bit codes, and otherwise the first frame.
    pub(in crate::light) fn scanned_indices(&self, frames: usize) -> Vec<usize> {
        let mut indices = vec![0];
        if self.encoding.largest_code == Some(65535.0) {
            indices.extend([frames / 2, frames - 1]);
            indices.dedup();
        }
        indices
    }

    /// Adds the notes that depend on the pixels and on the conversion. If the file does not state the depth of 16-bit
    /// codes, the function finds it in `scanned`, which are up to three pages. `pages` describes the pages.
    pub(in crate::light) fn complete_notes(
        &mut self,
        linear: &Linearization,
        scanned: &[Pixels],
        pages: &str,
    ) {
        if scanned.first().is_some_and(Pixels::is_transparent) {
            self.notes.push("alpha is not used: transparent pixels have their stored color".to_owned());
        }
        self.notes.extend(linear.hdr_note(&self.encoding));
        if self.encoding.white_code.is_none() && !linear.has_full_scale() {
            let mut scan = CodeScan::default();
            scanned.iter().filter_map(Pixels::codes16).for_each(|codes| scan.add(codes));
            self.notes.extend(scan.apply(&mut self.encoding, pages));
        }
    }

    /// Returns the notes with the name of the file.
    pub(in crate::light) fn named_notes(&self) -> Vec<String> {
        self.notes.iter().map(|note| format!("{}: {note}", self.path.display())).collect()
    }
}

/// Returns the error for a file with fewer pages than its header states.
pub(in crate::light) fn missing_page_error(path: &Path, found: u64, pages: u64) -> Error {
    Error::new(ErrorKind::Input, path.display())
        .found(format_args!("the end of the file after {}", Count(found, "page")))
        .expected(format_args!("{}, as stated in the header", Count(pages, "page")))
        .remedy("save the file again, because it is truncated")
}

fn displayed_size(width: u32, height: u32, orientation: Orientation, path: &Path) -> Result<Geometry> {
    let (width, height) = if swaps_axes(orientation) { (height, width) } else { (width, height) };
    declared_geometry(width.into(), height.into(), &path.display().to_string())
}

/// Returns a note about pixels that are not square. `densities` are pixels per unit of length in x and y of the stored
/// image.
fn density_note([x, y]: [f64; 2], orientation: Orientation, displayed: Geometry) -> Option<String> {
    let aspect = if swaps_axes(orientation) { PixelAspect::new(x, y) } else { PixelAspect::new(y, x) };
    aspect.unused_note(displayed)
}

/// Returns a note about the exposure of a Radiance HDR picture, which the samples were multiplied by.
fn hdr_exposure_note(path: &Path) -> Result<Option<String>> {
    let mut header = Vec::new();
    buffered(path)?
        .take(MAX_HDR_HEADER_BYTES)
        .read_to_end(&mut header)
        .map_err(|e| Error::io(path.display(), e))?;
    let text = String::from_utf8_lossy(&header);
    let lines = text.lines().take_while(|line| !line.is_empty());
    let stated = lines.filter(|line| line.starts_with("EXPOSURE=") || line.starts_with("COLORCORR="));
    let stated: Vec<&str> = stated.collect();
    Ok((!stated.is_empty()).then(|| format!("{} in the header is not used", stated.join(", "))))
}

fn buffered(path: &Path) -> Result<BufReader<InputReader<InputFile>>> {
    Ok(BufReader::new(InputFile::open(path)?.into_reader()))
}

type Reader = ImageReader<BufReader<InputReader<InputFile>>>;

/// Decodes an image. If damage is accepted, the pixels before the damage are used, and the damage is added to `notes`.
fn decode(
    reader: Reader,
    path: &Path,
    policy: DamagePolicy,
    notes: &mut Vec<String>,
) -> Result<DynamicImage> {
    if reader.format() == Some(ImageFormat::Jpeg) {
        let mut bytes = Vec::new();
        reader.into_inner().read_to_end(&mut bytes).map_err(|e| Error::io(path.display(), e))?;
        return jpeg_file::decode(&bytes, path, policy, notes);
    }
    let refused = |e| decode_error(path, e);
    let decoder = reader.into_decoder().map_err(refused)?;
    limits().reserve(decoder.total_bytes()).map_err(refused)?;
    // If an allocation fails, the decoder and the conversion abort the process. The decoder and the conversion
    // together allocate at most twice the decoded bytes, so this amount is checked first.
    inputs::check_memory(path.display(), 2 * decoder.total_bytes() as usize)?;
    let mut damage = None;
    let image =
        DynamicImage::from_decoder(PartialDecoder { decoder, damage: &mut damage }).map_err(refused)?;
    match damage {
        None => {}
        Some(e) if policy == DamagePolicy::Accept => {
            notes.push(format!("damaged: found {e}; missing parts of the image are black"));
        }
        Some(e) => return Err(decode_error(path, e).remedy(policy.remedy())),
    }
    Ok(image)
}

/// Returns whether an error means that the data of an image are damaged.
fn is_damage(error: &ImageError) -> bool {
    match error {
        ImageError::Decoding(_) => true,
        ImageError::IoError(e) => {
            matches!(e.kind(), io::ErrorKind::UnexpectedEof | io::ErrorKind::InvalidData)
        }
        _ => false,
    }
}

/// A decoder that returns damage separately, with the pixels before the damage.
struct PartialDecoder<'a, D> {
    decoder: D,
    damage: &'a mut Option<ImageError>,
}

impl<D: ImageDecoder> ImageDecoder for PartialDecoder<'_, D> {
    fn dimensions(&self) -> (u32, u32) {
        self.decoder.dimensions()
    }

    fn color_type(&self) -> ColorType {
        self.decoder.color_type()
    }

    fn read_image(self, pixels: &mut [u8]) -> ImageResult<()> {
        match self.decoder.read_image(pixels) {
            Err(e) if is_damage(&e) => *self.damage = Some(e),
            result => return result,
        }
        Ok(())
    }

    fn read_image_boxed(self: Box<Self>, pixels: &mut [u8]) -> ImageResult<()> {
        (*self).read_image(pixels)
    }
}

fn reader(path: &Path) -> Result<Reader> {
    with_format(buffered(path)?, path)
}

/// Returns the reader with the memory limits, and with the format of the content or, if unknown, of the extension.
fn with_format(file: BufReader<InputReader<InputFile>>, path: &Path) -> Result<Reader> {
    let mut reader = ImageReader::new(file);
    reader.limits(limits());
    if let Ok(format) = ImageFormat::from_path(path) {
        reader.set_format(format);
    }
    reader.with_guessed_format().map_err(|e| Error::io(path.display(), e))
}
