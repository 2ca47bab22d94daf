//! A lock file beside an output. The lock file prevents several processes from writing the output at the same time.

use std::fs::{self, File, TryLockError};
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};
use std::time::Duration;

use super::platform::{is_same_file, set_no_follow};
use spikelane::error::{Error, Result, error};

/// Another process may lock the file briefly while that process lists unfinished outputs, so `acquire` tries several
/// times.
const MAX_ATTEMPTS: u32 = 10;
const RETRY_INTERVAL: Duration = Duration::from_millis(20);

/// An exclusive lock on the output `NAME`. The lock is a system lock on the hidden file `.NAME.lock`, and dropping
/// this value releases the lock.
///
/// The operating system releases the lock when the process ends for any reason. The lock file of a killed process does
/// not block other processes, because the next process replaces the lock file. If the file system does not support
/// locks, the output is not protected.
#[derive(Debug)]
pub(super) struct LockFile {
    /// Path of the lock file, if the file must be removed on drop.
    path: Option<PathBuf>,
    _file: Option<File>,
}

/// The first characters of the text in a lock file. The process id follows the prefix.
const PROCESS_PREFIX: &str = "spikelane process ";

impl LockFile {
    /// Acquires the lock on `output`. The folder of `output` must exist. Error messages name `claimed`, which is either
    /// `output` or a folder.
    ///
    /// # Errors
    /// * [`ErrorKind::Busy`](spikelane::ErrorKind::Busy) if another process holds the lock.
    /// * [`ErrorKind::Exists`](spikelane::ErrorKind::Exists) if the path of the lock file is occupied by an entry that is not a lock file.
    /// * Other errors of the operating system.
    pub(super) fn acquire(output: &Path, claimed: &Path) -> Result<Self> {
        let path = &*lock_path(output);
        let refused = |e| Error::io(path.display(), e);
        for attempt in 0..MAX_ATTEMPTS {
            if attempt > 0 {
                std::thread::sleep(RETRY_INTERVAL);
            }
            let (file, is_new) = match create(path) {
                Ok(file) => (file, true),
                Err(e) if e.kind() == io::ErrorKind::AlreadyExists => match open(path) {
                    Ok(file) => (file, false),
                    // The process that had the lock has just removed the lock file, so the next attempt can create it.
                    Err(e) if e.kind() == io::ErrorKind::NotFound => continue,
                    Err(e) => return Err(not_a_lock_error(path, e)),
                },
                Err(e) => return Err(refused(e)),
            };
            match file.try_lock() {
                Err(TryLockError::WouldBlock) => continue,
                // The file system does not support locks, so the output is written without a lock.
                Err(TryLockError::Error(_)) => {
                    return Ok(Self { path: is_new.then(|| path.to_path_buf()), _file: None });
                }
                Ok(()) => {}
            }
            // Only the process that has the lock removes the lock file. If `path` refers to the locked file now, `path`
            // refers to it until the lock is released. Otherwise the next attempt opens the new file.
            if !is_still_at(&file, path) {
                continue;
            }
            if !is_new {
                if read_process_id(path).is_none() {
                    return Err(not_a_lock_error(path, "a file with other content"));
                }
                // An existing lock file is never overwritten. Instead it is removed, and the next attempt creates a new
                // lock file. If the file belongs to another user and cannot be removed, the lock on the existing file
                // is used.
                if fs::remove_file(path).is_ok() {
                    continue;
                }
                return Ok(Self { path: None, _file: Some(file) });
            }
            let mut lock = Self { path: Some(path.to_path_buf()), _file: None };
            // The text is written with a single call. If the process is killed during the write, the file contains
            // either the whole text or a prefix. `read_process_id` accepts both.
            (&file)
                .write_all(format!("{PROCESS_PREFIX}{}", std::process::id()).as_bytes())
                .map_err(refused)?;
            lock._file = Some(file);
            return Ok(lock);
        }
        Err(error!(Busy, "{}", claimed.display(); found "another process that writes this output";
            expected "only one process per output";
            remedy "wait until this process ends, or choose another output"))
    }
}

impl Drop for LockFile {
    fn drop(&mut self) {
        // The lock file is removed while the lock is still held. After a release, another process could create its own
        // lock file, which this process would then remove; see `acquire`.
        if let Some(path) = &self.path {
            let _ = fs::remove_file(path);
        }
    }
}

/// Returns the path of the lock file of an output.
fn lock_path(output: &Path) -> PathBuf {
    let mut name = std::ffi::OsString::from(".");
    name.push(output.file_name().unwrap_or_default());
    name.push(".lock");
    output.with_file_name(name)
}

fn create(path: &Path) -> io::Result<File> {
    File::options().read(true).write(true).create_new(true).open(path)
}

/// Opens an existing lock file. The function does not follow links and does not block on pipes.
fn open(path: &Path) -> io::Result<File> {
    let file = set_no_follow(File::options().read(true)).open(path)?;
    if file.metadata()?.is_file() { Ok(file) } else { Err(io::ErrorKind::InvalidInput.into()) }
}

fn not_a_lock_error(path: &Path, found: impl std::fmt::Display) -> Error {
    error!(Exists, "{}", path.display(); found "{found}";
        expected "the lock file of another process, or no file";
        remedy "move the file, or choose another output")
}

/// Returns whether `path` still refers to `file`.
fn is_still_at(file: &File, path: &Path) -> bool {
    match (file.metadata(), fs::symlink_metadata(path)) {
        (Ok(opened), Ok(named)) => is_same_file(&opened, &named) != Some(false),
        _ => false,
    }
}

/// Returns the process id in a lock file. Returns `None` if the file is not a lock file.
///
/// Returns 0 if the process that created the lock file was killed before the process had written its id.
pub(super) fn read_process_id(path: &Path) -> Option<u32> {
    let small = fs::symlink_metadata(path).is_ok_and(|m| m.is_file() && m.len() < 64);
    let text = if small { fs::read_to_string(path).ok()? } else { return None };
    // If a process is killed during the write, the file contains only a prefix of the text.
    if PROCESS_PREFIX.starts_with(&text) {
        Some(0)
    } else {
        text.strip_prefix(PROCESS_PREFIX)?.trim().parse().ok()
    }
}

/// Returns whether a process has a lock on the file. Returns `None` if the file cannot be opened or if the file system
/// does not support locks.
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
    use spikelane::ErrorKind;

    #[test]
    fn one_process_holds_a_lock_and_its_file_goes_with_it() {
        let folder = tempfile::tempdir().unwrap();
        let output = folder.path().join("run.dat");
        let lock = LockFile::acquire(&output, &output).unwrap();
        assert_eq!(is_held(&lock_path(&output)), Some(true));
        assert_eq!(LockFile::acquire(&output, &output).unwrap_err().kind(), ErrorKind::Busy);
        drop(lock);
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
        LockFile::acquire(&output, &output).unwrap();
    }

    #[test]
    fn the_lock_file_of_a_killed_process_blocks_nobody_and_is_not_written_to() {
        let folder = tempfile::tempdir().unwrap();
        let output = folder.path().join("run.dat");
        for text in ["spikelane process 123456", ""] {
            let other = folder.path().join("other");
            fs::write(&other, text).unwrap();
            fs::hard_link(&other, lock_path(&output)).unwrap();
            drop(LockFile::acquire(&output, &output).unwrap());
            assert_eq!(fs::read_to_string(&other).unwrap(), text);
            assert!(!lock_path(&output).exists());
        }
    }

    #[test]
    fn a_file_of_somebody_else_in_the_place_of_a_lock_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let output = folder.path().join("run.dat");
        fs::write(lock_path(&output), "mine").unwrap();
        assert_eq!(LockFile::acquire(&output, &output).unwrap_err().kind(), ErrorKind::Exists);
        assert_eq!(fs::read(lock_path(&output)).unwrap(), b"mine");
    }

    #[test]
    fn a_truncated_lock_file_belongs_to_a_killed_process() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(".run.dat.lock");
        for (text, process) in [
            ("", Some(0)),
            ("spikelane proc", Some(0)),
            (PROCESS_PREFIX, Some(0)),
            ("spikelane process 7", Some(7)),
            ("process 7", None),
            ("mine", None),
        ] {
            fs::write(&path, text).unwrap();
            assert_eq!(read_process_id(&path), process, "{text:?}");
        }
    }

    #[cfg(unix)]
    #[test]
    fn a_link_in_the_place_of_a_lock_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let output = folder.path().join("run.dat");
        let other = folder.path().join("other");
        fs::write(&other, "mine").unwrap();
        std::os::unix::fs::symlink(&other, lock_path(&output)).unwrap();
        assert_eq!(LockFile::acquire(&output, &output).unwrap_err().kind(), ErrorKind::Exists);
        assert_eq!(fs::read(&other).unwrap(), b"mine");
    }

    /// Each of the eight threads opens the file separately, so the system treats their locks as the locks of eight
    /// processes.
    #[test]
    fn only_one_of_many_threads_holds_a_lock() {
        use std::sync::atomic::{AtomicU32, Ordering};
        let folder = tempfile::tempdir().unwrap();
        let output = folder.path().join("run.dat");
        fs::write(lock_path(&output), "spikelane process 1").unwrap();
        let (inside, acquired) = (AtomicU32::new(0), AtomicU32::new(0));
        std::thread::scope(|scope| {
            for _ in 0..8 {
                scope.spawn(|| {
                    for _ in 0..20 {
                        if let Ok(lock) = LockFile::acquire(&output, &output) {
                            assert_eq!(inside.fetch_add(1, Ordering::SeqCst), 0);
                            acquired.fetch_add(1, Ordering::SeqCst);
                            std::thread::yield_now();
                            inside.fetch_sub(1, Ordering::SeqCst);
                            drop(lock);
                        }
                    }
                });
            }
        });
        assert!(acquired.load(Ordering::SeqCst) > 0);
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
    }
}
