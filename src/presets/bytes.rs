//! A camera as one block of bytes: its file with the maps inside, for pickles and messages.

use std::borrow::Cow;

use crate::effects::{Camera, Catalogue};
use crate::error::{Error, Kind, Result};
use crate::presets::file::parse_maps;
use crate::presets::maps::Files;
use crate::presets::to_toml;

/// The beginning of the bytes; the number is the version of what follows.
const MAGIC: &[u8; 8] = b"spkcam01";

/// The camera file of `camera` with its maps; [`from_bytes`] reads it back. Equal cameras give equal bytes.
///
/// After eight bytes of magic come blocks, each its length (64 bits, little-endian) and its bytes: the text, then
/// for each map its name and its file.
///
/// # Errors
/// As [`to_toml`].
pub fn to_bytes(camera: &Camera) -> Result<Vec<u8>> {
    let saved = to_toml(camera)?;
    let mut bytes = MAGIC.to_vec();
    let mut block = |part: &[u8]| {
        bytes.extend((part.len() as u64).to_le_bytes());
        bytes.extend(part);
    };
    block(saved.text.as_bytes());
    for (name, map) in &saved.maps {
        block(name.as_bytes());
        block(map);
    }
    Ok(bytes)
}

/// FNV-1a over `bytes`, those of [`to_bytes`] or of a text: tells cameras apart, the same on every machine and in
/// every version.
#[must_use]
pub fn key(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |h, b| (h ^ u64::from(*b)).wrapping_mul(0x0000_0100_0000_01b3))
}

/// The camera that [`to_bytes`] wrote.
///
/// # Errors
/// [`Kind::Input`] when the bytes are none of this version, or were cut short; otherwise as [`super::parse`].
pub fn from_bytes(bytes: &[u8]) -> Result<Camera> {
    from_bytes_with(bytes, &Catalogue::new())
}

/// The same for a camera that may have any of `effects`.
///
/// # Errors
/// As [`from_bytes`].
pub fn from_bytes_with(bytes: &[u8], effects: &Catalogue) -> Result<Camera> {
    let bad = |found: &str| {
        Error::new(Kind::Input, "camera bytes")
            .found(found)
            .expected("a camera that this version of the library wrote")
            .remedy("write it anew, or keep cameras as .toml files, which every version reads")
    };
    let mut rest = bytes.strip_prefix(MAGIC).ok_or_else(|| match bytes {
        [b's', b'p', b'k', b'c', b'a', b'm', ..] => bad("bytes of another version"),
        _ => bad("other bytes"),
    })?;
    let mut blocks = Vec::new();
    while !rest.is_empty() {
        let (length, after) = rest.split_first_chunk::<8>().ok_or_else(|| bad("bytes that end too early"))?;
        let length = usize::try_from(u64::from_le_bytes(*length)).unwrap_or(usize::MAX);
        let (block, after) = after.split_at_checked(length).ok_or_else(|| bad("bytes that end too early"))?;
        blocks.push(block);
        rest = after;
    }
    let Some((text, maps)) = blocks.split_first() else { return Err(bad("bytes that end too early")) };
    let text = std::str::from_utf8(text).map_err(|_| bad("text that is no UTF-8"))?;
    parse_maps(text, &Inside(maps), effects)
}

/// Names and files in turn.
struct Inside<'a>(&'a [&'a [u8]]);

impl Files for Inside<'_> {
    fn read(&self, file: &str) -> Result<(Cow<'_, [u8]>, String)> {
        let (pairs, _) = self.0.as_chunks::<2>();
        let found = pairs.iter().find(|[name, _]| *name == file.as_bytes());
        found.map(|[_, bytes]| (Cow::Borrowed(*bytes), file.to_owned())).ok_or_else(|| {
            Error::new(Kind::Input, file)
                .found("no such map in the bytes")
                .expected("every map of the camera")
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::presets::builtin;
    use crate::spikes::{Crop, Geometry};

    fn camera() -> Camera {
        let mut camera = builtin("physical").unwrap();
        camera.sensor.geometry = Geometry::new(5, 3).unwrap();
        camera.maps.gain = Some((0..15).map(|p| 1.0 + 0.001 * f64::from(p)).collect());
        camera.maps.swing_v = Some(vec![1.1; 15]);
        camera
    }

    #[test]
    fn a_camera_with_maps_and_a_window_comes_back_whole() {
        let camera = camera();
        assert_eq!(from_bytes(&to_bytes(&camera).unwrap()).unwrap(), camera);
        let part = camera.window(Crop { x: 1, y: 1, width: 3, height: 2 }).unwrap();
        assert_eq!(from_bytes(&to_bytes(&part).unwrap()).unwrap(), part);
        assert_ne!(part, camera);
    }

    #[test]
    fn bytes_cut_anywhere_or_of_another_version_are_refused() {
        let bytes = to_bytes(&camera()).unwrap();
        for end in 0..bytes.len() {
            assert!(from_bytes(&bytes[..end]).is_err(), "cut at {end}");
        }
        let mut other = bytes.clone();
        other[7] = b'9';
        let error = from_bytes(&other).unwrap_err().to_string();
        assert!(error.contains("another version"), "{error}");
        let last = bytes.len() - 1;
        let mut changed = bytes;
        changed[last] ^= 1;
        assert_eq!(from_bytes(&changed).unwrap_err().kind(), Kind::Corrupt);
    }
}
