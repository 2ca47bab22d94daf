//! What light a dataset is made of, and whose folders and codes it has.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::texts;
use spikelane::error::{Error, Kind};
use spikelane_io::light::{Fit, Insertion, Transfer};
use spikelane_io::simulate::ImageForm;
use spikelane_scene::{Lighting, SamplesPerPixel};

/// Which loaders find their folders.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Structure {
    /// `SPLIT/spike/ID.dat`, `SPLIT/gt/ID.png` and SpikeCV's `config.yaml`.
    #[default]
    SpikeCv,
    /// `SPLIT/spike/ID.dat` and `SPLIT/gt/ID.png`, as Spike-Zoo's base dataset.
    SpikeZoo,
}

impl Structure {
    /// The name in arguments and manifests.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::SpikeCv => "spikecv",
            Self::SpikeZoo => "spike-zoo",
        }
    }
}

impl std::fmt::Display for Structure {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}

impl std::str::FromStr for Structure {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self, Error> {
        [Self::SpikeCv, Self::SpikeZoo].into_iter().find(|l| l.name() == name).ok_or_else(|| {
            Error::new(Kind::Usage, "dataset structure")
                .found(format_args!("`{name}`"))
                .expected("spikecv or spike-zoo")
        })
    }
}

/// Which clear images are kept, and how they are stored.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Eq, Serialize)]
#[serde(default, deny_unknown_fields)]
pub struct Images {
    /// Readouts from one to the next, from readout 0 on. Without it those of a scene's own images are
    /// kept, and of given inputs none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub every: Option<u64>,
    /// How they are stored.
    #[serde(rename = "as", deserialize_with = "texts::read", serialize_with = "texts::write")]
    pub form: ImageForm,
}

/// Random driving scenes.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(default, deny_unknown_fields)]
pub struct Drives {
    /// Number of scenes.
    pub sequences: u32,
    /// Clear images of each.
    pub images: u32,
    /// Readouts from one image to the next; light follows every readout.
    pub readouts_per_image: u32,
    /// Images from one labelled image to the next; 0 for no labels.
    pub label_every: u32,
    /// The light of each scene is one of these, by its name; without any it is drawn by the scene's seed.
    #[serde(
        deserialize_with = "texts::read_lights",
        serialize_with = "texts::write_lights",
        skip_serializing_if = "Vec::is_empty"
    )]
    pub lighting: Vec<Lighting>,
    /// Lamp flicker in hertz.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub flicker_hz: Option<f64>,
    /// Vehicles, or as many as the seed says.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub vehicles: Option<u32>,
    /// Wished speed in km/h, or what the seed says.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub speed_kmh: Option<f64>,
    /// Luminance of full scale in cd/m2 for all scenes, or each scene's own white.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub white_cd_m2: Option<f32>,
    /// Colour samples of a pixel.
    #[serde(deserialize_with = "texts::read_samples", serialize_with = "texts::write_samples")]
    pub samples: SamplesPerPixel,
    /// Also the clear images as linear `f32`.
    pub npy: bool,
    /// Also depth and flow as KITTI's 16-bit PNGs.
    pub kitti: bool,
    /// Also the light of labelled images in colour, as EXR.
    pub exr: bool,
}

spikelane::unstable::with_methods!(Drives {
    with_sequences: sequences: u32,
    with_images: images: u32,
    with_readouts_per_image: readouts_per_image: u32,
    with_label_every: label_every: u32,
    with_lighting: lighting: Vec<Lighting>,
    with_flicker_hz: flicker_hz: Option<f64>,
    with_vehicles: vehicles: Option<u32>,
    with_speed_kmh: speed_kmh: Option<f64>,
    with_white_cd_m2: white_cd_m2: Option<f32>,
    with_samples: samples: SamplesPerPixel,
    with_npy: npy: bool,
    with_kitti: kitti: bool,
    with_exr: exr: bool,
});

impl Default for Drives {
    fn default() -> Self {
        Self::rhdd()
    }
}

impl Drives {
    /// Names of datasets that are known.
    pub const PRESETS: [&'static str; 2] = ["rhdd", "tiny"];

    /// The dataset of that name.
    #[must_use]
    pub fn preset(name: &str) -> Option<Self> {
        match name {
            "rhdd" => Some(Self::rhdd()),
            "tiny" => Some(Self::tiny()),
            _ => None,
        }
    }

    /// Two scenes of 40 images, for a first try.
    #[must_use]
    pub fn tiny() -> Self {
        Self { sequences: 2, images: 40, label_every: 20, ..Self::rhdd() }
    }

    /// The dataset of the SCSim paper: 30 scenes of 500 images, one readout per image.
    #[must_use]
    pub const fn rhdd() -> Self {
        Self {
            sequences: 30,
            images: 500,
            readouts_per_image: 1,
            label_every: 25,
            lighting: Vec::new(),
            flicker_hz: None,
            vehicles: None,
            speed_kmh: None,
            white_cd_m2: None,
            samples: SamplesPerPixel::Sixteen,
            npy: false,
            kitti: false,
            exr: false,
        }
    }

    /// Readouts of one sequence.
    #[must_use]
    pub fn readouts(&self) -> u64 {
        u64::from(self.images) * u64::from(self.readouts_per_image)
    }
}

/// Videos and image folders below a folder.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Inputs {
    /// Where they lie.
    pub folder: PathBuf,
    /// A text that names them, one path below the folder a line; without it all that the folder holds are taken.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub list: Option<PathBuf>,
    /// Readouts of every frame; `None` as its times or rate say, see [`spikelane_io::light::Pace`].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub readouts_per_frame: Option<u64>,
    /// Light between frames.
    #[serde(default = "linear", deserialize_with = "texts::read", serialize_with = "texts::write")]
    pub insertion: Insertion,
    /// How frames come to the camera's size.
    #[serde(default, deserialize_with = "texts::read", serialize_with = "texts::write")]
    pub fit: Fit,
    /// Declared transfer function.
    #[serde(
        default,
        deserialize_with = "texts::read_some",
        serialize_with = "texts::write_some",
        skip_serializing_if = "Option::is_none"
    )]
    pub transfer: Option<Transfer>,
}

const fn linear() -> Insertion {
    Insertion::Linear
}

/// Where the light of a dataset comes from.
#[derive(Clone, Debug, PartialEq)]
pub enum Work {
    /// Driving scenes.
    Drives(Drives),
    /// Given pictures.
    Inputs(Inputs),
}

impl Structure {
    /// The rate, in spikes per pixel and readout, for which code 255 of the ground truth stands.
    ///
    /// Spike-Zoo divides reconstructed rates by the `rate` of its configuration, 0.6 by default, before it
    /// compares them with code / 255. SpikeCV's pictures are 255 times the rate, and its PSNR compares codes.
    #[must_use]
    pub const fn rate_at_255(self) -> f64 {
        match self {
            Self::SpikeCv => 1.0,
            Self::SpikeZoo => 0.6,
        }
    }
}

/// What codes stand for, for manifests and records.
pub(crate) fn ground_truth(structure: Structure) -> Value {
    json!({
        "file": "gt.png", "transfer": "linear", "rate_at_255": structure.rate_at_255(),
        "readout": "floor(readouts / 2), counted from 0",
    })
}
