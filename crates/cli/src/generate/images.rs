//! Reference images beside a stream. Their folder has a hidden name until the simulation is complete.

use std::path::{Path, PathBuf};

use spikelane::unstable::inputs::PARTIAL_ENDING;
use spikelane::{Error, ErrorKind, Result};
use spikelane_io::light::Frame;
use spikelane_io::simulate::{ImageFacts, ImageFile, ImageFormat};
use spikelane_io::storage::{self, unfinished};

#[derive(clap::Args, Clone, Copy, Debug)]
pub(crate) struct ImageArgs {
    /// Write the light of every N-th readout as an image to the folder STEM.images
    ///
    /// The name of each image is the number of its readout, from 0.
    #[arg(hide_short_help = true, long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pub images_every: Option<u64>,
    /// Set the format of the images of --images-every: u8, u16 or f32
    ///
    /// u8 is a PNG in sRGB, u16 a linear PNG, and f32 a linear .npy array.
    #[arg(hide_short_help = true, long, value_name = "FORMAT", default_value = "u8")]
    pub images_format: ImageFormat,
}

/// The reference images of a running simulation. Dropping this value removes them, unless the folder was renamed.
pub(crate) struct ImageFolder {
    format: ImageFormat,
    path: PathBuf,
    hidden_path: PathBuf,
    facts: ImageFacts,
}

impl ImageFolder {
    /// Creates a hidden folder beside `place`. Returns `None` if no images are requested.
    pub(crate) fn create(args: ImageArgs, place: &Path) -> Result<Option<Self>> {
        let Some(every) = args.images_every else { return Ok(None) };
        let name = place.file_name().unwrap_or_default();
        let hidden = hidden_path(place, "");
        remove_folder(&hidden)?;
        std::fs::create_dir_all(&hidden).map_err(|e| Error::io(hidden.display(), e))?;
        let facts =
            ImageFacts { folder: name.to_string_lossy().into_owned(), ..args.images_format.facts(every) };
        Ok(Some(Self { format: args.images_format, path: place.to_owned(), hidden_path: hidden, facts }))
    }

    /// Writes the light of readout `readout` as an image.
    pub(crate) fn write(&mut self, readout: u64, light: &Frame) -> Result<()> {
        let file = format!("{readout:06}.{}", self.format.extension());
        let bytes = self.format.encode(&light.image_values(), light.geometry())?;
        storage::write_small(&self.hidden_path.join(&file), &bytes, false)?;
        self.facts.files.push(ImageFile { file, readout, digest: storage::Digest::hash_bytes(&bytes) });
        Ok(())
    }

    /// Renames the folder to its final name. An existing folder of this name is replaced.
    pub(crate) fn finish(mut self) -> Result<ImageFacts> {
        check_replaceable(&self.path)?;
        // The old folder is renamed before its files are removed. If the process is killed, no incomplete folder has the
        // final name.
        let old = hidden_path(&self.path, ".old");
        remove_folder(&old)?;
        match std::fs::rename(&self.path, &old) {
            Err(e) if e.kind() != std::io::ErrorKind::NotFound => {
                return Err(Error::io(self.path.display(), e));
            }
            _ => {}
        }
        std::fs::rename(&self.hidden_path, &self.path).map_err(|e| Error::io(self.path.display(), e))?;
        remove_folder(&old)?;
        Ok(std::mem::replace(&mut self.facts, self.format.facts(1)))
    }
}

impl Drop for ImageFolder {
    fn drop(&mut self) {
        // If the folder was renamed, the hidden folder no longer exists and the call has no effect.
        let _ = std::fs::remove_dir_all(&self.hidden_path);
    }
}

/// Returns the hidden name of a folder that is being written or removed.
fn hidden_path(place: &Path, ending: &str) -> PathBuf {
    let mut name = std::ffi::OsString::from(".");
    name.push(place.file_name().unwrap_or_default());
    name.push(ending);
    name.push(PARTIAL_ENDING);
    place.with_file_name(name)
}

/// Returns an error if the folder contains a file that is not a reference image. Only reference images can be replaced.
pub(crate) fn check_replaceable(folder: &Path) -> Result<()> {
    let Ok(entries) = std::fs::read_dir(folder) else { return Ok(()) };
    for entry in entries {
        let path = entry.map_err(|e| Error::io(folder.display(), e))?.path();
        let ending = path.extension().unwrap_or_default();
        // If a simulation was killed, the folder still contains the image that it was writing.
        let partial = path.file_name().is_some_and(|name| unfinished::is_numbered(&name.to_string_lossy()));
        if !path.is_file() || !(ending == "png" || ending == "npy" || partial) {
            return Err(Error::new(ErrorKind::Exists, path.display())
                .found("files that are not clean reference images")
                .expected("a folder of clean reference images, which may be replaced")
                .remedy("move this file, or choose another --output"));
        }
    }
    Ok(())
}

/// Removes a folder of reference images, if it exists.
pub(crate) fn remove_folder(folder: &Path) -> Result<()> {
    check_replaceable(folder)?;
    match std::fs::remove_dir_all(folder) {
        Err(e) if e.kind() != std::io::ErrorKind::NotFound => Err(Error::io(folder.display(), e)),
        _ => Ok(()),
    }
}
