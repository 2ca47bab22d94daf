//! Removal of unfinished files after errors.

use std::path::Path;

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
