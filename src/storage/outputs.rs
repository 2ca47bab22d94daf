//! The files that one command writes together: checked, and claimed, before work begins.

use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use crate::error::{Error, Kind, Result};
use crate::storage::lock::LockFile;
use crate::storage::partial::{directory, refuse_existing};

/// The name on which a process locks a folder of numbered files.
const FOLDER_LOCK: &str = "folder";

/// Outputs that belong together, which this process alone may write until the set is dropped.
///
/// Keep it until the last of the files has its name. Folders that it made are removed again if they are empty then.
#[derive(Debug)]
#[must_use = "the claim ends when the set is dropped"]
pub struct OutputSet {
    // Declared first: a lock lies in a folder.
    _locks: Vec<LockFile>,
    _folders: MadeFolders,
}

impl OutputSet {
    /// Claims `files`: refuses those that may not be written, makes their folders with all parents, and keeps other
    /// processes from writing them. A lock that can be made in a folder also shows that the folder takes files.
    ///
    /// # Errors
    /// [`Kind::Exists`] when a file exists and `force` is false, or is a folder, a device, a pipe or a socket;
    /// [`Kind::Busy`] when another process writes one of them; [`Kind::Io`] with the folder that takes no files.
    pub fn claim<P: AsRef<Path>>(files: impl IntoIterator<Item = P>, force: bool) -> Result<Self> {
        let mut files: Vec<PathBuf> = files.into_iter().map(|file| file.as_ref().to_path_buf()).collect();
        // Every process claims its files in the same order, so that two processes never each hold a file that the other needs.
        files.sort_unstable();
        files.dedup();
        files.iter().try_for_each(|file| refuse_existing(file, force))?;
        let mut folders = MadeFolders::default();
        files.iter().try_for_each(|file| folders.make(directory(file)))?;
        let locks = files.iter().map(|file| lock(file, file)).collect::<Result<_>>()?;
        let set = Self { _locks: locks, _folders: folders };
        // Another process may have finished them meanwhile.
        files.iter().try_for_each(|file| refuse_existing(file, force))?;
        Ok(set)
    }

    /// Claims a whole folder, made with all parents, for files whose names only the work will show.
    ///
    /// # Errors
    /// [`Kind::Busy`] when another process has claimed it; [`Kind::Io`] when it takes no files.
    pub(crate) fn claim_folder(folder: &Path) -> Result<Self> {
        let mut folders = MadeFolders::default();
        folders.make(folder)?;
        let locks = vec![lock(&folder.join(FOLDER_LOCK), folder)?];
        Ok(Self { _locks: locks, _folders: folders })
    }
}

fn lock(file: &Path, whole: &Path) -> Result<LockFile> {
    LockFile::take(file, whole).map_err(|e| match e.io_error().map(std::io::Error::kind) {
        Some(ErrorKind::PermissionDenied | ErrorKind::ReadOnlyFilesystem) => {
            let found = e.parts().found.to_owned();
            unwritable(directory(file), found)
        }
        _ => e,
    })
}

fn unwritable(folder: &Path, found: impl std::fmt::Display) -> Error {
    Error::new(Kind::Io, folder.display())
        .found(found)
        .expected("a folder that takes files")
        .remedy("allow writing to it, or choose another folder for the output")
}

/// Folders that were made; dropping it removes those that are empty.
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
                // Another process made it meanwhile.
                Err(e) if e.kind() == ErrorKind::AlreadyExists => {}
                Err(e) => return Err(unmade(folder, e)),
            }
        }
        match fs::metadata(folder) {
            Ok(found) if found.is_dir() => Ok(()),
            Ok(_) => Err(unmade(folder, "a file of that name")),
            Err(e) => Err(unmade(folder, e)),
        }
    }
}

fn unmade(folder: &Path, found: impl std::fmt::Display) -> Error {
    Error::new(Kind::Io, folder.display())
        .found(found)
        .expected("a folder, or a place where one can be made")
        .remedy("choose another folder for the output, or make this one")
}

impl Drop for MadeFolders {
    fn drop(&mut self) {
        for folder in self.0.iter().rev() {
            // Refused by the system when anything is in it.
            let _ = fs::remove_dir(folder);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
        let held = OutputSet::claim([&b, &a], false).unwrap();
        assert_eq!(OutputSet::claim([&c, &b], false).unwrap_err().kind(), Kind::Busy);
        let other = OutputSet::claim([&c], false).unwrap();
        drop((held, other));
        drop(OutputSet::claim([&b, &c], false).unwrap());
        assert_eq!(fs::read_dir(top.path()).unwrap().count(), 0);
    }

    #[test]
    fn what_is_there_is_refused_before_a_folder_is_made() {
        let top = tempfile::tempdir().unwrap();
        let (old, new) = (top.path().join("old"), top.path().join("folder/new"));
        fs::write(&old, "mine").unwrap();
        assert_eq!(OutputSet::claim([&old, &new], false).unwrap_err().kind(), Kind::Exists);
        assert!(!top.path().join("folder").exists());
        let error = OutputSet::claim([old.join("below")], true).unwrap_err();
        assert_eq!((error.kind(), error.subject()), (Kind::Io, &*old.display().to_string()));
        assert!(OutputSet::claim([&old, &new], true).is_ok());
    }

    #[test]
    fn a_folder_is_claimed_once() {
        let top = tempfile::tempdir().unwrap();
        let folder = top.path().join("frames");
        let held = OutputSet::claim_folder(&folder).unwrap();
        let error = OutputSet::claim_folder(&folder).unwrap_err();
        assert_eq!((error.kind(), error.subject()), (Kind::Busy, &*folder.display().to_string()));
        drop(held);
        assert!(!folder.exists());
    }
}
