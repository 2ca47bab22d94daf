//! The steps that bring files to the disk: one function for each, so that a test can look at their order.
//!
//! After a power failure the disk may hold any rename that was asked for, and of a file only what was synced before.
//! So a file is synced before its rename, the folders it lies in as well, and the folder of the new name after it.

use std::fs::{self, File};
use std::path::Path;

use spikelane::error::{Error, Result};

pub(super) fn io(path: &Path) -> impl FnOnce(std::io::Error) -> Error + '_ {
    move |e| Error::io(path.display(), e)
}

/// Brings the bytes of an open file to the disk.
pub fn sync_file(file: &File, path: &Path) -> Result<()> {
    file.sync_all().map_err(io(path))?;
    #[cfg(feature = "record-steps")]
    record::synced(path);
    Ok(())
}

/// Brings the names in a folder to the disk.
pub fn sync_folder(folder: &Path) -> Result<()> {
    File::open(folder).and_then(|f| f.sync_all()).map_err(io(folder))?;
    #[cfg(feature = "record-steps")]
    record::add(record::Step::Folder(folder.to_owned()));
    Ok(())
}

/// Gives a file or folder another name, in place of what has it.
pub fn rename(from: &Path, to: &Path) -> Result<()> {
    fs::rename(from, to).map_err(io(to))?;
    renamed(from, to);
    Ok(())
}

/// Notes a rename that was made otherwise.
pub(crate) fn renamed(from: &Path, to: &Path) {
    #[cfg(feature = "record-steps")]
    record::add(record::Step::Rename(from.to_owned(), to.to_owned()));
    #[cfg(not(feature = "record-steps"))]
    let _ = (from, to);
}

/// What a test saw, below one folder at a time.
#[cfg(feature = "record-steps")]
pub mod record {
    use std::path::{Path, PathBuf};
    use std::sync::Mutex;

    /// A step that was taken.
    #[derive(Clone, Debug)]
    pub enum Step {
        /// A file with the bytes that it then had.
        File(PathBuf, Vec<u8>),
        /// A folder whose entries were synced.
        Folder(PathBuf),
        /// A new name in place of an old one.
        Rename(PathBuf, PathBuf),
        /// A file that was removed.
        Remove(PathBuf),
    }

    static LOG: Mutex<Option<(PathBuf, Vec<Step>)>> = Mutex::new(None);

    /// Notes the steps below `root` from now on.
    pub fn begin(root: &Path) {
        *LOG.lock().unwrap() = Some((root.to_owned(), Vec::new()));
    }

    /// The steps since the beginning.
    pub fn end() -> Vec<Step> {
        LOG.lock().unwrap().take().map(|(_, steps)| steps).unwrap_or_default()
    }

    /// Notes that a file was synced.
    pub fn synced(path: &Path) {
        add(Step::File(path.to_owned(), Vec::new()));
    }

    /// Notes a step below the root.
    pub fn add(mut step: Step) {
        let mut log = LOG.lock().unwrap();
        let Some((root, steps)) = log.as_mut() else { return };
        let (Step::File(path, _) | Step::Folder(path) | Step::Rename(path, _) | Step::Remove(path)) = &step;
        if !path.starts_with(root) {
            return;
        }
        if let Step::File(path, bytes) = &mut step {
            *bytes = std::fs::read(path).unwrap();
        }
        steps.push(step);
    }
}
