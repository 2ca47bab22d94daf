//! Movies for people: animated images, and videos by ffmpeg. The file extension selects the format.

use std::path::Path;

use spikelane::{Error, ErrorKind, Geometry, Result};

use super::animation::{AnimationFormat, AnimationWriter};
use super::video::{FrameEncoding, VideoWriter};

/// Extensions of movies, for messages.
pub(crate) const MOVIE_EXTENSIONS: &str = ".gif, .webp, .mp4, .mkv, .mov, .avi, .webm";

/// Format of a movie.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum MovieFormat {
    Animation(AnimationFormat),
    Video,
}

impl MovieFormat {
    /// Returns the format that the extension of `path` selects. Returns `None` if it is not the extension of a movie.
    pub(crate) fn from_path(path: &Path) -> Option<Self> {
        let extension = path.extension()?.to_string_lossy().to_lowercase();
        match extension.as_str() {
            "mp4" | "mkv" | "mov" | "avi" | "webm" => Some(Self::Video),
            other => AnimationFormat::from_extension(other).map(Self::Animation),
        }
    }

    /// Returns the format of `path`.
    ///
    /// # Errors
    /// [`ErrorKind::Usage`] if the extension is not that of a movie.
    pub(crate) fn require(path: &Path) -> Result<Self> {
        Self::from_path(path).ok_or_else(|| {
            let extension = path.extension().map_or_else(
                || "no extension".to_owned(),
                |e| format!("the extension .{}", e.to_string_lossy()),
            );
            Error::new(ErrorKind::Usage, path.display()).found(extension).expected(MOVIE_EXTENSIONS)
        })
    }

    /// Encodes the sRGB codes of a frame, row-major: one code per pixel, or red, green and blue of each pixel. Several
    /// threads may encode frames at the same time.
    pub(crate) fn encode_frame(self, geometry: Geometry, levels: Vec<u8>) -> Result<Vec<u8>> {
        match self {
            Self::Animation(format) => format.encode_frame(geometry, &levels),
            Self::Video => Ok(levels),
        }
    }
}

/// A movie that is being written.
pub(crate) enum MovieWriter {
    Animation(AnimationWriter),
    Video(VideoWriter),
}

impl MovieWriter {
    /// Creates a movie of frames with the size `geometry`, in color if `is_color` is set.
    ///
    /// # Errors
    /// If the file exists and `force` is false, if ffmpeg is missing, if the format cannot have this size or rate, or for an
    /// animated image in color.
    pub(crate) fn create(
        path: &Path,
        format: MovieFormat,
        geometry: Geometry,
        is_color: bool,
        fps: f64,
        force: bool,
    ) -> Result<Self> {
        Ok(match format {
            MovieFormat::Animation(format) => {
                Self::Animation(AnimationWriter::create(path, format, geometry, is_color, fps, force)?)
            }
            MovieFormat::Video => {
                let frames =
                    if is_color { FrameEncoding::Color(geometry) } else { FrameEncoding::Gray(geometry) };
                Self::Video(VideoWriter::start(path, frames, fps, force)?)
            }
        })
    }

    /// Writes a frame that [`MovieFormat::encode_frame`] encoded.
    pub(crate) fn push(&mut self, encoded: &[u8]) -> Result<()> {
        match self {
            Self::Animation(writer) => writer.push(encoded),
            Self::Video(writer) => writer.push(encoded),
        }
    }

    /// Completes the movie and gives it its final name.
    pub(crate) fn finish(self) -> Result<()> {
        match self {
            Self::Animation(writer) => writer.finish(),
            Self::Video(writer) => writer.finish(),
        }
    }
}
