//! Folders that are made, synced and removed whole, as data sets need it.

use std::fs::{self, File};
use std::path::{Path, PathBuf};

#[cfg(test)]
use super::steps::record;
use super::steps::{io, sync_file, sync_folder};
use crate::error::{Error, Result};

/// Files that are synced at a time: waits for the disk overlap, and journals take several at once.
const AT_ONCE: usize = 8;

/// Removes a folder with all that is in it, or a file; what is not there is no error.
///
/// A folder loses its name first, so that a kill in the middle leaves no half of it under that name.
pub(crate) fn remove(path: &Path) -> Result<()> {
    let removed = match fs::symlink_metadata(path) {
        Ok(found) if found.is_dir() => remove_folder(path),
        Ok(_) => fs::remove_file(path),
        Err(e) => Err(e),
    };
    match removed {
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(()),
        other => other.map_err(io(path))?,
    }
    #[cfg(test)]
    record::add(record::Step::Remove(path.to_owned()));
    Ok(())
}

fn remove_folder(path: &Path) -> std::io::Result<()> {
    let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    if is_partial(&name) {
        return fs::remove_dir_all(path);
    }
    let hidden = path.with_file_name(format!(".{name}.old.partial"));
    if hidden.exists() {
        fs::remove_dir_all(&hidden)?;
    }
    fs::rename(path, &hidden)?;
    fs::remove_dir_all(&hidden)
}

/// Whether a name is of something in the making, or going.
fn is_partial(name: &str) -> bool {
    name.starts_with('.') && name.ends_with(".partial")
}

/// Removes what killed runs left in a folder, and in no folder below: `.NAME.partial`. Whoever calls it is alone there.
pub(crate) fn remove_partials(folder: &Path, of: impl Fn(&str) -> bool) -> Result<()> {
    let entries = match fs::read_dir(folder) {
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(()),
        other => other.map_err(io(folder))?,
    };
    for entry in entries {
        let path = entry.map_err(io(folder))?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        if is_partial(&name) && of(&name) {
            remove(&path)?;
        }
    }
    Ok(())
}

/// Brings every file below a folder to the disk, and then every folder, itself the last.
pub(crate) fn sync_tree(folder: &Path) -> Result<()> {
    let (mut files, mut folders) = (Vec::new(), Vec::new());
    walk(folder, &mut files, &mut folders)?;
    let sync = |path: &PathBuf| sync_file(&File::open(path).map_err(io(path))?, path);
    let each = files.len().div_ceil(AT_ONCE).max(1);
    std::thread::scope(|scope| {
        let parts: Vec<_> =
            files.chunks(each).map(|part| scope.spawn(move || part.iter().try_for_each(sync))).collect();
        parts.into_iter().try_for_each(|part| {
            part.join().unwrap_or_else(|_| Err(Error::new(crate::Kind::Io, "a thread that syncs files")))
        })
    })?;
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
