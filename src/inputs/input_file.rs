//! Opening and reading of input files.

use std::borrow::{Borrow, Cow};
use std::fs::{File, Metadata};
use std::io::{self, Read, Seek, SeekFrom};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::count::Count;
use crate::error::{Error, Result, bail, error};

/// Largest size in bytes of a text file with settings: a plan, a camera, a set of recordings or a sidecar.
pub const MAX_TEXT_BYTES: u64 = 16 << 20;

/// A regular file, or a part of one such as a member of a tar, open for reading at any position and from any thread.
///
/// The length is determined when the file is opened. Another process may change or shorten the file at any time. The
/// bytes are therefore copied and never mapped. If the file was shortened, a read beyond its new end returns an error
/// and does not raise a signal.
#[derive(Debug)]
pub struct InputFile {
    file: Arc<File>,
    path: PathBuf,
    /// Offset of the first byte. It is 0 unless this is a part of a file.
    start: u64,
    len: u64,
}

impl InputFile {
    /// Opens the regular file at `path` without blocking.
    ///
    /// # Errors
    /// Returns [`ErrorKind::Io`](crate::ErrorKind::Io) if the file cannot be opened, and [`ErrorKind::Input`](crate::ErrorKind::Input) if it is a folder, pipe, socket or
    /// device.
    pub fn open(path: &Path) -> Result<Self> {
        let io = |e| Error::io(path.display(), e);
        // Opening a named pipe blocks until another process opens the pipe, so the type is checked before the file is
        // opened.
        // The file at `path` can be replaced between the check and the opening. The file is therefore opened without
        // blocking and checked again.
        check_regular(path, &std::fs::metadata(path).map_err(io)?)?;
        let file = open_without_waiting(path).map_err(io)?;
        let metadata = file.metadata().map_err(io)?;
        check_regular(path, &metadata)?;
        Ok(Self { file: Arc::new(file), path: path.to_owned(), start: 0, len: metadata.len() })
    }

    /// Returns the bytes of `range` as a file of their own. Errors refer to the part as `path`.
    ///
    /// # Errors
    /// Returns [`ErrorKind::Input`](crate::ErrorKind::Input) if the range is not inside the file.
    pub fn part(&self, range: Range<u64>, path: PathBuf) -> Result<Self> {
        if range.start > range.end || range.end > self.len {
            bail!(Input, "{}", path.display(); found "bytes {} to {}", range.start, range.end;
                expected "bytes within the {} of {}", Count(self.len, "byte"), self.path.display();
                remedy "the file is truncated or damaged; copy it again");
        }
        let file = Arc::clone(&self.file);
        Ok(Self { file, path, start: self.start + range.start, len: range.end - range.start })
    }

    /// Returns whether the file was empty at opening.
    pub const fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Returns the length at opening, in bytes.
    pub const fn len(&self) -> u64 {
        self.len
    }

    /// Returns the path under which the file was opened.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Fills `bytes` with the bytes of the file that start at `offset`.
    ///
    /// # Errors
    /// Returns [`ErrorKind::Input`](crate::ErrorKind::Input) if the file has too few bytes, for example because another process shortened the
    /// file.
    /// Returns [`ErrorKind::Io`](crate::ErrorKind::Io) if the system cannot read the file.
    pub fn read_at(&self, offset: u64, bytes: &mut [u8]) -> Result<()> {
        let at = self.start.saturating_add(offset);
        read_exact_at(&self.file, at, bytes).map_err(|e| match e.kind() {
            io::ErrorKind::UnexpectedEof => self.shortened_error(offset + bytes.len() as u64),
            _ => Error::io(self.path.display(), e),
        })
    }

    /// Returns a reader with its own position, which starts at the first byte.
    ///
    /// The reader ends at the length that the file had when it was opened. If the file has been shortened since, the
    /// reader returns an error.
    pub fn reader(&self) -> InputReader<&Self> {
        InputReader { file: self, position: 0 }
    }

    /// Returns a reader that owns the file and otherwise equals [`InputFile::reader`].
    pub fn into_reader(self) -> InputReader<Self> {
        InputReader { file: self, position: 0 }
    }

    /// Returns all bytes.
    ///
    /// `limit` is the maximum size in bytes. `description` names the kind of file in errors.
    ///
    /// # Errors
    /// Returns [`ErrorKind::Input`](crate::ErrorKind::Input) if the file is larger than `limit`. Also returns the errors of
    /// [`InputFile::read_at`].
    pub fn read_all(&self, description: &str, limit: u64) -> Result<Vec<u8>> {
        if self.len > limit {
            bail!(Input, "{}", self.path.display(); found "{}", Count(self.len, "byte");
                expected "{description}, at most {}", Count(limit, "byte"));
        }
        let len = usize::try_from(self.len).unwrap_or(usize::MAX);
        let mut bytes = super::zeroed_vec(self.path.display(), len)?;
        self.read_at(0, &mut bytes)?;
        Ok(bytes)
    }

    fn shortened_error(&self, wanted: u64) -> Error {
        let now = self.file.metadata().map_or(0, |m| m.len()).saturating_sub(self.start);
        error!(Input, "{}", self.path.display();
            found "{}; the file had {} when the program opened the file", Count(now, "byte"), Count(self.len, "byte");
            expected "bytes up to {wanted}";
            remedy "another process shortened or replaced the file; read the file again when the other process has finished")
    }
}

/// A sequential reader of an [`InputFile`].
#[derive(Debug)]
pub struct InputReader<F> {
    file: F,
    position: u64,
}

impl<F: Borrow<InputFile>> Read for InputReader<F> {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        let file = self.file.borrow();
        let left = file.len.saturating_sub(self.position);
        let len = usize::try_from(left).unwrap_or(usize::MAX).min(bytes.len());
        file.read_at(self.position, &mut bytes[..len]).map_err(io::Error::other)?;
        self.position += len as u64;
        Ok(len)
    }
}

impl<F: Borrow<InputFile>> Seek for InputReader<F> {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        let position = match to {
            SeekFrom::Start(at) => Some(at),
            SeekFrom::End(by) => self.file.borrow().len.checked_add_signed(by),
            SeekFrom::Current(by) => self.position.checked_add_signed(by),
        };
        self.position = position.ok_or(io::ErrorKind::InvalidInput)?;
        Ok(self.position)
    }
}

/// Returns all bytes of the regular file at `path`.
///
/// `limit` is the maximum size in bytes. `description` names the kind of file in errors.
///
/// # Errors
/// Returns the errors of [`InputFile::open`]. Returns [`ErrorKind::Input`](crate::ErrorKind::Input) if the file is larger than `limit`.
pub fn read_bytes(path: &Path, description: &str, limit: u64) -> Result<Vec<u8>> {
    InputFile::open(path)?.read_all(description, limit)
}

/// Returns the text of the regular file at `path`. The maximum size is [`MAX_TEXT_BYTES`].
///
/// `description` names the kind of file in errors.
///
/// # Errors
/// Returns the errors of [`read_bytes`], and [`ErrorKind::Input`](crate::ErrorKind::Input) if the text is not UTF-8.
pub fn read_text(path: &Path, description: &str) -> Result<String> {
    read_text_up_to(path, description, MAX_TEXT_BYTES)
}

/// Returns the text of the regular file at `path`. The maximum size is `limit` bytes.
///
/// `description` names the kind of file in errors.
///
/// # Errors
/// Returns the errors of [`read_text`].
pub fn read_text_up_to(path: &Path, description: &str, limit: u64) -> Result<String> {
    let bytes = read_bytes(path, description, limit)?;
    decoded_text(bytes).map_err(|found| {
        error!(Input, "{}", path.display(); found "{found}"; expected "{description}, as text in UTF-8";
            remedy "save it as UTF-8")
    })
}

/// Returns the text of a file without its byte order mark. The text is UTF-8, or UTF-16 with a byte order mark.
///
/// Editors on Windows write such files.
fn decoded_text(bytes: Vec<u8>) -> std::result::Result<String, String> {
    let order: fn([u8; 2]) -> u16 = match bytes[..] {
        [0xFF, 0xFE, ..] => u16::from_le_bytes,
        [0xFE, 0xFF, ..] => u16::from_be_bytes,
        [0xEF, 0xBB, 0xBF, ..] => return decoded_text(bytes[3..].to_vec()),
        _ => {
            return String::from_utf8(bytes)
                .map_err(|e| format!("bytes at {} that are not UTF-8", e.utf8_error().valid_up_to()));
        }
    };
    let (units, rest) = bytes[2..].as_chunks();
    let units: Vec<u16> = units.iter().map(|unit| order(*unit)).collect();
    match String::from_utf16(&units) {
        Ok(text) if rest.is_empty() => Ok(text),
        _ => Err("text that is not UTF-16, although it starts with the byte order mark of UTF-16".to_owned()),
    }
}

/// Returns the bytes of a text in UTF-8 without a byte order mark. The text is UTF-8, or UTF-16 with a byte order mark.
///
/// Other bytes are returned unchanged, because the parser of the text reports them.
///
/// # Examples
/// ```
/// use spikelane::unstable::inputs::utf8_bytes;
/// assert_eq!(*utf8_bytes(b"\xEF\xBB\xBF{}"), *b"{}");
/// assert_eq!(*utf8_bytes(b"\xFF\xFE{\0}\0"), *b"{}");
/// ```
pub fn utf8_bytes(bytes: &[u8]) -> Cow<'_, [u8]> {
    if !matches!(bytes, [0xEF, 0xBB, 0xBF, ..] | [0xFE, 0xFF, ..] | [0xFF, 0xFE, ..]) {
        return Cow::Borrowed(bytes);
    }
    decoded_text(bytes.to_vec()).map_or(Cow::Borrowed(bytes), |text| Cow::Owned(text.into_bytes()))
}

/// Returns the path of a name in a text file. `folder` is the folder to which the name is relative.
///
/// Programs on Windows separate folders with backslashes. Elsewhere a backslash can be a part of a file name, so a file
/// with exactly this name takes precedence.
///
/// # Examples
/// ```
/// use spikelane::unstable::inputs::path_from_text;
/// assert_eq!(path_from_text("set".as_ref(), r"flats\dark.dat"), std::path::Path::new("set/flats/dark.dat"));
/// ```
pub fn path_from_text(folder: &Path, name: &str) -> PathBuf {
    let path = folder.join(name);
    if !name.contains('\\') || path.symlink_metadata().is_ok() {
        return path;
    }
    folder.join(name.replace('\\', "/"))
}

/// Replaces the error that a file does not exist by `None`.
///
/// # Errors
/// Returns every other error of `read`.
pub fn not_found_as_none<T>(read: Result<T>) -> Result<Option<T>> {
    match read {
        Ok(value) => Ok(Some(value)),
        Err(e) if e.io_error().is_some_and(|e| e.kind() == io::ErrorKind::NotFound) => Ok(None),
        Err(e) => Err(e),
    }
}

fn check_regular(path: &Path, metadata: &Metadata) -> Result<()> {
    if metadata.is_file() {
        return Ok(());
    }
    let description = if metadata.is_dir() { "a directory" } else { "a pipe or device" };
    Err(error!(Input, "{}", path.display(); found "{description}"; expected "a regular file"))
}

/// The flag `O_NONBLOCK` of `open(2)`.
#[cfg(any(target_os = "linux", target_os = "android"))]
const O_NONBLOCK: i32 = 0o4000;
#[cfg(target_vendor = "apple")]
const O_NONBLOCK: i32 = 0x4;

#[cfg(any(target_os = "linux", target_os = "android", target_vendor = "apple"))]
fn open_without_waiting(path: &Path) -> io::Result<File> {
    use std::os::unix::fs::OpenOptionsExt as _;
    File::options().read(true).custom_flags(O_NONBLOCK).open(path)
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

/// Reads with `seek` and `read`, because stable Rust has no positioned reads on WebAssembly.
///
/// WebAssembly has no threads, so no other code can change the position of the file between `seek` and `read`.
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
    use crate::ErrorKind;

    #[test]
    fn text_is_decoded_by_its_byte_order_mark() {
        let wide = |mark: u16, bytes: fn(u16) -> [u8; 2]| -> Vec<u8> {
            [mark].into_iter().chain("é 0.5\n".encode_utf16()).flat_map(bytes).collect()
        };
        for bytes in [
            "é 0.5\n".as_bytes().to_vec(),
            "\u{feff}é 0.5\n".as_bytes().to_vec(),
            wide(0xFEFF, u16::to_le_bytes),
            wide(0xFEFF, u16::to_be_bytes),
        ] {
            assert_eq!(decoded_text(bytes).unwrap(), "é 0.5\n");
        }
        assert_eq!(decoded_text(vec![]).unwrap(), "");
        assert!(decoded_text(vec![0xFF, 0xFE, 0x41]).is_err());
        assert!(decoded_text(vec![0xFF, 0xFE, 0x00, 0xD8]).is_err());
        assert!(decoded_text(b"a\xFF".to_vec()).unwrap_err().contains("bytes at 1"));
    }

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
        assert_eq!(error.kind(), ErrorKind::Input);
        assert!(error.to_string().contains("950 bytes; the file had 1000"), "{error}");
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
    fn a_part_reads_its_own_bytes_and_ends_inside_its_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("shard.tar");
        std::fs::write(&path, "0123456789").unwrap();
        let file = InputFile::open(&path).unwrap();
        let outer = file.part(2..8, "outer".into()).unwrap();
        let inner = outer.part(1..4, "inner".into()).unwrap();
        assert_eq!(inner.read_all("a part", 3).unwrap(), b"345");
        let mut text = String::new();
        inner.reader().read_to_string(&mut text).unwrap();
        assert_eq!(text, "345");
        let error = outer.part(4..7, "beyond".into()).unwrap_err();
        assert!(error.kind() == ErrorKind::Input && error.subject() == "beyond", "{error}");
    }

    #[test]
    fn large_files_and_folders_are_refused_by_name() {
        let folder = tempfile::tempdir().unwrap();
        assert_eq!(InputFile::open(folder.path()).unwrap_err().kind(), ErrorKind::Input);
        let path = folder.path().join("plan.json");
        std::fs::write(&path, "{}").unwrap();
        assert_eq!(read_text(&path, "a plan").unwrap(), "{}");
        assert_eq!(read_bytes(&path, "a plan", 1).unwrap_err().kind(), ErrorKind::Input);
        File::options().write(true).open(&path).unwrap().set_len(MAX_TEXT_BYTES + 1).unwrap();
        assert_eq!(read_text(&path, "a plan").unwrap_err().kind(), ErrorKind::Input);
    }

    #[cfg(unix)]
    #[test]
    fn a_pipe_is_refused_at_once() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("pipe");
        assert!(std::process::Command::new("mkfifo").arg(&path).status().unwrap().success());
        assert_eq!(InputFile::open(&path).unwrap_err().kind(), ErrorKind::Input);
        assert_eq!(InputFile::open(Path::new("/dev/zero")).unwrap_err().kind(), ErrorKind::Input);
    }
}
