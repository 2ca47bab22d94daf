//! Creates, syncs and removes whole folders. Data sets consist of such folders.

use std::fs::{self, File};
use std::path::{Path, PathBuf};

#[cfg(feature = "record-steps")]
use super::sync::record;
use super::sync::{io, sync_file, sync_folder};
use spikelane::error::Result;
use spikelane::unstable::inputs::{Access, InnerPath, PARTIAL_ENDING};
use spikelane::unstable::threads;

/// Maximum number of files that are synced concurrently. Concurrent syncs wait for the disk at the same time. In
/// addition, the journal of the file system can commit several files at once.
const MAX_CONCURRENT_SYNCS: usize = 8;

/// Creates the parent folders of `inner` below `root`. Returns the path at which `inner` can be written, `root`
/// joined with `inner`.
///
/// # Errors
/// [`ErrorKind::Input`](spikelane::ErrorKind::Input) if a part of the path is a link. Also errors of the operating
/// system.
pub fn create_parents(root: &Path, inner: &InnerPath) -> Result<PathBuf> {
    let path = inner.resolve_in(root, Access::Write)?;
    if let Some(parent) = path.parent() {
        fs::create_dir_all(parent).map_err(io(parent))?;
    }
    Ok(path)
}

/// Creates the file at `path` and replaces an existing entry. If `path` is a link, the link is removed and its target
/// is unchanged.
pub fn create(path: &Path) -> Result<File> {
    remove_path(path)?;
    File::options().write(true).create_new(true).open(path).map_err(io(path))
}

/// Removes the file or folder `inner` below `root`. A folder is removed with its content. It is not an error if the
/// entry does not exist.
///
/// A folder is renamed before its content is removed. If the removal is interrupted, no partial folder has the
/// original name.
///
/// # Errors
/// [`ErrorKind::Input`](spikelane::ErrorKind::Input) if a parent folder in the path is a link. Also errors of the
/// operating system.
pub fn remove(root: &Path, inner: &InnerPath) -> Result<()> {
    remove_path(&inner.resolve_for_removal(root)?)
}

/// Removes the entry at `path`. If the entry is a link, the link is removed and its target is unchanged.
fn remove_path(path: &Path) -> Result<()> {
    let removed = match fs::symlink_metadata(path) {
        Ok(metadata) if metadata.is_dir() => remove_folder(path),
        Ok(_) => fs::remove_file(path),
        Err(e) => Err(e),
    };
    match removed {
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(()),
        other => other.map_err(io(path))?,
    }
    #[cfg(feature = "record-steps")]
    record::record_step(record::Step::Remove(path.to_owned()));
    Ok(())
}

fn remove_folder(path: &Path) -> std::io::Result<()> {
    let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    if is_partial(&name) {
        return fs::remove_dir_all(path);
    }
    let hidden = path.with_file_name(format!(".{name}.old{PARTIAL_ENDING}"));
    match fs::symlink_metadata(&hidden) {
        Ok(metadata) if metadata.is_dir() => fs::remove_dir_all(&hidden)?,
        Ok(_) => fs::remove_file(&hidden)?,
        Err(_) => {}
    }
    fs::rename(path, &hidden)?;
    fs::remove_dir_all(&hidden)
}

/// Returns whether an entry with this name is being written or removed.
fn is_partial(name: &str) -> bool {
    name.starts_with('.') && name.ends_with(PARTIAL_ENDING)
}

/// Removes entries with names `.NAME.spikelane.partial` directly in the folder `inner` below `root`. These entries remain if a
/// process is killed. Subfolders are not searched.
///
/// No other process may write to this folder at the same time.
///
/// # Errors
/// [`ErrorKind::Input`](spikelane::ErrorKind::Input) if a part of the path is a link. Also errors of the operating
/// system.
pub fn remove_partials_in(root: &Path, inner: &InnerPath) -> Result<()> {
    remove_partials(&inner.resolve_in(root, Access::Write)?, |_| true)
}

/// Removes the partial entries directly in `folder` for whose names `accepts` returns true.
pub fn remove_partials(folder: &Path, accepts: impl Fn(&str) -> bool) -> Result<()> {
    let entries = match fs::read_dir(folder) {
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(()),
        other => other.map_err(io(folder))?,
    };
    for entry in entries {
        let path = entry.map_err(io(folder))?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        if is_partial(&name) && accepts(&name) {
            remove_path(&path)?;
        }
    }
    Ok(())
}

/// Syncs all files below `folder`, then all subfolders, and finally `folder` itself.
pub fn sync_tree(folder: &Path) -> Result<()> {
    let (mut files, mut folders) = (Vec::new(), Vec::new());
    walk(folder, &mut files, &mut folders)?;
    let sync = |path: &PathBuf| sync_file(&File::open(path).map_err(io(path))?, path);
    threads::map_indexed(MAX_CONCURRENT_SYNCS, files.len(), |i| sync(&files[i]))
        .into_iter()
        .collect::<Result<()>>()?;
    folders.iter().rev().try_for_each(|f| sync_folder(f))
}

/// Appends the files and folders below `folder` to the lists. Each folder precedes its content.
fn walk(folder: &Path, files: &mut Vec<PathBuf>, folders: &mut Vec<PathBuf>) -> Result<()> {
    folders.push(folder.to_owned());
    for entry in fs::read_dir(folder).map_err(io(folder))? {
        let entry = entry.map_err(io(folder))?;
        if entry.file_type().map_err(io(folder))?.is_dir() {
            walk(&entry.path(), files, folders)?;
        } else {
            files.push(entry.path());
        }
    }
    Ok(())
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;
    use std::os::unix::fs::symlink;

    /// The test puts a link at each position of a path. In every case, the content of the link's target must remain.
    #[test]
    fn removal_never_follows_a_link() {
        let top = tempfile::tempdir().unwrap();
        let (set, home) = (top.path().join("set"), top.path().join("home"));
        fs::create_dir_all(set.join("sequences")).unwrap();
        fs::create_dir_all(home.join("a")).unwrap();
        fs::write(home.join("a/.thesis.spikelane.partial"), "precious").unwrap();
        symlink(home.join("a"), set.join("sequences/a")).unwrap();
        symlink(&home, set.join("train")).unwrap();
        remove(&set, &InnerPath::from("sequences/a")).unwrap();
        assert!(fs::symlink_metadata(set.join("sequences/a")).is_err(), "the link itself is removed");
        assert_eq!(
            remove(&set, &InnerPath::from("train/a")).unwrap_err().kind(),
            spikelane::ErrorKind::Input
        );
        assert_eq!(
            remove_partials_in(&set, &InnerPath::from("train/a")).unwrap_err().kind(),
            spikelane::ErrorKind::Input
        );
        symlink(home.join("a"), set.join(".b.old.spikelane.partial")).unwrap();
        fs::create_dir(set.join("b")).unwrap();
        remove(&set, &InnerPath::from("b")).unwrap();
        assert_eq!(fs::read(home.join("a/.thesis.spikelane.partial")).unwrap(), b"precious");
    }

    #[test]
    fn a_new_file_takes_the_place_of_a_link_and_not_of_what_it_leads_to() {
        let top = tempfile::tempdir().unwrap();
        let (mine, hidden) = (top.path().join("mine"), top.path().join(".coco.spikelane.partial"));
        fs::write(&mine, "precious").unwrap();
        symlink(&mine, &hidden).unwrap();
        drop(create(&hidden).unwrap());
        assert_eq!(
            (fs::read(&mine).unwrap(), fs::read(&hidden).unwrap()),
            (b"precious".to_vec(), Vec::new())
        );
        symlink(top.path(), top.path().join("up")).unwrap();
        assert_eq!(
            create_parents(top.path(), &InnerPath::from("up/new")).unwrap_err().kind(),
            spikelane::ErrorKind::Input
        );
    }
}
