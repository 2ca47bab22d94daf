//! The keys of `dataset.toml`.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use toml::{Table, Value};

use super::camera;
use super::tables::{ImagesTable, InputsTable, ScenesTable, SplitsTable, said};
use crate::dataset::{DatasetOptions, Drives, Images, Splits, Structure, Work};
use crate::error::{Error, Kind, Result};
use crate::inputs::Access;

/// The version of the text that this program writes and reads.
const VERSION: i64 = 1;

/// The tables and their keys.
const KEYS: [(&str, &[&str]); 5] = [
    (
        "",
        &[
            "dataset",
            "seed",
            "scene_seed",
            "camera_seed",
            "structure",
            "version",
            "licence",
            "scenes",
            "inputs",
            "images",
            "splits",
            "camera",
        ],
    ),
    (
        "scenes",
        &[
            "kind",
            "sequences",
            "images",
            "readouts_per_image",
            "label_every",
            "lighting",
            "flicker_hz",
            "vehicles",
            "speed_kmh",
            "white_cd_m2",
            "samples",
            "npy",
            "kitti",
            "exr",
        ],
    ),
    ("inputs", &["folder", "list", "readouts_per_frame", "insertion", "fit", "transfer"]),
    ("images", &["every", "as"]),
    ("splits", &["validation", "test", "by_light"]),
];

/// Refuses keys that there are not, and asks for the nearest.
pub(super) fn check_keys(table: &Table) -> Result<()> {
    for (name, keys) in KEYS {
        let part = if name.is_empty() { Some(table) } else { table.get(name).and_then(Value::as_table) };
        for key in part.into_iter().flat_map(Table::keys) {
            if !keys.contains(&key.as_str()) {
                let place = if name.is_empty() { "dataset.toml".to_owned() } else { format!("[{name}]") };
                return Err(Error::new(Kind::Config, place)
                    .found(format_args!("`{key}`"))
                    .expected(keys.join(", "))
                    .or_nearest(key, keys.iter().copied()));
            }
        }
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
    #[serde(default, skip_serializing_if = "Option::is_none")]
    structure: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    version: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    licence: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    scenes: Option<ScenesTable>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    inputs: Option<InputsTable>,
    #[serde(default)]
    images: ImagesTable,
    #[serde(default)]
    splits: SplitsTable,
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

impl File {
    pub(super) fn of(options: &DatasetOptions, maps: &mut Vec<(String, Vec<u8>)>) -> Result<Self> {
        let (scenes, inputs) = match &options.work {
            Work::Drives(drives) => (Some(ScenesTable::of(drives)), None),
            Work::Inputs(inputs) => (None, Some(InputsTable::of(inputs)?)),
        };
        let Splits { validation, test, by_light } = options.splits;
        Ok(Self {
            dataset: VERSION,
            seed: seed_value(options.seed),
            scene_seed: seed_value(options.scene_seed),
            camera_seed: seed_value(options.camera_seed),
            structure: Some(options.structure.name().to_owned()),
            version: options.data_version.clone(),
            licence: options.licence.clone(),
            scenes,
            inputs,
            images: ImagesTable {
                every: options.images.every,
                form: Some(options.images.form.name().to_owned()),
            },
            splits: SplitsTable { validation, test, by_light },
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
            (Some(scenes), None) => Work::Drives(scenes.drives()?),
            (None, Some(inputs)) => Work::Inputs(inputs.inputs(folder)?),
            (None, None) => Work::Drives(Drives::rhdd()),
            (Some(_), Some(_)) => {
                return Err(Error::new(Kind::Config, "dataset.toml")
                    .found("[scenes] and [inputs]")
                    .expected("one of them"));
            }
        };
        let (camera, cameras) = camera::read(&self.camera, folder, access)?;
        let SplitsTable { validation, test, by_light } = self.splits;
        Ok(DatasetOptions {
            cameras,
            seed: seed_of("seed", &self.seed)?,
            scene_seed: seed_of("scene_seed", &self.scene_seed)?,
            camera_seed: seed_of("camera_seed", &self.camera_seed)?,
            images: Images {
                every: self.images.every,
                form: said("images.as", self.images.form.as_ref())?.unwrap_or_default(),
            },
            structure: said::<Structure>("structure", self.structure.as_ref())?.unwrap_or_default(),
            splits: Splits { validation, test, by_light },
            data_version: self.version,
            licence: self.licence,
            ..DatasetOptions::new(PathBuf::new(), work, camera)
        })
    }
}
