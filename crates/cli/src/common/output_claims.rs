//! Claims the outputs of a command.

use std::path::Path;

use super::progress::stop_flag;
use spikelane::Result;
use spikelane_io::storage::OutputSet;

/// Claims files (see [`OutputSet::claim`]). Also installs the signal handlers, because an interrupted command must remove
/// its locks.
pub(crate) fn claim<P: AsRef<Path>>(files: impl IntoIterator<Item = P>, force: bool) -> Result<OutputSet> {
    stop_flag()?;
    OutputSet::claim(files, force)
}

/// Claims a folder (see [`OutputSet::claim_folder`]). Installs the signal handlers as [`claim`] does.
pub(crate) fn claim_folder(folder: &Path) -> Result<OutputSet> {
    stop_flag()?;
    OutputSet::claim_folder(folder)
}
