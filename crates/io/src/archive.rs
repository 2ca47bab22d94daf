//! `.npz`: a zip archive of `.npy` files.

use std::io::{Read, Seek};

use zip::ZipArchive;

use spikelane::error::{Error, Kind, Result};

/// First bytes of an archive.
pub const MAGIC: &[u8] = b"PK\x03\x04";

/// An archive of arrays, stored or deflated.
pub struct Archive<R> {
    zip: ZipArchive<R>,
    name: String,
}

impl<R: Read + Seek> Archive<R> {
    /// Reads the directory of an archive. `name` stands for the file in errors.
    ///
    /// # Errors
    /// [`Kind::Input`] when it is no archive, or was cut short.
    pub fn new(name: &str, reader: R) -> Result<Self> {
        let zip = ZipArchive::new(reader).map_err(|e| {
            Error::new(Kind::Input, name)
                .found(e)
                .expected("an archive that numpy.savez or numpy.savez_compressed wrote")
                .remedy("save it again; it may have been cut short")
        })?;
        Ok(Self { zip, name: name.to_owned() })
    }

    /// The names of its arrays, as NumPy gives them (without `.npy`).
    #[must_use]
    pub fn arrays(&self) -> Vec<String> {
        // A name in no known encoding cannot be asked for either.
        let names = self.zip.file_names().flatten();
        names.filter_map(|name| name.strip_suffix(".npy").map(str::to_owned)).collect()
    }

    /// The bytes of the array called `array`, header first.
    ///
    /// # Errors
    /// [`Kind::Input`] when there is none, or it is packed in a way other than NumPy's two.
    pub fn entry(&mut self, array: &str) -> Result<impl Read + '_> {
        let name = &self.name;
        self.zip.by_name(&format!("{array}.npy")).map_err(|e| {
            Error::new(Kind::Input, name)
                .found(format_args!("{array}: {e}"))
                .expected("an array that numpy.savez or numpy.savez_compressed wrote")
        })
    }
}
