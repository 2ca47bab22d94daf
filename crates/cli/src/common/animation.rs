//! Animated images: GIF and WebP. WebP is lossless. GIF is lossless for gray levels, and dithers colors to a fixed palette
//! of 252 colors.

use std::io::{Seek as _, SeekFrom, Write as _};
use std::path::Path;

use image::{ExtendedColorType, ImageEncoder as _};
use spikelane::{Error, ErrorKind, Geometry, Result};
use spikelane_io::storage::PartialFile;

/// Largest side of a WebP image. A GIF has the same limit here.
const MAX_SIDE_PX: usize = 16_383;

/// Bits of a pixel value before the compression.
const GIF_CODE_BITS: u8 = 8;

/// Largest frame rate of a GIF. Browsers show frames of less than 20 ms for 100 ms.
const MAX_GIF_FPS: f64 = 50.0;

/// Bytes of a WebP file before its first chunk, and the part of them that the size of the file excludes.
const WEBP_HEADER_BYTES: usize = 12;
const RIFF_HEADER_BYTES: u64 = 8;

/// Format of an animated image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum AnimationFormat {
    Gif,
    Webp,
}

impl AnimationFormat {
    /// Returns the format that a file extension in lower case selects.
    pub(crate) fn from_extension(extension: &str) -> Option<Self> {
        match extension {
            "gif" => Some(Self::Gif),
            "webp" => Some(Self::Webp),
            _ => None,
        }
    }

    /// Encodes the sRGB codes of a frame, row-major: one code per pixel, or red, green and blue of each pixel.
    pub(crate) fn encode_frame(self, geometry: Geometry, levels: &[u8]) -> Result<Vec<u8>> {
        let (width, height) = (geometry.width(), geometry.height());
        let is_color = levels.len() == 3 * geometry.pixels();
        match self {
            Self::Gif => {
                let indices = if is_color { &*dither(geometry, levels) } else { levels };
                let encoded =
                    weezl::encode::Encoder::new(weezl::BitOrder::Lsb, GIF_CODE_BITS).encode(indices);
                let encoded = encoded.map_err(|e| Error::new(ErrorKind::Io, "GIF").found(e))?;
                // The data consists of blocks of at most 255 bytes, each after its length. An empty block ends it.
                let mut data = vec![GIF_CODE_BITS];
                for block in encoded.chunks(255) {
                    data.push(block.len() as u8);
                    data.extend_from_slice(block);
                }
                data.push(0);
                Ok(data)
            }
            Self::Webp => {
                let mut file = Vec::new();
                let kind = if is_color { ExtendedColorType::Rgb8 } else { ExtendedColorType::L8 };
                image::codecs::webp::WebPEncoder::new_lossless(&mut file)
                    .write_image(levels, width as u32, height as u32, kind)
                    .map_err(|e| Error::new(ErrorKind::Io, "WebP").found(e))?;
                // The file has one chunk, which contains the image.
                Ok(file.split_off(WEBP_HEADER_BYTES))
            }
        }
    }
}

/// An animated image that is being written. Frames repeat without end.
pub(crate) struct AnimationWriter {
    format: AnimationFormat,
    geometry: Geometry,
    fps: f64,
    frames: u64,
    file: std::io::BufWriter<std::fs::File>,
    bytes: u64,
    partial: PartialFile,
}

impl AnimationWriter {
    /// Creates the file. The hidden file receives its final name in [`Self::finish`].
    ///
    /// # Errors
    /// If the file exists and `force` is false, or if the format cannot have this size or frame rate.
    pub(crate) fn create(
        path: &Path,
        format: AnimationFormat,
        geometry: Geometry,
        is_color: bool,
        fps: f64,
        force: bool,
    ) -> Result<Self> {
        if geometry.width().max(geometry.height()) > MAX_SIDE_PX {
            return Err(Error::new(ErrorKind::Usage, path.display())
                .found(format_args!("frames of {geometry}"))
                .expected(format_args!("at most {MAX_SIDE_PX} pixels per side"))
                .remedy("write a video (.mp4) or single images"));
        }
        if format == AnimationFormat::Gif && fps > MAX_GIF_FPS {
            return Err(Error::new(ErrorKind::Usage, "--fps")
                .found(fps)
                .expected(format_args!("at most {MAX_GIF_FPS} frames per second for a GIF"))
                .remedy("reduce --fps, or write a .webp"));
        }
        let partial = PartialFile::create_with_suffix(path, force, "")?;
        let file = std::fs::OpenOptions::new().write(true).open(partial.hidden_path());
        let file = file.map_err(|e| Error::io(path.display(), e))?;
        let mut writer =
            Self { format, geometry, fps, frames: 0, file: std::io::BufWriter::new(file), bytes: 0, partial };
        let header = match format {
            AnimationFormat::Gif => gif_header(geometry, is_color),
            AnimationFormat::Webp => webp_header(geometry),
        };
        writer.write(&header)?;
        Ok(writer)
    }

    /// Writes a frame that [`AnimationFormat::encode_frame`] encoded.
    pub(crate) fn push(&mut self, encoded: &[u8]) -> Result<()> {
        let header = match self.format {
            AnimationFormat::Gif => gif_frame_header(self.geometry, self.frame_length(100.0)),
            AnimationFormat::Webp => {
                webp_frame_header(self.geometry, self.frame_length(1000.0), encoded.len())
            }
        };
        self.frames += 1;
        self.write(&header)?;
        self.write(encoded)
    }

    /// Returns the length of the next frame in ticks. Lengths are whole ticks, and their sum stays within half a tick of
    /// the exact time.
    fn frame_length(&self, ticks_per_second: f64) -> u32 {
        let end_of = |frames: u64| (frames as f64 * ticks_per_second / self.fps).round();
        (end_of(self.frames + 1) - end_of(self.frames)) as u32
    }

    /// Completes the file and gives it its final name.
    pub(crate) fn finish(mut self) -> Result<()> {
        match self.format {
            AnimationFormat::Gif => self.write(&[0x3b])?,
            AnimationFormat::Webp => {
                let size = u32::try_from(self.bytes - RIFF_HEADER_BYTES).map_err(|_| {
                    Error::new(ErrorKind::Space, "WebP").found(self.bytes).expected("at most 4 GB")
                })?;
                let patched = self.file.seek(SeekFrom::Start(4));
                patched.map_err(|e| Error::io(self.partial.hidden_path().display(), e))?;
                self.write(&size.to_le_bytes())?;
            }
        }
        self.file.flush().map_err(|e| Error::io(self.partial.hidden_path().display(), e))?;
        self.partial.commit().map(drop)
    }

    fn write(&mut self, bytes: &[u8]) -> Result<()> {
        self.bytes += bytes.len() as u64;
        self.file.write_all(bytes).map_err(|e| Error::io(self.partial.hidden_path().display(), e))
    }
}

/// Numbers of levels of red, green and blue in the palette of a GIF in color. The eye resolves green best.
const GIF_LEVELS: [usize; 3] = [6, 7, 6];

/// Side of the pattern of thresholds with which colors are dithered.
const DITHER_SIDE: usize = 8;

/// Returns the colors of the palette of a GIF: 256 gray levels, or all combinations of [`GIF_LEVELS`].
fn gif_palette(is_color: bool) -> Vec<[u8; 3]> {
    if !is_color {
        return (0..=255u8).map(|level| [level; 3]).collect();
    }
    let [red, green, blue] = GIF_LEVELS;
    let code = |level: usize, levels: usize| (255 * level / (levels - 1)) as u8;
    let color =
        |i: usize| [code(i / (green * blue), red), code(i / blue % green, green), code(i % blue, blue)];
    // A palette has a power of two of entries. The last ones are black and not used.
    (0..256).map(|i| if i < red * green * blue { color(i) } else { [0; 3] }).collect()
}

/// Returns the threshold of a pixel in the ordered dither of Bayer (1973), in 64ths from 0 to 63. The bits of the
/// threshold are those of `x ^ y` and `y`, in reverse order.
fn dither_threshold(x: usize, y: usize) -> usize {
    (0..3).fold(0, |threshold, bit| {
        let (x, y) = (x >> bit & 1, y >> bit & 1);
        threshold << 2 | (x ^ y) << 1 | y
    })
}

/// Returns the palette indices of red, green and blue of each pixel. Ordered dither keeps the mean color of an area, and
/// does not flicker, because the thresholds of all frames are equal.
fn dither(geometry: Geometry, levels: &[u8]) -> Vec<u8> {
    let width = geometry.width();
    let index = |(p, rgb): (usize, &[u8])| {
        let threshold = dither_threshold(p % width % DITHER_SIDE, p / width % DITHER_SIDE);
        let level = |code: u8, levels: usize| {
            (usize::from(code) * (levels - 1) * 64 + 255 * threshold + 127) / (255 * 64)
        };
        rgb.iter().zip(GIF_LEVELS).fold(0, |index, (code, levels)| index * levels + level(*code, levels))
            as u8
    };
    levels.chunks_exact(3).enumerate().map(index).collect()
}

/// Returns the start of a GIF: size, palette, and the extension for endless repetition.
fn gif_header(geometry: Geometry, is_color: bool) -> Vec<u8> {
    let mut header = b"GIF89a".to_vec();
    header.extend((geometry.width() as u16).to_le_bytes());
    header.extend((geometry.height() as u16).to_le_bytes());
    // A global palette of 2^(7 + 1) colors with 8 bits each.
    header.extend([0xf7, 0, 0]);
    header.extend(gif_palette(is_color).concat());
    header.extend([0x21, 0xff, 11]);
    header.extend(b"NETSCAPE2.0");
    header.extend([3, 1, 0, 0, 0]);
    header
}

/// Returns what precedes the pixels of a frame: its length in hundredths of a second, and its place.
fn gif_frame_header(geometry: Geometry, hundredths: u32) -> Vec<u8> {
    let mut header = vec![0x21, 0xf9, 4, 0];
    header.extend((hundredths as u16).to_le_bytes());
    header.extend([0, 0, 0x2c, 0, 0, 0, 0]);
    header.extend((geometry.width() as u16).to_le_bytes());
    header.extend((geometry.height() as u16).to_le_bytes());
    header.push(0);
    header
}

fn u24(value: usize) -> [u8; 3] {
    let [a, b, c, ..] = (value as u32).to_le_bytes();
    [a, b, c]
}

fn chunk_header(name: &[u8; 4], bytes: usize) -> Vec<u8> {
    [name.as_slice(), &(bytes as u32).to_le_bytes()].concat()
}

/// Returns the start of an animated WebP file. Its size in bytes 4 to 7 is written at the end.
fn webp_header(geometry: Geometry) -> Vec<u8> {
    let mut header = b"RIFF\0\0\0\0WEBP".to_vec();
    header.extend(chunk_header(b"VP8X", 10));
    // Bit 1: the file has an animation.
    header.extend([0x02, 0, 0, 0]);
    header.extend(u24(geometry.width() - 1));
    header.extend(u24(geometry.height() - 1));
    header.extend(chunk_header(b"ANIM", 6));
    // An opaque black background, and endless repetition.
    header.extend([0, 0, 0, 255, 0, 0]);
    header
}

/// Returns the header of a frame. The image chunk of `bytes` bytes follows.
fn webp_frame_header(geometry: Geometry, milliseconds: u32, bytes: usize) -> Vec<u8> {
    let mut header = chunk_header(b"ANMF", 16 + bytes);
    header.extend([0; 6]);
    header.extend(u24(geometry.width() - 1));
    header.extend(u24(geometry.height() - 1));
    header.extend(u24(milliseconds as usize));
    // Bit 1: the frame replaces the pixels of the frame before.
    header.push(0x02);
    header
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dither_keeps_the_mean_color_of_an_area() {
        let (geometry, palette) = (Geometry::new(8, 8).unwrap(), gif_palette(true));
        for code in 0..=255u8 {
            let color = [code, 255 - code, code / 2];
            let indices = dither(geometry, &color.repeat(64));
            for (i, expected) in color.into_iter().enumerate() {
                let sum: f64 = indices.iter().map(|p| f64::from(palette[usize::from(*p)][i])).sum();
                // A pixel of 64 changes the mean by less than one code, and a color of the palette is rounded by less than one.
                assert!((sum / 64.0 - f64::from(expected)).abs() < 1.5, "{color:?} {i}: {sum}");
            }
        }
    }

    #[test]
    fn each_threshold_occurs_once() {
        let mut all: Vec<usize> = (0..8).flat_map(|y| (0..8).map(move |x| dither_threshold(x, y))).collect();
        all.sort_unstable();
        assert!(all.into_iter().eq(0..64));
    }
}
