//! A lock file beside an output, which lets one process at a time write it.

use std::fs::{self, File, TryLockError};
use std::io::{self, ErrorKind, Write as _};
use std::path::{Path, PathBuf};
use std::time::Duration;

use super::platform::{same_file, without_links};
use spikelane::error::{Error, Kind, Result};

/// A process that lists locks holds each of them for a moment.
const TRIES: u32 = 10;
const BETWEEN: Duration = Duration::from_millis(20);

/// The lock on `NAME`, held until it is dropped: the hidden file `.NAME.lock` under a lock of the system.
///
/// The system releases the lock when its process ends, however it ends. The file of a killed process blocks
/// nobody: the next process replaces it. A file system without locks gives no protection.
#[derive(Debug)]
pub(super) struct LockFile {
    /// What to remove in the end.
    path: Option<PathBuf>,
    _file: Option<File>,
}

/// How the text of a lock file begins; the number of the process follows.
const TEXT: &str = "process ";

impl LockFile {
    /// Takes the lock on the output `output`, whose folder has to exist. Errors name `whole`, what is locked as a whole: the
    /// output itself, or a folder.
    ///
    /// # Errors
    /// [`Kind::Busy`] when another process holds it; [`Kind::Exists`] when something that is no file has the
    /// name of the lock file; what the operating system refuses.
    pub(super) fn take(output: &Path, whole: &Path) -> Result<Self> {
        let path = &*place(output);
        let refused = |e| Error::io(path.display(), e);
        for attempt in 0..TRIES {
            if attempt > 0 {
                std::thread::sleep(BETWEEN);
            }
            let (file, fresh) = match create(path) {
                Ok(file) => (file, true),
                Err(e) if e.kind() == ErrorKind::AlreadyExists => match open(path) {
                    Ok(file) => (file, false),
                    // Its holder has just removed it.
                    Err(e) if e.kind() == ErrorKind::NotFound => continue,
                    Err(e) => return Err(not_a_lock(path, e)),
                },
                Err(e) => return Err(refused(e)),
            };
            match file.try_lock() {
                Err(TryLockError::WouldBlock) => continue,
                // No locks here.
                Err(TryLockError::Error(_)) => {
                    return Ok(Self { path: fresh.then(|| path.to_path_buf()), _file: None });
                }
                Ok(()) => {}
            }
            // Whoever removes the file holds its lock, so that the name is ours from here on, or was not any more.
            if !is_at(&file, path) {
                continue;
            }
            if !fresh {
                if process_in(path).is_none() {
                    return Err(not_a_lock(path, "a file of other content"));
                }
                // It is replaced, never written to. One that belongs to somebody else may stay, and then serves as it is.
                if fs::remove_file(path).is_ok() {
                    continue;
                }
                return Ok(Self { path: None, _file: Some(file) });
            }
            let mut lock = Self { path: Some(path.to_path_buf()), _file: None };
            // In one call, so that a process that is killed leaves all of it or nothing.
            (&file).write_all(format!("{TEXT}{}", std::process::id()).as_bytes()).map_err(refused)?;
            lock._file = Some(file);
            return Ok(lock);
        }
        Err(Error::new(Kind::Busy, whole.display())
            .found("another process that writes it")
            .expected("one process at a time")
            .remedy("let it finish, or choose another output"))
    }
}

impl Drop for LockFile {
    fn drop(&mut self) {
        // Removed before the lock is released, see `take`.
        if let Some(path) = &self.path {
            let _ = fs::remove_file(path);
        }
    }
}

/// Where the lock of an output lies.
fn place(output: &Path) -> PathBuf {
    let mut name = std::ffi::OsString::from(".");
    name.push(output.file_name().unwrap_or_default());
    name.push(".lock");
    output.with_file_name(name)
}

fn create(path: &Path) -> io::Result<File> {
    File::options().read(true).write(true).create_new(true).open(path)
}

/// Opens a lock file that is there: never through a link, and without waiting for a pipe.
fn open(path: &Path) -> io::Result<File> {
    let file = without_links(File::options().read(true)).open(path)?;
    if file.metadata()?.is_file() { Ok(file) } else { Err(ErrorKind::InvalidInput.into()) }
}

fn not_a_lock(path: &Path, found: impl std::fmt::Display) -> Error {
    Error::new(Kind::Exists, path.display())
        .found(found)
        .expected("the lock file that another process left, or no file")
        .remedy("move it away, or choose another output")
}

/// Whether the name still belongs to this file.
fn is_at(file: &File, path: &Path) -> bool {
    match (file.metadata(), fs::symlink_metadata(path)) {
        (Ok(own), Ok(named)) => same_file(&own, &named) != Some(false),
        _ => false,
    }
}

/// Returns the process that a lock file names, zero where that process was killed before it had written its number, and
/// `None` for any other file.
pub(super) fn process_in(path: &Path) -> Option<u32> {
    let small = fs::symlink_metadata(path).is_ok_and(|m| m.is_file() && m.len() < 64);
    let text = if small { fs::read_to_string(path).ok()? } else { return None };
    // A killed process can have left the beginning of the text.
    if TEXT.starts_with(&text) { Some(0) } else { text.strip_prefix(TEXT)?.trim().parse().ok() }
}

/// Whether a process holds a lock on the file; `None` where the file cannot be opened, or has no locks.
pub(super) fn is_held(path: &Path) -> Option<bool> {
    match open(path).ok()?.try_lock_shared() {
        Ok(()) => Some(false),
        Err(TryLockError::WouldBlock) => Some(true),
        Err(TryLockError::Error(_)) => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_process_holds_a_lock_and_its_file_goes_with_it() {
        let folder = tempfile::tempdir().unwrap();
        let output = folder.path().join("run.dat");
        let held = LockFile::take(&output, &output).unwrap();
        assert_eq!(is_held(&place(&output)), Some(true));
        assert_eq!(LockFile::take(&output, &output).unwrap_err().kind(), Kind::Busy);
        drop(held);
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
        LockFile::take(&output, &output).unwrap();
    }

    #[test]
    fn the_lock_file_of_a_killed_process_blocks_nobody_and_is_not_written_to() {
        let folder = tempfile::tempdir().unwrap();
        let output = folder.path().join("run.dat");
        for text in ["process 123456", ""] {
            let other = folder.path().join("other");
            fs::write(&other, text).unwrap();
            fs::hard_link(&other, place(&output)).unwrap();
            drop(LockFile::take(&output, &output).unwrap());
            assert_eq!(fs::read_to_string(&other).unwrap(), text);
            assert!(!place(&output).exists());
        }
    }

    #[test]
    fn a_file_of_somebody_else_in_the_place_of_a_lock_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let output = folder.path().join("run.dat");
        fs::write(place(&output), "mine").unwrap();
        assert_eq!(LockFile::take(&output, &output).unwrap_err().kind(), Kind::Exists);
        assert_eq!(fs::read(place(&output)).unwrap(), b"mine");
    }

    #[test]
    fn a_lock_whose_text_is_not_whole_is_that_of_a_killed_process() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(".run.dat.lock");
        for (text, process) in
            [("", Some(0)), ("proc", Some(0)), (TEXT, Some(0)), ("process 7", Some(7)), ("mine", None)]
        {
            fs::write(&path, text).unwrap();
            assert_eq!(process_in(&path), process, "{text:?}");
        }
    }

    #[cfg(unix)]
    #[test]
    fn a_link_in_the_place_of_a_lock_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let output = folder.path().join("run.dat");
        let other = folder.path().join("other");
        fs::write(&other, "mine").unwrap();
        std::os::unix::fs::symlink(&other, place(&output)).unwrap();
        assert_eq!(LockFile::take(&output, &output).unwrap_err().kind(), Kind::Exists);
        assert_eq!(fs::read(&other).unwrap(), b"mine");
    }

    /// Eight threads open files of their own, as processes do.
    #[test]
    fn of_many_that_want_a_lock_at_once_one_has_it_at_a_time() {
        use std::sync::atomic::{AtomicU32, Ordering};
        let folder = tempfile::tempdir().unwrap();
        let output = folder.path().join("run.dat");
        fs::write(place(&output), "process 1").unwrap();
        let (inside, taken) = (AtomicU32::new(0), AtomicU32::new(0));
        std::thread::scope(|scope| {
            for _ in 0..8 {
                scope.spawn(|| {
                    for _ in 0..20 {
                        if let Ok(lock) = LockFile::take(&output, &output) {
                            assert_eq!(inside.fetch_add(1, Ordering::SeqCst), 0);
                            taken.fetch_add(1, Ordering::SeqCst);
                            std::thread::yield_now();
                            inside.fetch_sub(1, Ordering::SeqCst);
                            drop(lock);
                        }
                    }
                });
            }
        });
        assert!(taken.load(Ordering::SeqCst) > 0);
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
    }
}
