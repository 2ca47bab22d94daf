//! Files that are written with a hidden name and get their final name when they are complete.

use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use spikelane::error::{Error, Result};
use spikelane::unstable::inputs::{InnerPath, InputFile, PARTIAL_ENDING, read_bytes};
use spikelane_io::storage::{folders, is_same_file, sync};

/// The hidden name of a file. When this value is dropped, the file with this name is removed.
///
/// After the rename to the final name, no file has the hidden name.
pub(crate) struct HiddenFile<'a>(pub &'a Path);

impl Drop for HiddenFile<'_> {
    fn drop(&mut self) {
        // `drop` cannot report an error, so errors are ignored.
        let _ = std::fs::remove_file(self.0);
    }
}

/// Creates the additional name `inner` below `root` for the file `from`. Returns 1 if the file was copied, and
/// otherwise 0.
///
/// The file is first created with a hidden name, which depends only on the final name. If a process is killed, the next
/// attempt therefore replaces the hidden file.
pub(crate) fn link_or_copy(from: &Path, root: &Path, inner: &InnerPath) -> Result<u64> {
    let to = folders::create_parents(root, inner)?;
    if are_same_file(from, &to) {
        return Ok(0);
    }
    let hidden = hidden_path(&to);
    let io = |e| Error::io(to.display(), e);
    // If `from` is a symbolic link, the hard link refers to the target of `from`. A hard link to a relative symbolic
    // link would not work in another folder.
    let from = fs::canonicalize(from).map_err(|e| Error::io(from.display(), e))?;
    let _ = fs::remove_file(&hidden);
    // If the hidden name and the final name are hard links to the same file, the rename has no effect. The hidden name
    // is then removed too.
    let _draft = HiddenFile(&hidden);
    let mut copied = 0;
    if fs::hard_link(&from, &hidden).is_err() {
        let mut file = folders::create(&hidden)?;
        let source = InputFile::open(&from)?;
        std::io::copy(&mut source.reader(), &mut file).map_err(io)?;
        sync::sync_file(&file, &hidden)?;
        copied = 1;
    }
    sync::rename(&hidden, &to).map(|()| copied)
}

/// Writes the small file `inner` below `root`. If the file already contains `bytes`, the file is not written again.
pub(crate) fn write_if_changed(root: &Path, inner: &InnerPath, bytes: &[u8]) -> Result<()> {
    let to = folders::create_parents(root, inner)?;
    if read_bytes(&to, "a file of the dataset", bytes.len() as u64).is_ok_and(|content| content == bytes) {
        return Ok(());
    }
    let hidden = hidden_path(&to);
    let _draft = HiddenFile(&hidden);
    let mut file = folders::create(&hidden)?;
    file.write_all(bytes).map_err(|e| Error::io(to.display(), e))?;
    sync::sync_file(&file, &hidden)?;
    sync::rename(&hidden, &to)
}

/// Returns the hidden name of a file. The file is written with this name and then renamed to `path`, which is in the
/// same folder.
fn hidden_path(path: &Path) -> PathBuf {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    path.with_file_name(format!(".{name}{PARTIAL_ENDING}"))
}

/// Returns whether two paths refer to the same file.
fn are_same_file(a: &Path, b: &Path) -> bool {
    match (fs::metadata(a), fs::metadata(b)) {
        (Ok(a), Ok(b)) => is_same_file(&a, &b) == Some(true),
        _ => false,
    }
}
