//! The one way to open an input.

use std::borrow::Borrow;
use std::fs::{File, Metadata};
use std::io::{self, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use crate::error::{Error, Kind, Result};

/// The most that a text file of settings (a plan, a camera, a set of recordings, a sidecar) may hold.
pub const MAX_TEXT_BYTES: u64 = 16 << 20;

/// A regular file, open for reading at any position and from any thread.
///
/// Its length is that at opening. Another process may change or shorten it at any time, so its bytes are copied and never
/// mapped: reading behind a new end is an error and not a signal.
#[derive(Debug)]
pub struct InputFile {
    file: File,
    path: PathBuf,
    len: u64,
}

impl InputFile {
    /// Opens the regular file at `path` without waiting.
    ///
    /// # Errors
    /// [`Kind::Io`] when it cannot be opened, [`Kind::Input`] when it is a folder, pipe, socket or device.
    pub fn open(path: &Path) -> Result<Self> {
        let io = |e| Error::io(path.display(), e);
        // A named pipe would wait for its other end in `open`, so its type is checked first. The type is checked again
        // on the open file, and opening does not wait, since the name can have changed between the two.
        regular(path, &std::fs::metadata(path).map_err(io)?)?;
        let file = open_without_waiting(path).map_err(io)?;
        let found = file.metadata().map_err(io)?;
        regular(path, &found)?;
        Ok(Self { file, path: path.to_owned(), len: found.len() })
    }

    /// Whether the file held no byte at opening.
    pub const fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// The length at opening, in bytes.
    pub const fn len(&self) -> u64 {
        self.len
    }

    /// The path that it was opened by.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Fills `bytes` from `offset` on.
    ///
    /// # Errors
    /// [`Kind::Input`] when the file ends before, which it does when another process shortened it; [`Kind::Io`] when the
    /// system refuses.
    pub fn read_at(&self, offset: u64, bytes: &mut [u8]) -> Result<()> {
        read_exact_at(&self.file, offset, bytes).map_err(|e| match e.kind() {
            io::ErrorKind::UnexpectedEof => self.shortened(offset + bytes.len() as u64),
            _ => Error::io(self.path.display(), e),
        })
    }

    /// Returns a reader of the bytes from the start on, with a position of its own.
    ///
    /// It ends at the length that the file had at opening, and reports an error where the file was shortened since.
    pub fn reader(&self) -> Cursor<&Self> {
        Cursor { file: self, position: 0 }
    }

    /// Returns a reader as [`InputFile::reader`] does, which owns the file.
    pub fn into_reader(self) -> Cursor<Self> {
        Cursor { file: self, position: 0 }
    }

    fn shortened(&self, wanted: u64) -> Error {
        let now = self.file.metadata().map_or(0, |m| m.len());
        Error::new(Kind::Input, self.path.display())
            .found(format_args!("{now} bytes where it had {} when it was opened", self.len))
            .expected(format_args!("bytes up to {wanted}"))
            .remedy("another process shortened or replaced the file; read it again when that process has finished")
    }
}

/// Reads an [`InputFile`] from one byte to the next.
#[derive(Debug)]
pub struct Cursor<F> {
    file: F,
    position: u64,
}

impl<F: Borrow<InputFile>> Read for Cursor<F> {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        let file = self.file.borrow();
        let left = file.len.saturating_sub(self.position);
        let len = usize::try_from(left).unwrap_or(usize::MAX).min(bytes.len());
        file.read_at(self.position, &mut bytes[..len]).map_err(io::Error::other)?;
        self.position += len as u64;
        Ok(len)
    }
}

impl<F: Borrow<InputFile>> Seek for Cursor<F> {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        let moved = match to {
            SeekFrom::Start(at) => Some(at),
            SeekFrom::End(by) => self.file.borrow().len.checked_add_signed(by),
            SeekFrom::Current(by) => self.position.checked_add_signed(by),
        };
        self.position = moved.ok_or(io::ErrorKind::InvalidInput)?;
        Ok(self.position)
    }
}

/// Returns all bytes of the regular file at `path`, which may hold at most `limit`; `what` names the kind of file.
///
/// # Errors
/// As [`InputFile::open`]; [`Kind::Input`] when it is larger.
pub fn read_bytes(path: &Path, what: &str, limit: u64) -> Result<Vec<u8>> {
    let file = InputFile::open(path)?;
    if file.len() > limit {
        return Err(Error::new(Kind::Input, path.display())
            .found(format_args!("{} bytes", file.len()))
            .expected(format_args!("{what}, at most {limit} bytes")));
    }
    let len = usize::try_from(file.len()).unwrap_or(usize::MAX);
    let mut bytes = super::zeroed(path.display(), len)?;
    file.read_at(0, &mut bytes)?;
    Ok(bytes)
}

/// Returns the text of the regular file at `path`, at most [`MAX_TEXT_BYTES`]; `what` names the kind of file.
///
/// # Errors
/// As [`read_bytes`]; [`Kind::Input`] when it is not UTF-8.
pub fn read_text(path: &Path, what: &str) -> Result<String> {
    read_text_up_to(path, what, MAX_TEXT_BYTES)
}

/// Returns the text of the regular file at `path`, at most `limit` bytes; `what` names the kind of file.
///
/// # Errors
/// As [`read_text`].
pub fn read_text_up_to(path: &Path, what: &str, limit: u64) -> Result<String> {
    let bytes = read_bytes(path, what, limit)?;
    String::from_utf8(bytes).map_err(|e| {
        Error::new(Kind::Input, path.display())
            .found(format_args!("bytes that are not UTF-8 at {}", e.utf8_error().valid_up_to()))
            .expected(format_args!("{what}, as text"))
    })
}

/// Returns `None` in place of the error that there is no such file.
///
/// # Errors
/// Every other error of `read`.
pub fn if_found<T>(read: Result<T>) -> Result<Option<T>> {
    match read {
        Ok(value) => Ok(Some(value)),
        Err(e) if e.io_error().is_some_and(|e| e.kind() == io::ErrorKind::NotFound) => Ok(None),
        Err(e) => Err(e),
    }
}

fn regular(path: &Path, found: &Metadata) -> Result<()> {
    if found.is_file() {
        return Ok(());
    }
    let what = if found.is_dir() { "a directory" } else { "a pipe or device" };
    Err(Error::new(Kind::Input, path.display()).found(what).expected("a regular file"))
}

/// `O_NONBLOCK` of `open(2)`.
#[cfg(any(target_os = "linux", target_os = "android"))]
const NONBLOCK: i32 = 0o4000;
#[cfg(target_vendor = "apple")]
const NONBLOCK: i32 = 0x4;

#[cfg(any(target_os = "linux", target_os = "android", target_vendor = "apple"))]
fn open_without_waiting(path: &Path) -> io::Result<File> {
    use std::os::unix::fs::OpenOptionsExt as _;
    File::options().read(true).custom_flags(NONBLOCK).open(path)
}

#[cfg(not(any(target_os = "linux", target_os = "android", target_vendor = "apple")))]
fn open_without_waiting(path: &Path) -> io::Result<File> {
    File::open(path)
}

#[cfg(unix)]
fn read_exact_at(file: &File, offset: u64, bytes: &mut [u8]) -> io::Result<()> {
    use std::os::unix::fs::FileExt as _;
    file.read_exact_at(bytes, offset)
}

/// WebAssembly has no positioned reads in stable Rust; it has no threads either that could move the position between.
#[cfg(not(any(unix, windows)))]
fn read_exact_at(mut file: &File, offset: u64, bytes: &mut [u8]) -> io::Result<()> {
    file.seek(SeekFrom::Start(offset))?;
    file.read_exact(bytes)
}

#[cfg(windows)]
fn read_exact_at(file: &File, mut offset: u64, mut bytes: &mut [u8]) -> io::Result<()> {
    use std::os::windows::fs::FileExt as _;
    while !bytes.is_empty() {
        match file.seek_read(bytes, offset) {
            Ok(0) => return Err(io::ErrorKind::UnexpectedEof.into()),
            Ok(n) => {
                bytes = &mut bytes[n..];
                offset += n as u64;
            }
            Err(e) if e.kind() == io::ErrorKind::Interrupted => {}
            Err(e) => return Err(e),
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_that_is_shortened_while_it_is_read_is_an_error() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("stream.dat");
        std::fs::write(&path, [7; 1000]).unwrap();
        let file = InputFile::open(&path).unwrap();
        let mut bytes = [0; 100];
        file.read_at(900, &mut bytes).unwrap();
        assert_eq!(bytes, [7; 100]);
        File::options().write(true).open(&path).unwrap().set_len(950).unwrap();
        let error = file.read_at(900, &mut bytes).unwrap_err();
        assert_eq!(error.kind(), Kind::Input);
        assert!(error.to_string().contains("950 bytes where it had 1000"), "{error}");
        assert!(io::copy(&mut file.reader(), &mut io::sink()).is_err());
    }

    #[test]
    fn a_reader_ends_at_the_length_at_opening() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("growing");
        std::fs::write(&path, "first").unwrap();
        let file = InputFile::open(&path).unwrap();
        std::fs::write(&path, "first and more").unwrap();
        let mut text = String::new();
        file.reader().read_to_string(&mut text).unwrap();
        assert_eq!(text, "first");
    }

    #[test]
    fn large_files_and_folders_are_refused_by_name() {
        let folder = tempfile::tempdir().unwrap();
        assert_eq!(InputFile::open(folder.path()).unwrap_err().kind(), Kind::Input);
        let path = folder.path().join("plan.json");
        std::fs::write(&path, "{}").unwrap();
        assert_eq!(read_text(&path, "a plan").unwrap(), "{}");
        assert_eq!(read_bytes(&path, "a plan", 1).unwrap_err().kind(), Kind::Input);
        File::options().write(true).open(&path).unwrap().set_len(MAX_TEXT_BYTES + 1).unwrap();
        assert_eq!(read_text(&path, "a plan").unwrap_err().kind(), Kind::Input);
    }

    #[cfg(unix)]
    #[test]
    fn a_pipe_is_refused_at_once() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("pipe");
        assert!(std::process::Command::new("mkfifo").arg(&path).status().unwrap().success());
        assert_eq!(InputFile::open(&path).unwrap_err().kind(), Kind::Input);
        assert_eq!(InputFile::open(Path::new("/dev/zero")).unwrap_err().kind(), Kind::Input);
    }
}
