//! A file under construction, and the moment it takes its name.

use std::fs::{self, File, OpenOptions};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use crate::storage::steps;
use spikelane::error::{Error, Kind, Result};

/// Tells apart the partial files of one process.
static NEXT: AtomicU64 = AtomicU64::new(0);

/// A hidden file beside its final path; dropping it removes it.
///
/// Its process holds a lock on it, by which others see that it is still being written.
#[derive(Debug)]
pub struct Partial {
    file: File,
    hidden: PathBuf,
    path: PathBuf,
    force: bool,
    committed: bool,
}

impl Partial {
    /// Creates `.NAME.PID-N.partial` beside `path`.
    pub(super) fn create(path: &Path, force: bool) -> Result<Self> {
        Self::create_ending(path, force, "")
    }

    /// As `create`, with `ending` behind the hidden name: for a program that writes the file by its
    /// name and reads its form from the ending.
    pub fn create_ending(path: &Path, force: bool, ending: &str) -> Result<Self> {
        refuse_existing(path, force)?;
        let name = path.file_name().ok_or_else(|| {
            Error::new(Kind::Usage, path.display()).found("no file name").expected("the path of a file")
        })?;
        loop {
            let n = NEXT.fetch_add(1, Ordering::Relaxed);
            let mut hidden_name = std::ffi::OsString::from(".");
            hidden_name.push(name);
            hidden_name.push(format!(".{}-{n}.partial{ending}", std::process::id()));
            let hidden = path.with_file_name(hidden_name);
            let created = OpenOptions::new().read(true).write(true).create_new(true).open(&hidden);
            match created {
                Ok(file) => {
                    // Where there are no locks the file is written all the same.
                    let _ = file.try_lock();
                    return Ok(Self { file, hidden, path: path.to_path_buf(), force, committed: false });
                }
                // Left by an earlier process of the same id: not ours to remove.
                Err(e) if e.kind() == ErrorKind::AlreadyExists => {}
                Err(e) => {
                    let error = Error::io(path.display(), e);
                    return Err(match error.kind() {
                        Kind::Io => error.expected("a directory that exists and can be written to"),
                        _ => error,
                    });
                }
            }
        }
    }

    pub(super) fn file(&self) -> &File {
        &self.file
    }

    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// The hidden path.
    pub fn hidden(&self) -> &Path {
        &self.hidden
    }

    /// Syncs the bytes, gives the file its name, and syncs the directory;
    /// returns the time all this took.
    pub fn commit(self) -> Result<Duration> {
        self.commit_replacing(&[])
    }

    /// As [`commit`](Self::commit); removes the files in `stale`, which the new one makes untrue, before it gets its name.
    pub(super) fn commit_replacing(self, stale: &[&Path]) -> Result<Duration> {
        let start = Instant::now();
        self.sync()?;
        let folder = directory(&self.path).to_owned();
        stale.iter().try_for_each(|path| remove_old(path))?;
        self.commit_unsynced()?;
        steps::sync_folder(&folder)?;
        Ok(start.elapsed())
    }

    /// Brings the bytes to the disk.
    pub(super) fn sync(&self) -> Result<()> {
        steps::sync_file(&self.file, &self.hidden).map_err(|e| e.within(self.path.display()))
    }

    /// Gives the file its name. What of it is on the disk after a power failure is the system's choice.
    pub(super) fn commit_unsynced(mut self) -> Result<()> {
        if self.force {
            // Again: since the start something else may have taken the name.
            refuse_existing(&self.path, true)?;
            steps::rename(&self.hidden, &self.path)?;
        } else {
            rename_new(&self.hidden, &self.path)?;
            steps::renamed(&self.hidden, &self.path);
        }
        self.committed = true;
        Ok(())
    }
}

impl Drop for Partial {
    fn drop(&mut self) {
        if !self.committed {
            // Nobody is left to hear of a failure here.
            let _ = fs::remove_file(&self.hidden);
        }
    }
}

/// Removes a file that new ones replace, if it is there; refuses what is no plain file.
pub(super) fn remove_old(path: &Path) -> Result<()> {
    refuse_existing(path, true)?;
    match fs::remove_file(path) {
        Err(e) if e.kind() != ErrorKind::NotFound => Err(Error::io(path.display(), e)),
        _ => Ok(()),
    }
}

/// The directory that holds `path`.
pub(super) fn directory(path: &Path) -> &Path {
    match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    }
}

fn exists(path: &Path) -> Error {
    Error::new(Kind::Exists, path.display())
        .found("a file of that name")
        .expected("a free name")
        .remedy("choose another output, or allow overwriting (--force)")
}

/// Whether a file may get the name `path`.
///
/// With `force` it may replace a plain file, or a link that leads to one or nowhere: the link itself, never its target.
pub(super) fn refuse_existing(path: &Path, force: bool) -> Result<()> {
    // Not `Path::exists`: a dangling link is somebody's too.
    let Ok(named) = fs::symlink_metadata(path) else { return Ok(()) };
    let link = named.is_symlink();
    let kind = if link { fs::metadata(path).map(|target| target.file_type()) } else { Ok(named.file_type()) };
    let what = match kind {
        // `/dev/stdout` may lead to a plain file today; it is an open file all the same.
        _ if link && leads_to_devices(path) => "an open file or a device",
        Ok(kind) if !kind.is_file() => other_than_a_file(kind),
        _ if force => return Ok(()),
        _ => return Err(exists(path)),
    };
    Err(Error::new(Kind::Exists, path.display())
        .found(if link { format!("a link to {what}") } else { what.to_owned() })
        .expected("a free name, since only plain files are ever replaced")
        .remedy("choose another output"))
}

/// Whether a link names something of `/proc` or `/dev`, other than a file in shared memory.
fn leads_to_devices(link: &Path) -> bool {
    let Ok(target) = fs::read_link(link) else { return false };
    let target = directory(link).join(target);
    let below = |folder: &str| target.starts_with(folder);
    below("/proc") || (below("/dev") && !below("/dev/shm"))
}

#[cfg(unix)]
fn other_than_a_file(kind: fs::FileType) -> &'static str {
    use std::os::unix::fs::FileTypeExt as _;
    match kind {
        k if k.is_dir() => "a directory",
        k if k.is_fifo() => "a pipe",
        k if k.is_socket() => "a socket",
        _ => "a device",
    }
}

#[cfg(not(unix))]
fn other_than_a_file(kind: fs::FileType) -> &'static str {
    if kind.is_dir() { "a directory" } else { "a device" }
}

/// Renames without ever replacing: a file that appeared under the final name
/// since the start stays, and the new one is given up.
fn rename_new(hidden: &Path, path: &Path) -> Result<()> {
    match rename_no_replace(hidden, path) {
        Ok(()) => Ok(()),
        Err(e) if e.kind() == ErrorKind::AlreadyExists => Err(exists(path)),
        // File systems without that rename (NFS, some FUSE) have links, which
        // do not replace either.
        Err(e) if matches!(e.kind(), ErrorKind::InvalidInput | ErrorKind::Unsupported) => {
            link_then_unlink(hidden, path)
        }
        Err(e) => Err(Error::io(path.display(), e)),
    }
}

#[cfg(any(target_os = "linux", target_vendor = "apple"))]
fn rename_no_replace(hidden: &Path, path: &Path) -> std::io::Result<()> {
    use rustix::fs::{CWD, RenameFlags, renameat_with};
    Ok(renameat_with(CWD, hidden, CWD, path, RenameFlags::NOREPLACE)?)
}

#[cfg(not(any(target_os = "linux", target_vendor = "apple")))]
fn rename_no_replace(_: &Path, _: &Path) -> std::io::Result<()> {
    Err(ErrorKind::Unsupported.into())
}

fn link_then_unlink(hidden: &Path, path: &Path) -> Result<()> {
    match fs::hard_link(hidden, path) {
        Ok(()) => fs::remove_file(hidden).map_err(|e| Error::io(hidden.display(), e)),
        Err(e) if e.kind() == ErrorKind::AlreadyExists => Err(exists(path)),
        Err(e) if matches!(e.kind(), ErrorKind::PermissionDenied | ErrorKind::Unsupported) => {
            look_then_rename(hidden, path)
        }
        Err(e) => Err(Error::io(path.display(), e)),
    }
}

/// For file systems that can neither (exFAT): a look and a rename, one process at a time. A program that is not this one
/// and makes the same name between the two loses its file.
fn look_then_rename(hidden: &Path, path: &Path) -> Result<()> {
    let io = |e| Error::io(path.display(), e);
    let folder = File::open(directory(path)).map_err(io)?;
    lock(&folder).map_err(io)?;
    refuse_existing(path, false)?;
    fs::rename(hidden, path).map_err(io)
}

/// Waits for the lock of a folder, which goes with `folder`; where there are no locks, there is none.
#[cfg(unix)]
fn lock(folder: &File) -> std::io::Result<()> {
    let no_locks = Some(rustix::io::Errno::NOLCK.raw_os_error());
    loop {
        match folder.lock() {
            Err(e) if e.kind() == ErrorKind::Interrupted => {}
            Err(e) if e.kind() == ErrorKind::Unsupported || e.raw_os_error() == no_locks => return Ok(()),
            other => return other,
        }
    }
}

#[cfg(not(unix))]
fn lock(_: &File) -> std::io::Result<()> {
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_link_fallback_never_replaces_a_file() {
        let dir = tempfile::tempdir().unwrap();
        let (hidden, path) = (dir.path().join(".new"), dir.path().join("old"));
        fs::write(&hidden, "new").unwrap();
        fs::write(&path, "old").unwrap();
        assert_eq!(link_then_unlink(&hidden, &path).unwrap_err().kind(), Kind::Exists);
        assert_eq!(fs::read(&path).unwrap(), b"old");
        fs::remove_file(&path).unwrap();
        link_then_unlink(&hidden, &path).unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"new");
        assert!(!hidden.exists());
    }

    #[test]
    fn without_links_either_a_file_that_is_there_stays() {
        let dir = tempfile::tempdir().unwrap();
        let (hidden, path) = (dir.path().join(".new"), dir.path().join("old"));
        fs::write(&hidden, "new").unwrap();
        fs::write(&path, "old").unwrap();
        assert_eq!(look_then_rename(&hidden, &path).unwrap_err().kind(), Kind::Exists);
        assert_eq!(
            (fs::read(&path).unwrap(), fs::read(&hidden).unwrap()),
            (b"old".to_vec(), b"new".to_vec())
        );
        fs::remove_file(&path).unwrap();
        look_then_rename(&hidden, &path).unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"new");
        assert!(!hidden.exists());
    }

    #[cfg(unix)]
    #[test]
    fn a_link_is_replaced_itself_and_what_is_no_file_never_is() {
        use std::os::unix::fs::symlink;
        let dir = tempfile::tempdir().unwrap();
        let at = |name: &str| dir.path().join(name);
        fs::write(at("target"), "mine").unwrap();
        fs::create_dir(at("folder")).unwrap();
        let _socket = std::os::unix::net::UnixListener::bind(at("socket")).unwrap();
        for (link, target) in [
            ("file", "target"),
            ("nowhere", "missing"),
            ("to-folder", "folder"),
            ("to-device", "/dev/null"),
            ("to-open", "/proc/self/fd/1"),
        ] {
            symlink(target, at(link)).unwrap();
        }
        for name in ["file", "nowhere"] {
            assert_eq!(refuse_existing(&at(name), false).unwrap_err().kind(), Kind::Exists, "{name}");
            Partial::create(&at(name), true).unwrap().commit().unwrap();
            assert!(fs::symlink_metadata(at(name)).unwrap().is_file(), "{name}");
        }
        assert_eq!(fs::read(at("target")).unwrap(), b"mine");
        for name in ["folder", "socket", "to-folder", "to-device", "to-open"] {
            let before = fs::symlink_metadata(at(name)).unwrap().file_type();
            assert_eq!(Partial::create(&at(name), true).unwrap_err().kind(), Kind::Exists, "{name}");
            assert_eq!(fs::symlink_metadata(at(name)).unwrap().file_type(), before, "{name}");
        }
    }

    #[cfg(unix)]
    #[test]
    fn what_takes_the_name_meanwhile_is_replaced_only_if_it_is_a_file() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("name");
        let partial = Partial::create(&path, true).unwrap();
        let _socket = std::os::unix::net::UnixListener::bind(&path).unwrap();
        assert_eq!(partial.commit().unwrap_err().kind(), Kind::Exists);
        assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 1);
    }

    /// Eight that see a free name at once: one gets it, and no file is lost.
    #[test]
    fn without_links_one_of_many_threads_gets_the_name() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("name");
        let won = std::thread::scope(|scope| {
            let all: Vec<_> = (0..8)
                .map(|k| {
                    let (hidden, path) = (dir.path().join(format!(".{k}")), &path);
                    fs::write(&hidden, k.to_string()).unwrap();
                    scope.spawn(move || look_then_rename(&hidden, path).is_ok())
                })
                .collect();
            all.into_iter().map(|t| t.join().unwrap()).filter(|won| *won).count()
        });
        assert_eq!((won, fs::read_dir(dir.path()).unwrap().count()), (1, 8));
    }
}
