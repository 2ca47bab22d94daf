//! Hidden files and folders that processes left when they were killed.

use std::fs;
use std::path::{Path, PathBuf};

use crate::storage::lock::{is_held, process_in};
use crate::storage::steps::io;
use spikelane::error::Result;

/// A hidden file or folder of work that is not finished.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Unfinished {
    /// Where it lies.
    pub path: PathBuf,
    /// Its bytes, of a folder those of all files in it.
    pub bytes: u64,
    /// The process that made it, where its name or text contains the number.
    pub process: Option<u32>,
    /// Whether its process still works on it; `None` where that cannot be seen.
    pub running: Option<bool>,
}

/// Every hidden file and folder below `folder` that this program makes while it works. Links are not followed.
///
/// # Errors
/// When a folder cannot be read.
pub fn unfinished(folder: &Path) -> Result<Vec<Unfinished>> {
    let mut found = Vec::new();
    // A data set is locked in its own folder, which may lie above the one that was named.
    let above = folder.canonicalize().is_ok_and(|f| f.ancestors().skip(1).any(is_claimed));
    walk(folder, above, &mut found)?;
    found.sort_by(|a, b| a.path.cmp(&b.path));
    Ok(found)
}

/// Removes it, unless its process works on it meanwhile.
pub fn remove(unfinished: &Unfinished) -> Result<bool> {
    let path = &unfinished.path;
    if is_held(path) == Some(true) {
        return Ok(false);
    }
    let folder = fs::symlink_metadata(path).is_ok_and(|found| found.is_dir());
    let removed = if folder { fs::remove_dir_all(path) } else { fs::remove_file(path) };
    match removed {
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => Ok(false),
        other => other.map(|()| true).map_err(io(path)),
    }
}

fn walk(folder: &Path, claimed: bool, found: &mut Vec<Unfinished>) -> Result<()> {
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
            let (bytes, held) = contents(&path)?;
            let running = Some(busy || held);
            found.push(Unfinished { bytes, process: process_of(&name), running, path });
        } else if kind.is_dir() {
            walk(&path, claimed, found)?;
        } else if is_partial(&name) || (kind.is_file() && is_lock(&path, &name)) {
            let bytes = fs::symlink_metadata(&path).map_or(0, |m| m.len());
            let process = process_of(&name).or_else(|| process_in(&path).filter(|id| *id > 0));
            // Files with a number behind the process's are locked by it, and so are locks.
            let running = match is_held(&path) {
                Some(true) => Some(true),
                Some(false) if name.ends_with(".lock") || is_numbered(&name) => Some(false),
                Some(false) => Some(busy),
                None if kind.is_symlink() => Some(busy),
                None => None,
            };
            found.push(Unfinished { path, bytes, process, running });
        }
    }
    Ok(())
}

/// Whether a process has claimed the folder with all that is below it.
fn is_claimed(folder: &Path) -> bool {
    ["lock", ".folder.lock"].iter().any(|name| is_held(&folder.join(name)) == Some(true))
}

/// The bytes of a hidden folder, and whether a process holds a file of it.
fn contents(folder: &Path) -> Result<(u64, bool)> {
    let (mut bytes, mut held) = (0, false);
    for entry in fs::read_dir(folder).map_err(io(folder))? {
        let entry = entry.map_err(io(folder))?;
        let kind = entry.file_type().map_err(io(folder))?;
        if kind.is_dir() {
            let (inner, inner_held) = contents(&entry.path())?;
            bytes += inner;
            held |= inner_held;
        } else if kind.is_file() {
            bytes += entry.metadata().map_or(0, |m| m.len());
            held |= is_held(&entry.path()) == Some(true);
        }
    }
    Ok((bytes, held))
}

/// `.NAME.PID-N.partial`, the same with the ending of a video behind it, `.NAME.PID.partial`, or `.NAME.partial`.
fn is_partial(name: &str) -> bool {
    stem(name).is_some_and(|stem| stem.len() > 1)
}

/// The hidden name before `.partial`.
fn stem(name: &str) -> Option<&str> {
    let (stem, ending) = name.rsplit_once(".partial")?;
    let whole = ending.is_empty() || (ending.starts_with('.') && !ending[1..].contains('.'));
    (name.starts_with('.') && whole).then_some(stem)
}

fn process_of(name: &str) -> Option<u32> {
    let (_, number) = stem(name)?.rsplit_once('.')?;
    number.split('-').next()?.parse().ok()
}

/// Returns whether a name is that of a file in the making, with the process that makes it: `.NAME.PID-N.partial`.
#[must_use]
pub fn is_numbered(name: &str) -> bool {
    let number = stem(name).and_then(|stem| stem.rsplit_once('.')).and_then(|(_, n)| n.split_once('-'));
    number.is_some_and(|(process, n)| process.parse::<u32>().is_ok() && n.parse::<u64>().is_ok())
}

fn is_lock(path: &Path, name: &str) -> bool {
    name.starts_with('.') && name.ends_with(".lock") && process_in(path).is_some()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::storage::{OutputSet, partial::Partial};

    #[test]
    fn only_names_that_this_program_makes_are_unfinished() {
        for name in
            [".a.dat.12-0.partial", ".a.mp4.12-3.partial.mp4", ".manifest.jsonl.12.partial", ".s.partial"]
        {
            assert!(is_partial(name), "{name}");
        }
        for name in ["a.partial", ".partial", ".rsync-partial", ".a.partial.tar.gz", ".a.partially", "a.dat"]
        {
            assert!(!is_partial(name), "{name}");
        }
        assert_eq!(process_of(".a.dat.12-0.partial"), Some(12));
        assert_eq!(process_of(".manifest.jsonl.7.partial"), Some(7));
        assert_eq!(process_of(".scene-0001.partial"), None);
        assert!(is_numbered(".a.dat.12-0.partial") && !is_numbered(".a.dat.12.partial"));
    }

    #[test]
    fn what_is_at_work_runs_and_what_was_left_does_not() {
        let top = tempfile::tempdir().unwrap();
        let at = |name: &str| top.path().join(name);
        let state = || -> Vec<(String, Option<bool>)> {
            let name = |u: &Unfinished| u.path.file_name().unwrap().to_string_lossy().into_owned();
            unfinished(top.path()).unwrap().iter().map(|u| (name(u), u.running)).collect()
        };
        fs::create_dir_all(at("set/.s.partial")).unwrap();
        fs::write(at("set/.s.partial/stream.dat"), [0; 10]).unwrap();
        fs::write(at(".old.dat.1-0.partial"), "").unwrap();
        fs::write(at(".old.dat.lock"), "process 1").unwrap();
        fs::write(at(".other.lock"), "of another program").unwrap();
        let left = [(".old.dat.1-0.partial", false), (".old.dat.lock", false), (".s.partial", false)];
        let expected = |list: &[(&str, bool)]| -> Vec<(String, Option<bool>)> {
            list.iter().map(|(name, running)| ((*name).to_owned(), Some(*running))).collect()
        };
        assert_eq!(state(), expected(&left));
        let claim = OutputSet::claim_folder(&at("set")).unwrap();
        assert!(state().contains(&(".s.partial".to_owned(), Some(true))));
        drop(claim);
        let new = Partial::create(&at("new.dat"), false).unwrap();
        let running: Vec<_> = state().into_iter().filter(|(_, running)| *running == Some(true)).collect();
        assert_eq!(running.len(), 1);
        assert!(!remove(&unfinished(top.path()).unwrap()[0]).unwrap());
        drop(new);
        for found in unfinished(top.path()).unwrap() {
            assert!(remove(&found).unwrap());
        }
        assert!(state().is_empty() && at(".other.lock").exists());
    }
}
