//! `.npz` files: zip archives of `.npy` arrays.

use std::io::{self, Read, Seek};

use zip::ZipArchive;
use zip::result::ZipError;

use spikelane::error::{Error, Result, error};

/// The first bytes of a nonempty zip archive.
pub const MAGIC: &[u8] = b"PK\x03\x04";

/// An `.npz` archive whose arrays are stored or deflated.
pub struct Archive<R> {
    zip: ZipArchive<R>,
    name: String,
}

impl<R: Read + Seek> Archive<R> {
    /// Reads the directory of an archive. Error messages refer to the archive as `name`.
    ///
    /// # Errors
    /// [`ErrorKind::Input`](spikelane::ErrorKind::Input) if the bytes are not a zip archive or are truncated.
    pub fn new(name: &str, reader: R) -> Result<Self> {
        let zip = ZipArchive::new(reader).map_err(|e| {
            archive_error(name, e)
                .expected("an archive written by numpy.savez or numpy.savez_compressed")
                .remedy("save the archive again; the file may be truncated")
        })?;
        Ok(Self { zip, name: name.to_owned() })
    }

    /// Returns the names of the arrays without the ending `.npy`, as NumPy lists the names.
    #[must_use]
    pub fn array_names(&self) -> Vec<String> {
        // The archive can contain entries whose names cannot be decoded. These entries are skipped, because `entry`
        // cannot find them by name.
        let names = self.zip.file_names().flatten();
        names.filter_map(|name| name.strip_suffix(".npy").map(str::to_owned)).collect()
    }

    /// Returns a reader of the `.npy` bytes of the array `array`. The reader starts at the header of the array.
    ///
    /// If the compressed bytes are damaged, the reader returns an error that wraps [`ErrorKind::Input`](spikelane::ErrorKind::Input).
    ///
    /// # Errors
    /// [`ErrorKind::Input`](spikelane::ErrorKind::Input) if the array does not exist or is neither stored nor deflated.
    pub fn entry(&mut self, array: &str) -> Result<impl Read + '_> {
        let subject = format!("{}: {array}", self.name);
        match self.zip.by_name(&format!("{array}.npy")) {
            Ok(reader) => Ok(EntryReader { reader, subject }),
            Err(e) => Err(archive_error(&subject, e)
                .expected("an array written by numpy.savez or numpy.savez_compressed")),
        }
    }
}

/// A reader of an array. The decompressor reports damage with several kinds of errors, which become one kind.
struct EntryReader<R> {
    reader: R,
    subject: String,
}

impl<R: Read> Read for EntryReader<R> {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        self.reader.read(bytes).map_err(|e| {
            if is_of_file(&e) { e } else { io::Error::other(archive_error(&self.subject, ZipError::Io(e))) }
        })
    }
}

/// Returns whether the file could not be read. Otherwise, the bytes of the file are damaged.
fn is_of_file(e: &io::Error) -> bool {
    e.raw_os_error().is_some()
        || e.kind() == io::ErrorKind::Interrupted
        || e.get_ref().is_some_and(|source| source.is::<Error>())
}

fn archive_error(subject: &str, e: ZipError) -> Error {
    match e {
        ZipError::Io(e) if is_of_file(&e) => Error::io(subject, e),
        e => error!(Input, "{subject}"; found "{e}"; expected "an archive without damage";
            remedy "copy the file again, or save the archive again"),
    }
}
