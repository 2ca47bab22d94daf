//! Outputs of pictures: one file, a folder, or a movie.

use std::path::Path;

use spikelane::unstable::npy::{self, Element};
use spikelane::{Error, ErrorKind, Geometry, Result};
use spikelane_io::storage::{self, FileWriter};

use crate::common::{MovieFormat, MovieWriter, PictureFormat, StreamOutput, picture_levels};

/// An output of pictures.
pub(super) struct PictureSink<'a> {
    pub path: &'a Path,
    pub force: bool,
    /// Format of pictures that are files.
    pub format: PictureFormat,
    /// Rate, or interval in readouts, that is white.
    pub white: f32,
    pub geometry: Geometry,
    pub target: Target,
}

/// Where pictures are written.
pub(super) enum Target {
    Stdout,
    File,
    /// A folder of numbered PNGs.
    Folder,
    Npy(FileWriter),
    Movie(MovieFormat, MovieWriter),
}

impl PictureSink<'_> {
    /// Encodes a picture. Several threads may call this method at the same time.
    pub(super) fn encode(&self, values: &[f32]) -> Result<Vec<u8>> {
        match &self.target {
            Target::Npy(_) => Ok(values.iter().flat_map(|v| v.to_le_bytes()).collect()),
            Target::Movie(format, _) => {
                format.encode_frame(self.geometry, picture_levels(values, self.white, self.geometry))
            }
            _ => self.format.encode(values, self.white, self.geometry),
        }
    }

    /// Writes an encoded picture. Pictures must be written in order.
    pub(super) fn write(&mut self, at: usize, encoded: &[u8]) -> Result<()> {
        match &mut self.target {
            Target::Stdout => StreamOutput::default().write(encoded),
            Target::File => storage::write_small(self.path, encoded, self.force),
            Target::Folder => {
                storage::write_small(&self.path.join(format!("{at:09}.png")), encoded, self.force)
            }
            Target::Npy(file) => file.write_all(encoded),
            Target::Movie(_, movie) => movie.push(encoded),
        }
    }

    pub(super) fn finish(self) -> Result<()> {
        match self.target {
            Target::Npy(file) => file.finish().map(drop),
            Target::Movie(_, movie) => movie.finish(),
            _ => Ok(()),
        }
    }
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

/// Creates an array of f32 with the shape (height, width) or (pictures, height, width). Its pictures are written one at a
/// time.
///
/// `channels` is 1 for gray pictures, and 3 for color pictures, which have a last axis of length 3. If `pictures` is `None`,
/// the array contains one picture and has the shape (height, width).
pub(super) fn create_array(
    path: &Path,
    force: bool,
    geometry: Geometry,
    channels: usize,
    pictures: Option<usize>,
) -> Result<FileWriter> {
    let sides = pictures.into_iter().chain([geometry.height(), geometry.width()]);
    let shape: Vec<u64> = sides.chain((channels > 1).then_some(channels)).map(|n| n as u64).collect();
    let header = npy::header_bytes(Element::F32, &shape);
    let bytes = header.len() + 4 * pictures.unwrap_or(1) * geometry.pixels() * channels;
    let mut writer = FileWriter::create(path, bytes as u64, force)?;
    writer.write_all(&header)?;
    Ok(writer)
}
