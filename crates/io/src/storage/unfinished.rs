//! Hidden files and folders that killed processes did not remove.

use std::fs;
use std::path::{Path, PathBuf};

use crate::storage::lock_file::{is_held, read_process_id};
use crate::storage::sync::io;
use spikelane::error::Result;
use spikelane::unstable::inputs::PARTIAL_ENDING;

/// A hidden file or folder of unfinished work.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UnfinishedOutput {
    /// The path of the file or folder.
    pub path: PathBuf,
    /// Number of bytes of the file, or of all files in the folder.
    pub bytes: u64,
    /// The id of the process that created the entry. `None` if neither the name nor the text of the entry contains a
    /// process id.
    pub process: Option<u32>,
    /// Whether a process is still writing the entry, or `None` if this is unknown.
    pub is_running: Option<bool>,
}

/// Returns all hidden files and folders below `folder` that unfinished runs of this program created. Links are not
/// followed.
///
/// # Errors
/// If a folder cannot be read.
pub fn find_unfinished(folder: &Path) -> Result<Vec<UnfinishedOutput>> {
    let mut unfinished = Vec::new();
    // The lock of a data set is in the top folder of the data set, which may be a parent of `folder`.
    let above = folder.canonicalize().is_ok_and(|f| f.ancestors().skip(1).any(is_claimed));
    walk(folder, above, &mut unfinished)?;
    unfinished.sort_by(|a, b| a.path.cmp(&b.path));
    Ok(unfinished)
}

/// Removes the entry unless a process is still writing the entry. Returns whether the entry was removed.
pub fn remove(unfinished: &UnfinishedOutput) -> Result<bool> {
    let path = &unfinished.path;
    if is_held(path) == Some(true) {
        return Ok(false);
    }
    let folder = fs::symlink_metadata(path).is_ok_and(|metadata| metadata.is_dir());
    let removed = if folder { fs::remove_dir_all(path) } else { fs::remove_file(path) };
    match removed {
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => Ok(false),
        other => other.map(|()| true).map_err(io(path)),
    }
}

fn walk(folder: &Path, claimed: bool, unfinished: &mut Vec<UnfinishedOutput>) -> Result<()> {
    let mut entries = Vec::new();
    for entry in fs::read_dir(folder).map_err(io(folder))? {
        let entry = entry.map_err(io(folder))?;
        let kind = entry.file_type().map_err(io(folder))?;
        entries.push((entry.path(), entry.file_name().to_string_lossy().into_owned(), kind));
    }
    let locks = |(path, name, kind): &(PathBuf, String, fs::FileType)| {
        kind.is_file() && is_lock(path, name) && is_held(path) == Some(true)
    };
    let claimed = claimed || is_claimed(folder);
    let busy = claimed || entries.iter().any(locks);
    for (path, name, kind) in entries {
        let partial = is_partial(&name) && !kind.is_symlink();
        if partial && kind.is_dir() {
            let (bytes, is_locked) = contents(&path)?;
            let running = Some(busy || is_locked);
            unfinished.push(UnfinishedOutput {
                bytes,
                process: process_id(&name),
                is_running: running,
                path,
            });
        } else if kind.is_dir() {
            walk(&path, claimed, unfinished)?;
        } else if is_partial(&name) || (kind.is_file() && is_lock(&path, &name)) {
            let bytes = fs::symlink_metadata(&path).map_or(0, |m| m.len());
            let process = process_id(&name).or_else(|| read_process_id(&path).filter(|id| *id > 0));
            // Lock files, and partial files with a number after the process id, are locked by the process that writes
            // them. For other entries, a lock on a parent folder shows that a process is still writing.
            let running = match is_held(&path) {
                Some(true) => Some(true),
                Some(false) if name.ends_with(".lock") || is_numbered(&name) => Some(false),
                Some(false) => Some(busy),
                None if kind.is_symlink() => Some(busy),
                None => None,
            };
            unfinished.push(UnfinishedOutput { path, bytes, process, is_running: running });
        }
    }
    Ok(())
}

/// Returns whether a process has locked the folder with all its content.
fn is_claimed(folder: &Path) -> bool {
    ["lock", ".folder.lock"].iter().any(|name| is_held(&folder.join(name)) == Some(true))
}

/// Returns the number of bytes of a hidden folder, and whether a process has a lock on one of the files in the folder.
fn contents(folder: &Path) -> Result<(u64, bool)> {
    let (mut bytes, mut is_locked) = (0, false);
    for entry in fs::read_dir(folder).map_err(io(folder))? {
        let entry = entry.map_err(io(folder))?;
        let kind = entry.file_type().map_err(io(folder))?;
        if kind.is_dir() {
            let (inner, inner_held) = contents(&entry.path())?;
            bytes += inner;
            is_locked |= inner_held;
        } else if kind.is_file() {
            bytes += entry.metadata().map_or(0, |m| m.len());
            is_locked |= is_held(&entry.path()) == Some(true);
        }
    }
    Ok((bytes, is_locked))
}

/// Returns whether a name has one of the forms `.NAME.PID-N.spikelane.partial`, `.NAME.PID-N.spikelane.partial.EXT`,
/// `.NAME.PID.spikelane.partial` and `.NAME.spikelane.partial`.
fn is_partial(name: &str) -> bool {
    stem(name).is_some_and(|stem| stem.len() > 1)
}

/// Returns the part of a hidden name that precedes [`PARTIAL_ENDING`].
fn stem(name: &str) -> Option<&str> {
    let (stem, ending) = name.rsplit_once(PARTIAL_ENDING)?;
    let has_partial_ending = ending.is_empty() || (ending.starts_with('.') && !ending[1..].contains('.'));
    (name.starts_with('.') && has_partial_ending).then_some(stem)
}

fn process_id(name: &str) -> Option<u32> {
    let (_, number) = stem(name)?.rsplit_once('.')?;
    number.split('-').next()?.parse().ok()
}

/// Returns whether a name has the form `.NAME.PID-N.spikelane.partial`. A file with a name of this form is locked by the
/// process that writes the file.
#[must_use]
pub fn is_numbered(name: &str) -> bool {
    let number = stem(name).and_then(|stem| stem.rsplit_once('.')).and_then(|(_, n)| n.split_once('-'));
    number.is_some_and(|(process, n)| process.parse::<u32>().is_ok() && n.parse::<u64>().is_ok())
}

fn is_lock(path: &Path, name: &str) -> bool {
    let is_empty = fs::symlink_metadata(path).is_ok_and(|m| m.len() == 0);
    // An empty file can be the lock of another program.
    name.starts_with('.') && name.ends_with(".lock") && !is_empty && read_process_id(path).is_some()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::storage::{OutputSet, partial_file::PartialFile};

    #[test]
    fn only_names_that_this_program_makes_are_unfinished() {
        for name in [
            ".a.dat.12-0.spikelane.partial",
            ".a.mp4.12-3.spikelane.partial.mp4",
            ".manifest.jsonl.12.spikelane.partial",
            ".s.spikelane.partial",
        ] {
            assert!(is_partial(name), "{name}");
        }
        for name in [
            "a.spikelane.partial",
            ".spikelane.partial",
            ".a.partial",
            ".a.12-0.partial",
            ".rsync-partial",
            ".a.spikelane.partial.tar.gz",
            ".a.partially",
            "a.dat",
        ] {
            assert!(!is_partial(name), "{name}");
        }
        assert_eq!(process_id(".a.dat.12-0.spikelane.partial"), Some(12));
        assert_eq!(process_id(".manifest.jsonl.7.spikelane.partial"), Some(7));
        assert_eq!(process_id(".scene-0001.spikelane.partial"), None);
        assert!(is_numbered(".a.dat.12-0.spikelane.partial") && !is_numbered(".a.dat.12.spikelane.partial"));
    }

    #[test]
    fn outputs_of_live_processes_are_running() {
        let top = tempfile::tempdir().unwrap();
        let at = |name: &str| top.path().join(name);
        let state = || -> Vec<(String, Option<bool>)> {
            let name = |u: &UnfinishedOutput| u.path.file_name().unwrap().to_string_lossy().into_owned();
            find_unfinished(top.path()).unwrap().iter().map(|u| (name(u), u.is_running)).collect()
        };
        fs::create_dir_all(at("set/.s.spikelane.partial")).unwrap();
        fs::write(at("set/.s.spikelane.partial/stream.dat"), [0; 10]).unwrap();
        fs::write(at(".old.dat.1-0.spikelane.partial"), "").unwrap();
        fs::write(at(".old.dat.lock"), "spikelane process 1").unwrap();
        for (name, text) in
            [(".other.lock", "of another program"), (".empty.lock", ""), (".b.dat.partial", "half")]
        {
            fs::write(at(name), text).unwrap();
        }
        fs::create_dir(at(".backup.partial")).unwrap();
        fs::write(at(".backup.partial/thesis.txt"), "mine").unwrap();
        let left = [
            (".old.dat.1-0.spikelane.partial", false),
            (".old.dat.lock", false),
            (".s.spikelane.partial", false),
        ];
        let expected = |list: &[(&str, bool)]| -> Vec<(String, Option<bool>)> {
            list.iter().map(|(name, running)| ((*name).to_owned(), Some(*running))).collect()
        };
        assert_eq!(state(), expected(&left));
        let claim = OutputSet::claim_folder(&at("set")).unwrap();
        assert!(state().contains(&(".s.spikelane.partial".to_owned(), Some(true))));
        drop(claim);
        let new = PartialFile::create(&at("new.dat"), false).unwrap();
        let running: Vec<_> = state().into_iter().filter(|(_, running)| *running == Some(true)).collect();
        assert_eq!(running.len(), 1);
        assert!(!remove(&find_unfinished(top.path()).unwrap()[0]).unwrap());
        drop(new);
        for output in find_unfinished(top.path()).unwrap() {
            assert!(remove(&output).unwrap());
        }
        assert!(state().is_empty());
        for name in [".other.lock", ".empty.lock", ".b.dat.partial", ".backup.partial/thesis.txt"] {
            assert!(at(name).exists(), "{name}");
        }
    }
}
