//! YUV4MPEG2 video (`.y4m`), from a file or a pipe.
//!
//! Luminance is a weighted sum of *linear* colors, but Y' is a weighted sum of *coded* colors. A color frame is
//! therefore converted from Y'CbCr to R'G'B', then to linear colors, then to luminance. If luminance were computed
//! from Y' alone, saturated colors would be wrong by a third. Subsampled chroma is repeated, not interpolated. Mono
//! frames contain only Y'.
//!
//! The header may contain `XCOLORRANGE=FULL` or `XCOLORRANGE=LIMITED`. If the header contains neither, color has
//! limited range (16 to 235) and mono has full range, as in ffmpeg. The header never declares the matrix; see
//! [`Matrix`]. R'G'B' values outside 0 to 1 are clipped.

use std::io::{BufRead, BufReader, Chain, Cursor, Read};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use ::y4m::{Decoder, Limits};
use spikelane::error::{Error, ErrorKind, Result};
use spikelane::light::{Frame, OwnedSamples, Rate, Source};
use spikelane::sensor::{FrontEnd, FullScale};
use spikelane::spikes::Geometry;
use spikelane::unstable::Count;
use spikelane::unstable::inputs::{self, InputFile, MAX_PICTURE_BYTES};
use spikelane::unstable::light::declared_geometry;

use super::yuv::{PlaneLayout, SampleEncoding, chroma};
use crate::light::images::encoding::Encoding;
use crate::light::images::linearization::{Linearization, with_colors};
use crate::light::pixel_aspect::PixelAspect;
use crate::light::resize_mode::ResizeMode;

pub use super::yuv::Matrix;

/// A `.y4m` video as a source of frames at the camera's size.
pub struct Y4mSource {
    reader: Y4mReader<Box<dyn Read + Send>>,
    frames: Option<u64>,
    linear: Linearization,
    resize_mode: ResizeMode,
    camera: Geometry,
    /// The size of the frames with square pixels.
    displayed_size: Geometry,
    /// Notes about the transfer function and the shape of the pixels.
    notes: Vec<String>,
}

impl Y4mSource {
    /// Opens a file and counts its frames. The frames are not decoded.
    ///
    /// # Errors
    /// Errors of [`Y4mReader::new`]. Also [`ErrorKind::Input`] if the last frame is truncated or the file contains no
    /// frame.
    pub fn open(
        path: &Path,
        camera: Geometry,
        resize_mode: ResizeMode,
        linear: Linearization,
    ) -> Result<Self> {
        let name = path.display().to_string();
        let input = Box::new(InputFile::open(path)?.into_reader());
        let mut video = Self::from_reader(input, &name, camera, resize_mode, linear)?;
        let frames = video.reader.count_frames(&InputFile::open(path)?)?;
        if frames == 0 {
            return Err(Error::new(ErrorKind::Input, name).found("no frame").expected("at least one frame"));
        }
        video.frames = Some(frames);
        Ok(video)
    }

    /// Reads a video from a stream. Error messages refer to the stream as `name`.
    ///
    /// # Errors
    /// Errors of [`Y4mReader::new`]. Also [`ErrorKind::Input`] if the mode is [`ResizeMode::Crop`] and the video is
    /// smaller than the camera.
    pub fn from_reader(
        reader: Box<dyn Read + Send>,
        name: &str,
        camera: Geometry,
        resize_mode: ResizeMode,
        linear: Linearization,
    ) -> Result<Self> {
        Self::with_sample_encoding(reader, name, camera, resize_mode, linear, SampleEncoding::default())
    }

    pub(in crate::light) fn with_sample_encoding(
        reader: Box<dyn Read + Send>,
        name: &str,
        camera: Geometry,
        resize_mode: ResizeMode,
        linear: Linearization,
        known: SampleEncoding,
    ) -> Result<Self> {
        let reader = Y4mReader::with_sample_encoding(reader, name, known)?;
        let displayed_size = reader.pixel_aspect.displayed_size(reader.geometry());
        resize_mode.check(displayed_size, camera).map_err(|e| e.with_context(name))?;
        let largest_code = Some(((1_u32 << reader.depth()) - 1).into());
        let encoding = Encoding { transfer: known.transfer, largest_code, ..Encoding::default() };
        let aspect_note = reader.pixel_aspect.used_note(reader.geometry());
        let notes = linear.hdr_note(&encoding).into_iter().chain(aspect_note);
        let notes = notes.map(|note| format!("{name}: {note}")).collect();
        let linear = linear.for_encoding(&encoding);
        Ok(Self { reader, frames: None, linear, resize_mode, camera, displayed_size, notes })
    }
}

impl Y4mSource {
    /// Returns width and height of the stored frames.
    pub(super) fn coded_size(&self) -> (u32, u32) {
        let size = self.reader.geometry();
        (size.width() as u32, size.height() as u32)
    }
}

impl Source for Y4mSource {
    fn geometry(&self) -> Geometry {
        self.camera
    }

    fn stored_geometry(&self) -> Option<Geometry> {
        Some(self.displayed_size)
    }

    fn frames(&self) -> Option<u64> {
        self.frames
    }

    fn next_frame(&mut self, into: &mut Frame) -> Result<bool> {
        let Some(frame) = self.reader.next_light(&self.linear)? else {
            return Ok(false);
        };
        let frame = ResizeMode::Stretch.apply(frame, self.displayed_size)?;
        *into = self.resize_mode.apply(frame, self.camera)?;
        Ok(true)
    }

    fn rate(&self) -> Option<Rate> {
        self.reader.rate()
    }

    fn front_end(&self) -> FrontEnd {
        self.linear.front_end_for(false)
    }

    fn full_scale(&self) -> FullScale {
        self.linear.full_scale()
    }

    fn describe(&self) -> String {
        let count = self.frames.map_or("frames".to_owned(), |n| Count(n, "frame").to_string());
        let rate = self.rate().map_or(String::new(), |r| format!(" at {r} per second"));
        let (name, size) = (&self.reader.name, self.reader.geometry);
        format!("{name}: video of {size}, {count}{rate}{}", self.linear.full_scale_text())
    }

    fn notes(&self) -> Vec<String> {
        self.notes.clone()
    }
}

/// The first bytes of every y4m file.
pub const MAGIC: &[u8] = b"YUV4MPEG2 ";

/// Maximum length of a header line. The `y4m` decoder has the same limit.
const MAX_HEADER_LINE_BYTES: u64 = 1024;

/// Counts the bytes that the decoder reads. At the end of the stream, only the byte count distinguishes a complete
/// last frame from a truncated last frame.
struct CountingReader<R> {
    inner: R,
    bytes_read: Arc<AtomicU64>,
}

impl<R: Read> Read for CountingReader<R> {
    fn read(&mut self, buf: &mut [u8]) -> std::io::Result<usize> {
        let n = self.inner.read(buf)?;
        self.bytes_read.fetch_add(n as u64, Ordering::Relaxed);
        Ok(n)
    }
}

type Input<R> = CountingReader<Chain<Cursor<Vec<u8>>, BufReader<R>>>;

/// Reads the frames of a `.y4m` stream at their original size.
pub struct Y4mReader<R: Read> {
    pub(super) name: String,
    decoder: Decoder<Input<R>>,
    pub(super) bytes_read: Arc<AtomicU64>,
    pub(super) frames_read: u64,
    pub(super) geometry: Geometry,
    pub(super) planes: PlaneLayout,
    pixel_aspect: PixelAspect,
}

impl<R: Read> Y4mReader<R> {
    /// Reads the header. Error messages refer to the stream as `name`. If `matrix` is `None`, the height of the video
    /// determines the matrix.
    ///
    /// # Errors
    /// [`ErrorKind::Input`] if the header is damaged or declares an invalid size, an unknown color space or interlaced video.
    pub fn new(reader: R, name: &str, matrix: Option<Matrix>) -> Result<Self> {
        Self::with_sample_encoding(reader, name, SampleEncoding { matrix, ..SampleEncoding::default() })
    }

    /// As [`Y4mReader::new`], but the properties in `SampleEncoding` override the header.
    pub(in crate::light) fn with_sample_encoding(
        reader: R,
        name: &str,
        known: SampleEncoding,
    ) -> Result<Self> {
        let mut reader = BufReader::new(reader);
        let mut header = Vec::new();
        reader
            .by_ref()
            .take(MAX_HEADER_LINE_BYTES)
            .read_until(b'\n', &mut header)
            .map_err(|e| Error::io(name, e))?;
        check_header(&header, name)?;
        let full = known.is_full_range.or(declares_full_range(&header));
        let pixel_aspect = pixel_aspect(&header);
        let depth = replace_deep_color_space(&mut header);
        let bytes_read = Arc::new(AtomicU64::new(0));
        let input =
            CountingReader { inner: Cursor::new(header).chain(reader), bytes_read: Arc::clone(&bytes_read) };
        let limits = Limits { bytes: MAX_PICTURE_BYTES as usize };
        let decoder = Decoder::new_with_limits(input, limits).map_err(|e| damaged_error(name, &e))?;
        let (width, height) = (decoder.get_width(), decoder.get_height());
        let geometry = declared_geometry(width as u64, height as u64, name)?;
        let chroma = chroma(decoder.get_colorspace());
        let layout = PlaneLayout {
            width,
            height,
            depth: depth.unwrap_or(decoder.get_bit_depth()),
            chroma,
            is_full_range: full.unwrap_or(chroma.is_none()),
            matrix: known.matrix.unwrap_or(Matrix::from_height(height)),
        };
        Ok(Self {
            name: name.to_owned(),
            decoder,
            bytes_read,
            frames_read: 0,
            geometry,
            planes: layout,
            pixel_aspect,
        })
    }

    /// Returns the width and height of the video.
    #[must_use]
    pub const fn geometry(&self) -> Geometry {
        self.geometry
    }

    /// Returns the frame rate in frames per second, or `None` if the header contains no valid rate.
    #[must_use]
    pub fn rate(&self) -> Option<Rate> {
        let rate = self.decoder.get_framerate();
        Rate::new(rate.num as u64, rate.den as u64).ok()
    }

    /// Returns the number of bits per sample, which is 8, 9, 10, 12, 14 or 16.
    #[must_use]
    pub const fn depth(&self) -> usize {
        self.planes.depth
    }

    /// Returns the stored planes of the next frame, or `None` at the end of the stream. 16-bit samples are
    /// little-endian.
    ///
    /// # Errors
    /// * [`ErrorKind::Input`] if a frame is truncated or does not start with a frame header.
    /// * [`ErrorKind::Io`] if reading fails.
    pub fn next_planes(&mut self) -> Result<Option<[Vec<u8>; 3]>> {
        self.next(|f| [f.get_y_plane(), f.get_u_plane(), f.get_v_plane()].map(<[u8]>::to_vec))
    }

    /// Returns the luminance of the next frame, or `None` at the end of the stream. 8-bit video is converted to 16-bit
    /// samples, and deeper video to floats.
    ///
    /// # Errors
    /// As [`Y4mReader::next_planes`].
    pub fn next_light(&mut self, linear: &Linearization) -> Result<Option<Frame>> {
        let (layout, geometry) = (self.planes, self.geometry);
        let table = linear.table16();
        let keeps_color = linear.keeps_color() && layout.chroma.is_some();
        let light = self.next(|f| {
            let planes = [f.get_y_plane(), f.get_u_plane(), f.get_v_plane()];
            let colors = keeps_color.then(|| layout.rgb(planes, table));
            let light = layout.light(planes, linear, table);
            let samples = if layout.depth == 8 && !linear.requires_floats() {
                OwnedSamples::U16(light.map(|x| (x * 65535.0 + 0.5) as u16).collect())
            } else {
                OwnedSamples::F32(light.collect())
            };
            (samples, colors)
        })?;
        light.map(|(samples, colors)| with_colors(Frame::new(geometry, samples)?, colors)).transpose()
    }

    fn next<T>(&mut self, take: impl FnOnce(&::y4m::Frame) -> T) -> Result<Option<T>> {
        let before = self.bytes_read.load(Ordering::Relaxed);
        match self.decoder.read_frame() {
            Ok(frame) => {
                self.frames_read += 1;
                Ok(Some(take(&frame)))
            }
            Err(::y4m::Error::EOF) => {
                let got = self.bytes_read.load(Ordering::Relaxed) - before;
                if got == 0 {
                    return Ok(None);
                }
                Err(truncated_error(&self.name, self.frames_read))
            }
            Err(::y4m::Error::IoError(e)) => Err(Error::io(&self.name, e)),
            Err(e) => Err(damaged_error(&format!("{}: frame {}", self.name, self.frames_read), &e)),
        }
    }
}

fn truncated_error(name: &str, frame: u64) -> Error {
    Error::new(ErrorKind::Input, name)
        .found(format_args!("the end of the file in frame {frame}"))
        .expected("complete frames")
        .remedy("the video is truncated; create the video again")
}

fn damaged_error(name: &str, error: &::y4m::Error) -> Error {
    let found = match error {
        ::y4m::Error::UnknownColorspace => "an unknown color space".to_owned(),
        ::y4m::Error::EOF => "no complete header".to_owned(),
        ::y4m::Error::OutOfMemory => format!("frames of more than {MAX_PICTURE_BYTES} bytes"),
        other => other.to_string(),
    };
    Error::new(ErrorKind::Input, name)
        .found(found)
        .expected("YUV4MPEG2 in mono, 420, 422 or 444 of 8, 9, 10, 12, 14 or 16 bits")
        .remedy("convert the video with ffmpeg -pix_fmt yuv444p -f yuv4mpegpipe")
}

/// Checks the properties of a header that the decoder does not check. The size must be valid, and the video must be
/// progressive.
fn check_header(header: &[u8], name: &str) -> Result<()> {
    let bad = |found: &str| {
        Error::new(ErrorKind::Input, name)
            .found(found)
            .expected("a YUV4MPEG2 header line with width and height of progressive video")
    };
    if !header.starts_with(MAGIC) || header.last() != Some(&b'\n') {
        return Err(bad("no such header"));
    }
    let mut sides = [0_u32; 2];
    for token in tokens(header) {
        let (key, value) = token.split_at(1);
        let text = str::from_utf8(value).unwrap_or("");
        match key {
            b"W" => sides[0] = text.parse().map_err(|_| bad("an invalid width"))?,
            b"H" => sides[1] = text.parse().map_err(|_| bad("an invalid height"))?,
            b"I" if matches!(text, "t" | "b" | "m") => {
                return Err(bad("interlaced video")
                    .remedy("deinterlace the video, for example with ffmpeg -vf yadif"));
            }
            _ => {}
        }
    }
    let geometry = declared_geometry(sides[0].into(), sides[1].into(), name)?;
    // If an allocation fails, the decoder aborts the process. The decoder allocates three planes of 16 bits and the
    // light of one frame, so this amount is checked first.
    inputs::check_memory(name, 8 * geometry.pixels())
}

fn tokens(header: &[u8]) -> impl Iterator<Item = &[u8]> {
    header[MAGIC.len()..].trim_ascii_end().split(|b| *b == b' ').filter(|t| !t.is_empty())
}

/// Replaces the name of a color space of more than 8 bits by a name that the decoder supports. Returns the original
/// number of bits.
///
/// The decoder supports only color spaces of 10 and 12 bits, and only 12 bits for mono. From the name of the color
/// space, the decoder only computes the number of bytes per sample. Therefore the names of 12-bit color spaces also
/// work for other depths.
fn replace_deep_color_space(header: &mut Vec<u8>) -> Option<usize> {
    let token = tokens(header).find(|t| t.first() == Some(&b'C'))?;
    let space = str::from_utf8(&token[1..]).ok()?;
    let (kind, bits) = match space.strip_prefix("mono") {
        Some(bits) => ("mono", bits),
        None => space.split_once('p').filter(|(kind, _)| matches!(*kind, "420" | "422" | "444"))?,
    };
    let bits: usize = bits.parse().ok().filter(|b| matches!(b, 9 | 10 | 12 | 14 | 16))?;
    let name = if kind == "mono" { "Cmono12".to_owned() } else { format!("C{kind}p12") };
    let text = String::from_utf8_lossy(header).replacen(&format!(" C{space}"), &format!(" {name}"), 1);
    *header = text.into_bytes();
    Some(bits)
}

/// Returns whether the header declares full range. Returns `None` if the header declares no range.
fn declares_full_range(header: &[u8]) -> Option<bool> {
    tokens(header).find_map(|t| match t {
        b"XCOLORRANGE=FULL" => Some(true),
        b"XCOLORRANGE=LIMITED" => Some(false),
        _ => None,
    })
}

/// Returns the shape of the pixels. `0:0` means an unknown shape, which is read as square.
fn pixel_aspect(header: &[u8]) -> PixelAspect {
    let token = tokens(header).find_map(|t| str::from_utf8(t.strip_prefix(b"A")?).ok());
    let ratio =
        token.and_then(|t| t.split_once(':')).and_then(|(x, y)| Some((x.parse().ok()?, y.parse().ok()?)));
    ratio.map_or(PixelAspect::SQUARE, |(x, y)| PixelAspect::new(x, y))
}

impl<R: Read> Y4mReader<R> {
    /// Counts the frames of the file. The frames are not decoded, and the position of this reader does not change.
    pub(super) fn count_frames(&self, file: &InputFile) -> Result<u64> {
        let refused = |e| Error::io(&self.name, e);
        let length = file.len();
        let mut file = BufReader::with_capacity(256, file.reader());
        let mut line = Vec::new();
        file.by_ref().take(MAX_HEADER_LINE_BYTES).read_until(b'\n', &mut line).map_err(refused)?;
        let mut at = line.len() as u64;
        let bytes = self.planes.bytes();
        let mut frames = 0;
        while at < length {
            line.clear();
            let head =
                file.by_ref().take(MAX_HEADER_LINE_BYTES).read_until(b'\n', &mut line).map_err(refused)?;
            if !b"FRAME".starts_with(&line[..line.len().min(5)]) {
                return Err(Error::new(ErrorKind::Input, &self.name)
                    .found(format_args!("other data at byte {at}"))
                    .expected(format_args!("the word FRAME before frame {frames}"))
                    .remedy("the video is damaged; create the video again"));
            }
            at += head as u64 + bytes;
            if at > length {
                return Err(truncated_error(&self.name, frames));
            }
            file.seek_relative(bytes as i64).map_err(refused)?;
            frames += 1;
        }
        Ok(frames)
    }
}
