//! Clear images of a sequence, one per readout that is kept.

use std::fs;
use std::path::{Path, PathBuf};

use crate::DatasetOptions;
use crate::labels::write;
use spikelane::error::{Error, Result};
use spikelane_io::light::Frame;
use spikelane_io::simulate::{ImageFacts, ImageForm};

/// Writes images into `images/` of a sequence's folder, named for their readouts.
pub(super) struct Keeper {
    pub folder: PathBuf,
    pub every: Option<u64>,
    form: ImageForm,
    npy: bool,
}

impl Keeper {
    /// Keeps the light of every `every`-th readout; with `npy` also as floats.
    pub(crate) fn new(
        options: &DatasetOptions,
        every: Option<u64>,
        npy: bool,
        folder: &Path,
    ) -> Result<Self> {
        if every.is_some() {
            let images = folder.join("images");
            fs::create_dir_all(&images).map_err(|e| Error::io(images.display(), e))?;
        }
        Ok(Self { folder: folder.to_owned(), every, form: options.images.form, npy })
    }

    /// Writes the light of a readout.
    pub(crate) fn keep(&mut self, readout: u64, light: &Frame) -> Result<()> {
        let (values, geometry) = (light.to_f32(), light.geometry());
        let mut forms = vec![self.form];
        if self.npy && self.form != ImageForm::F32 {
            forms.push(ImageForm::F32);
        }
        for form in forms {
            let name = format!("images/{readout:06}.{}", form.extension());
            write(&self.folder, &name, &form.encode(&values, geometry)?)?;
        }
        Ok(())
    }

    /// For records; the record's own list has the files and their digests.
    pub(crate) fn facts(&self) -> Option<ImageFacts> {
        self.every.map(|every| self.form.facts(every))
    }
}
