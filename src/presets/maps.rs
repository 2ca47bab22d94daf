//! Per-pixel maps of a camera file. The camera file refers to `.npy` files by relative path and digest.

use std::borrow::Cow;
use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::effects::Maps;
use crate::error::{Error, ErrorKind, Result, bail, error};
use crate::inputs::{Access, InnerPath, deserialize_digest, read_bytes};
use crate::npy;
use crate::spikes::Geometry;

/// Largest size of a map file in bytes. The largest sensor has 2^28 pixels of 8 bytes each, and a header is added.
const MAX_MAP_BYTES: u64 = (8 << 28) + (1 << 16);

/// A map: the path of its file relative to the camera file, and the digest of its bytes.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub(super) struct MapEntry {
    pub file: String,
    #[serde(deserialize_with = "deserialize_digest")]
    pub digest: String,
}

#[derive(Clone, Debug, Default, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Table {
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gain: Option<MapEntry>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub dark_pa: Option<MapEntry>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub capacitance_ff: Option<MapEntry>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub swing_v: Option<MapEntry>,
}

/// The storage from which the maps of a camera file are read.
pub(super) trait MapSource {
    /// Returns the bytes of `file`, and the name of the file for errors.
    fn read(&self, file: &str) -> Result<(Cow<'_, [u8]>, String)>;
}

/// Map files in the folder that contains the camera file. If the folder is `None`, no map can be read.
pub(super) struct MapFolder<'a>(pub Option<&'a Path>);

impl MapSource for MapFolder<'_> {
    fn read(&self, file: &str) -> Result<(Cow<'_, [u8]>, String)> {
        let inner = InnerPath::parse(ErrorKind::Config, "file", file)
            .map_err(|e| e.expected("a path relative to the camera file, inside the folder of this file"))?;
        let folder = self
            .0
            .ok_or_else(|| error!(Config, "{file}"; expected "a camera file in the folder of its maps"))?;
        let path = inner.resolve_in(folder, Access::Read)?;
        let bytes = read_bytes(&path, "a map", MAX_MAP_BYTES)?;
        Ok((Cow::Owned(bytes), path.display().to_string()))
    }
}

impl Table {
    pub(crate) fn load(&self, files: &dyn MapSource, geometry: Geometry) -> Result<Maps> {
        let load = |key: &str, entry: &Option<MapEntry>| match entry {
            None => Ok(None),
            Some(entry) => {
                let map = entry.load(files, geometry);
                map.map(Some).map_err(|e| e.with_context(format_args!("maps.{key}")))
            }
        };
        Ok(Maps {
            gain: load("gain", &self.gain)?,
            dark_pa: load("dark_pa", &self.dark_pa)?,
            capacitance_ff: load("capacitance_ff", &self.capacitance_ff)?,
            swing_v: load("swing_v", &self.swing_v)?,
        })
    }
}

/// Returns the digest of a map file.
///
/// # Errors
/// Returns [`ErrorKind::Usage`] in a build without the feature `maps`, which provides the hash function.
pub(super) fn digest(bytes: &[u8]) -> Result<String> {
    Error::require_feature("the digests of maps in a camera file", "maps", cfg!(feature = "maps"))?;
    Ok(format!("blake3:{}", hash(bytes)))
}

#[cfg(feature = "maps")]
fn hash(bytes: &[u8]) -> String {
    blake3::hash(bytes).to_hex().to_string()
}

#[cfg(not(feature = "maps"))]
fn hash(_: &[u8]) -> String {
    String::new()
}

impl MapEntry {
    fn load(&self, files: &dyn MapSource, geometry: Geometry) -> Result<Vec<f64>> {
        let (bytes, name) = files.read(&self.file)?;
        let actual = digest(&bytes)?;
        if actual != self.digest {
            bail!(Corrupt, "{name}"; found "{actual}"; expected "{}", self.digest;
                remedy "restore the map that belongs to this camera file");
        }
        read(&bytes, geometry).map_err(|e| e.with_context(name))
    }
}

fn read(bytes: &[u8], geometry: Geometry) -> Result<Vec<f64>> {
    let wrong = |found: &dyn std::fmt::Display| {
        error!(Input, "map"; found "{found}";
            expected "an .npy array with {} rows and {} columns of f64", geometry.height(), geometry.width())
    };
    let (header, values) = npy::read_values("map", bytes)?;
    let shape = [geometry.height() as u64, geometry.width() as u64];
    if header.shape != shape || header.element != npy::Element::F64 {
        return Err(wrong(&format_args!("shape {} of {}", npy::shape_text(&header.shape), header.element)));
    }
    Ok(values)
}

/// Returns a map as the bytes of an `.npy` file.
pub(super) fn write(map: &[f64], geometry: Geometry) -> Result<Vec<u8>> {
    npy::map_to_bytes(map, geometry.width())
}
