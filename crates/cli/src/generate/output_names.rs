//! The names of the files that a simulation writes.

use std::path::{Path, PathBuf};

use crate::common::output_claims;
use crate::common::output_stem::OutputStem;
use spikelane::{Error, ErrorKind, Result};
use spikelane_io::storage::OutputSet;

/// The file names that begin with one stem.
pub(crate) struct OutputNames {
    pub stream: PathBuf,
    pub clean_stream: PathBuf,
    pub sidecar: PathBuf,
    pub picture: PathBuf,
    pub camera: PathBuf,
    pub images: PathBuf,
}

impl OutputNames {
    pub(crate) fn new(stem: &OutputStem) -> Self {
        let name = |ending: &str| stem.with_ending(ending);
        let data = stem.layout.default_extension();
        Self {
            stream: name(&format!(".{data}")),
            clean_stream: name(&format!(".clean.{data}")),
            sidecar: name(".json"),
            picture: name(".png"),
            camera: name(".camera"),
            images: name(".images"),
        }
    }

    /// Returns the files of a simulation. `clean` is whether they include the clean stream.
    pub(crate) fn files(&self, clean: bool) -> Vec<&Path> {
        let all =
            [(&self.stream, true), (&self.clean_stream, clean), (&self.sidecar, true), (&self.picture, true)];
        all.into_iter().filter(|(_, wanted)| *wanted).map(|(path, _)| path.as_path()).collect()
    }

    /// Claims the files of a simulation. Returns an error if the folder of reference images exists and `force` is false.
    pub(crate) fn claim(&self, clean: bool, images: bool, force: bool) -> Result<OutputSet> {
        if images && !force && self.images.symlink_metadata().is_ok() {
            return Err(Error::new(ErrorKind::Exists, self.images.display())
                .found("a folder of that name")
                .expected("a path that does not exist")
                .remedy("choose another output, or pass --force to replace the folder"));
        }
        output_claims::claim(self.files(clean), force)
    }
}
