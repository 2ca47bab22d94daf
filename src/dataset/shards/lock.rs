//! One process at a shard: a lock that the system drops with its holder.

use std::fs::{self, File, OpenOptions};
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::time::Duration;

use rustix::fs::{FlockOperation, flock};
use rustix::io::Errno;

use crate::error::{Error, Kind, Result};

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
        let options = OpenOptions::new().read(true).write(true).create(true).truncate(false).open(path);
        let mut file = options.map_err(io)?;
        for attempt in 1.. {
            match flock(&file, FlockOperation::NonBlockingLockExclusive) {
                Ok(()) => break,
                Err(Errno::INTR) => {}
                Err(Errno::WOULDBLOCK) if attempt < TRIES => std::thread::sleep(BETWEEN),
                Err(Errno::WOULDBLOCK) => {
                    return Err(Error::new(Kind::Busy, path.display())
                        .found(format_args!("held by {}", said(path)))
                        .expected("a shard that nobody is at")
                        .remedy("let it finish; if it is gone, its lock went with it"));
                }
                Err(e) => return Err(without_locks(path, e)),
            }
        }
        file.set_len(0).map_err(io)?;
        writeln!(file, "{} process {}", host(), std::process::id()).map_err(io)?;
        Ok(Self { _file: file })
    }
}

fn without_locks(path: &Path, e: Errno) -> Error {
    Error::io(path.display(), e.into()).expected("a file system with locks (flock)").remedy(
        "give --no-lock where the scheduler starts each shard once, or mount the file system with locks \
         (Lustre: -o flock)",
    )
}

/// Who holds the lock at `path`, if somebody does.
pub(super) fn holder(path: &Path) -> Option<String> {
    let file = File::open(path).ok()?;
    match flock(&file, FlockOperation::NonBlockingLockShared) {
        Err(Errno::WOULDBLOCK) => Some(said(path)),
        _ => None,
    }
}

fn said(path: &Path) -> String {
    let text = fs::read_to_string(path).unwrap_or_default();
    let text = text.trim();
    if text.is_empty() { "another process".to_owned() } else { text.to_owned() }
}

/// The name of this machine.
fn host() -> String {
    rustix::system::uname().nodename().to_string_lossy().into_owned()
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

    /// The seam for a file system without locks, which a test cannot mount.
    #[test]
    fn a_file_system_without_locks_is_named_with_what_to_do() {
        let error = without_locks(Path::new("lock"), Errno::NOLCK);
        assert_eq!(error.kind(), Kind::Io);
        assert!(error.to_string().contains("--no-lock"), "{error}");
    }
}
