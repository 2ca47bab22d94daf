//! Reads and writes the records of studies. A record is a line of JSON in a gzip file.

use std::fs::{self, File};
use std::io::{Read as _, Write as _};
use std::path::Path;

use flate2::Compression;
use flate2::read::MultiGzDecoder;
use flate2::write::GzEncoder;

/// Returns the records of the diagnosis study, one per line.
///
/// # Panics
/// Never, because the file is compiled into the program.
#[must_use]
pub fn diagnosis_records() -> String {
    text(include_bytes!("../data/diagnosis.jsonl.gz"))
}

fn text(bytes: &[u8]) -> String {
    let mut text = String::new();
    MultiGzDecoder::new(bytes).read_to_string(&mut text).expect("lines in gzip");
    text
}

/// Returns the text of a file of records, or an empty string if the file does not exist.
///
/// # Panics
/// If the file cannot be read, or if [`append`] or [`write()`] did not create it. The panic prevents the caller from
/// overwriting such a file.
#[must_use]
pub fn read(path: &Path) -> String {
    if !path.exists() {
        return String::new();
    }
    text(&fs::read(path).unwrap_or_else(|e| panic!("{}: {e}", path.display())))
}

/// Writes `text` as a file of records.
///
/// # Panics
/// If writing fails.
pub fn write(path: &Path, text: &str) {
    let mut encoder = GzEncoder::new(File::create(path).unwrap(), Compression::best());
    encoder.write_all(text.as_bytes()).unwrap();
    encoder.finish().unwrap();
}

/// Appends a line to a file. If the process is killed between two lines, the file is still readable.
///
/// # Panics
/// If writing fails.
pub fn append(path: &Path, line: &str) {
    // A gzip file may consist of several members. The decoder returns the concatenation of their texts.
    let mut encoder = GzEncoder::new(Vec::new(), Compression::best());
    writeln!(encoder, "{line}").unwrap();
    let member = encoder.finish().unwrap();
    File::options().create(true).append(true).open(path).unwrap().write_all(&member).unwrap();
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_that_are_added_one_by_one_are_read_as_one_text() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("records.jsonl.gz");
        assert_eq!(read(&path), "");
        write(&path, "first\n");
        append(&path, "second");
        append(&path, "third");
        assert_eq!(read(&path), "first\nsecond\nthird\n");
    }
}
