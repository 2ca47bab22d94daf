//! `.npz` files: zip archives of `.npy` arrays.

use std::io::{Read, Seek};

use zip::ZipArchive;

use spikelane::error::{Error, ErrorKind, Result};

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
    /// [`ErrorKind::Input`] if the bytes are not a zip archive or are truncated.
    pub fn new(name: &str, reader: R) -> Result<Self> {
        let zip = ZipArchive::new(reader).map_err(|e| {
            Error::new(ErrorKind::Input, name)
                .found(e)
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
    /// # Errors
    /// [`ErrorKind::Input`] if the array does not exist or is neither stored nor deflated.
    pub fn entry(&mut self, array: &str) -> Result<impl Read + '_> {
        let name = &self.name;
        self.zip.by_name(&format!("{array}.npy")).map_err(|e| {
            Error::new(ErrorKind::Input, name)
                .found(format_args!("{array}: {e}"))
                .expected("an array written by numpy.savez or numpy.savez_compressed")
        })
    }
}
