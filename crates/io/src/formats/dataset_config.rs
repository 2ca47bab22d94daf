//! The `config.yaml` of a data set, as SpikeCV has it, tells the size of the streams below it.

use std::path::{Path, PathBuf};

use spikelane::error::{Error, Kind, Result};
use spikelane::spikes::Geometry;
use spikelane::unstable::inputs::read_bytes;

const NAME: &str = "config.yaml";

/// How many folders up it is looked for: `SET/SPLIT/spike/ID.dat` is two below.
const LEVELS: usize = 4;

/// A configuration is a page; what is larger belongs to something else.
const MAX_BYTES: u64 = 1 << 20;

/// The size in the nearest configuration at or above the folder of `stream`, and where it stands.
///
/// Only files with both keys `spike_w` and `spike_h` count: others have configurations of that name too.
///
/// # Errors
/// [`Kind::Config`] when the keys hold no size.
pub(super) fn above(stream: &Path) -> Result<Option<(Geometry, PathBuf)>> {
    let Ok(whole) = std::path::absolute(stream) else { return Ok(None) };
    for folder in whole.ancestors().skip(1).take(LEVELS) {
        let path = folder.join(NAME);
        let bytes = read_bytes(&path, "a configuration", MAX_BYTES).ok();
        let Some(text) = bytes.and_then(|bytes| String::from_utf8(bytes).ok()) else { continue };
        if let (Some(width), Some(height)) = (value(&text, "spike_w"), value(&text, "spike_h")) {
            return size(width, height, &path).map(|geometry| Some((geometry, path)));
        }
    }
    Ok(None)
}

fn size(width: &str, height: &str, path: &Path) -> Result<Geometry> {
    let side = |text: &str| text.parse::<u32>().ok();
    let geometry = side(width).zip(side(height)).and_then(|(w, h)| Geometry::new(w, h).ok());
    geometry.ok_or_else(|| {
        Error::new(Kind::Config, path.display())
            .found(format_args!("spike_w: {width}, spike_h: {height}"))
            .expected("width and height in pixels")
            .remedy("correct it, or give width and height, and it is not read")
    })
}

/// The value of a key at the outermost level, without quotes and comment.
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

    #[test]
    fn the_nearest_configuration_with_both_keys_counts() {
        let place = tempfile::tempdir().unwrap();
        let deep = place.path().join("train/spike");
        std::fs::create_dir_all(&deep).unwrap();
        let write = |at: &str, text: &str| std::fs::write(place.path().join(at), text).unwrap();
        let stream = deep.join("a.dat");
        assert_eq!(above(&stream).unwrap(), None);
        write("config.yaml", "filename: x\nspike_w: 64 # pixels\nspike_h: '48'\n");
        // Some other program's file, nearer.
        write("train/config.yaml", "learning_rate: 0.1\n");
        let (geometry, path) = above(&stream).unwrap().unwrap();
        assert_eq!((geometry, path), (Geometry::new(64, 48).unwrap(), place.path().join("config.yaml")));
        write("train/config.yaml", "spike_w: wide\nspike_h: 3\n");
        assert_eq!(above(&stream).unwrap_err().kind(), Kind::Config);
    }
}
