//! Per-pixel maps beside a camera file: `.npy` by relative path and digest.

use std::borrow::Cow;
use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::effects::Maps;
use crate::error::{Error, Kind, Result};
use crate::inputs::{Access, InnerPath, read_bytes};
use crate::npy;
use crate::spikes::Geometry;

/// The most that a map may hold, in bytes: 8 for each of 2^28 pixels, the most of a sensor, and a header.
const MAX_BYTES: u64 = (8 << 28) + (1 << 16);

/// One map: its file, relative to the camera file, and the digest of its bytes.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Entry {
    pub file: String,
    pub digest: String,
}

#[derive(Clone, Debug, Default, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Table {
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gain: Option<Entry>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub dark_pa: Option<Entry>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub capacitance_ff: Option<Entry>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub swing_v: Option<Entry>,
}

/// Where the maps of a camera file lie.
pub(super) trait Files {
    /// The bytes of `file`, and what to call it in errors.
    fn read(&self, file: &str) -> Result<(Cow<'_, [u8]>, String)>;
}

/// Files in a folder, if there is one.
pub(super) struct Folder<'a>(pub Option<&'a Path>);

impl Files for Folder<'_> {
    fn read(&self, file: &str) -> Result<(Cow<'_, [u8]>, String)> {
        let inner = InnerPath::parse(Kind::Config, "file", file)
            .map_err(|e| e.expected("a path relative to the camera file, inside its folder"))?;
        let folder = self.0.ok_or_else(|| {
            Error::new(Kind::Config, file).expected("a camera file, whose folder has its maps")
        })?;
        let path = inner.below(folder, Access::Read)?;
        let bytes = read_bytes(&path, "a map", MAX_BYTES)?;
        Ok((Cow::Owned(bytes), path.display().to_string()))
    }
}

impl Table {
    pub(crate) fn load(&self, files: &dyn Files, geometry: Geometry) -> Result<Maps> {
        let load = |key: &str, entry: &Option<Entry>| match entry {
            None => Ok(None),
            Some(entry) => {
                let map = entry.load(files, geometry);
                map.map(Some).map_err(|e| e.within(format_args!("maps.{key}")))
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

/// # Errors
/// [`Kind::Usage`] in a build without the feature `files`, which brings the hash.
pub(super) fn digest(bytes: &[u8]) -> Result<String> {
    Error::require("maps of a camera file, which have digests", "maps", cfg!(feature = "maps"))?;
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

impl Entry {
    fn load(&self, files: &dyn Files, geometry: Geometry) -> Result<Vec<f64>> {
        let (bytes, name) = files.read(&self.file)?;
        let found = digest(&bytes)?;
        if found != self.digest {
            return Err(Error::new(Kind::Corrupt, name)
                .found(found)
                .expected(&self.digest)
                .remedy("restore the map that belongs to this camera file"));
        }
        read(&bytes, geometry).map_err(|e| e.within(name))
    }
}

fn read(bytes: &[u8], geometry: Geometry) -> Result<Vec<f64>> {
    let wrong = |found: &dyn std::fmt::Display| {
        Error::new(Kind::Input, "map").found(found).expected(format_args!(
            "an .npy array of {} rows and {} columns of f64",
            geometry.height(),
            geometry.width()
        ))
    };
    let (header, values) = npy::read_values("map", bytes)?;
    let shape = [geometry.height() as u64, geometry.width() as u64];
    if header.shape != shape || header.element != npy::Element::F64 {
        return Err(wrong(&format_args!("shape {:?} of {}", header.shape, header.element)));
    }
    Ok(values)
}

/// The bytes of a map as `.npy`.
pub(super) fn write(map: &[f64], geometry: Geometry) -> Result<Vec<u8>> {
    npy::map_to_bytes(map, geometry.width())
}
