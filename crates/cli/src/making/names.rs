//! The files that a run writes.

use std::path::{Path, PathBuf};

use crate::shared::outputs;
use crate::shared::stem::Stem;
use spikelane::{Error, Kind, Result};
use spikelane_io::storage::OutputSet;

/// The names that come out of a stem.
pub(crate) struct Names {
    pub noisy: PathBuf,
    pub clean: PathBuf,
    pub sidecar: PathBuf,
    pub picture: PathBuf,
    pub camera: PathBuf,
    pub images: PathBuf,
}

impl Names {
    pub(crate) fn new(stem: &Stem) -> Self {
        let name = |ending: &str| stem.with(ending);
        let data = stem.layout.default_extension();
        Self {
            noisy: name(&format!(".{data}")),
            clean: name(&format!(".clean.{data}")),
            sidecar: name(".json"),
            picture: name(".png"),
            camera: name(".camera"),
            images: name(".images"),
        }
    }

    /// The files of a run with or without a clean twin.
    pub(crate) fn files(&self, clean: bool) -> Vec<&Path> {
        let all = [(&self.noisy, true), (&self.clean, clean), (&self.sidecar, true), (&self.picture, true)];
        all.into_iter().filter(|(_, wanted)| *wanted).map(|(path, _)| path.as_path()).collect()
    }

    /// Claims the files of a run, and refuses a folder in the place of its clear images.
    pub(crate) fn claim(&self, clean: bool, images: bool, force: bool) -> Result<OutputSet> {
        if images && !force && self.images.symlink_metadata().is_ok() {
            return Err(Error::new(Kind::Exists, self.images.display())
                .found("a folder of that name")
                .expected("a free name")
                .remedy("choose another output, or allow overwriting (--force)"));
        }
        outputs::claim(self.files(clean), force)
    }
}
