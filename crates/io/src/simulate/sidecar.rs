//! The JSON file beside a stream: what it is, and everything needed to make it again.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::formats::{Layout, sidecar_beside};
use crate::light::{Source, Transfer};
use crate::simulate::{ImageFacts, ImageFile, Written};
use crate::storage;
use spikelane::effects::Camera;
use spikelane::effects::definition::Form;
use spikelane::error::{Error, Kind, Result};
use spikelane::presets;
use spikelane::spikes::Geometry;
use spikelane::unstable::draws::Seeds;
use spikelane::unstable::inputs::{Access, InnerPath, MAX_TEXT_BYTES, PlainName, read_bytes};

/// One file of a run.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
pub struct StreamFacts {
    /// Name, in the sidecar's folder.
    pub file: String,
    /// Length.
    pub bytes: u64,
    /// Digest of all bytes, `blake3:<hex>`; the same on every backend and any number of threads.
    pub digest: String,
    /// Spikes in it.
    pub spikes: u64,
    /// Spikes per pixel and readout.
    pub mean_rate: f64,
}

impl StreamFacts {
    /// The facts of a file of `readouts` frames.
    #[must_use]
    pub fn new(written: &Written, geometry: Geometry, readouts: u64) -> Self {
        let name = written.path.file_name().unwrap_or_default();
        Self {
            file: name.to_string_lossy().into_owned(),
            bytes: written.bytes,
            digest: written.digest.clone(),
            spikes: written.spikes,
            mean_rate: written.spikes as f64 / (geometry.pixels() as f64 * readouts.max(1) as f64),
        }
    }

    /// Returns the path of the file, which lies beside its sidecar at `sidecar`.
    ///
    /// # Errors
    /// [`Kind::Config`] when the sidecar names no file beside it, and [`Kind::Input`] for a link that leaves the folder,
    /// unless `access` allows it.
    pub fn beside(&self, sidecar: &Path, access: Access) -> Result<PathBuf> {
        let name = PlainName::parse(Kind::Config, format_args!("{}: file", sidecar.display()), &self.file)
            .map_err(|e| e.expected("a file beside the sidecar").remedy("name the stream itself"))?;
        beside(sidecar, &InnerPath::from(name), access)
    }
}

/// Returns the path of `inner` in the folder of the sidecar.
fn beside(sidecar: &Path, inner: &InnerPath, access: Access) -> Result<PathBuf> {
    // Of a sidecar without a folder the paths are empty, and those of its files are their names alone.
    inner.below(sidecar.parent().unwrap_or(Path::new("")), access)
}

/// Where the light came from and how it was read.
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Serialize)]
pub struct LightFacts {
    /// The source in its own words.
    pub source: String,
    /// Transfer function that was undone: linear, srgb, or an exponent.
    pub transfer: String,
    /// Weights of red, green and blue.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub luminance: Option<[f64; 3]>,
    /// Whether colour became a rounded grey code before the transfer function was undone.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub grey_codes: Option<bool>,
    /// The 8-bit code of light 1.0, or `peak` for the brightest pixel of each frame.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub full_scale: Option<String>,
    /// How frames were brought to the camera's size.
    pub fit: String,
    /// A motion over a single image.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub motion: Option<String>,
    /// What the light does between frames.
    pub insertion: String,
    /// Readouts per frame, as a fraction; `None` when one frame is held.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub readouts_per_frame: Option<String>,
    /// Frames per second that the source states or the user gave.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub source_rate: Option<String>,
    /// Frames read.
    pub frames: u64,
    /// Electrons per readout at full scale.
    pub exposure_electrons: f64,
    /// Brightest light of the plan in full scales.
    pub greatest_light: f64,
    /// Frames that held brighter light, which was cut.
    pub frames_beyond_greatest_light: u64,
}

impl LightFacts {
    /// What `source` says of itself.
    #[must_use]
    pub fn of(source: &dyn Source) -> Self {
        let used = source.front_end();
        Self {
            source: source.describe(),
            transfer: used.transfer.unwrap_or(Transfer::Linear).to_string(),
            luminance: Some(used.luminance),
            grey_codes: Some(used.grey_codes),
            full_scale: Some(used.full_scale.to_string()),
            source_rate: source.rate().map(|r| r.to_string()),
            ..Self::default()
        }
    }
}

/// The nominal circuit.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[non_exhaustive]
pub struct SensorFacts {
    /// Femtofarads.
    pub capacitance_ff: f64,
    /// Volts.
    pub swing_v: f64,
    /// Nominal thresholds per readout at full scale.
    pub thresholds_at_full_scale: f64,
    /// Electrons in a nominal threshold.
    pub electrons_per_threshold: f64,
}

/// The camera, in numbers and as the text of a camera file.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[non_exhaustive]
pub struct CameraFacts {
    /// Name.
    pub name: String,
    /// Where its numbers come from.
    pub source: String,
    /// Circuit.
    pub sensor: SensorFacts,
    /// Effects and their parameters: numbers in the stored unit, or words.
    pub effects: BTreeMap<String, BTreeMap<String, Value>>,
    /// Names of the maps that the camera file refers to.
    pub maps: Vec<String>,
    /// The camera file.
    pub toml: String,
}

impl CameraFacts {
    /// Describes `camera`.
    ///
    /// # Errors
    /// As [`presets::to_toml`].
    pub fn new(camera: &Camera) -> Result<Self> {
        let saved = presets::to_toml(camera)?;
        let effects = camera.effects().iter().map(|effect| {
            let params = effect.definition().params.iter().zip(effect.values());
            let values = params.map(|(p, &v)| {
                let value = match p.form {
                    Form::Number { .. } if v.is_finite() => Value::from(v),
                    _ => Value::from(p.format(v)),
                };
                (p.key.to_owned(), value)
            });
            (effect.name().to_owned(), values.collect())
        });
        Ok(Self {
            name: camera.name.clone(),
            source: camera.source.clone(),
            sensor: SensorFacts {
                capacitance_ff: camera.sensor.capacitance_ff,
                swing_v: camera.sensor.swing_v,
                thresholds_at_full_scale: camera.sensor.thresholds_at_full_scale,
                electrons_per_threshold: camera.operating(0.0).electrons,
            },
            effects: effects.collect(),
            maps: saved.maps.into_iter().map(|(name, _)| name).collect(),
            toml: saved.text,
        })
    }
}

/// The sidecar. Files of other programs may lack everything but the first keys.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
pub struct Sidecar {
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Name of the layout.
    pub layout: String,
    /// Frames of each stream.
    pub readouts: u64,
    /// Readouts per second.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub readout_hz: Option<f64>,
    /// The (noisy) stream.
    #[serde(flatten)]
    pub stream: StreamFacts,
    /// Its clean twin.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub clean: Option<StreamFacts>,
    /// What fixes the randomness.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub seeds: Option<BTreeMap<String, u64>>,
    /// The light.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub light: Option<LightFacts>,
    /// The camera.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub camera: Option<CameraFacts>,
    /// Clear images that were kept.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub images: Option<ImageFacts>,
    /// Of a converted stream: the range, the crop, and the sidecar of the original.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub converted_from: Option<Value>,
    /// Version of the crate that made it.
    pub version: String,
    /// The command that made it, argument by argument.
    #[serde(default)]
    pub command: Vec<String>,
}

impl Sidecar {
    /// The facts that every stream has.
    #[must_use]
    pub fn new(geometry: Geometry, layout: Layout, readouts: u64, stream: StreamFacts) -> Self {
        Self {
            width: geometry.width() as u32,
            height: geometry.height() as u32,
            layout: layout.name().to_owned(),
            readouts,
            readout_hz: None,
            stream,
            clean: None,
            seeds: None,
            light: None,
            camera: None,
            images: None,
            converted_from: None,
            version: env!("CARGO_PKG_VERSION").to_owned(),
            command: Vec::new(),
        }
    }

    /// Seeds as the sidecar keeps them.
    #[must_use]
    pub fn seed_facts(seeds: Seeds) -> BTreeMap<String, u64> {
        let named = [("camera", seeds.camera), ("shot", seeds.shot), ("sequence", seeds.sequence)];
        named.map(|(name, seed)| (name.to_owned(), seed)).into()
    }

    /// Writes it, whole or not at all.
    ///
    /// # Errors
    /// As [`storage::write_small`].
    pub fn write(&self, path: &Path, force: bool) -> Result<()> {
        let mut text = serde_json::to_string_pretty(self)
            .map_err(|e| Error::new(Kind::Config, path.display()).found(e))?;
        text.push('\n');
        storage::write_small(path, text.as_bytes(), force)
    }

    /// Reads a sidecar.
    ///
    /// # Errors
    /// [`Kind::Io`] when it cannot be read, [`Kind::Config`] when it is none.
    pub fn read(path: &Path) -> Result<Self> {
        let text = read_bytes(path, "a sidecar", MAX_TEXT_BYTES)?;
        serde_json::from_slice(&text).map_err(|e| {
            Error::new(Kind::Config, path.display())
                .found(e)
                .expected("a sidecar that this program wrote")
                .remedy("restore it, or give width, height and layout")
        })
    }

    /// The sidecar that lies beside a stream, with its path; `None` when there is none.
    ///
    /// # Errors
    /// As [`Sidecar::read`]; [`Kind::Input`] for a link that leads elsewhere.
    pub fn beside(stream: &Path) -> Result<Option<(PathBuf, Self)>> {
        sidecar_beside(stream)?.map(|path| Self::read(&path).map(|sidecar| (path, sidecar))).transpose()
    }

    /// Returns the paths and digests of the clear images that the sidecar at `path` lists, which lie in a folder beside it.
    ///
    /// # Errors
    /// As [`StreamFacts::beside`].
    pub fn images_beside(&self, path: &Path, access: Access) -> Result<Vec<(PathBuf, &str)>> {
        let Some(images) = &self.images else { return Ok(Vec::new()) };
        let name = |key: &str, text: &str| {
            PlainName::parse(Kind::Config, format_args!("{}: images: {key}", path.display()), text)
        };
        let folder = InnerPath::from(name("folder", &images.folder)?);
        let image = |image: &'_ ImageFile| beside(path, &folder.join(name("file", &image.file)?), access);
        images.files.iter().map(|file| Ok((image(file)?, file.digest.as_str()))).collect()
    }

    /// What it says of the file called `name`: the clean twin's facts for its name, else the stream's.
    #[must_use]
    pub fn facts(&self, name: &str) -> &StreamFacts {
        self.clean.as_ref().filter(|clean| clean.file == name).unwrap_or(&self.stream)
    }
}

/// Writes `camera` as `camera.toml` into `folder` (made if missing), its maps beside it by
/// relative path and digest, so that the folder can be moved; returns the camera file's path.
///
/// # Errors
/// [`Kind::Exists`] when a file is there and `force` is false; what the system refuses.
pub fn save_camera(camera: &Camera, folder: &Path, force: bool) -> Result<PathBuf> {
    let saved = presets::to_toml(camera)?;
    let path = folder.join("camera.toml");
    let mut all = saved.maps.iter().map(|(name, _)| folder.join(name)).chain([path.clone()]);
    if let Some(taken) = all.find(|p| !force && p.exists()) {
        return Err(Error::new(Kind::Exists, taken.display())
            .found("a file of that name")
            .expected("a free name")
            .remedy("choose another folder, or allow overwriting (--force)"));
    }
    std::fs::create_dir_all(folder).map_err(|e| Error::io(folder.display(), e))?;
    let mut group = storage::FileGroup::new(force);
    for (name, bytes) in &saved.maps {
        group.write(&folder.join(name), bytes)?;
    }
    group.write(&path, saved.text.as_bytes())?;
    group.commit()?;
    Ok(path)
}
