//! Writes files so that a file is either complete or does not exist under its final name.
//!
//! A file is written under a hidden name beside its final path. The blocks of the file are reserved before the first
//! write. After the last write, the file is synced and then renamed. An interruption at any point does not change
//! existing files. A large file is mapped one window at a time, so memory use does not depend on its length.

mod digest;
pub mod folders;
mod group;
mod guarded_map;
mod lock_file;
mod mapping_guard;
mod outputs;
mod partial_file;
mod platform;
mod shared_memory;
pub mod sync;
pub mod unfinished;
mod word_buffer;
mod writer;

pub use digest::Digest;
pub(crate) use digest::READ_BYTES;
pub use group::FileGroup;
pub use outputs::OutputSet;
pub use partial_file::PartialFile;
pub use platform::{has_other_links, host_name, is_same_file, open_no_follow};
pub use shared_memory::SharedMemory;
pub use word_buffer::WordBuffer;
pub use writer::{FileSummary, FileWriter};

use std::io::Write as _;
use std::path::Path;

use spikelane::error::{Error, Result};

/// Writes a small file, such as a sidecar or an image, in one call.
///
/// Other processes read either the old file or the complete new file.
///
/// # Examples
/// ```
/// use spikelane_io::storage::write_small;
/// # let folder = tempfile::tempdir().map_err(|e| spikelane::Error::io("a folder", e))?;
/// let path = folder.path().join("notes.txt");
/// write_small(&path, b"first", false)?;
/// let error = write_small(&path, b"second", false).unwrap_err();
/// assert_eq!(error.kind(), spikelane::ErrorKind::Exists);
/// assert_eq!(std::fs::read(&path).map_err(|e| spikelane::Error::io("notes", e))?, b"first");
/// # Ok::<(), spikelane::Error>(())
/// ```
///
/// # Errors
/// * [`ErrorKind::Exists`](spikelane::ErrorKind::Exists) if `path` exists and `force` is false.
/// * [`ErrorKind::Space`](spikelane::ErrorKind::Space) if the disk is full.
/// * Other errors of the operating system.
pub fn write_small(path: &Path, bytes: &[u8], force: bool) -> Result<()> {
    let partial = partial_file::PartialFile::create(path, force)?;
    partial.file().write_all(bytes).map_err(|e| Error::io(path.display(), e))?;
    partial.commit().map(drop)
}

/// Writes a small file that contains a secret.
///
/// The function works as [`write_small`], but other users of the machine cannot open the file at any time. The file has the
/// mode 0600, or fewer permissions if the umask removes them. On Windows, the file inherits the permissions of its folder.
///
/// # Examples
/// ```
/// use spikelane_io::storage::write_small_private;
/// # let folder = tempfile::tempdir().map_err(|e| spikelane::Error::io("a folder", e))?;
/// let path = folder.path().join("key");
/// write_small_private(&path, b"secret", false)?;
/// # #[cfg(unix)]
/// # {
/// use std::os::unix::fs::PermissionsExt as _;
/// let mode = std::fs::metadata(&path).map_err(|e| spikelane::Error::io("key", e))?.permissions().mode();
/// assert_eq!(mode & 0o777, 0o600);
/// # }
/// # Ok::<(), spikelane::Error>(())
/// ```
///
/// # Errors
/// As [`write_small`].
pub fn write_small_private(path: &Path, bytes: &[u8], force: bool) -> Result<()> {
    let partial = partial_file::PartialFile::create_private(path, force)?;
    partial.file().write_all(bytes).map_err(|e| Error::io(path.display(), e))?;
    partial.commit().map(drop)
}

/// Writes or replaces a small file that can be generated again, such as an intermediate result.
///
/// Unless the machine loses power, other processes read either the old file or the complete new file. The file is not
/// synced, because a sync takes ten times as long as the write. After a power failure, the file may be truncated or
/// contain zeros, so programs that read the file must verify its content.
pub fn write_small_unsynced(path: &Path, bytes: &[u8]) -> Result<()> {
    let partial = partial_file::PartialFile::create(path, true)?;
    partial.file().write_all(bytes).map_err(|e| Error::io(path.display(), e))?;
    partial.commit_unsynced()
}

/// Checks that the files `names` in `folder` may be written. Callers check before a long computation, so that a
/// conflict is reported early.
///
/// # Errors
/// [`ErrorKind::Exists`](spikelane::ErrorKind::Exists) if a file exists and `force` is false, or if an
/// existing entry is not a regular file.
pub fn refuse_existing(folder: &Path, names: &[&str], force: bool) -> Result<()> {
    names.iter().try_for_each(|name| partial_file::refuse_existing(&folder.join(name), force))
}

/// Removes a file that new files replace or invalidate. It is not an error if the file does not exist.
pub fn remove_stale(path: &Path) -> Result<()> {
    partial_file::remove_stale(path)
}

/// Returns the number of free bytes for an unprivileged user on the disk of `path`. Returns `None` if the system
/// cannot report the number.
///
/// `path` does not have to exist yet.
///
/// # Errors
/// If neither `path` nor one of its parent folders can be queried.
pub fn free_space(path: &Path) -> Result<Option<u64>> {
    let mut at = path;
    loop {
        match platform::free_bytes(at) {
            Ok(free) => return Ok(free),
            Err(e) => match at.parent() {
                Some(parent) if !parent.as_os_str().is_empty() => at = parent,
                _ => return Err(Error::io(path.display(), e)),
            },
        }
    }
}
