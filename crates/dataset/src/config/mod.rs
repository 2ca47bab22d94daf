//! A whole dataset as one text, `dataset.toml`: printed from options, and read back into them.

mod camera;
mod file;

use std::path::Path;

use crate::DatasetOptions;
use spikelane::error::{Error, Kind, Result};
use spikelane::unstable::inputs::{Access, read_text};

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
    let mut table: toml::Table = toml::from_str(text).map_err(|e| wrong(&e))?;
    file::expand_kind(&mut table)?;
    let file: file::File = table.try_into().map_err(|e| wrong(&e))?;
    let access = Access::reading(follow_links);
    file.options(folder, access).map(|options| DatasetOptions { follow_links, ..options })
}

/// The error of a text, with the nearest key if one is unknown.
fn wrong(error: &toml::de::Error) -> Error {
    let found = Error::new(Kind::Config, "dataset.toml").found(error.to_string().trim_end());
    // unknown field `A`, expected one of `B`, `C`
    let mut quoted = error.message().split('`').skip(1).step_by(2);
    match quoted.next().filter(|_| error.message().starts_with("unknown field")) {
        Some(key) => found.or_nearest(key, quoted),
        None => found,
    }
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Drives, Work};
    use spikelane_scene::Lighting;

    #[test]
    fn errors_name_the_key_the_word_and_what_is_expected() {
        for (text, words) in [
            ("sed = 1", &["unknown field `sed`", "did you mean seed?"][..]),
            ("[scenes]\nflickr_hz = 100.0", &["`flickr_hz`", "did you mean flicker_hz?"]),
            ("[scenes]\nkind = \"tyni\"", &["scenes.kind", "tyni", "rhdd, tiny", "did you mean tiny?"]),
            ("[scenes]\nlighting = [\"dusk\", \"dsk\"]", &["scenes.lighting", "`dsk`", "night"]),
            ("[scenes]\nsamples = 5", &["scenes.samples", "`5`", "4 or 16"]),
            ("[scenes]\nimages = \"many\"", &["scenes.images", "\"many\"", "u32"]),
            ("[inputs]\nfolder = \".\"\nfit = \"zoom\"", &["inputs.fit", "zoom", "crop"]),
            ("[images]\nas = \"u7\"", &["images.as", "u7", "u16"]),
            ("[splits]\ntest = \"all\"", &["splits.test", "all"]),
            ("structure = \"coco\"", &["structure", "coco", "spike-zoo"]),
            ("[scenes]\nimages = = 2", &["line 3"]),
        ] {
            let error = parse(&format!("dataset = 1\n{text}\n"), Path::new("")).unwrap_err();
            assert_eq!(error.kind(), Kind::Config, "{text}");
            for word in words {
                assert!(error.to_string().contains(word), "{text}: {error} has no {word}");
            }
        }
    }

    #[test]
    fn a_kind_fills_in_what_the_table_leaves_out() {
        let text = "dataset = 1\n[scenes]\nkind = \"tiny\"\nimages = 3\nlighting = \"dusk\"\n";
        let options = parse(text, Path::new("")).unwrap();
        let wanted = Drives::tiny().with_images(3).with_lighting(vec![Lighting::Dusk]);
        assert_eq!((options.work, options.splits.test), (Work::Drives(wanted), 0.2));
    }
}
