//! Writes the reference images of a sequence. Each image shows the light of one selected readout.

use std::fs;
use std::path::{Path, PathBuf};

use crate::DatasetOptions;
use crate::labels::write_label_file;
use crate::light_statistics::LightStatistics;
use spikelane::error::{Error, Result};
use spikelane_io::light::Frame;
use spikelane_io::simulate::{ImageFacts, ImageFormat};

/// Writes images to the folder `images/` of a sequence. The file name of an image is the readout number.
pub(super) struct ReferenceImageWriter {
    pub folder: PathBuf,
    pub interval_readouts: Option<u64>,
    format: ImageFormat,
    write_npy: bool,
    pub statistics: LightStatistics,
}

impl ReferenceImageWriter {
    /// Creates a writer for the light of every `every`-th readout. If `npy` is true, the light is also written as `f32`
    /// values.
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
        Ok(Self {
            folder: folder.to_owned(),
            interval_readouts: every,
            format: options.images.format,
            write_npy: npy,
            statistics: LightStatistics::default(),
        })
    }

    /// Writes the image of readout `readout` with the light `light`.
    pub(crate) fn write(&mut self, readout: u64, light: &Frame) -> Result<()> {
        let (values, geometry) = (light.image_values(), light.geometry());
        self.statistics.push(readout, &light.to_f32());
        let mut forms = vec![self.format];
        if self.write_npy && self.format != ImageFormat::F32 {
            forms.push(ImageFormat::F32);
        }
        for form in forms {
            let name = format!("images/{readout:06}.{}", form.extension());
            write_label_file(&self.folder, &name, &form.encode(&values, geometry)?)?;
        }
        Ok(())
    }

    /// Returns the description of the images for the record of the sequence. The description lists no files, because
    /// the record lists all files with their digests.
    pub(crate) fn facts(&self) -> Option<ImageFacts> {
        self.interval_readouts.map(|every| self.format.facts(every))
    }
}
