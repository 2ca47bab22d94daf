//! One process at a shard: a lock that the system drops with its holder.

use std::fs::{File, OpenOptions, TryLockError};
use std::io;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::time::Duration;

use spikelane::error::{Error, Kind, Result};
use spikelane::unstable::inputs::read_bytes;
use spikelane_io::storage::{has_other_names, host, open_own};

/// Somebody who asks whether a lock is held has it himself for a moment.
const TRIES: u32 = 10;
const BETWEEN: Duration = Duration::from_millis(30);

/// A lock that is held until it is dropped.
#[derive(Debug)]
pub(super) struct Lock {
    _file: File,
}

impl Lock {
    /// Takes the lock at `path` and writes there who has it.
    ///
    /// # Errors
    /// [`Kind::Busy`] with the holder when another process has it; [`Kind::Io`] where the file system has no locks.
    pub(crate) fn take(path: &Path) -> Result<Self> {
        let io = |e| Error::io(path.display(), e);
        let mut file =
            open_own(OpenOptions::new().read(true).write(true).create(true).truncate(false), path)?;
        for attempt in 1.. {
            match file.try_lock() {
                Ok(()) => break,
                Err(TryLockError::WouldBlock) if attempt < TRIES => std::thread::sleep(BETWEEN),
                Err(TryLockError::WouldBlock) => {
                    return Err(Error::new(Kind::Busy, path.display())
                        .found(format_args!("held by {}", said(path)))
                        .expected("a shard that nobody is at")
                        .remedy("let it finish; if it is gone, its lock went with it"));
                }
                Err(TryLockError::Error(e)) => return Err(without_locks(path, e)),
            }
        }
        if has_other_names(&file.metadata().map_err(io)?) {
            return Err(Error::new(Kind::Input, path.display())
                .found("a file that has other names as well")
                .expected("a lock that this program made")
                .remedy("remove this name; the file keeps the others"));
        }
        file.set_len(0).map_err(io)?;
        writeln!(file, "{} process {}", host(), std::process::id()).map_err(io)?;
        Ok(Self { _file: file })
    }
}

fn without_locks(path: &Path, e: io::Error) -> Error {
    Error::io(path.display(), e).expected("a file system with locks (flock)").remedy(
        "give --no-lock where the scheduler starts each shard once, or mount the file system with locks \
         (Lustre: -o flock)",
    )
}

/// Who holds the lock at `path`, if somebody does.
pub(super) fn holder(path: &Path) -> Option<String> {
    let file = open_own(OpenOptions::new().read(true), path).ok()?;
    match file.try_lock_shared() {
        Err(TryLockError::WouldBlock) => Some(said(path)),
        _ => None,
    }
}

/// The longest text of a lock that is shown: the name of a machine and the number of a process.
const MAX_HOLDER_BYTES: u64 = 512;

fn said(path: &Path) -> String {
    let text = read_bytes(path, "a lock", MAX_HOLDER_BYTES).unwrap_or_default();
    let text = String::from_utf8_lossy(&text);
    let text = text.trim();
    if text.is_empty() || text.chars().any(char::is_control) {
        "another process".to_owned()
    } else {
        text.to_owned()
    }
}

/// Where the lock of the shard in `folder` is.
pub(super) fn place(folder: &Path) -> PathBuf {
    folder.join("lock")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lock_is_held_by_one_and_says_by_whom() {
        let dir = tempfile::tempdir().unwrap();
        let path = place(dir.path());
        assert_eq!(holder(&path), None);
        let first = Lock::take(&path).unwrap();
        let error = Lock::take(&path).unwrap_err();
        assert_eq!(error.kind(), Kind::Busy);
        assert!(error.to_string().contains(&format!("process {}", std::process::id())), "{error}");
        assert!(holder(&path).is_some());
        drop(first);
        assert_eq!(holder(&path), None);
        Lock::take(&path).unwrap();
    }

    /// What a lock's name leads to keeps its bytes: the file of a link, the file of another name, a pipe.
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
            let error = Lock::take(&at(name)).unwrap_err();
            assert!(matches!(error.kind(), Kind::Input | Kind::Io), "{name}: {error}");
            assert_eq!(holder(&at(name)), None, "{name}");
        }
        assert_eq!(std::fs::read(&mine).unwrap(), b"precious");
        assert!(!at("nowhere").exists());
    }

    /// The seam for a file system without locks, which a test cannot mount.
    #[test]
    fn a_file_system_without_locks_is_named_with_what_to_do() {
        let error = without_locks(Path::new("lock"), rustix::io::Errno::NOLCK.into());
        assert_eq!(error.kind(), Kind::Io);
        assert!(error.to_string().contains("--no-lock"), "{error}");
    }
}
