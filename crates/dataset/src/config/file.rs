//! The keys of `dataset.toml`.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use toml::{Table, Value};

use super::camera;
use crate::spec::serde_text;
use crate::{
    Content, DatasetLayout, DatasetOptions, InputContent, ReferenceImageOptions, SceneContent, Splits,
};
use spikelane::error::{Error, ErrorKind, Result};
use spikelane::unstable::inputs::{Access, path_from_text};

/// Version of the file format.
const FORMAT_VERSION: i64 = 1;

/// Replaces the key `preset` of `[scenes]` with the options of the preset. Options that the table already contains are
/// unchanged.
pub(super) fn expand_preset(table: &mut Table) -> Result<()> {
    let Some(scenes) = table.get_mut("scenes").and_then(Value::as_table_mut) else { return Ok(()) };
    let Some(kind) = scenes.remove("preset") else { return Ok(()) };
    let drives = kind.as_str().and_then(SceneContent::from_preset).ok_or_else(|| {
        Error::new(ErrorKind::Config, "scenes.preset")
            .found(&kind)
            .expected(SceneContent::PRESETS.join(", "))
            .with_suggestion(kind.as_str().unwrap_or_default(), SceneContent::PRESETS)
    })?;
    let options =
        Table::try_from(&drives).map_err(|e| Error::new(ErrorKind::Config, "scenes.preset").found(e))?;
    for (key, value) in options {
        scenes.entry(key).or_insert(value);
    }
    Ok(())
}

#[derive(Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub(super) struct DatasetFile {
    format_version: i64,
    #[serde(default = "default_seed")]
    seed: Value,
    #[serde(default = "default_seed")]
    scene_seed: Value,
    #[serde(default = "default_seed")]
    camera_seed: Value,
    #[serde(
        default,
        deserialize_with = "serde_text::deserialize_text",
        serialize_with = "serde_text::serialize_text"
    )]
    dataset_layout: DatasetLayout,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    data_version: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    license: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    scenes: Option<SceneContent>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    inputs: Option<InputContent>,
    #[serde(default)]
    images: ReferenceImageOptions,
    #[serde(default = "Splits::default_shares")]
    splits: Splits,
    #[serde(default = "default_camera")]
    camera: Value,
}

fn default_seed() -> Value {
    Value::Integer(0)
}

fn default_camera() -> Value {
    Value::String("physical".to_owned())
}

/// Returns a seed as a TOML integer. If the seed exceeds the range of TOML integers, returns the seed as text.
fn seed_value(seed: u64) -> Value {
    i64::try_from(seed).map_or_else(|_| Value::String(seed.to_string()), Value::Integer)
}

fn parse_seed(key: &str, value: &Value) -> Result<u64> {
    let read = match value {
        Value::Integer(n) => u64::try_from(*n).ok(),
        Value::String(text) => text.parse().ok(),
        _ => None,
    };
    read.ok_or_else(|| {
        Error::new(ErrorKind::Config, key)
            .found(value)
            .expected("a whole number from 0 to 18446744073709551615")
    })
}

/// Returns the inputs with absolute paths. The text of the options may be stored in another folder, where relative
/// paths would be wrong.
fn with_absolute_paths(inputs: &InputContent) -> Result<InputContent> {
    let absolute = |path: &Path| std::path::absolute(path).map_err(|e| Error::io(path.display(), e));
    let list = inputs.list.as_deref().map(absolute).transpose()?;
    Ok(InputContent { folder: absolute(&inputs.folder)?, list, ..inputs.clone() })
}

impl DatasetFile {
    pub(super) fn from_options(options: &DatasetOptions, maps: &mut Vec<(String, Vec<u8>)>) -> Result<Self> {
        let (scenes, inputs) = match &options.content {
            Content::Scenes(drives) => (Some(drives.clone()), None),
            Content::Inputs(inputs) => (None, Some(with_absolute_paths(inputs)?)),
        };
        Ok(Self {
            format_version: FORMAT_VERSION,
            seed: seed_value(options.seed),
            scene_seed: seed_value(options.scene_seed),
            camera_seed: seed_value(options.camera_seed),
            dataset_layout: options.dataset_layout,
            data_version: options.data_version.clone(),
            license: options.license.clone(),
            scenes,
            inputs,
            images: options.images,
            splits: options.splits,
            camera: camera::write(options, maps)?,
        })
    }

    pub(super) fn into_options(self, folder: &Path, access: Access) -> Result<DatasetOptions> {
        if self.format_version != FORMAT_VERSION {
            return Err(Error::new(ErrorKind::Config, "dataset")
                .found(format_args!("version {} of the format", self.format_version))
                .expected(FORMAT_VERSION)
                .remedy("use the version of spikelane that wrote the file"));
        }
        let work = match (self.scenes, self.inputs) {
            (Some(drives), None) => Content::Scenes(drives),
            (None, Some(inputs)) => Content::Inputs(InputContent {
                folder: path_from_text(folder, &inputs.folder.to_string_lossy()),
                list: inputs.list.map(|list| path_from_text(folder, &list.to_string_lossy())),
                ..inputs
            }),
            (None, None) => Content::Scenes(SceneContent::rhdd()),
            (Some(_), Some(_)) => {
                return Err(Error::new(ErrorKind::Config, "dataset.toml")
                    .found("[scenes] and [inputs]")
                    .expected("either [scenes] or [inputs]"));
            }
        };
        let (camera, cameras) = camera::read(&self.camera, folder, access)?;
        Ok(DatasetOptions {
            cameras,
            seed: parse_seed("seed", &self.seed)?,
            scene_seed: parse_seed("scene_seed", &self.scene_seed)?,
            camera_seed: parse_seed("camera_seed", &self.camera_seed)?,
            images: self.images,
            dataset_layout: self.dataset_layout,
            splits: self.splits,
            data_version: self.data_version,
            license: self.license,
            ..DatasetOptions::new(PathBuf::new(), work, camera)
        })
    }
}
