//! YUV4MPEG2 video (`.y4m`), from a file or a pipe.
//!
//! Luminance is a sum of *linear* colours, and Y' is a sum of coded ones, so
//! a colour frame goes Y'CbCr -> R'G'B' -> linear -> luminance; the shortcut
//! from Y' alone is wrong by a third on saturated colours. Subsampled chroma is
//! repeated, not interpolated. Mono frames have only Y'.
//!
//! The header may say `XCOLORRANGE=FULL` or `LIMITED`; without it colour is limited
//! (16 to 235) and mono is full, as ffmpeg treats them. It never says which
//! matrix was used: see [`Matrix`]. R'G'B' outside 0 to 1 is clipped.

use std::io::{BufRead, BufReader, Chain, Cursor, Read};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use ::y4m::{Decoder, Limits};
use spikelane::error::{Error, Kind, Result};
use spikelane::light::{Frame, OwnedSamples, Rate, Source};
use spikelane::sensor::FrontEnd;
use spikelane::spikes::Geometry;
use spikelane::unstable::inputs::{self, InputFile, MAX_PICTURE_BYTES};
use spikelane::unstable::light::stored_size;

use super::yuv::{Known, Layout, chroma};
use crate::light::fit::Fit;
use crate::light::pictures::picture::Linear;

pub use super::yuv::Matrix;

/// A `.y4m` video as frames at the camera's size.
pub struct Video {
    reader: Reader<Box<dyn Read + Send>>,
    frames: Option<u64>,
    linear: Linear,
    fit: Fit,
    camera: Geometry,
}

impl Video {
    /// Opens a file and counts its frames by their headers alone.
    ///
    /// # Errors
    /// As [`Reader::new`]; [`Kind::Input`] too when the last frame is cut short or there is none.
    pub fn open(path: &Path, camera: Geometry, fit: Fit, linear: Linear) -> Result<Self> {
        let name = path.display().to_string();
        let input = Box::new(InputFile::open(path)?.into_reader());
        let mut video = Self::from_reader(input, &name, camera, fit, linear)?;
        let frames = video.reader.count(&InputFile::open(path)?)?;
        if frames == 0 {
            return Err(Error::new(Kind::Input, name).found("no frame").expected("at least one frame"));
        }
        video.frames = Some(frames);
        Ok(video)
    }

    /// Reads a stream; `name` stands for it in errors.
    ///
    /// # Errors
    /// As [`Reader::new`], and when [`Fit::Crop`] finds the video too small.
    pub fn from_reader(
        reader: Box<dyn Read + Send>,
        name: &str,
        camera: Geometry,
        fit: Fit,
        linear: Linear,
    ) -> Result<Self> {
        Self::with_known_codes(reader, name, camera, fit, linear, Known::default())
    }

    pub(in crate::light) fn with_known_codes(
        reader: Box<dyn Read + Send>,
        name: &str,
        camera: Geometry,
        fit: Fit,
        linear: Linear,
        known: Known,
    ) -> Result<Self> {
        let reader = Reader::with_known(reader, name, known)?;
        fit.check(reader.geometry(), camera).map_err(|e| e.within(name))?;
        Ok(Self { reader, frames: None, linear, fit, camera })
    }
}

impl Source for Video {
    fn geometry(&self) -> Geometry {
        self.camera
    }

    fn stored(&self) -> Option<Geometry> {
        Some(self.reader.geometry())
    }

    fn frames(&self) -> Option<u64> {
        self.frames
    }

    fn next_frame(&mut self, into: &mut Frame) -> Result<bool> {
        let Some(frame) = self.reader.next_light(&self.linear)? else {
            return Ok(false);
        };
        *into = self.fit.apply(frame, self.camera)?;
        Ok(true)
    }

    fn rate(&self) -> Option<Rate> {
        self.reader.rate()
    }

    fn front_end(&self) -> FrontEnd {
        self.linear.used(false)
    }

    fn describe(&self) -> String {
        let count = self.frames.map_or("frames".to_owned(), |n| format!("{n} frames"));
        let rate = self.rate().map_or(String::new(), |r| format!(" at {r} per second"));
        let (name, size) = (&self.reader.name, self.reader.geometry);
        format!("{name}: video of {size}, {count}{rate}")
    }
}

/// The first bytes of every file.
pub const MAGIC: &[u8] = b"YUV4MPEG2 ";

/// Longest header line; the decoder's own bound.
const LINE: u64 = 1024;

/// Counts what the decoder takes, which alone tells a clean end from a frame cut short.
struct Counted<R> {
    inner: R,
    taken: Arc<AtomicU64>,
}

impl<R: Read> Read for Counted<R> {
    fn read(&mut self, buf: &mut [u8]) -> std::io::Result<usize> {
        let n = self.inner.read(buf)?;
        self.taken.fetch_add(n as u64, Ordering::Relaxed);
        Ok(n)
    }
}

type Input<R> = Counted<Chain<Cursor<Vec<u8>>, BufReader<R>>>;

/// Frames of a `.y4m` stream at their own size.
pub struct Reader<R: Read> {
    pub(super) name: String,
    decoder: Decoder<Input<R>>,
    pub(super) taken: Arc<AtomicU64>,
    pub(super) read: u64,
    pub(super) geometry: Geometry,
    pub(super) layout: Layout,
}

impl<R: Read> Reader<R> {
    /// Reads the header. `name` stands for the stream in errors; without a `matrix` the height decides.
    ///
    /// # Errors
    /// [`Kind::Input`] when the header is damaged, describes an impossible size, an unknown colour space or interlaced video.
    pub fn new(reader: R, name: &str, matrix: Option<Matrix>) -> Result<Self> {
        Self::with_known(reader, name, Known { matrix, full: None })
    }

    /// As [`Reader::new`], for a stream of whose codes more is known than its header says.
    pub(in crate::light) fn with_known(reader: R, name: &str, known: Known) -> Result<Self> {
        let mut reader = BufReader::new(reader);
        let mut header = Vec::new();
        reader.by_ref().take(LINE).read_until(b'\n', &mut header).map_err(|e| Error::io(name, e))?;
        check_header(&header, name)?;
        let full = known.full.or(range(&header));
        let depth = shallow(&mut header);
        let taken = Arc::new(AtomicU64::new(0));
        let input = Counted { inner: Cursor::new(header).chain(reader), taken: Arc::clone(&taken) };
        let limits = Limits { bytes: MAX_PICTURE_BYTES as usize };
        let decoder = Decoder::new_with_limits(input, limits).map_err(|e| damaged(name, &e))?;
        let (width, height) = (decoder.get_width(), decoder.get_height());
        let geometry = stored_size(width as u64, height as u64, name)?;
        let chroma = chroma(decoder.get_colorspace());
        let layout = Layout {
            width,
            height,
            depth: depth.unwrap_or(decoder.get_bit_depth()),
            chroma,
            full: full.unwrap_or(chroma.is_none()),
            matrix: known.matrix.unwrap_or(Matrix::of_height(height)),
        };
        Ok(Self { name: name.to_owned(), decoder, taken, read: 0, geometry, layout })
    }

    /// Width and height of the video.
    #[must_use]
    pub const fn geometry(&self) -> Geometry {
        self.geometry
    }

    /// Frames per second, unless the header says nothing sensible.
    #[must_use]
    pub fn rate(&self) -> Option<Rate> {
        let rate = self.decoder.get_framerate();
        Rate::new(rate.num as u64, rate.den as u64).ok()
    }

    /// Bits of a sample: 8, 9, 10, 12, 14 or 16.
    #[must_use]
    pub const fn depth(&self) -> usize {
        self.layout.depth
    }

    /// The planes of the next frame as they are stored (16-bit samples little-endian), or `None` at the end.
    ///
    /// # Errors
    /// [`Kind::Input`] when a frame is cut short or does not begin as one, [`Kind::Io`] when reading fails.
    pub fn next_planes(&mut self) -> Result<Option<[Vec<u8>; 3]>> {
        self.next(|f| [f.get_y_plane(), f.get_u_plane(), f.get_v_plane()].map(<[u8]>::to_vec))
    }

    /// The luminance of the next frame, or `None` at the end. 8-bit video gives
    /// 16-bit samples, deeper video floats.
    ///
    /// # Errors
    /// As [`Reader::next_planes`].
    pub fn next_light(&mut self, linear: &Linear) -> Result<Option<Frame>> {
        let (layout, geometry) = (self.layout, self.geometry);
        let table = linear.integers().table16();
        let samples = self.next(|f| {
            let planes = [f.get_y_plane(), f.get_u_plane(), f.get_v_plane()];
            let light = layout.light(planes, linear, table);
            if layout.depth == 8 {
                OwnedSamples::U16(light.map(|x| (x * 65535.0 + 0.5) as u16).collect())
            } else {
                OwnedSamples::F32(light.collect())
            }
        })?;
        samples.map(|s| Frame::new(geometry, s)).transpose()
    }

    fn next<T>(&mut self, take: impl FnOnce(&::y4m::Frame) -> T) -> Result<Option<T>> {
        let before = self.taken.load(Ordering::Relaxed);
        match self.decoder.read_frame() {
            Ok(frame) => {
                self.read += 1;
                Ok(Some(take(&frame)))
            }
            Err(::y4m::Error::EOF) => {
                let got = self.taken.load(Ordering::Relaxed) - before;
                if got == 0 {
                    return Ok(None);
                }
                Err(cut_short(&self.name, self.read))
            }
            Err(::y4m::Error::IoError(e)) => Err(Error::io(&self.name, e)),
            Err(e) => Err(damaged(&format!("{}: frame {}", self.name, self.read), &e)),
        }
    }
}

fn cut_short(name: &str, frame: u64) -> Error {
    Error::new(Kind::Input, name)
        .found(format_args!("the end within frame {frame}"))
        .expected("whole frames")
        .remedy("the video was cut short; make it again")
}

fn damaged(name: &str, error: &::y4m::Error) -> Error {
    let found = match error {
        ::y4m::Error::UnknownColorspace => "a colour space that is not known here".to_owned(),
        ::y4m::Error::EOF => "no complete header".to_owned(),
        ::y4m::Error::OutOfMemory => format!("frames of more than {MAX_PICTURE_BYTES} bytes"),
        other => other.to_string(),
    };
    Error::new(Kind::Input, name)
        .found(found)
        .expected("YUV4MPEG2 in mono, 420, 422 or 444 of 8, 9, 10, 12, 14 or 16 bits")
        .remedy("convert it with ffmpeg -pix_fmt yuv444p -f yuv4mpegpipe")
}

/// Refuses what the decoder would take on trust: sizes whose product overflows, and interlacing.
fn check_header(header: &[u8], name: &str) -> Result<()> {
    let bad = |found: &str| {
        Error::new(Kind::Input, name)
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
            b"W" => sides[0] = text.parse().map_err(|_| bad("an impossible width"))?,
            b"H" => sides[1] = text.parse().map_err(|_| bad("an impossible height"))?,
            b"I" if matches!(text, "t" | "b" | "m") => {
                return Err(bad("interlaced video").remedy("deinterlace it, as ffmpeg -vf yadif does"));
            }
            _ => {}
        }
    }
    let geometry = stored_size(sides[0].into(), sides[1].into(), name)?;
    // The decoder aborts the process where memory is missing: three planes of 16 bits, and the light of a frame.
    inputs::check_memory(name, 8 * geometry.pixels())
}

fn tokens(header: &[u8]) -> impl Iterator<Item = &[u8]> {
    header[MAGIC.len()..].trim_ascii_end().split(|b| *b == b' ').filter(|t| !t.is_empty())
}

/// Gives a colour space of more than 8 bits the decoder's name for samples of two bytes, and returns its bits: the
/// decoder knows only 10 and 12, and mono only of 12, but looks no further than at the bytes.
fn shallow(header: &mut Vec<u8>) -> Option<usize> {
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

/// Whether the header declares full range.
fn range(header: &[u8]) -> Option<bool> {
    tokens(header).find_map(|t| match t {
        b"XCOLORRANGE=FULL" => Some(true),
        b"XCOLORRANGE=LIMITED" => Some(false),
        _ => None,
    })
}

impl<R: Read> Reader<R> {
    /// Counts the frames of the file that this reader reads, skipping their contents.
    pub(super) fn count(&self, file: &InputFile) -> Result<u64> {
        let refused = |e| Error::io(&self.name, e);
        let length = file.len();
        let mut file = BufReader::with_capacity(256, file.reader());
        let mut line = Vec::new();
        file.by_ref().take(LINE).read_until(b'\n', &mut line).map_err(refused)?;
        let mut at = line.len() as u64;
        let bytes = self.layout.bytes();
        let mut frames = 0;
        while at < length {
            line.clear();
            let head = file.by_ref().take(LINE).read_until(b'\n', &mut line).map_err(refused)?;
            if !b"FRAME".starts_with(&line[..line.len().min(5)]) {
                return Err(Error::new(Kind::Input, &self.name)
                    .found(format_args!("something else at byte {at}"))
                    .expected(format_args!("the word FRAME before frame {frames}"))
                    .remedy("the video is damaged; make it again"));
            }
            at += head as u64 + bytes;
            if at > length {
                return Err(cut_short(&self.name, frames));
            }
            file.seek_relative(bytes as i64).map_err(refused)?;
            frames += 1;
        }
        Ok(frames)
    }
}
