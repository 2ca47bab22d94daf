//! Records of studies, a line of JSON each, in files compressed with gzip.

use std::fs::{self, File};
use std::io::{Read as _, Write as _};
use std::path::Path;

use flate2::Compression;
use flate2::read::MultiGzDecoder;
use flate2::write::GzEncoder;

/// What was judged in the study of diagnoses.
///
/// # Panics
/// Never: the file is part of the program.
#[must_use]
pub fn diagnosis() -> String {
    text(include_bytes!("../data/diagnosis.jsonl.gz"))
}

fn text(bytes: &[u8]) -> String {
    let mut text = String::new();
    MultiGzDecoder::new(bytes).read_to_string(&mut text).expect("lines in gzip");
    text
}

/// The lines of a file; none where there is no file.
///
/// # Panics
/// When the file cannot be read, or is not what [`append`] and [`write`] make: it would be overwritten at the end.
#[must_use]
pub fn read(path: &Path) -> String {
    if !path.exists() {
        return String::new();
    }
    text(&fs::read(path).unwrap_or_else(|e| panic!("{}: {e}", path.display())))
}

/// Writes a file of these lines.
///
/// # Panics
/// When the system refuses.
pub fn write(path: &Path, text: &str) {
    let mut encoder = GzEncoder::new(File::create(path).unwrap(), Compression::best());
    encoder.write_all(text.as_bytes()).unwrap();
    encoder.finish().unwrap();
}

/// Adds a line to a file, which stays readable if the process is killed between two lines.
///
/// # Panics
/// When the system refuses.
pub fn append(path: &Path, line: &str) {
    // Members of gzip, one after the other, are the texts one after the other.
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
