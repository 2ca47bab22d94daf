//! Reading of large text files line by line.

use std::io::{BufRead as _, BufReader, Read as _};

use super::input_file::{InputFile, InputReader};
use crate::count::Count;
use crate::error::{Error, Result, bail};

/// A reader of the lines of an [`InputFile`]. Only one line is in memory at a time.
#[derive(Debug)]
pub struct InputLines<'a> {
    reader: BufReader<InputReader<&'a InputFile>>,
    file: &'a InputFile,
    limit: u64,
    line: Vec<u8>,
    number: u64,
}

impl<'a> InputLines<'a> {
    /// Returns the lines of `file`, each of which may have at most `limit` bytes.
    pub fn new(file: &'a InputFile, limit: u64) -> Self {
        let reader = BufReader::with_capacity(1 << 16, file.reader());
        Self { reader, file, limit, line: Vec::new(), number: 0 }
    }

    /// Returns the next line, including a line break if the line has one. Returns `None` at the end of the file. A byte
    /// order mark before the first line is skipped.
    ///
    /// # Errors
    /// Returns [`ErrorKind::Input`](crate::ErrorKind::Input) if a line is longer than the limit. Also returns the errors of
    /// [`InputFile::read_at`].
    pub fn next_line(&mut self) -> Result<Option<&[u8]>> {
        self.line.clear();
        let mut part = (&mut self.reader).take(self.limit.saturating_add(1));
        part.read_until(b'\n', &mut self.line).map_err(|e| Error::io(self.file.path().display(), e))?;
        if self.line.is_empty() {
            return Ok(None);
        }
        self.number += 1;
        if self.line.len() as u64 > self.limit {
            bail!(Input, "{}", self.file.path().display();
                found "more than {} in line {}", Count(self.limit, "byte"), self.number;
                expected "lines of at most {}", Count(self.limit, "byte"));
        }
        let mark: &[u8] = if self.number == 1 { b"\xEF\xBB\xBF" } else { b"" };
        Ok(Some(self.line.strip_prefix(mark).unwrap_or(&self.line)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ErrorKind;

    #[test]
    fn a_line_that_is_too_long_is_an_error_that_names_it() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("manifest.jsonl");
        std::fs::write(&path, "12345\n\n123456\n").unwrap();
        let file = InputFile::open(&path).unwrap();
        let mut lines = InputLines::new(&file, 6);
        assert_eq!(lines.next_line().unwrap(), Some(&b"12345\n"[..]));
        assert_eq!(lines.next_line().unwrap(), Some(&b"\n"[..]));
        let error = lines.next_line().unwrap_err();
        assert!(error.kind() == ErrorKind::Input && error.to_string().contains("line 3"), "{error}");
    }

    #[test]
    fn the_last_line_needs_no_line_break_and_the_first_line_no_byte_order_mark() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("journal.jsonl");
        std::fs::write(&path, "\u{feff}a\nb").unwrap();
        let file = InputFile::open(&path).unwrap();
        let mut lines = InputLines::new(&file, 10);
        assert_eq!(lines.next_line().unwrap(), Some(&b"a\n"[..]));
        assert_eq!(lines.next_line().unwrap(), Some(&b"b"[..]));
        assert_eq!(lines.next_line().unwrap(), None);
    }
}
