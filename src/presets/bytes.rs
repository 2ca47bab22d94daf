//! A camera and its maps as one block of bytes, for pickles and messages.

use std::borrow::Cow;

use crate::effects::{Camera, Catalog};
use crate::error::{Result, error};
use crate::presets::file::from_toml_and_maps;
use crate::presets::maps::MapSource;
use crate::presets::to_toml;

/// The first bytes of the block. The number in the text is the version of the format.
const MAGIC: &[u8; 8] = b"spkcam01";

/// Returns the camera file of `camera` and its maps as bytes that [`from_bytes`] reads. Equal cameras have equal bytes.
///
/// The bytes start with eight magic bytes. Each following block has a length (64 bits, little-endian) and contents. The
/// first block contains the text of the camera file. For each map, one block contains the file name and the next block
/// contains the file.
///
/// # Examples
/// ```
/// use spikelane::presets;
/// let mut camera = presets::builtin("physical")?;
/// camera.sensor.readout_hz = 40_000.0;
/// assert_eq!(presets::from_bytes(&presets::to_bytes(&camera)?)?, camera);
/// # Ok::<(), spikelane::Error>(())
/// ```
///
/// # Errors
/// Returns the errors of [`to_toml`].
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

/// Returns the FNV-1a hash of `bytes`, for example of the result of [`to_bytes`] or of a text.
///
/// The hash identifies a camera. It does not depend on the machine or the version.
///
/// # Examples
/// ```
/// use spikelane::presets;
/// let camera = presets::builtin("physical")?;
/// let mut other = camera.clone();
/// other.sensor.swing_v += 0.001;
/// let of = |camera| Ok::<_, spikelane::Error>(presets::fingerprint(&presets::to_bytes(camera)?));
/// assert_ne!(of(&camera)?, of(&other)?);
/// // The FNV-1a hash of "a".
/// assert_eq!(presets::fingerprint(b"a"), 0xaf63_dc4c_8601_ec8c);
/// # Ok::<(), spikelane::Error>(())
/// ```
#[must_use]
pub fn fingerprint(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |h, b| (h ^ u64::from(*b)).wrapping_mul(0x0000_0100_0000_01b3))
}

/// Parses the result of [`to_bytes`]. The camera may only have effects of this library.
///
/// # Examples
/// ```
/// use spikelane::presets;
/// let bytes = presets::to_bytes(&presets::builtin("physical")?)?;
/// assert_eq!(presets::from_bytes(&bytes)?.name, "physical");
///
/// let error = presets::from_bytes(&bytes[..20]).unwrap_err();
/// assert_eq!((error.kind(), &*error.parts().found), (spikelane::ErrorKind::Input, "truncated data"));
/// # Ok::<(), spikelane::Error>(())
/// ```
///
/// # Errors
/// Returns [`ErrorKind::Input`](crate::ErrorKind::Input) if another version wrote the bytes or if bytes are missing. Also returns the errors of
/// [`super::from_toml`].
pub fn from_bytes(bytes: &[u8]) -> Result<Camera> {
    Catalog::new().camera_from_bytes(bytes)
}

impl Catalog {
    /// Parses the result of [`to_bytes`]. The camera may have any effect of this catalog.
    ///
    /// # Errors
    /// Returns the errors of [`from_bytes`].
    pub fn camera_from_bytes(&self, bytes: &[u8]) -> Result<Camera> {
        let bad = |found: &str| {
            error!(Input, "camera bytes"; found "{found}";
                expected "a camera written by this version of the library";
                remedy "write the camera again, or store cameras as .toml files, which every version reads")
        };
        let mut rest = bytes.strip_prefix(MAGIC).ok_or_else(|| match bytes {
            [b's', b'p', b'k', b'c', b'a', b'm', ..] => bad("data of another version"),
            _ => bad("other data"),
        })?;
        let mut blocks = Vec::new();
        while !rest.is_empty() {
            let (length, after) = rest.split_first_chunk::<8>().ok_or_else(|| bad("truncated data"))?;
            let length = usize::try_from(u64::from_le_bytes(*length)).unwrap_or(usize::MAX);
            let (block, after) = after.split_at_checked(length).ok_or_else(|| bad("truncated data"))?;
            blocks.push(block);
            rest = after;
        }
        let Some((text, maps)) = blocks.split_first() else { return Err(bad("truncated data")) };
        let text = std::str::from_utf8(text).map_err(|_| bad("text that is not UTF-8"))?;
        from_toml_and_maps(text, &EmbeddedMaps(maps), self)
    }
}

/// The names and the files of maps in alternation.
struct EmbeddedMaps<'a>(&'a [&'a [u8]]);

impl MapSource for EmbeddedMaps<'_> {
    fn read(&self, file: &str) -> Result<(Cow<'_, [u8]>, String)> {
        let (pairs, _) = self.0.as_chunks::<2>();
        let pair = pairs.iter().find(|[name, _]| *name == file.as_bytes());
        pair.map(|[_, bytes]| (Cow::Borrowed(*bytes), file.to_owned())).ok_or_else(|| {
            error!(Input, "{file}"; found "a reference to a map that the data does not contain";
                expected "every map of the camera")
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ErrorKind;
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
        let part = camera.window(Crop { row: 1, col: 1, width: 3, height: 2 }).unwrap();
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
        assert_eq!(from_bytes(&changed).unwrap_err().kind(), ErrorKind::Corrupt);
    }
}
