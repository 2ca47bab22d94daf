//! The steps that make files durable. Each step is a separate function, so that tests can record and check the order
//! of the steps.
//!
//! After a power failure, any rename may be on the disk, but only file contents that were synced before the power
//! failure are guaranteed. Therefore a file and its folders are synced before the rename. After the rename, the folder
//! of the new name is synced.

use std::fs::{self, File};
use std::path::Path;

use spikelane::error::{Error, Result};

pub(super) fn io(path: &Path) -> impl FnOnce(std::io::Error) -> Error + '_ {
    move |e| Error::io(path.display(), e)
}

/// Syncs the bytes of an open file to the disk.
pub fn sync_file(file: &File, path: &Path) -> Result<()> {
    file.sync_all().map_err(io(path))?;
    #[cfg(feature = "record-steps")]
    record::record_sync(path);
    Ok(())
}

/// Syncs the names of the entries in a folder to the disk.
pub fn sync_folder(folder: &Path) -> Result<()> {
    File::open(folder).and_then(|f| f.sync_all()).map_err(io(folder))?;
    #[cfg(feature = "record-steps")]
    record::record_step(record::Step::SyncFolder(folder.to_owned()));
    Ok(())
}

/// Renames a file or folder. An existing entry is replaced.
pub fn rename(from: &Path, to: &Path) -> Result<()> {
    fs::rename(from, to).map_err(io(to))?;
    record_rename(from, to);
    Ok(())
}

/// Records a rename that another function than [`rename`] has executed.
pub(crate) fn record_rename(from: &Path, to: &Path) {
    #[cfg(feature = "record-steps")]
    record::record_step(record::Step::Rename(from.to_owned(), to.to_owned()));
    #[cfg(not(feature = "record-steps"))]
    let _ = (from, to);
}

/// A log of the steps below one folder. Tests use this log.
#[cfg(feature = "record-steps")]
pub mod record {
    use std::path::{Path, PathBuf};
    use std::sync::Mutex;

    /// A recorded step.
    #[derive(Clone, Debug)]
    pub enum Step {
        /// A sync of a file. The bytes are the content of the file at the sync.
        SyncFile(PathBuf, Vec<u8>),
        /// A sync of the names in a folder.
        SyncFolder(PathBuf),
        /// A rename from the first path to the second.
        Rename(PathBuf, PathBuf),
        /// A removal of a file or folder.
        Remove(PathBuf),
    }

    static LOG: Mutex<Option<(PathBuf, Vec<Step>)>> = Mutex::new(None);

    /// Starts a log of the steps below `root`.
    pub fn begin(root: &Path) {
        *LOG.lock().unwrap() = Some((root.to_owned(), Vec::new()));
    }

    /// Ends the log and returns the recorded steps.
    pub fn end() -> Vec<Step> {
        LOG.lock().unwrap().take().map(|(_, steps)| steps).unwrap_or_default()
    }

    /// Records the sync of a file.
    pub fn record_sync(path: &Path) {
        record_step(Step::SyncFile(path.to_owned(), Vec::new()));
    }

    /// Records a step if its path is below the root of the log.
    pub fn record_step(mut step: Step) {
        let mut log = LOG.lock().unwrap();
        let Some((root, steps)) = log.as_mut() else { return };
        let (Step::SyncFile(path, _) | Step::SyncFolder(path) | Step::Rename(path, _) | Step::Remove(path)) =
            &step;
        if !path.starts_with(root) {
            return;
        }
        if let Step::SyncFile(path, bytes) = &mut step {
            *bytes = std::fs::read(path).unwrap();
        }
        steps.push(step);
    }
}
