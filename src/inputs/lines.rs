//! Large text files, line by line.

use std::io::{BufRead as _, BufReader, Read as _};

use super::file::{Cursor, InputFile};
use crate::error::{Error, Kind, Result};

/// Reads an [`InputFile`] one line at a time, so that memory holds one line and not the file.
#[derive(Debug)]
pub struct Lines<'a> {
    reader: BufReader<Cursor<&'a InputFile>>,
    file: &'a InputFile,
    limit: u64,
    line: Vec<u8>,
    number: u64,
}

impl<'a> Lines<'a> {
    /// Returns the lines of `file`, each of which may have at most `limit` bytes.
    pub fn new(file: &'a InputFile, limit: u64) -> Self {
        let reader = BufReader::with_capacity(1 << 16, file.reader());
        Self { reader, file, limit, line: Vec::new(), number: 0 }
    }

    /// Returns the next line with its line break, if it has one; `None` at the end of the file.
    ///
    /// # Errors
    /// [`Kind::Input`] for a line that is too long, and the errors of reading.
    pub fn next_line(&mut self) -> Result<Option<&[u8]>> {
        self.line.clear();
        let mut part = (&mut self.reader).take(self.limit.saturating_add(1));
        part.read_until(b'\n', &mut self.line).map_err(|e| Error::io(self.file.path().display(), e))?;
        if self.line.is_empty() {
            return Ok(None);
        }
        self.number += 1;
        if self.line.len() as u64 > self.limit {
            return Err(Error::new(Kind::Input, self.file.path().display())
                .found(format_args!("more than {} bytes in line {}", self.limit, self.number))
                .expected(format_args!("lines of at most {} bytes", self.limit)));
        }
        Ok(Some(&self.line))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_that_is_too_long_is_an_error_that_names_it() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("manifest.jsonl");
        std::fs::write(&path, "12345\n\n123456\n").unwrap();
        let file = InputFile::open(&path).unwrap();
        let mut lines = Lines::new(&file, 6);
        assert_eq!(lines.next_line().unwrap(), Some(&b"12345\n"[..]));
        assert_eq!(lines.next_line().unwrap(), Some(&b"\n"[..]));
        let error = lines.next_line().unwrap_err();
        assert!(error.kind() == Kind::Input && error.to_string().contains("line 3"), "{error}");
    }

    #[test]
    fn the_last_line_needs_no_line_break() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("journal.jsonl");
        std::fs::write(&path, "a\nb").unwrap();
        let file = InputFile::open(&path).unwrap();
        let mut lines = Lines::new(&file, 10);
        assert_eq!(lines.next_line().unwrap(), Some(&b"a\n"[..]));
        assert_eq!(lines.next_line().unwrap(), Some(&b"b"[..]));
        assert_eq!(lines.next_line().unwrap(), None);
    }
}
