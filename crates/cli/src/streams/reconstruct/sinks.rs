//! Outputs of pictures: one file, a folder, or a movie.

use std::path::{Path, PathBuf};

use crate::common::{MovieFormat, MovieWriter, PictureFormat, StreamOutput, picture_levels};

use spikelane::unstable::npy::{self, Element};
use spikelane::{Error, ErrorKind, Geometry, Result};
use spikelane_io::storage::{self, FileWriter};

/// An output of pictures.
pub(super) trait PictureSink: Sync {
    /// Encodes a picture. Several threads may call this method at the same time.
    fn encode(&self, values: &[f32]) -> Result<Vec<u8>>;
    /// Writes an encoded picture. Pictures must be written in order.
    fn write(&mut self, at: usize, encoded: &[u8]) -> Result<()>;
    fn finish(self: Box<Self>) -> Result<()>;
}

/// Conversion of rates to gray levels or colors.
#[derive(Clone, Copy)]
pub(super) struct GrayScale {
    pub white: f32,
    pub geometry: Geometry,
}

impl GrayScale {
    fn encode(self, values: &[f32], format: PictureFormat) -> Result<Vec<u8>> {
        format.encode(values, self.white, self.geometry)
    }
}

/// Writes one picture.
pub(super) struct FileSink {
    pub path: PathBuf,
    pub force: bool,
    pub format: PictureFormat,
    pub gray_scale: GrayScale,
}

impl PictureSink for FileSink {
    fn encode(&self, values: &[f32]) -> Result<Vec<u8>> {
        self.gray_scale.encode(values, self.format)
    }

    fn write(&mut self, _: usize, encoded: &[u8]) -> Result<()> {
        storage::write_small(&self.path, encoded, self.force)
    }

    fn finish(self: Box<Self>) -> Result<()> {
        Ok(())
    }
}

/// Writes one picture as PNG to standard output.
pub(super) struct StdoutSink {
    pub format: PictureFormat,
    pub gray_scale: GrayScale,
}

impl PictureSink for StdoutSink {
    fn encode(&self, values: &[f32]) -> Result<Vec<u8>> {
        self.gray_scale.encode(values, self.format)
    }

    fn write(&mut self, _: usize, encoded: &[u8]) -> Result<()> {
        StreamOutput::default().write(encoded)
    }

    fn finish(self: Box<Self>) -> Result<()> {
        Ok(())
    }
}

/// Writes an animated image or a video.
pub(super) struct MovieSink {
    pub movie: MovieWriter,
    pub format: MovieFormat,
    pub gray_scale: GrayScale,
}

impl PictureSink for MovieSink {
    fn encode(&self, values: &[f32]) -> Result<Vec<u8>> {
        let levels = picture_levels(values, self.gray_scale.white, self.gray_scale.geometry);
        self.format.encode_frame(self.gray_scale.geometry, levels)
    }

    fn write(&mut self, _: usize, encoded: &[u8]) -> Result<()> {
        self.movie.push(encoded)
    }

    fn finish(self: Box<Self>) -> Result<()> {
        self.movie.finish()
    }
}

/// Writes a folder of numbered pictures.
pub(super) struct FolderSink {
    pub path: PathBuf,
    pub force: bool,
    pub format: PictureFormat,
    pub gray_scale: GrayScale,
}

/// Returns an error if the folder is not empty and `force` is false.
pub(super) fn check_empty_folder(folder: &Path, force: bool) -> Result<()> {
    let Ok(mut entries) = std::fs::read_dir(folder) else { return Ok(()) };
    if force || entries.next().is_none() {
        return Ok(());
    }
    Err(Error::new(ErrorKind::Exists, folder.display())
        .found("a folder with files")
        .expected("an empty or new folder")
        .remedy("choose another folder, or pass --force to replace files"))
}

impl PictureSink for FolderSink {
    fn encode(&self, values: &[f32]) -> Result<Vec<u8>> {
        self.gray_scale.encode(values, self.format)
    }

    fn write(&mut self, at: usize, encoded: &[u8]) -> Result<()> {
        storage::write_small(&self.path.join(format!("{at:09}.png")), encoded, self.force)
    }

    fn finish(self: Box<Self>) -> Result<()> {
        Ok(())
    }
}

/// An array of f32 with the shape (height, width) or (pictures, height, width). Color pictures have a last axis of length
/// 3. The array is written one picture at a time.
pub(super) struct NpySink(FileWriter);

impl NpySink {
    /// Creates an array of `pictures` pictures. If `pictures` is `None`, the array contains one picture and has the shape
    /// (height, width).
    ///
    /// `channels` is 1 for gray pictures, and 3 for color pictures.
    pub(crate) fn new(
        path: &Path,
        force: bool,
        geometry: Geometry,
        channels: usize,
        pictures: Option<usize>,
    ) -> Result<Self> {
        let sides = [geometry.height(), geometry.width()];
        let shape: Vec<u64> = pictures
            .into_iter()
            .chain(sides)
            .chain((channels > 1).then_some(channels))
            .map(|n| n as u64)
            .collect();
        let header = npy::header_bytes(Element::F32, &shape);
        let bytes = header.len() + 4 * pictures.unwrap_or(1) * geometry.pixels() * channels;
        let mut writer = FileWriter::create(path, bytes as u64, force)?;
        writer.write_all(&header)?;
        Ok(Self(writer))
    }
}

impl PictureSink for NpySink {
    fn encode(&self, values: &[f32]) -> Result<Vec<u8>> {
        Ok(values.iter().flat_map(|v| v.to_le_bytes()).collect())
    }

    fn write(&mut self, _: usize, encoded: &[u8]) -> Result<()> {
        self.0.write_all(encoded)
    }

    fn finish(self: Box<Self>) -> Result<()> {
        self.0.finish().map(drop)
    }
}
