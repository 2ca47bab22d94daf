//! A file that is written under a hidden name and then renamed to its final name.

use std::fs::{self, File, OpenOptions};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use crate::storage::platform::set_private;
use crate::storage::sync;
use spikelane::error::{Error, ErrorKind, Result, Setting, error};
use spikelane::unstable::inputs::PARTIAL_ENDING;

/// Number of the next partial file. The number distinguishes the partial files of one process.
static NEXT_FILE_NUMBER: AtomicU64 = AtomicU64::new(0);

/// A hidden file beside its final path. If this value is dropped before `commit`, the hidden file is removed.
///
/// The process that writes the file has a lock on the file. The lock shows other processes that the file is still
/// being written.
#[derive(Debug)]
pub struct PartialFile {
    file: File,
    hidden_path: PathBuf,
    path: PathBuf,
    force: bool,
    is_committed: bool,
}

impl PartialFile {
    /// Creates the hidden file `.NAME.PID-N.spikelane.partial` beside `path`.
    pub(super) fn create(path: &Path, force: bool) -> Result<Self> {
        Self::create_with_suffix(path, force, "")
    }

    /// Creates the hidden file as [`create`](Self::create) does. Other users cannot open the file.
    pub(super) fn create_private(path: &Path, force: bool) -> Result<Self> {
        Self::create_with_options(path, force, "", set_private(&mut OpenOptions::new()))
    }

    /// Creates the hidden file `.NAME.PID-N.spikelane.partial` beside `path`, with `ending` appended to the name. External
    /// programs that write the file determine the file format from this ending.
    pub fn create_with_suffix(path: &Path, force: bool, ending: &str) -> Result<Self> {
        Self::create_with_options(path, force, ending, &mut OpenOptions::new())
    }

    fn create_with_options(
        path: &Path,
        force: bool,
        ending: &str,
        options: &mut OpenOptions,
    ) -> Result<Self> {
        refuse_existing(path, force)?;
        let name = path.file_name().ok_or_else(
            || error!(Usage, "{}", path.display(); found "no file name"; expected "the path of a file"),
        )?;
        loop {
            let n = NEXT_FILE_NUMBER.fetch_add(1, Ordering::Relaxed);
            let mut hidden_name = std::ffi::OsString::from(".");
            hidden_name.push(name);
            hidden_name.push(format!(".{}-{n}{PARTIAL_ENDING}{ending}", std::process::id()));
            let hidden = path.with_file_name(hidden_name);
            let created = options.read(true).write(true).create_new(true).open(&hidden);
            match created {
                Ok(file) => {
                    // An error is ignored, because some file systems do not support locks.
                    let _ = file.try_lock();
                    return Ok(Self {
                        file,
                        hidden_path: hidden,
                        path: path.to_path_buf(),
                        force,
                        is_committed: false,
                    });
                }
                // An earlier process with the same id created this file. The file is not removed, and the next number
                // is tried.
                Err(e) if e.kind() == io::ErrorKind::AlreadyExists => {}
                Err(e) => {
                    let error = Error::io(path.display(), e);
                    return Err(match error.kind() {
                        ErrorKind::Io => error.expected("an existing, writable folder"),
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

    /// Returns the path of the hidden file.
    pub fn hidden_path(&self) -> &Path {
        &self.hidden_path
    }

    /// Syncs the file, renames the file to its final name and syncs the folder. Returns the elapsed time.
    pub fn commit(self) -> Result<Duration> {
        self.commit_replacing(&[])
    }

    /// Commits the file as [`commit`](Self::commit) does, but removes the files in `stale` before the rename. The new
    /// file invalidates the files in `stale`.
    pub(super) fn commit_replacing(self, stale: &[&Path]) -> Result<Duration> {
        let start = Instant::now();
        self.sync()?;
        let folder = parent_folder(&self.path).to_owned();
        stale.iter().try_for_each(|path| remove_stale(path))?;
        self.commit_unsynced()?;
        sync::sync_folder(&folder)?;
        Ok(start.elapsed())
    }

    /// Syncs the bytes of the file.
    pub(super) fn sync(&self) -> Result<()> {
        sync::sync_file(&self.file, &self.hidden_path).map_err(|e| e.with_context(self.path.display()))
    }

    /// Renames the file to its final name. If the file was not synced, its content after a power failure is undefined.
    pub(super) fn commit_unsynced(mut self) -> Result<()> {
        if self.force {
            // Another process may have created an entry at this path since `create`, so the check is repeated.
            refuse_existing(&self.path, true)?;
            sync::rename(&self.hidden_path, &self.path)?;
        } else {
            rename_new(&self.hidden_path, &self.path)?;
            sync::record_rename(&self.hidden_path, &self.path);
        }
        self.is_committed = true;
        Ok(())
    }
}

impl Drop for PartialFile {
    fn drop(&mut self) {
        if !self.is_committed {
            // `drop` cannot report an error, so errors are ignored.
            let _ = fs::remove_file(&self.hidden_path);
        }
    }
}

/// Removes a file that new files replace. It is not an error if the file does not exist. Entries that are not regular
/// files are rejected.
pub(super) fn remove_stale(path: &Path) -> Result<()> {
    refuse_existing(path, true)?;
    match fs::remove_file(path) {
        Err(e) if e.kind() != io::ErrorKind::NotFound => Err(Error::io(path.display(), e)),
        _ => Ok(()),
    }
}

/// Returns the folder of `path`.
pub(super) fn parent_folder(path: &Path) -> &Path {
    match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    }
}

fn exists_error(path: &Path) -> Error {
    error!(Exists, "{}", path.display(); found "an existing file"; expected "a path that does not exist";
        remedy "choose another path, or set {} to replace the file", Setting("force"))
}

/// Checks that a file may be created at `path`.
///
/// If `force` is true, the new file may replace a regular file, a link to a regular file, or a link without a target.
/// For a link, the link is replaced and its target is unchanged.
pub(super) fn refuse_existing(path: &Path, force: bool) -> Result<()> {
    // `Path::exists` would return false for a link without a target, so the metadata of the link itself are read.
    let Ok(named) = fs::symlink_metadata(path) else { return Ok(()) };
    let link = named.is_symlink();
    let kind = if link { fs::metadata(path).map(|target| target.file_type()) } else { Ok(named.file_type()) };
    let what = match kind {
        // `/dev/stdout` can be a link to a regular file. That file is open and must not be replaced.
        _ if link && points_to_device(path) => "an open file or a device",
        Ok(kind) if !kind.is_file() => file_type_name(kind),
        _ if force => return Ok(()),
        _ => return Err(exists_error(path)),
    };
    Err(error!(Exists, "{}", path.display();
        found "{}", if link { format!("a link to {what}") } else { what.to_owned() };
        expected "a path that does not exist, because only plain files are replaced";
        remedy "choose another path"))
}

/// Returns whether the target of a link is in `/proc` or `/dev`. `/dev/shm` does not count.
fn points_to_device(link: &Path) -> bool {
    let Ok(target) = fs::read_link(link) else { return false };
    let target = parent_folder(link).join(target);
    let below = |folder: &str| target.starts_with(folder);
    below("/proc") || (below("/dev") && !below("/dev/shm"))
}

#[cfg(unix)]
fn file_type_name(kind: fs::FileType) -> &'static str {
    use std::os::unix::fs::FileTypeExt as _;
    match kind {
        k if k.is_dir() => "a directory",
        k if k.is_fifo() => "a pipe",
        k if k.is_socket() => "a socket",
        _ => "a device",
    }
}

#[cfg(not(unix))]
fn file_type_name(kind: fs::FileType) -> &'static str {
    if kind.is_dir() { "a directory" } else { "a device" }
}

/// Renames `hidden` to `path` without replacing an existing entry. If another process created a file at `path` since
/// `create`, that file is unchanged and the rename fails.
fn rename_new(hidden: &Path, path: &Path) -> Result<()> {
    match rename_no_replace(hidden, path) {
        Ok(()) => Ok(()),
        Err(e) if e.kind() == io::ErrorKind::AlreadyExists => Err(exists_error(path)),
        // File systems that cannot rename without replacing (NFS, some FUSE) support hard links. The creation of a hard
        // link does not replace an existing entry either.
        Err(e) if matches!(e.kind(), io::ErrorKind::InvalidInput | io::ErrorKind::Unsupported) => {
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
    Err(io::ErrorKind::Unsupported.into())
}

fn link_then_unlink(hidden: &Path, path: &Path) -> Result<()> {
    match fs::hard_link(hidden, path) {
        Ok(()) => fs::remove_file(hidden).map_err(|e| Error::io(hidden.display(), e)),
        Err(e) if e.kind() == io::ErrorKind::AlreadyExists => Err(exists_error(path)),
        Err(e) if matches!(e.kind(), io::ErrorKind::PermissionDenied | io::ErrorKind::Unsupported) => {
            check_then_rename(hidden, path)
        }
        Err(e) => Err(Error::io(path.display(), e)),
    }
}

/// Checks that `path` does not exist and then renames `hidden` to `path`. Both steps run under a lock on the folder.
/// This function is for file systems without hard links (exFAT).
///
/// The lock does not affect other programs. If another program creates a file at `path` between the check and the
/// rename, that file is replaced.
fn check_then_rename(hidden: &Path, path: &Path) -> Result<()> {
    let io = |e| Error::io(path.display(), e);
    let folder = File::open(parent_folder(path)).map_err(io)?;
    lock(&folder).map_err(io)?;
    refuse_existing(path, false)?;
    fs::rename(hidden, path).map_err(io)
}

/// Waits for a lock on the folder. Dropping `folder` releases the lock. If the file system does not support locks,
/// returns without a lock.
#[cfg(unix)]
fn lock(folder: &File) -> std::io::Result<()> {
    let no_locks = Some(rustix::io::Errno::NOLCK.raw_os_error());
    loop {
        match folder.lock() {
            Err(e) if e.kind() == io::ErrorKind::Interrupted => {}
            Err(e) if e.kind() == io::ErrorKind::Unsupported || e.raw_os_error() == no_locks => return Ok(()),
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
        assert_eq!(link_then_unlink(&hidden, &path).unwrap_err().kind(), ErrorKind::Exists);
        assert_eq!(fs::read(&path).unwrap(), b"old");
        fs::remove_file(&path).unwrap();
        link_then_unlink(&hidden, &path).unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"new");
        assert!(!hidden.exists());
    }

    #[test]
    fn the_rename_fallback_never_replaces_a_file() {
        let dir = tempfile::tempdir().unwrap();
        let (hidden, path) = (dir.path().join(".new"), dir.path().join("old"));
        fs::write(&hidden, "new").unwrap();
        fs::write(&path, "old").unwrap();
        assert_eq!(check_then_rename(&hidden, &path).unwrap_err().kind(), ErrorKind::Exists);
        assert_eq!(
            (fs::read(&path).unwrap(), fs::read(&hidden).unwrap()),
            (b"old".to_vec(), b"new".to_vec())
        );
        fs::remove_file(&path).unwrap();
        check_then_rename(&hidden, &path).unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"new");
        assert!(!hidden.exists());
    }

    #[cfg(unix)]
    #[test]
    fn a_link_is_replaced_and_other_file_types_are_refused() {
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
            assert_eq!(refuse_existing(&at(name), false).unwrap_err().kind(), ErrorKind::Exists, "{name}");
            PartialFile::create(&at(name), true).unwrap().commit().unwrap();
            assert!(fs::symlink_metadata(at(name)).unwrap().is_file(), "{name}");
        }
        assert_eq!(fs::read(at("target")).unwrap(), b"mine");
        for name in ["folder", "socket", "to-folder", "to-device", "to-open"] {
            let before = fs::symlink_metadata(at(name)).unwrap().file_type();
            assert_eq!(PartialFile::create(&at(name), true).unwrap_err().kind(), ErrorKind::Exists, "{name}");
            assert_eq!(fs::symlink_metadata(at(name)).unwrap().file_type(), before, "{name}");
        }
    }

    #[cfg(unix)]
    #[test]
    fn a_concurrent_entry_is_replaced_only_if_it_is_a_file() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("name");
        let partial = PartialFile::create(&path, true).unwrap();
        let _socket = std::os::unix::net::UnixListener::bind(&path).unwrap();
        assert_eq!(partial.commit().unwrap_err().kind(), ErrorKind::Exists);
        assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 1);
    }

    /// Eight threads find the name unused at the same time. Exactly one thread renames its file to the name, and no
    /// file is overwritten.
    #[test]
    fn without_links_one_of_many_threads_gets_the_name() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("name");
        let won = std::thread::scope(|scope| {
            let all: Vec<_> = (0..8)
                .map(|k| {
                    let (hidden, path) = (dir.path().join(format!(".{k}")), &path);
                    fs::write(&hidden, k.to_string()).unwrap();
                    scope.spawn(move || check_then_rename(&hidden, path).is_ok())
                })
                .collect();
            all.into_iter().map(|t| t.join().unwrap()).filter(|won| *won).count()
        });
        assert_eq!((won, fs::read_dir(dir.path()).unwrap().count()), (1, 8));
    }
}
