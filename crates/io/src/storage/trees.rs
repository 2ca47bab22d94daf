//! Folders that are made, synced and removed whole, as data sets need it.

use std::fs::{self, File};
use std::path::{Path, PathBuf};

#[cfg(feature = "record-steps")]
use super::steps::record;
use super::steps::{io, sync_file, sync_folder};
use spikelane::error::Result;
use spikelane::unstable::inputs::{Access, InnerPath};
use spikelane::unstable::threads;

/// Files that are synced at a time: waits for the disk overlap, and journals take several at once.
const AT_ONCE: usize = 8;

/// Returns the path of `inner` below `root` for writing, after its parent folders were made.
///
/// # Errors
/// [`Kind::Input`](spikelane::Kind::Input) when a part of it is a link, and what the system refuses.
pub fn prepare(root: &Path, inner: &InnerPath) -> Result<PathBuf> {
    let path = inner.below(root, Access::Write)?;
    if let Some(parent) = path.parent() {
        fs::create_dir_all(parent).map_err(io(parent))?;
    }
    Ok(path)
}

/// Creates the file at `path`, in place of what has that name. A link of that name is removed and not followed.
pub fn create(path: &Path) -> Result<File> {
    remove_path(path)?;
    File::options().write(true).create_new(true).open(path).map_err(io(path))
}

/// Removes the folder `inner` below `root` with all that is in it, or a file; what is not there is no error.
///
/// A folder loses its name first, so that a kill in the middle leaves no half of it under that name.
///
/// # Errors
/// [`Kind::Input`](spikelane::Kind::Input) when a part of the path above it is a link, and what the system refuses.
pub fn remove(root: &Path, inner: &InnerPath) -> Result<()> {
    remove_path(&inner.removable_below(root)?)
}

/// Removes what `path` names itself: of a link the link.
fn remove_path(path: &Path) -> Result<()> {
    let removed = match fs::symlink_metadata(path) {
        Ok(found) if found.is_dir() => remove_folder(path),
        Ok(_) => fs::remove_file(path),
        Err(e) => Err(e),
    };
    match removed {
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(()),
        other => other.map_err(io(path))?,
    }
    #[cfg(feature = "record-steps")]
    record::add(record::Step::Remove(path.to_owned()));
    Ok(())
}

fn remove_folder(path: &Path) -> std::io::Result<()> {
    let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    if is_partial(&name) {
        return fs::remove_dir_all(path);
    }
    let hidden = path.with_file_name(format!(".{name}.old.partial"));
    match fs::symlink_metadata(&hidden) {
        Ok(found) if found.is_dir() => fs::remove_dir_all(&hidden)?,
        Ok(_) => fs::remove_file(&hidden)?,
        Err(_) => {}
    }
    fs::rename(path, &hidden)?;
    fs::remove_dir_all(&hidden)
}

/// Whether a name is of something in the making, or going.
fn is_partial(name: &str) -> bool {
    name.starts_with('.') && name.ends_with(".partial")
}

/// Removes what killed runs left in the folder `inner` below `root`, and in no folder below it: `.NAME.partial`. Whoever
/// calls it is alone there.
///
/// # Errors
/// [`Kind::Input`](spikelane::Kind::Input) when a part of the path is a link, and what the system refuses.
pub fn remove_partials_in(root: &Path, inner: &InnerPath) -> Result<()> {
    remove_partials(&inner.below(root, Access::Write)?, |_| true)
}

/// Removes what killed runs left in `folder` itself, of the names that `of` accepts.
pub fn remove_partials(folder: &Path, of: impl Fn(&str) -> bool) -> Result<()> {
    let entries = match fs::read_dir(folder) {
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(()),
        other => other.map_err(io(folder))?,
    };
    for entry in entries {
        let path = entry.map_err(io(folder))?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        if is_partial(&name) && of(&name) {
            remove_path(&path)?;
        }
    }
    Ok(())
}

/// Brings every file below a folder to the disk, and then every folder, itself the last.
pub fn sync_tree(folder: &Path) -> Result<()> {
    let (mut files, mut folders) = (Vec::new(), Vec::new());
    walk(folder, &mut files, &mut folders)?;
    let sync = |path: &PathBuf| sync_file(&File::open(path).map_err(io(path))?, path);
    threads::indexed(AT_ONCE, files.len(), |i| sync(&files[i])).into_iter().collect::<Result<()>>()?;
    folders.iter().rev().try_for_each(|f| sync_folder(f))
}

/// Files and folders below a folder; a folder comes before what is in it.
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

    /// A folder that a link leads to keeps what is in it, whichever part of the path is the link.
    #[test]
    fn removal_never_follows_a_link() {
        let top = tempfile::tempdir().unwrap();
        let (set, home) = (top.path().join("set"), top.path().join("home"));
        fs::create_dir_all(set.join("sequences")).unwrap();
        fs::create_dir_all(home.join("a")).unwrap();
        fs::write(home.join("a/.thesis.partial"), "precious").unwrap();
        symlink(home.join("a"), set.join("sequences/a")).unwrap();
        symlink(&home, set.join("train")).unwrap();
        remove(&set, &InnerPath::from("sequences/a")).unwrap();
        assert!(fs::symlink_metadata(set.join("sequences/a")).is_err(), "the link itself is gone");
        assert_eq!(remove(&set, &InnerPath::from("train/a")).unwrap_err().kind(), spikelane::Kind::Input);
        assert_eq!(
            remove_partials_in(&set, &InnerPath::from("train/a")).unwrap_err().kind(),
            spikelane::Kind::Input
        );
        symlink(home.join("a"), set.join(".b.old.partial")).unwrap();
        fs::create_dir(set.join("b")).unwrap();
        remove(&set, &InnerPath::from("b")).unwrap();
        assert_eq!(fs::read(home.join("a/.thesis.partial")).unwrap(), b"precious");
    }

    #[test]
    fn a_new_file_takes_the_place_of_a_link_and_not_of_what_it_leads_to() {
        let top = tempfile::tempdir().unwrap();
        let (mine, hidden) = (top.path().join("mine"), top.path().join(".coco.partial"));
        fs::write(&mine, "precious").unwrap();
        symlink(&mine, &hidden).unwrap();
        drop(create(&hidden).unwrap());
        assert_eq!(
            (fs::read(&mine).unwrap(), fs::read(&hidden).unwrap()),
            (b"precious".to_vec(), Vec::new())
        );
        symlink(top.path(), top.path().join("up")).unwrap();
        assert_eq!(
            prepare(top.path(), &InnerPath::from("up/new")).unwrap_err().kind(),
            spikelane::Kind::Input
        );
    }
}
