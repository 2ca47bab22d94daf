//! The `config.yaml` of a SpikeCV data set. The file contains the geometry of all streams in its folder and
//! subfolders.

use std::path::{Path, PathBuf};

use crate::formats::sidecar::check_beside;
use spikelane::error::{Result, Setting, error};
use spikelane::spikes::Geometry;
use spikelane::unstable::inputs::read_text_up_to;

const CONFIG_FILE_NAME: &str = "config.yaml";

/// Maximum number of folders that are searched. The first folder is the folder of the stream. For a stream
/// `SET/SPLIT/spike/ID.dat`, `SET` is the third folder.
const MAX_PARENT_FOLDERS: usize = 4;

/// Size limit of a configuration file. A SpikeCV configuration is never larger.
const MAX_BYTES: u64 = 1 << 20;

/// Returns the geometry in the nearest `config.yaml`, and the path of that file. The search starts in the folder of
/// `stream` and continues in its parent folders.
///
/// Files that lack `spike_w` or `spike_h` are skipped, because other programs also use the name `config.yaml`.
///
/// # Errors
/// * [`ErrorKind::Config`](spikelane::ErrorKind::Config) if the values of `spike_w` and `spike_h` are not a valid geometry.
/// * [`ErrorKind::Input`](spikelane::ErrorKind::Input) if the file is a symbolic link to a file in another folder.
pub(super) fn find_above(stream: &Path) -> Result<Option<(Geometry, PathBuf)>> {
    let Ok(absolute) = std::path::absolute(stream) else { return Ok(None) };
    for folder in absolute.ancestors().skip(1).take(MAX_PARENT_FOLDERS) {
        let path = folder.join(CONFIG_FILE_NAME);
        let Ok(text) = read_text_up_to(&path, "a configuration", MAX_BYTES) else { continue };
        if let (Some(width), Some(height)) = (value(&text, "spike_w"), value(&text, "spike_h")) {
            check_beside(&path, stream)?;
            return size(width, height, &path).map(|geometry| Some((geometry, path)));
        }
    }
    Ok(None)
}

fn size(width: &str, height: &str, path: &Path) -> Result<Geometry> {
    let side = |text: &str| text.parse::<u32>().ok();
    let geometry = side(width).zip(side(height)).and_then(|(w, h)| Geometry::new(w, h).ok());
    geometry.ok_or_else(|| {
        error!(Config, "{}", path.display(); found "spike_w: {width}, spike_h: {height}";
            expected "width and height in pixels";
            remedy "correct the file; to ignore the file, set {} and {}", Setting("width"), Setting("height"))
    })
}

/// Returns the value of a top-level key. Quotes and a trailing comment are removed.
fn value<'a>(text: &'a str, key: &str) -> Option<&'a str> {
    text.lines().find_map(|line| {
        let value = line.strip_prefix(key)?.trim_start().strip_prefix(':')?;
        let value = value.split(" #").next().unwrap_or_default().trim();
        Some(value.trim_matches(['"', '\'']))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use spikelane::ErrorKind;

    #[test]
    fn the_nearest_configuration_with_both_keys_counts() {
        let place = tempfile::tempdir().unwrap();
        let deep = place.path().join("train/spike");
        std::fs::create_dir_all(&deep).unwrap();
        let write = |at: &str, text: &str| std::fs::write(place.path().join(at), text).unwrap();
        let stream = deep.join("a.dat");
        assert_eq!(find_above(&stream).unwrap(), None);
        write("config.yaml", "filename: x\nspike_w: 64 # pixels\nspike_h: '48'\n");
        // The `config.yaml` in the nearer folder belongs to another program and must be skipped.
        write("train/config.yaml", "learning_rate: 0.1\n");
        let (geometry, path) = find_above(&stream).unwrap().unwrap();
        assert_eq!((geometry, path), (Geometry::new(64, 48).unwrap(), place.path().join("config.yaml")));
        // A file from Windows.
        write("config.yaml", "\u{feff}spike_w: 32\r\nspike_h: 16\r\n");
        assert_eq!(find_above(&stream).unwrap().unwrap().0, Geometry::new(32, 16).unwrap());
        write("train/config.yaml", "spike_w: wide\nspike_h: 3\n");
        assert_eq!(find_above(&stream).unwrap_err().kind(), ErrorKind::Config);
    }

    #[cfg(unix)]
    #[test]
    fn a_link_to_a_configuration_in_another_folder_is_an_error() {
        let place = tempfile::tempdir().unwrap();
        let at = |name: &str| place.path().join(name);
        for folder in ["set", "other", "links"] {
            std::fs::create_dir(at(folder)).unwrap();
        }
        std::fs::write(at("set/config.yaml"), "spike_w: 64\nspike_h: 48\n").unwrap();
        std::os::unix::fs::symlink("../set/config.yaml", at("other/config.yaml")).unwrap();
        std::os::unix::fs::symlink("../set/config.yaml", at("links/config.yaml")).unwrap();
        std::fs::write(at("set/a.dat"), "").unwrap();
        std::os::unix::fs::symlink("../set/a.dat", at("links/a.dat")).unwrap();
        assert_eq!(find_above(&at("other/a.dat")).unwrap_err().kind(), ErrorKind::Input);
        // The target of the stream is beside the configuration.
        assert!(find_above(&at("links/a.dat")).unwrap().is_some());
    }
}
