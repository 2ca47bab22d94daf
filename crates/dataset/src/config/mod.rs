//! Conversion between the options of a dataset and the text of a `dataset.toml`.

mod camera;
mod file;

use std::path::Path;

use crate::DatasetOptions;
use spikelane::error::{Error, ErrorKind, Result};
use spikelane::unstable::error::toml_fault;
use spikelane::unstable::inputs::{Access, read_text};

/// The text of a `dataset.toml`, and the maps of its cameras.
#[derive(Clone, Debug, PartialEq)]
pub struct DatasetText {
    /// The text of `dataset.toml`.
    pub text: String,
    /// Names and bytes of the camera maps. The maps must be stored in the folder of `dataset.toml`.
    pub maps: Vec<(String, Vec<u8>)>,
}

/// Returns the text of a `dataset.toml`. [`from_toml`] restores all options from the text, except the output folder,
/// the number of threads and `resume`.
///
/// # Examples
/// ```
/// use std::path::Path;
/// use spikelane_dataset::{Access, config};
/// let short = "format_version = 1\n[scenes]\npreset = \"tiny\"";
/// let options = config::from_toml(short, Path::new(""), Access::Read)?;
/// // The text contains every option of the preset, and it restores the options.
/// let text = config::to_toml(&options)?.text;
/// assert_eq!(config::from_toml(&text, Path::new(""), Access::Read)?.content, options.content);
/// # Ok::<(), spikelane::Error>(())
/// ```
///
/// # Errors
/// * The errors of [`spikelane::presets::to_toml`].
/// * [`ErrorKind::Config`] if two cameras have different maps with the same name.
pub fn to_toml(options: &DatasetOptions) -> Result<DatasetText> {
    let mut maps = Vec::new();
    let file = file::DatasetFile::from_options(options, &mut maps)?;
    let body = toml::to_string(&file).map_err(|e| Error::new(ErrorKind::Config, "dataset.toml").found(e))?;
    let head = format!(
        "# A dataset of spikelane {}. It is made by: spikelane dataset --config dataset.toml -o DIR\n",
        env!("CARGO_PKG_VERSION")
    );
    Ok(DatasetText { text: head + &body, maps })
}

/// Parses the text of a `dataset.toml`. Paths in the text are relative to `folder`. Camera files must be in `folder`
/// or its subfolders.
///
/// In the returned options, the output folder is empty, the number of threads is one, and `resume` is false.
///
/// # Examples
/// ```
/// use std::path::Path;
/// use spikelane_dataset::{Access, Content, config};
/// let text = "format_version = 1\n[scenes]\npreset = \"tiny\"\nsequences = 3";
/// let options = config::from_toml(text, Path::new(""), Access::Read)?;
/// assert!(matches!(options.content, Content::Scenes(scenes) if scenes.sequences == 3));
///
/// let error = config::from_toml("sed = 1", Path::new(""), Access::Read).unwrap_err();
/// assert_eq!(error.parts().remedy, "did you mean seed?");
/// # Ok::<(), spikelane::Error>(())
/// ```
///
/// # Errors
/// [`ErrorKind::Config`] if the text has an unsupported version, an unknown key, or an invalid value.
pub fn from_toml(text: &str, folder: &Path, access: Access) -> Result<DatasetOptions> {
    let mut table: toml::Table = toml::from_str(text).map_err(|e| parse_error(&e))?;
    file::expand_preset(&mut table)?;
    let file: file::DatasetFile = table.try_into().map_err(|e| parse_error(&e))?;
    let follow_links = access == Access::ReadThroughLinks;
    file.into_options(folder, access).map(|options| DatasetOptions { follow_links, ..options })
}

/// Returns the error for invalid text. If the text contains an unknown key, the error suggests the most similar known
/// key.
fn parse_error(error: &toml::de::Error) -> Error {
    let message = Error::new(ErrorKind::Config, "dataset.toml").found(toml_fault(error));
    // The message of the TOML parser has the form: unknown field `A`, expected one of `B`, `C`.
    let mut quoted = error.message().split('`').skip(1).step_by(2);
    match quoted.next().filter(|_| error.message().starts_with("unknown field")) {
        Some(key) => message.with_suggestion(key, quoted),
        None => message,
    }
}

/// Reads the options from a `dataset.toml`.
///
/// # Errors
/// The errors of [`from_toml`]. Also [`ErrorKind::Io`] if the file cannot be read.
pub fn open(path: &Path, access: Access) -> Result<DatasetOptions> {
    let text = read_text(path, "a dataset.toml")?;
    let folder = path.parent().unwrap_or(Path::new(""));
    from_toml(&text, folder, access).map_err(|e| e.with_context(path.display()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Content, SceneContent};
    use spikelane_scene::Lighting;

    #[test]
    fn errors_name_the_key_the_word_and_what_is_expected() {
        for (text, words) in [
            ("sed = 1", &["unknown field `sed`", "did you mean seed?"][..]),
            ("[scenes]\nflickr_hz = 100.0", &["`flickr_hz`", "did you mean flicker_hz?"]),
            ("[scenes]\npreset = \"tyni\"", &["scenes.preset", "tyni", "rhdd, tiny", "did you mean tiny?"]),
            ("[scenes]\nlighting = [\"dusk\", \"dsk\"]", &["scenes.lighting", "`dsk`", "night"]),
            ("[scenes]\nsamples = 5", &["scenes.samples", "`5`", "4 or 16"]),
            ("[scenes]\nimages_per_scene = \"many\"", &["scenes.images_per_scene", "\"many\"", "u32"]),
            ("[inputs]\nfolder = \".\"\nresize_mode = \"zoom\"", &["inputs.resize_mode", "zoom", "crop"]),
            ("[images]\nformat = \"u7\"", &["images.format", "u7", "u16"]),
            ("[splits]\ntest = \"all\"", &["splits.test", "all"]),
            ("dataset_layout = \"coco\"", &["dataset_layout", "coco", "spike-zoo"]),
            ("[scenes]\nimages_per_scene = = 2", &["line 3"]),
        ] {
            let error =
                from_toml(&format!("format_version = 1\n{text}\n"), Path::new(""), Access::Read).unwrap_err();
            assert_eq!(error.kind(), ErrorKind::Config, "{text}");
            for word in words {
                assert!(error.to_string().contains(word), "{text}: {error} has no {word}");
            }
        }
    }

    #[test]
    fn a_preset_fills_in_what_the_table_leaves_out() {
        let text =
            "format_version = 1\n[scenes]\npreset = \"tiny\"\nimages_per_scene = 3\nlighting = \"dusk\"\n";
        let options = from_toml(text, Path::new(""), Access::Read).unwrap();
        let wanted = SceneContent::tiny().with_images_per_scene(3).with_lighting(vec![Lighting::Dusk]);
        assert_eq!((options.content, options.splits.test), (Content::Scenes(wanted), 0.2));
    }
}
