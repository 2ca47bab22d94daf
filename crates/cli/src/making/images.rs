//! Clear images beside a stream: a folder that gets its name when the run is done.

use std::path::{Path, PathBuf};

use spikelane::{Error, Kind, Result};
use spikelane_io::light::Frame;
use spikelane_io::simulate::{ImageFacts, ImageFile, ImageForm};
use spikelane_io::storage::{self, unfinished};

#[derive(clap::Args, Clone, Copy, Debug)]
pub(crate) struct ImageArgs {
    /// Also keep the clear light of every N-th readout, as STEM.images/READOUT, counted from 0
    #[arg(hide_short_help = true, long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pub images_every: Option<u64>,
    /// How these are stored: u8 (PNG, sRGB), u16 (PNG, linear) or f32 (npy, linear)
    #[arg(hide_short_help = true, long, value_name = "FORM", default_value = "u8")]
    pub images_as: ImageForm,
}

/// The images of a run in the making; removed unless they got their name.
pub(crate) struct Folder {
    form: ImageForm,
    place: PathBuf,
    hidden: PathBuf,
    facts: ImageFacts,
}

impl Folder {
    /// A hidden folder beside `place`; none when no images are asked for.
    pub(crate) fn begin(args: ImageArgs, place: &Path) -> Result<Option<Self>> {
        let Some(every) = args.images_every else { return Ok(None) };
        let name = place.file_name().unwrap_or_default();
        let hidden = hidden(place, ".partial");
        remove(&hidden)?;
        std::fs::create_dir_all(&hidden).map_err(|e| Error::io(hidden.display(), e))?;
        let facts = ImageFacts { folder: name.to_string_lossy().into_owned(), ..args.images_as.facts(every) };
        Ok(Some(Self { form: args.images_as, place: place.to_owned(), hidden, facts }))
    }

    /// Writes the light of a readout.
    pub(crate) fn keep(&mut self, readout: u64, light: &Frame) -> Result<()> {
        let file = format!("{readout:06}.{}", self.form.extension());
        let bytes = self.form.encode(&light.to_f32(), light.geometry())?;
        storage::write_small(&self.hidden.join(&file), &bytes, false)?;
        self.facts.files.push(ImageFile { file, readout, digest: storage::Digest::of(&bytes) });
        Ok(())
    }

    /// Gives the folder its name, in place of one that is there.
    pub(crate) fn finish(mut self) -> Result<ImageFacts> {
        check(&self.place)?;
        // The old folder loses its name before its files, so that a kill leaves no part of it under that name.
        let old = hidden(&self.place, ".old.partial");
        remove(&old)?;
        match std::fs::rename(&self.place, &old) {
            Err(e) if e.kind() != std::io::ErrorKind::NotFound => {
                return Err(Error::io(self.place.display(), e));
            }
            _ => {}
        }
        std::fs::rename(&self.hidden, &self.place).map_err(|e| Error::io(self.place.display(), e))?;
        remove(&old)?;
        Ok(std::mem::replace(&mut self.facts, self.form.facts(1)))
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        // Renamed, it is not there any more.
        let _ = std::fs::remove_dir_all(&self.hidden);
    }
}

/// The hidden name of a folder in the making, or of one that goes.
fn hidden(place: &Path, ending: &str) -> PathBuf {
    let mut name = std::ffi::OsString::from(".");
    name.push(place.file_name().unwrap_or_default());
    name.push(ending);
    place.with_file_name(name)
}

/// Refuses a folder in place of which images may not come: one that holds anything else.
pub(crate) fn check(folder: &Path) -> Result<()> {
    let Ok(entries) = std::fs::read_dir(folder) else { return Ok(()) };
    for entry in entries {
        let path = entry.map_err(|e| Error::io(folder.display(), e))?.path();
        let ending = path.extension().unwrap_or_default();
        // A killed run leaves the image that it was writing.
        let partial = path.file_name().is_some_and(|name| unfinished::is_numbered(&name.to_string_lossy()));
        if !path.is_file() || !(ending == "png" || ending == "npy" || partial) {
            return Err(Error::new(Kind::Exists, path.display())
                .found("something that is no clear image")
                .expected("a folder of clear images, which may be replaced")
                .remedy("move it, or choose another --output"));
        }
    }
    Ok(())
}

/// Removes a folder of images, if it is there.
pub(crate) fn remove(folder: &Path) -> Result<()> {
    check(folder)?;
    match std::fs::remove_dir_all(folder) {
        Err(e) if e.kind() != std::io::ErrorKind::NotFound => Err(Error::io(folder.display(), e)),
        _ => Ok(()),
    }
}
