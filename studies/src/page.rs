//! Generated parts of pages.

use std::path::Path;

/// Replaces the text between two markers of a page. If the page does not exist, writes a page with only this part.
///
/// # Panics
/// Panics if a marker is missing, or if the page cannot be written.
pub fn write_between_markers(path: &Path, [begin, end]: [&str; 2], text: &str) {
    let page = std::fs::read_to_string(path).unwrap_or_else(|_| format!("{begin}{end}\n"));
    let parts = page.split_once(begin).and_then(|(before, rest)| Some((before, rest.split_once(end)?.1)));
    let (before, after) = parts.unwrap_or_else(|| panic!("{}: no {begin} or {end}", path.display()));
    let text = format!("{before}{begin}{text}{end}{after}");
    std::fs::write(path, text).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
}
