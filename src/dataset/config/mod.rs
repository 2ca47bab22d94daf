//! A whole dataset as one text, `dataset.toml`: printed from options, and read back into them.

mod camera;
mod file;
mod tables;

use std::path::Path;

use crate::dataset::DatasetOptions;
use crate::error::{Error, Kind, Result};

/// A dataset as text.
#[derive(Clone, Debug, PartialEq)]
pub struct Written {
    /// The text of `dataset.toml`.
    pub text: String,
    /// Maps of its cameras, which belong beside it: names and bytes.
    pub maps: Vec<(String, Vec<u8>)>,
}

/// The text from which [`parse`] makes these options again, but for the output, threads and resuming.
///
/// # Errors
/// When a camera cannot be written down.
pub fn write(options: &DatasetOptions) -> Result<Written> {
    let mut maps = Vec::new();
    let file = file::File::of(options, &mut maps)?;
    let body = toml::to_string(&file).map_err(|e| Error::new(Kind::Config, "dataset.toml").found(e))?;
    let head = format!(
        "# A dataset of spikelane {}. It is made by: spikelane dataset --config dataset.toml -o DIR\n",
        env!("CARGO_PKG_VERSION")
    );
    Ok(Written { text: head + &body, maps })
}

/// DatasetOptions from the text of a `dataset.toml`; paths in it are relative to `folder`. The output is empty, the threads are
/// one, and nothing is resumed.
///
/// # Errors
/// [`Kind::Config`] for a text of another version, a key that there is not, or a value that makes no sense.
pub fn parse(text: &str, folder: &Path) -> Result<DatasetOptions> {
    let table: toml::Table = toml::from_str(text)
        .map_err(|e| Error::new(Kind::Config, "dataset.toml").found(e.to_string().trim_end()))?;
    file::check_keys(&table)?;
    let file: file::File = table.try_into().map_err(|e: toml::de::Error| {
        Error::new(Kind::Config, "dataset.toml").found(e.to_string().trim_end())
    })?;
    file.options(folder)
}

/// DatasetOptions from a `dataset.toml`.
///
/// # Errors
/// As [`parse`]; [`Kind::Io`] when it cannot be read.
pub fn read(path: &Path) -> Result<DatasetOptions> {
    let text = std::fs::read_to_string(path).map_err(|e| Error::io(path.display(), e))?;
    let folder = path.parent().unwrap_or(Path::new(""));
    parse(&text, folder).map_err(|e| e.within(path.display()))
}
