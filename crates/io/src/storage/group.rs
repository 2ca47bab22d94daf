//! Groups of small files that are renamed to their final names together.

use std::io::Write as _;
use std::path::{Path, PathBuf};

use crate::storage::partial_file::{PartialFile, parent_folder, remove_stale};
use crate::storage::sync;
use spikelane::error::{Error, Result};

/// Files that are first written under hidden names and then renamed together.
///
/// If the disk is full or a stop is requested before `commit`, all existing files are unchanged.
///
/// # Examples
/// ```
/// use spikelane_io::storage::FileGroup;
/// # let folder = tempfile::tempdir().map_err(|e| spikelane::Error::io("a folder", e))?;
/// let [image, list] = ["image.bin", "list.txt"].map(|name| folder.path().join(name));
/// let mut group = FileGroup::new(false);
/// group.write(&image, &[1, 2, 3])?;
/// assert!(!image.exists());
/// group.write(&list, b"image.bin\n")?;
/// group.commit()?;
/// assert!(image.exists() && list.exists());
/// # Ok::<(), spikelane::Error>(())
/// ```
#[derive(Debug)]
pub struct FileGroup {
    force: bool,
    files: Vec<PartialFile>,
}

impl FileGroup {
    /// Creates an empty group. If `force` is true, the files of the group replace existing files.
    pub const fn new(force: bool) -> Self {
        Self { force, files: Vec::new() }
    }

    /// Writes a file under a hidden name.
    pub fn write(&mut self, path: &Path, bytes: &[u8]) -> Result<()> {
        let partial = PartialFile::create(path, self.force)?;
        partial.file().write_all(bytes).map_err(|e| Error::io(path.display(), e))?;
        self.files.push(partial);
        Ok(())
    }

    /// Renames the files to their final names in the order of the calls of `write`. If the last file exists, the group
    /// is complete.
    ///
    /// Existing files are removed before the first rename. Therefore an interruption never results in a mixture of old
    /// and new files.
    pub fn commit(self) -> Result<()> {
        self.files.iter().try_for_each(PartialFile::sync)?;
        let mut folders: Vec<_> = self.files.iter().map(|f| parent_folder(f.path()).to_path_buf()).collect();
        folders.dedup();
        if self.force {
            self.files.iter().rev().try_for_each(|file| remove_stale(file.path()))?;
        }
        let mut named: Vec<PathBuf> = Vec::new();
        for file in self.files {
            let path = file.path().to_path_buf();
            if let Err(e) = file.commit_unsynced() {
                // A partly renamed group could be mistaken for a complete group, so the renamed files are removed.
                // Errors of the removal are ignored, because the first error is returned.
                named.iter().for_each(|path| drop(remove_stale(path)));
                return Err(e);
            }
            named.push(path);
        }
        folders.iter().try_for_each(|folder| sync::sync_folder(folder))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use spikelane::error::ErrorKind;
    use std::fs;

    #[test]
    fn a_group_appears_whole_or_not_at_all() {
        let top = tempfile::tempdir().unwrap();
        let [a, b] = ["a", "b"].map(|name| top.path().join(name));
        let mut group = FileGroup::new(false);
        group.write(&a, b"1").unwrap();
        group.write(&b, b"2").unwrap();
        assert!(!a.exists() && !b.exists());
        fs::write(&b, "mine").unwrap();
        assert_eq!(group.commit().unwrap_err().kind(), ErrorKind::Exists);
        assert!(!a.exists());
        assert_eq!(fs::read(&b).unwrap(), b"mine");
        assert_eq!(fs::read_dir(top.path()).unwrap().count(), 1);
        let mut group = FileGroup::new(true);
        group.write(&a, b"1").unwrap();
        group.write(&b, b"2").unwrap();
        group.commit().unwrap();
        assert_eq!((fs::read(&a).unwrap(), fs::read(&b).unwrap()), (b"1".to_vec(), b"2".to_vec()));
    }
}
