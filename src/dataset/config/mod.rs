//! A whole dataset as one text, `dataset.toml`: printed from options, and read back into them.

mod camera;
mod file;
mod tables;

use std::path::Path;

use crate::dataset::DatasetOptions;
use crate::error::{Error, Kind, Result};
use crate::inputs::{Access, read_text};

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
/// one, and nothing is resumed. The camera files that it names lie below `folder`.
///
/// # Errors
/// [`Kind::Config`] for a text of another version, a key that there is not, or a value that makes no sense.
pub fn parse(text: &str, folder: &Path) -> Result<DatasetOptions> {
    parse_with(text, folder, false)
}

/// The same; with `follow_links` links to camera files may leave the folder.
///
/// # Errors
/// As [`parse`].
pub fn parse_with(text: &str, folder: &Path, follow_links: bool) -> Result<DatasetOptions> {
    let table: toml::Table = toml::from_str(text)
        .map_err(|e| Error::new(Kind::Config, "dataset.toml").found(e.to_string().trim_end()))?;
    file::check_keys(&table)?;
    let file: file::File = table.try_into().map_err(|e: toml::de::Error| {
        Error::new(Kind::Config, "dataset.toml").found(e.to_string().trim_end())
    })?;
    let access = Access::reading(follow_links);
    file.options(folder, access).map(|options| DatasetOptions { follow_links, ..options })
}

/// DatasetOptions from a `dataset.toml`.
///
/// # Errors
/// As [`parse`]; [`Kind::Io`] when it cannot be read.
pub fn read(path: &Path, follow_links: bool) -> Result<DatasetOptions> {
    let text = read_text(path, "a dataset.toml")?;
    let folder = path.parent().unwrap_or(Path::new(""));
    parse_with(&text, folder, follow_links).map_err(|e| e.within(path.display()))
}
