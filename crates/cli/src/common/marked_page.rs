//! Writes generated text into a page of documentation, between marker lines.

use std::path::Path;

use spikelane::{Error, ErrorKind, Result};
use spikelane_io::storage;

/// Replaces the text between two marker lines of a page.
///
/// # Errors
/// [`ErrorKind::Input`] if the page lacks a marker line.
pub(crate) fn replace_between_markers(path: &Path, (begin, end): (&str, &str), text: &str) -> Result<()> {
    let old = std::fs::read_to_string(path).map_err(|e| Error::io(path.display(), e))?;
    let parts = old.split_once(begin).and_then(|(before, rest)| Some((before, rest.split_once(end)?.1)));
    let Some((before, after)) = parts else {
        return Err(Error::new(ErrorKind::Input, path.display())
            .found("no marker lines")
            .expected(format_args!("the lines {} and {}", begin.trim_end(), end.trim_end())));
    };
    storage::write_small(path, format!("{before}{begin}{text}{end}{after}").as_bytes(), true)
}
