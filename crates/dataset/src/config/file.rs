//! The keys of `dataset.toml`.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use toml::{Table, Value};

use super::camera;
use crate::asked::texts;
use crate::{DatasetOptions, Drives, Images, Inputs, Splits, Structure, Work};
use spikelane::error::{Error, Kind, Result};
use spikelane::unstable::inputs::Access;

/// The version of the text that this program writes and reads.
const VERSION: i64 = 1;

/// Replaces the `kind` of `[scenes]` by the options of that kind that the table does not set.
pub(super) fn expand_kind(table: &mut Table) -> Result<()> {
    let Some(scenes) = table.get_mut("scenes").and_then(Value::as_table_mut) else { return Ok(()) };
    let Some(kind) = scenes.remove("kind") else { return Ok(()) };
    let drives = kind.as_str().and_then(Drives::preset).ok_or_else(|| {
        Error::new(Kind::Config, "scenes.kind")
            .found(&kind)
            .expected(Drives::PRESETS.join(", "))
            .or_nearest(kind.as_str().unwrap_or_default(), Drives::PRESETS)
    })?;
    let options = Table::try_from(&drives).map_err(|e| Error::new(Kind::Config, "scenes.kind").found(e))?;
    for (key, value) in options {
        scenes.entry(key).or_insert(value);
    }
    Ok(())
}

#[derive(Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub(super) struct File {
    dataset: i64,
    #[serde(default = "zero")]
    seed: Value,
    #[serde(default = "zero")]
    scene_seed: Value,
    #[serde(default = "zero")]
    camera_seed: Value,
    #[serde(default, deserialize_with = "texts::read", serialize_with = "texts::write")]
    structure: Structure,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    version: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    licence: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    scenes: Option<Drives>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    inputs: Option<Inputs>,
    #[serde(default)]
    images: Images,
    #[serde(default = "Splits::usual")]
    splits: Splits,
    #[serde(default = "physical")]
    camera: Value,
}

fn zero() -> Value {
    Value::Integer(0)
}

fn physical() -> Value {
    Value::String("physical".to_owned())
}

/// A seed beyond what TOML's integers hold is a text.
fn seed_value(seed: u64) -> Value {
    i64::try_from(seed).map_or_else(|_| Value::String(seed.to_string()), Value::Integer)
}

fn seed_of(key: &str, value: &Value) -> Result<u64> {
    let read = match value {
        Value::Integer(n) => u64::try_from(*n).ok(),
        Value::String(text) => text.parse().ok(),
        _ => None,
    };
    read.ok_or_else(|| {
        Error::new(Kind::Config, key).found(value).expected("a whole number from 0 to 18446744073709551615")
    })
}

/// The inputs by absolute paths: the text may lie in another folder.
fn absolute(inputs: &Inputs) -> Result<Inputs> {
    let whole = |path: &Path| std::path::absolute(path).map_err(|e| Error::io(path.display(), e));
    let list = inputs.list.as_deref().map(whole).transpose()?;
    Ok(Inputs { folder: whole(&inputs.folder)?, list, ..inputs.clone() })
}

impl File {
    pub(super) fn of(options: &DatasetOptions, maps: &mut Vec<(String, Vec<u8>)>) -> Result<Self> {
        let (scenes, inputs) = match &options.work {
            Work::Drives(drives) => (Some(drives.clone()), None),
            Work::Inputs(inputs) => (None, Some(absolute(inputs)?)),
        };
        Ok(Self {
            dataset: VERSION,
            seed: seed_value(options.seed),
            scene_seed: seed_value(options.scene_seed),
            camera_seed: seed_value(options.camera_seed),
            structure: options.structure,
            version: options.data_version.clone(),
            licence: options.licence.clone(),
            scenes,
            inputs,
            images: options.images,
            splits: options.splits,
            camera: camera::write(options, maps)?,
        })
    }

    pub(super) fn options(self, folder: &Path, access: Access) -> Result<DatasetOptions> {
        if self.dataset != VERSION {
            return Err(Error::new(Kind::Config, "dataset")
                .found(format_args!("version {} of the text", self.dataset))
                .expected(VERSION)
                .remedy("make it with the version of the program that wrote it"));
        }
        let work = match (self.scenes, self.inputs) {
            (Some(drives), None) => Work::Drives(drives),
            (None, Some(inputs)) => Work::Inputs(Inputs {
                folder: folder.join(inputs.folder),
                list: inputs.list.map(|list| folder.join(list)),
                ..inputs
            }),
            (None, None) => Work::Drives(Drives::rhdd()),
            (Some(_), Some(_)) => {
                return Err(Error::new(Kind::Config, "dataset.toml")
                    .found("[scenes] and [inputs]")
                    .expected("one of them"));
            }
        };
        let (camera, cameras) = camera::read(&self.camera, folder, access)?;
        Ok(DatasetOptions {
            cameras,
            seed: seed_of("seed", &self.seed)?,
            scene_seed: seed_of("scene_seed", &self.scene_seed)?,
            camera_seed: seed_of("camera_seed", &self.camera_seed)?,
            images: self.images,
            structure: self.structure,
            splits: self.splits,
            data_version: self.version,
            licence: self.licence,
            ..DatasetOptions::new(PathBuf::new(), work, camera)
        })
    }
}
