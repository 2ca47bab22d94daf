//! The claim of a command on its outputs.

use std::path::Path;

use super::progress::stop_flag;
use spikelane::Result;
use spikelane_io::storage::OutputSet;

/// Claims files, see [`OutputSet::claim`]. From here on a request to stop is answered in order, so that it leaves no lock.
pub(crate) fn claim<P: AsRef<Path>>(files: impl IntoIterator<Item = P>, force: bool) -> Result<OutputSet> {
    stop_flag()?;
    OutputSet::claim(files, force)
}

/// Claims a folder, see [`OutputSet::claim_folder`], as [`claim`] does files.
pub(crate) fn claim_folder(folder: &Path) -> Result<OutputSet> {
    stop_flag()?;
    OutputSet::claim_folder(folder)
}
