//! The tables of `dataset.toml` and what each of them becomes.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::dataset::{Drives, Inputs};
use crate::error::{Error, Kind, Result};
use crate::scene::{Lighting, SamplesPerPixel};

/// One light, or a list of which each scene has one.
#[derive(Deserialize, Serialize)]
#[serde(untagged)]
enum Lights {
    One(String),
    Several(Vec<String>),
}

#[derive(Default, Deserialize, Serialize)]
#[serde(default, deny_unknown_fields)]
pub(super) struct ScenesTable {
    #[serde(skip_serializing_if = "Option::is_none")]
    kind: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    sequences: Option<u32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    images: Option<u32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    readouts_per_image: Option<u32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    label_every: Option<u32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    lighting: Option<Lights>,
    #[serde(skip_serializing_if = "Option::is_none")]
    flicker_hz: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    vehicles: Option<u32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    speed_kmh: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    white_cd_m2: Option<f32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    samples: Option<u32>,
    npy: bool,
    kitti: bool,
    exr: bool,
}

#[derive(Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub(super) struct InputsTable {
    folder: PathBuf,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    list: Option<PathBuf>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    readouts_per_frame: Option<u64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    insertion: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    fit: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    transfer: Option<String>,
}

#[derive(Default, Deserialize, Serialize)]
#[serde(default, deny_unknown_fields)]
pub(super) struct ImagesTable {
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) every: Option<u64>,
    #[serde(rename = "as", skip_serializing_if = "Option::is_none")]
    pub(super) form: Option<String>,
}

#[derive(Deserialize, Serialize)]
#[serde(default, deny_unknown_fields)]
pub(super) struct SplitsTable {
    pub(super) validation: f64,
    pub(super) test: f64,
    pub(super) by_light: bool,
}

impl Default for SplitsTable {
    fn default() -> Self {
        Self { validation: 0.0, test: 0.2, by_light: false }
    }
}

/// A word or number of the file by the rules of the command line.
pub(super) fn said<T: std::str::FromStr<Err = Error>>(key: &str, text: Option<&String>) -> Result<Option<T>> {
    let as_config = |e: Error| {
        let parts = e.parts();
        Error::new(Kind::Config, key).found(parts.found).expected(parts.expected).remedy(parts.remedy)
    };
    text.map(|t| t.parse().map_err(as_config)).transpose()
}

impl ScenesTable {
    pub(super) fn of(d: &Drives) -> Self {
        Self {
            kind: None,
            sequences: Some(d.sequences),
            images: Some(d.images),
            readouts_per_image: Some(d.readouts_per_image),
            label_every: Some(d.label_every),
            lighting: match &d.lighting[..] {
                [] => None,
                [one] => Some(Lights::One(one.name().to_owned())),
                all => Some(Lights::Several(all.iter().map(|l| l.name().to_owned()).collect())),
            },
            flicker_hz: d.flicker_hz,
            vehicles: d.vehicles,
            speed_kmh: d.speed_kmh,
            white_cd_m2: d.white_cd_m2,
            samples: Some(if d.samples == SamplesPerPixel::Four { 4 } else { 16 }),
            npy: d.npy,
            kitti: d.kitti,
            exr: d.exr,
        }
    }

    pub(super) fn drives(self) -> Result<Drives> {
        let bad = |key: &str, word: &str, names: Vec<&str>| {
            Error::new(Kind::Config, format_args!("scenes.{key}"))
                .found(format_args!("`{word}`"))
                .expected(names.join(", "))
                .or_nearest(word, names)
        };
        let known = match &self.kind {
            None => Drives::rhdd(),
            Some(kind) => Drives::preset(kind).ok_or_else(|| bad("kind", kind, Drives::PRESETS.to_vec()))?,
        };
        let light = |name: &String| {
            let names = || Lighting::ALL.map(Lighting::name).to_vec();
            Lighting::from_name(name).ok_or_else(|| bad("lighting", name, names()))
        };
        let lights = match &self.lighting {
            None => &[][..],
            Some(Lights::One(name)) => std::slice::from_ref(name),
            Some(Lights::Several(names)) => names,
        };
        let samples = match self.samples {
            None => known.samples,
            Some(4) => SamplesPerPixel::Four,
            Some(16) => SamplesPerPixel::Sixteen,
            Some(n) => return Err(bad("samples", &n.to_string(), vec!["4", "16"])),
        };
        Ok(Drives {
            sequences: self.sequences.unwrap_or(known.sequences),
            images: self.images.unwrap_or(known.images),
            readouts_per_image: self.readouts_per_image.unwrap_or(known.readouts_per_image),
            label_every: self.label_every.unwrap_or(known.label_every),
            lighting: lights.iter().map(light).collect::<Result<_>>()?,
            flicker_hz: self.flicker_hz,
            vehicles: self.vehicles,
            speed_kmh: self.speed_kmh,
            white_cd_m2: self.white_cd_m2,
            samples,
            npy: self.npy,
            kitti: self.kitti,
            exr: self.exr,
        })
    }
}

impl InputsTable {
    pub(super) fn of(inputs: &Inputs) -> Result<Self> {
        let whole = |path: &Path| std::path::absolute(path).map_err(|e| Error::io(path.display(), e));
        Ok(Self {
            folder: whole(&inputs.folder)?,
            list: inputs.list.as_deref().map(whole).transpose()?,
            readouts_per_frame: inputs.readouts_per_frame,
            insertion: Some(inputs.insertion.to_string()),
            fit: Some(inputs.fit.to_string()),
            transfer: inputs.transfer.map(|t| t.to_string()),
        })
    }

    pub(super) fn inputs(self, folder: &Path) -> Result<Inputs> {
        Ok(Inputs {
            folder: folder.join(self.folder),
            list: self.list.map(|list| folder.join(list)),
            readouts_per_frame: self.readouts_per_frame,
            insertion: said("inputs.insertion", self.insertion.as_ref())?
                .unwrap_or(crate::light::Insertion::Linear),
            fit: said("inputs.fit", self.fit.as_ref())?.unwrap_or(crate::light::Fit::Resize),
            transfer: said("inputs.transfer", self.transfer.as_ref())?,
        })
    }
}
