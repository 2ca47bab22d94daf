//! The output files of one command. The files are checked and locked before the computation starts.

use std::path::{Path, PathBuf};
use std::{fs, io};

use crate::storage::lock_file::LockFile;
use crate::storage::partial_file::{parent_folder, refuse_existing};
use spikelane::error::{Error, Result, error};

/// The name in the lock file of a whole folder.
const FOLDER_LOCK: &str = "folder";

/// Output files that only this process may write until the set is dropped.
///
/// Keep the set until the last file has its final name. When the set is dropped, the folders that the set created are
/// removed if they are empty.
///
/// # Examples
/// ```
/// use spikelane::ErrorKind;
/// use spikelane_io::formats::OutputSet;
/// # let folder = tempfile::tempdir().map_err(|e| spikelane::Error::io("a folder", e))?;
/// let path = folder.path().join("run.dat");
/// let claim = OutputSet::claim([&path], false)?;
/// // As long as the claim exists, nobody else can write the file.
/// assert_eq!(OutputSet::claim([&path], false).unwrap_err().kind(), ErrorKind::Busy);
/// drop(claim);
/// # Ok::<(), spikelane::Error>(())
/// ```
#[derive(Debug)]
#[must_use = "the claim ends when the set is dropped"]
pub struct OutputSet {
    // The locks must be dropped before the folders are removed, because the lock files are in these folders.
    _locks: Vec<LockFile>,
    _folders: MadeFolders,
}

impl OutputSet {
    /// Locks `files`. The function checks that the files may be written, creates their folders, and prevents other
    /// processes from writing the files.
    ///
    /// The creation of the lock files also proves that the folders are writable.
    ///
    /// # Errors
    /// * [`ErrorKind::Exists`](spikelane::ErrorKind::Exists) if a file exists and `force` is false, or if a path is a folder, a device, a pipe or a
    ///   socket.
    /// * [`ErrorKind::Busy`](spikelane::ErrorKind::Busy) if another process writes one of the files.
    /// * [`ErrorKind::Io`](spikelane::ErrorKind::Io) if a folder is not writable. The error message contains the path of the folder.
    pub fn claim<P: AsRef<Path>>(files: impl IntoIterator<Item = P>, force: bool) -> Result<Self> {
        let mut files: Vec<PathBuf> = files.into_iter().map(|file| file.as_ref().to_path_buf()).collect();
        // All processes lock files in the same order, so two processes cannot deadlock.
        files.sort_unstable();
        files.dedup();
        files.iter().try_for_each(|file| refuse_existing(file, force))?;
        let mut folders = MadeFolders::default();
        files.iter().try_for_each(|file| folders.make(parent_folder(file)))?;
        let locks = files.iter().map(|file| lock(file, file)).collect::<Result<_>>()?;
        let set = Self { _locks: locks, _folders: folders };
        // Another process may have written a file between the first check and the lock, so the check is repeated.
        files.iter().try_for_each(|file| refuse_existing(file, force))?;
        Ok(set)
    }

    /// Creates a folder and its parents, and locks the folder. The names of the output files in the folder need not be
    /// known yet.
    ///
    /// # Errors
    /// * [`ErrorKind::Busy`](spikelane::ErrorKind::Busy) if another process has locked the folder.
    /// * [`ErrorKind::Io`](spikelane::ErrorKind::Io) if the folder is not writable.
    pub fn claim_folder(folder: &Path) -> Result<Self> {
        let mut folders = MadeFolders::default();
        folders.make(folder)?;
        let locks = vec![lock(&folder.join(FOLDER_LOCK), folder)?];
        Ok(Self { _locks: locks, _folders: folders })
    }
}

fn lock(file: &Path, claimed: &Path) -> Result<LockFile> {
    LockFile::acquire(file, claimed).map_err(|e| match e.io_error().map(std::io::Error::kind) {
        Some(io::ErrorKind::PermissionDenied | io::ErrorKind::ReadOnlyFilesystem) => {
            let found = e.parts().found.into_owned();
            unwritable_folder_error(parent_folder(file), found)
        }
        _ => e,
    })
}

fn unwritable_folder_error(folder: &Path, found: impl std::fmt::Display) -> Error {
    error!(Io, "{}", folder.display(); found "{found}"; expected "a writable folder";
        remedy "allow writing to this folder, or choose another output folder")
}

/// Folders that this process created. When this value is dropped, the empty folders are removed.
#[derive(Debug, Default)]
struct MadeFolders(Vec<PathBuf>);

impl MadeFolders {
    fn make(&mut self, folder: &Path) -> Result<()> {
        let missing: Vec<&Path> = folder
            .ancestors()
            .take_while(|f| !f.as_os_str().is_empty() && fs::symlink_metadata(f).is_err())
            .collect();
        for folder in missing.into_iter().rev() {
            match fs::create_dir(folder) {
                Ok(()) => self.0.push(folder.to_path_buf()),
                // Another process created the folder in the meantime, so this process must not remove the folder.
                Err(e) if e.kind() == io::ErrorKind::AlreadyExists => {}
                Err(e) => return Err(make_folder_error(folder, e)),
            }
        }
        match fs::metadata(folder) {
            Ok(metadata) if metadata.is_dir() => Ok(()),
            Ok(_) => Err(make_folder_error(folder, "a file with this name")),
            Err(e) => Err(make_folder_error(folder, e)),
        }
    }
}

fn make_folder_error(folder: &Path, found: impl std::fmt::Display) -> Error {
    error!(Io, "{}", folder.display(); found "{found}";
        expected "a folder, or a path where a folder can be created";
        remedy "choose another output folder, or create this folder")
}

impl Drop for MadeFolders {
    fn drop(&mut self) {
        for folder in self.0.iter().rev() {
            // `remove_dir` fails if the folder is not empty. A folder that is not empty must remain, so the error is
            // ignored.
            let _ = fs::remove_dir(folder);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use spikelane::ErrorKind;

    #[test]
    fn a_folder_that_stays_empty_is_removed_and_one_with_a_file_stays() {
        let top = tempfile::tempdir().unwrap();
        let file = top.path().join("a/b/run.dat");
        let set = OutputSet::claim([&file], false).unwrap();
        assert!(top.path().join("a/b").is_dir());
        drop(set);
        assert!(!top.path().join("a").exists());
        let set = OutputSet::claim([&file], false).unwrap();
        fs::write(&file, "done").unwrap();
        drop(set);
        assert_eq!(fs::read_dir(file.parent().unwrap()).unwrap().count(), 1);
    }

    #[test]
    fn sets_that_share_a_file_exclude_each_other_and_others_do_not() {
        let top = tempfile::tempdir().unwrap();
        let [a, b, c] = ["a.dat", "b.json", "c.dat"].map(|name| top.path().join(name));
        let outputs = OutputSet::claim([&b, &a], false).unwrap();
        assert_eq!(OutputSet::claim([&c, &b], false).unwrap_err().kind(), ErrorKind::Busy);
        let other = OutputSet::claim([&c], false).unwrap();
        drop((outputs, other));
        drop(OutputSet::claim([&b, &c], false).unwrap());
        assert_eq!(fs::read_dir(top.path()).unwrap().count(), 0);
    }

    #[test]
    fn existing_outputs_are_refused_before_a_folder_is_made() {
        let top = tempfile::tempdir().unwrap();
        let (old, new) = (top.path().join("old"), top.path().join("folder/new"));
        fs::write(&old, "mine").unwrap();
        assert_eq!(OutputSet::claim([&old, &new], false).unwrap_err().kind(), ErrorKind::Exists);
        assert!(!top.path().join("folder").exists());
        let error = OutputSet::claim([old.join("below")], true).unwrap_err();
        assert_eq!((error.kind(), &*error.subject()), (ErrorKind::Io, &*old.display().to_string()));
        assert!(OutputSet::claim([&old, &new], true).is_ok());
    }

    #[test]
    fn a_folder_is_claimed_once() {
        let top = tempfile::tempdir().unwrap();
        let folder = top.path().join("frames");
        let outputs = OutputSet::claim_folder(&folder).unwrap();
        let error = OutputSet::claim_folder(&folder).unwrap_err();
        assert_eq!((error.kind(), &*error.subject()), (ErrorKind::Busy, &*folder.display().to_string()));
        drop(outputs);
        assert!(!folder.exists());
    }
}
