//! Small files that belong together and appear one right after the other.

use std::io::Write as _;
use std::path::{Path, PathBuf};

use crate::storage::partial::{Partial, directory, remove_old};
use crate::storage::steps;
use spikelane::error::{Error, Result};

/// Files that are written under hidden names first and get their names together, so that a full disk or a request to
/// stop leaves all old files or all new ones.
#[derive(Debug)]
pub struct FileGroup {
    force: bool,
    files: Vec<Partial>,
}

impl FileGroup {
    /// An empty group; with `force` its files replace those of the same names.
    pub const fn new(force: bool) -> Self {
        Self { force, files: Vec::new() }
    }

    /// Writes a file under a hidden name.
    pub fn write(&mut self, path: &Path, bytes: &[u8]) -> Result<()> {
        let partial = Partial::create(path, self.force)?;
        partial.file().write_all(bytes).map_err(|e| Error::io(path.display(), e))?;
        self.files.push(partial);
        Ok(())
    }

    /// Gives the files their names, in the order in which they were written: the last one vouches for the others.
    ///
    /// Old files of those names go first, so that a kill in between leaves no old file beside new ones.
    pub fn commit(self) -> Result<()> {
        self.files.iter().try_for_each(Partial::sync)?;
        let mut folders: Vec<_> = self.files.iter().map(|f| directory(f.path()).to_path_buf()).collect();
        folders.dedup();
        if self.force {
            self.files.iter().rev().try_for_each(|file| remove_old(file.path()))?;
        }
        let mut named: Vec<PathBuf> = Vec::new();
        for file in self.files {
            let path = file.path().to_path_buf();
            if let Err(e) = file.commit_unsynced() {
                // A part of a group looks finished and is not; the first error is the one to report.
                named.iter().for_each(|path| drop(remove_old(path)));
                return Err(e);
            }
            named.push(path);
        }
        folders.iter().try_for_each(|folder| steps::sync_folder(folder))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use spikelane::error::Kind;
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
        assert_eq!(group.commit().unwrap_err().kind(), Kind::Exists);
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
