//! The JSON sidecar of a stream. The sidecar describes the stream and contains all data that are needed to simulate
//! the stream again.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::formats::{Layout, StreamSummary, find_sidecar};
use crate::light::{Source, Transfer};
use crate::simulate::{ImageFacts, ImageFile};
use crate::storage;
use spikelane::effects::Camera;
use spikelane::effects::definition::ParamKind;
use spikelane::error::{Error, ErrorKind, Result, Setting, bail, error};
use spikelane::presets;
use spikelane::sensor::{FrontEnd, Mosaic};
use spikelane::spikes::Geometry;
use spikelane::unstable::draws::Seeds;
use spikelane::unstable::inputs::{
    Access, InnerPath, MAX_TEXT_BYTES, PlainName, check_link, deserialize_digest, read_bytes, utf8_bytes,
};

/// One stream file of a run.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
pub struct StreamFacts {
    /// Name of the file. The file is in the folder of the sidecar.
    pub file: String,
    /// Length of the file in bytes.
    pub bytes: u64,
    /// Digest of all bytes of the file, as `blake3:<hex>`. The digest does not depend on the backend or on the number
    /// of threads.
    #[serde(deserialize_with = "deserialize_digest")]
    pub digest: String,
    /// Number of spikes.
    pub spikes: u64,
    /// Mean number of spikes per pixel and readout.
    pub mean_rate: f64,
}

impl StreamFacts {
    /// Describes a file of `readouts` frames.
    #[must_use]
    pub fn new(written: &StreamSummary, geometry: Geometry, readouts: u64) -> Self {
        let name = written.path.file_name().unwrap_or_default();
        Self {
            file: name.to_string_lossy().into_owned(),
            bytes: written.bytes,
            digest: written.digest.clone(),
            spikes: written.spikes,
            mean_rate: written.spikes as f64 / (geometry.pixels() as f64 * readouts.max(1) as f64),
        }
    }

    /// Returns the path of the file in the folder of the sidecar. `sidecar` is the path of the sidecar.
    ///
    /// # Errors
    /// * [`ErrorKind::Config`] if the name in the sidecar is not a plain file name.
    /// * [`ErrorKind::Input`] if the file is a link to a file in another folder and `access` does not permit such
    ///   links.
    pub fn path_beside(&self, sidecar: &Path, access: Access) -> Result<PathBuf> {
        if let Some(path) = path_with_stem(sidecar, &self.file) {
            check_link(sidecar.parent().unwrap_or(Path::new("")), &path, access)?;
            return Ok(path);
        }
        let name =
            PlainName::parse(ErrorKind::Config, format_args!("{}: file", sidecar.display()), &self.file)
                .map_err(|e| {
                    e.expected("a file in the folder of the sidecar")
                        .remedy("select the stream instead of the sidecar")
                })?;
        // If the sidecar path has no folder, the returned path is relative to the current folder as well.
        InnerPath::from(name).resolve_in(sidecar.parent().unwrap_or(Path::new("")), access)
    }
}

/// Returns the path of the file `name` if `name` is not portable and begins with the stem of the sidecar.
///
/// A sidecar is UTF-8, so it cannot contain every file name. The stem is therefore copied from the path of the sidecar,
/// which the user named. Only the ending comes from the sidecar, and it cannot contain a path.
fn path_with_stem(sidecar: &Path, name: &str) -> Option<PathBuf> {
    let is_plain = |text: &str| PlainName::parse(ErrorKind::Config, "file", text).is_ok();
    if is_plain(name) && !name.contains(char::REPLACEMENT_CHARACTER) {
        return None;
    }
    let stem = sidecar.file_stem()?;
    let ending = name.strip_prefix(&*stem.to_string_lossy()).filter(|e| e.is_empty() || is_plain(e))?;
    let mut file = stem.to_os_string();
    file.push(ending);
    Some(sidecar.with_file_name(file))
}

/// The source of the light, and how the light was read.
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Serialize)]
pub struct LightFacts {
    /// Description of the source.
    pub source: String,
    /// The transfer function that was reversed: `linear`, `srgb`, or an exponent.
    pub transfer: String,
    /// Weights of red, green and blue in the luminance.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub luminance: Option<[f64; 3]>,
    /// Whether color was converted to a rounded gray code before the inverse of the transfer function was applied.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gray_codes: Option<bool>,
    /// The stored value that represents light 1.0, in the units of the input, or `peak` if the brightest pixel of each
    /// frame represents light 1.0. Earlier versions wrote the 8-bit code of the camera's front end.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub full_scale: Option<String>,
    /// How frames were resized to the camera's geometry. `None` for drawn light.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub resize_mode: Option<String>,
    /// The camera motion across a single image.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub motion: Option<String>,
    /// How light is interpolated between frames.
    pub interpolation: String,
    /// Number of readouts per frame as a fraction. `None` if the source is one constant frame.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub readouts_per_frame: Option<String>,
    /// Number of frames per second. The number was specified by the source or by the user.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub source_rate: Option<String>,
    /// Number of frames that were read.
    pub frames: u64,
    /// Electrons per readout at full scale.
    pub exposure_electrons: f64,
    /// Maximum light of the plan, in units of full scale.
    pub max_light: f64,
    /// Number of frames with light above `max_light`. Such light was clipped.
    pub frames_above_max_light: u64,
}

impl LightFacts {
    /// Returns the facts that `source` provides. Drawn light is not converted, so it has no facts about a conversion.
    #[must_use]
    pub fn from_source(source: &dyn Source) -> Self {
        let used = conversion(source);
        let transfer = used.and_then(|used| used.transfer).unwrap_or(Transfer::Linear);
        Self {
            source: source.describe(),
            transfer: transfer.to_string(),
            luminance: used.map(|used| used.luminance),
            gray_codes: used.map(|used| used.gray_codes),
            full_scale: used.map(|used| used.full_scale.to_string()),
            source_rate: source.rate().map(|r| r.to_string()),
            ..Self::default()
        }
    }

    /// Describes the light of `source` in one line: the conversion of stored values to light, or the drawn scene.
    #[must_use]
    pub fn summary(source: &dyn Source) -> String {
        conversion(source).map_or_else(|| source.describe(), |used| used.to_string())
    }
}

/// Returns the conversion of stored values to light, or `None` if the light is drawn at the camera's size.
///
/// Full scale is in the units of the input, because the user sets it in these units.
fn conversion(source: &dyn Source) -> Option<FrontEnd> {
    source.stored_geometry().map(|_| FrontEnd { full_scale: source.full_scale(), ..source.front_end() })
}

/// The nominal values of the sensor circuit.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[non_exhaustive]
pub struct SensorFacts {
    /// Capacitance in femtofarads.
    pub capacitance_ff: f64,
    /// Voltage swing in volts.
    pub swing_v: f64,
    /// Number of nominal thresholds per readout at full scale.
    pub thresholds_at_full_scale: f64,
    /// Electrons per nominal threshold.
    pub electrons_per_threshold: f64,
}

/// The camera as numbers, and as the text of a camera file.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[non_exhaustive]
pub struct CameraFacts {
    /// Name of the camera.
    pub name: String,
    /// Origin of the camera's parameters.
    pub source: String,
    /// The nominal circuit.
    pub sensor: SensorFacts,
    /// Effects and their parameters. A parameter is a number in the stored unit, or a name.
    pub effects: BTreeMap<String, BTreeMap<String, Value>>,
    /// Names of the maps that the camera file refers to.
    pub maps: Vec<String>,
    /// The text of the camera file.
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
                let value = match p.kind {
                    ParamKind::Number { .. } if v.is_finite() => Value::from(v),
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
                electrons_per_threshold: camera.operating_point(0.0).electrons,
            },
            effects: effects.collect(),
            maps: saved.maps.into_iter().map(|(name, _)| name).collect(),
            toml: saved.text,
        })
    }
}

/// The color filters of a camera.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[non_exhaustive]
pub struct MosaicFacts {
    /// The pattern from the first pixel of the stream, such as `RGGB`.
    pub pattern: String,
    /// The weights of linear red, green and blue in the light of each channel. A missing channel has the default
    /// response of its letter.
    #[serde(default)]
    pub weights: BTreeMap<char, [f64; 3]>,
    /// The illuminant of white, for which the weights of a channel sum to its light.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub illuminant: Option<String>,
    /// The light of each channel for white.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub white: BTreeMap<char, f64>,
}

impl MosaicFacts {
    /// Describes `mosaic`.
    ///
    /// # Examples
    /// ```
    /// use spikelane_io::simulate::MosaicFacts;
    /// let facts = MosaicFacts::new(&"BGGR".parse()?);
    /// assert_eq!((facts.pattern.as_str(), facts.white[&'R']), ("BGGR", 1.0));
    /// assert_eq!(facts.mosaic()?.to_string(), "BGGR");
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    #[must_use]
    pub fn new(mosaic: &Mosaic) -> Self {
        Self {
            pattern: mosaic.to_string(),
            weights: mosaic.channels().iter().map(|c| (c.name, c.weights())).collect(),
            illuminant: Some("D65".to_owned()),
            white: mosaic.channels().iter().map(|c| (c.name, c.white())).collect(),
        }
    }

    /// Returns the mosaic. Its channels have the gain 1 and the weights as their responses.
    ///
    /// # Errors
    /// As [`Mosaic::new`].
    pub fn mosaic(&self) -> Result<Mosaic> {
        let responses: Vec<(char, [f64; 3])> = self.weights.iter().map(|(name, w)| (*name, *w)).collect();
        Mosaic::new(&self.pattern, &responses).map_err(|e| e.with_context("sidecar: mosaic"))
    }
}

/// The sidecar of a stream. A key whose field is an `Option` or has a default may be missing in the file, for example
/// if another program wrote the sidecar.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
pub struct Sidecar {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Name of the layout.
    pub layout: String,
    /// Number of frames in each stream.
    pub readouts: u64,
    /// Readouts per second.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub readout_hz: Option<f64>,
    /// The stream that the camera recorded, including noise.
    #[serde(flatten)]
    pub stream: StreamFacts,
    /// The stream of the clean twin.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub clean: Option<StreamFacts>,
    /// The seeds of the random numbers.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub seeds: Option<BTreeMap<String, u64>>,
    /// The light source.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub light: Option<LightFacts>,
    /// The camera.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub camera: Option<CameraFacts>,
    /// The color filters of the camera. `None` for a gray camera.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mosaic: Option<MosaicFacts>,
    /// The reference images.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub images: Option<ImageFacts>,
    /// The description of the original stream, if this stream was converted. It contains the copied range, the crop and
    /// the sidecar of the original stream.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub converted_from: Option<Value>,
    /// Version of the crate that wrote the sidecar.
    pub version: String,
    /// The command line that wrote the sidecar.
    #[serde(default)]
    pub command: Vec<String>,
}

impl Sidecar {
    /// Creates a sidecar that contains only the facts that every stream has.
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
            mosaic: None,
            images: None,
            converted_from: None,
            version: env!("CARGO_PKG_VERSION").to_owned(),
            command: Vec::new(),
        }
    }

    /// Returns the seeds as the sidecar stores them.
    #[must_use]
    pub fn seed_facts(seeds: Seeds) -> BTreeMap<String, u64> {
        let named = [("camera", seeds.camera), ("shot", seeds.shot), ("sequence", seeds.sequence)];
        named.map(|(name, seed)| (name.to_owned(), seed)).into()
    }

    /// Writes the sidecar as a complete file.
    ///
    /// # Errors
    /// As [`storage::write_small`].
    pub fn write(&self, path: &Path, force: bool) -> Result<()> {
        let mut text = serde_json::to_string_pretty(self)
            .map_err(|e| error!(Config, "{}", path.display(); found "{e}"))?;
        text.push('\n');
        storage::write_small(path, text.as_bytes(), force)
    }

    /// Reads a sidecar.
    ///
    /// # Errors
    /// * [`ErrorKind::Io`] if the file cannot be read.
    /// * [`ErrorKind::Config`] if the file is not a sidecar.
    pub fn read(path: &Path) -> Result<Self> {
        Self::parse(path, &read_bytes(path, "a sidecar", MAX_TEXT_BYTES)?)
    }

    /// Parses the text of a sidecar. Errors refer to the sidecar as `path`.
    ///
    /// # Errors
    /// [`ErrorKind::Config`] if the text is not a sidecar.
    pub fn parse(path: &Path, text: &[u8]) -> Result<Self> {
        serde_json::from_slice(&utf8_bytes(text)).map_err(|e| {
            error!(Config, "{}", path.display(); found "{e}"; expected "a sidecar written by this version";
                remedy "restore the sidecar; if an earlier version wrote the sidecar, simulate the stream again")
        })
    }

    /// Returns the sidecar of a stream and the path of the sidecar, or `None` if no sidecar exists.
    ///
    /// # Errors
    /// Errors of [`Sidecar::read`]. Also [`ErrorKind::Input`] if the sidecar is a link to a file in another folder.
    pub fn read_beside(stream: &Path) -> Result<Option<(PathBuf, Self)>> {
        find_sidecar(stream)?.map(|path| Self::read(&path).map(|sidecar| (path, sidecar))).transpose()
    }

    /// Returns the paths and digests of the reference images that the sidecar lists. `path` is the path of the
    /// sidecar, and the folder of the images is beside the sidecar.
    ///
    /// # Errors
    /// As [`StreamFacts::path_beside`].
    pub fn image_paths(&self, path: &Path, access: Access) -> Result<Vec<(PathBuf, &str)>> {
        let Some(images) = &self.images else { return Ok(Vec::new()) };
        let name = |key: &str, text: &str| {
            PlainName::parse(ErrorKind::Config, format_args!("{}: images: {key}", path.display()), text)
        };
        let parent = path.parent().unwrap_or(Path::new(""));
        let folder = match path_with_stem(path, &images.folder) {
            Some(folder) => folder,
            None => InnerPath::from(name("folder", &images.folder)?).resolve_in(parent, access)?,
        };
        check_link(parent, &folder, access)?;
        let image =
            |image: &'_ ImageFile| InnerPath::from(name("file", &image.file)?).resolve_in(&folder, access);
        images.files.iter().map(|file| Ok((image(file)?, file.digest.as_str()))).collect()
    }

    /// Returns the facts of the file `name`. If `name` is the name of the clean twin's file, these are the facts of
    /// the clean stream. Otherwise these are the facts of the noisy stream.
    #[must_use]
    pub fn stream_facts(&self, name: &str) -> &StreamFacts {
        self.clean.as_ref().filter(|clean| clean.file == name).unwrap_or(&self.stream)
    }
}

/// Writes `camera` to `camera.toml` in `folder`. Returns the path of the camera file. A missing folder is created.
///
/// The maps of the camera are written beside the camera file. The camera file refers to each map by relative path and
/// digest, so the folder can be moved.
///
/// # Examples
/// ```
/// use spikelane::{Camera, Sensor, presets};
/// use spikelane_io::simulate::save_camera;
/// # let folder = tempfile::tempdir().map_err(|e| spikelane::Error::io("a folder", e))?;
/// let mut camera = Camera::ideal(Sensor::new(4, 2, 20_000.0)?);
/// camera.maps.gain = Some(vec![1.0, 0.9, 1.1, 1.0, 1.0, 1.0, 1.0, 1.0]);
/// let path = save_camera(&camera, folder.path(), false)?;
/// assert_eq!(presets::load(&path.display().to_string())?, camera);
/// # Ok::<(), spikelane::Error>(())
/// ```
///
/// # Errors
/// [`ErrorKind::Exists`] if a file exists and `force` is false. Also errors of the operating system.
pub fn save_camera(camera: &Camera, folder: &Path, force: bool) -> Result<PathBuf> {
    let saved = presets::to_toml(camera)?;
    let path = folder.join("camera.toml");
    let mut all = saved.maps.iter().map(|(name, _)| folder.join(name)).chain([path.clone()]);
    if let Some(existing) = all.find(|p| !force && p.exists()) {
        bail!(Exists, "{}", existing.display(); found "an existing file";
            expected "a path that does not exist";
            remedy "choose another folder, or set {} to replace the file", Setting("force"));
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
