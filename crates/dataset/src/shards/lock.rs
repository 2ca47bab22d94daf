//! The lock of a shard. Only one process at a time can have the lock. The operating system releases the lock when the
//! process ends.

use std::fs::{File, OpenOptions, TryLockError};
use std::io;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::time::Duration;

use spikelane::error::{Error, ErrorKind, Result, Setting};
use spikelane::unstable::inputs::read_bytes;
use spikelane_io::storage::{has_other_links, host_name, open_no_follow};

/// A process that tests a lock acquires the lock for a moment. Therefore a failed attempt is repeated.
const MAX_LOCK_ATTEMPTS: u32 = 10;
const RETRY_INTERVAL: Duration = Duration::from_millis(30);

/// A lock that is released when this value is dropped.
#[derive(Debug)]
pub(super) struct Lock {
    _file: File,
}

impl Lock {
    /// Acquires the lock at `path`, and writes the host name and the process id to the lock file.
    ///
    /// # Errors
    /// * [`ErrorKind::Busy`] if another process has the lock. The error names the host and the process.
    /// * [`ErrorKind::Input`] if the lock file has other hard links.
    /// * [`ErrorKind::Io`] if the file system does not support locks.
    pub(crate) fn acquire(path: &Path) -> Result<Self> {
        let io = |e| Error::io(path.display(), e);
        let mut file =
            open_no_follow(OpenOptions::new().read(true).write(true).create(true).truncate(false), path)?;
        for attempt in 1.. {
            match file.try_lock() {
                Ok(()) => break,
                Err(TryLockError::WouldBlock) if attempt < MAX_LOCK_ATTEMPTS => {
                    std::thread::sleep(RETRY_INTERVAL)
                }
                Err(TryLockError::WouldBlock) => {
                    return Err(Error::new(ErrorKind::Busy, path.display())
                        .found(format_args!("a lock of {}", holder_text(path)))
                        .expected("a shard without a running process")
                        .remedy("wait until the process ends; the end of a process releases its lock"));
                }
                Err(TryLockError::Error(e)) => return Err(unsupported_error(path, e)),
            }
        }
        if has_other_links(&file.metadata().map_err(io)?) {
            return Err(Error::new(ErrorKind::Input, path.display())
                .found("a file with several names (hard links)")
                .expected("a lock file written by spikelane")
                .remedy("remove this name of the file; the other names remain"));
        }
        file.set_len(0).map_err(io)?;
        writeln!(file, "{} process {}", host_name(), std::process::id()).map_err(io)?;
        Ok(Self { _file: file })
    }
}

fn unsupported_error(path: &Path, e: io::Error) -> Error {
    Error::io(path.display(), e).expected("a file system with locks (flock)").remedy(
        format_args!("set {} if the scheduler starts each shard only once, or mount the file system with locks (Lustre: -o flock)", Setting("no_lock")),
    )
}

/// Returns the host and the process that have the lock at `path`. Returns `None` if no process has the lock.
pub(super) fn holder(path: &Path) -> Option<String> {
    let file = open_no_follow(OpenOptions::new().read(true), path).ok()?;
    match file.try_lock_shared() {
        Err(TryLockError::WouldBlock) => Some(holder_text(path)),
        _ => None,
    }
}

/// Maximum length of the text in a lock file. The text consists of a host name and a process id.
const MAX_HOLDER_BYTES: u64 = 512;

fn holder_text(path: &Path) -> String {
    let text = read_bytes(path, "a lock", MAX_HOLDER_BYTES).unwrap_or_default();
    let text = String::from_utf8_lossy(&text);
    let text = text.trim();
    if text.is_empty() || text.chars().any(char::is_control) {
        "another process".to_owned()
    } else {
        text.to_owned()
    }
}

/// Returns the path of the lock of the shard in `folder`.
pub(super) fn lock_path(folder: &Path) -> PathBuf {
    folder.join("lock")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lock_is_held_by_one_and_says_by_whom() {
        let dir = tempfile::tempdir().unwrap();
        let path = lock_path(dir.path());
        assert_eq!(holder(&path), None);
        let first = Lock::acquire(&path).unwrap();
        let error = Lock::acquire(&path).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::Busy);
        assert!(error.to_string().contains(&format!("process {}", std::process::id())), "{error}");
        assert!(holder(&path).is_some());
        drop(first);
        assert_eq!(holder(&path), None);
        Lock::acquire(&path).unwrap();
    }

    /// If the path of the lock file is the path of another file, acquiring the lock must not change this other file.
    /// The test uses links to files, a file with a second name, a folder and a pipe.
    #[test]
    fn a_lock_that_is_no_file_of_its_own_is_refused_at_once() {
        let dir = tempfile::tempdir().unwrap();
        let mine = dir.path().join("thesis.txt");
        std::fs::write(&mine, "precious").unwrap();
        let at = |name: &str| dir.path().join(name);
        std::os::unix::fs::symlink(&mine, at("link")).unwrap();
        std::os::unix::fs::symlink("nowhere", at("dangling")).unwrap();
        std::fs::hard_link(&mine, at("hard")).unwrap();
        std::fs::create_dir(at("folder")).unwrap();
        rustix::fs::mknodat(
            rustix::fs::CWD,
            at("pipe"),
            rustix::fs::FileType::Fifo,
            rustix::fs::Mode::RUSR,
            0,
        )
        .unwrap();
        for name in ["link", "dangling", "hard", "folder", "pipe"] {
            let error = Lock::acquire(&at(name)).unwrap_err();
            assert!(matches!(error.kind(), ErrorKind::Input | ErrorKind::Io), "{name}: {error}");
            assert_eq!(holder(&at(name)), None, "{name}");
        }
        assert_eq!(std::fs::read(&mine).unwrap(), b"precious");
        assert!(!at("nowhere").exists());
    }

    /// Tests the error message directly, because a test cannot mount a file system without locks.
    #[test]
    fn a_file_system_without_locks_is_named_with_what_to_do() {
        let error = unsupported_error(Path::new("lock"), rustix::io::Errno::NOLCK.into());
        assert_eq!(error.kind(), ErrorKind::Io);
        assert!(error.to_string().contains("`no_lock`"), "{error}");
    }
}
