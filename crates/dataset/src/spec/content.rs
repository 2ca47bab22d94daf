//! The source of the light of a dataset, the reference images, and the folder layout for loaders.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::serde_text;
use spikelane::error::{Error, ErrorKind, Setting};
use spikelane_io::light::{Interpolation, ResizeMode, Transfer};
use spikelane_io::simulate::ImageFormat;
use spikelane_scene::{Lighting, SamplesPerPixel};

/// Folder layout and ground-truth codes that the loader of a framework expects.
///
/// # Examples
/// ```
/// use spikelane_dataset::DatasetLayout;
/// assert_eq!("spike-zoo".parse::<DatasetLayout>()?, DatasetLayout::SpikeZoo);
/// assert_eq!(DatasetLayout::default().to_string(), "spikecv");
/// # Ok::<(), spikelane::Error>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum DatasetLayout {
    /// The layout of SpikeCV, with `SPLIT/spike/ID.dat`, `SPLIT/gt/ID.png` and `config.yaml`.
    #[default]
    SpikeCv,
    /// The layout of Spike-Zoo's base dataset, with `SPLIT/spike/ID.dat` and `SPLIT/gt/ID.png`.
    SpikeZoo,
    /// The training folders of SSL-CSC for color cameras, with `SPLIT/spk/spikelane/ID.dat` and `SPLIT/gt/spikelane/ID.npy`.
    SslCsc,
}

impl DatasetLayout {
    /// Returns the name of the layout in arguments and manifests.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::SpikeCv => "spikecv",
            Self::SpikeZoo => "spike-zoo",
            Self::SslCsc => "ssl-csc",
        }
    }
}

impl std::fmt::Display for DatasetLayout {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}

impl std::str::FromStr for DatasetLayout {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self, Error> {
        [Self::SpikeCv, Self::SpikeZoo, Self::SslCsc].into_iter().find(|l| l.name() == name).ok_or_else(
            || {
                Error::new(ErrorKind::Usage, Setting("dataset_layout"))
                    .found(format_args!("`{name}`"))
                    .expected("spikecv, spike-zoo or ssl-csc")
            },
        )
    }
}

/// Specifies which reference images are written, and their format.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Eq, Serialize)]
#[serde(default, deny_unknown_fields)]
pub struct ReferenceImageOptions {
    /// Number of readouts between two images. The first image shows readout 0.
    ///
    /// If `None`, every image of a scene is written, and no image of an input is written.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub every: Option<u64>,
    /// Format of the images.
    #[serde(
        rename = "format",
        deserialize_with = "serde_text::deserialize_text",
        serialize_with = "serde_text::serialize_text"
    )]
    pub format: ImageFormat,
}

/// Options of random driving scenes.
///
/// # Examples
/// ```
/// use spikelane_dataset::SceneContent;
/// let scenes = SceneContent::tiny().with_sequences(3).with_label_every(0);
/// assert_eq!((scenes.sequences, scenes.label_every), (3, 0));
/// assert_ne!(SceneContent::tiny(), SceneContent::rhdd());
/// ```
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(default, deny_unknown_fields)]
pub struct SceneContent {
    /// Number of scenes.
    pub sequences: u32,
    /// Number of images per scene.
    pub images_per_scene: u32,
    /// Number of readouts between two images. The light changes at every readout.
    pub readouts_per_image: u32,
    /// Number of images between two labeled images. If 0, no labels are written.
    pub label_every: u32,
    /// Lighting presets. The name of a scene selects one of these presets. If the list is empty, the scene seed
    /// determines the preset.
    #[serde(
        deserialize_with = "serde_text::deserialize_lighting",
        serialize_with = "serde_text::serialize_lighting",
        skip_serializing_if = "Vec::is_empty"
    )]
    pub lighting: Vec<Lighting>,
    /// Flicker frequency of the lamps in hertz.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub flicker_hz: Option<f64>,
    /// Number of vehicles. If `None`, the scene seed determines the number.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub vehicles: Option<u32>,
    /// Desired speed in km/h. If `None`, the scene seed determines the speed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub speed_kmh: Option<f64>,
    /// Luminance of light 1.0 in cd/m2 for all scenes. If `None`, the exposure follows each scene.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub white_cd_m2: Option<f32>,
    /// Whether the exposure of each scene stays as it is at the start of the scene.
    pub lock_exposure: bool,
    /// Whether the lens is ideal. Otherwise the scene seed determines one lens for all scenes.
    pub ideal_lens: bool,
    /// Whether labels are those of a pinhole camera. Otherwise labels follow the distortion of the lens.
    pub undistorted_labels: bool,
    /// Number of color samples per pixel.
    #[serde(
        deserialize_with = "serde_text::deserialize_samples",
        serialize_with = "serde_text::serialize_samples"
    )]
    pub samples: SamplesPerPixel,
    /// Whether the light of the images is also written as linear `f32` values in `.npy` files.
    pub npy: bool,
    /// Whether depth and flow are also written as KITTI's 16-bit PNG files.
    pub kitti: bool,
    /// Whether the light of labeled images is also written in color as EXR files.
    pub exr: bool,
}

spikelane::unstable::with_methods!(SceneContent {
    with_sequences: sequences: u32,
    with_images_per_scene: images_per_scene: u32,
    with_readouts_per_image: readouts_per_image: u32,
    with_label_every: label_every: u32,
    with_lighting: lighting: Vec<Lighting>,
    with_flicker_hz: flicker_hz: Option<f64>,
    with_vehicles: vehicles: Option<u32>,
    with_speed_kmh: speed_kmh: Option<f64>,
    with_white_cd_m2: white_cd_m2: Option<f32>,
    with_lock_exposure: lock_exposure: bool,
    with_ideal_lens: ideal_lens: bool,
    with_undistorted_labels: undistorted_labels: bool,
    with_samples: samples: SamplesPerPixel,
    with_npy: npy: bool,
    with_kitti: kitti: bool,
    with_exr: exr: bool,
});

impl Default for SceneContent {
    fn default() -> Self {
        Self::rhdd()
    }
}

impl SceneContent {
    /// Names of the presets.
    pub const PRESETS: [&'static str; 2] = ["rhdd", "tiny"];

    /// Returns the preset with this name.
    #[must_use]
    pub fn from_preset(name: &str) -> Option<Self> {
        match name {
            "rhdd" => Some(Self::rhdd()),
            "tiny" => Some(Self::tiny()),
            _ => None,
        }
    }

    /// Returns a dataset of two scenes with 40 images each, for a first test.
    #[must_use]
    pub fn tiny() -> Self {
        Self { sequences: 2, images_per_scene: 40, label_every: 20, ..Self::rhdd() }
    }

    /// Returns the dataset of the SCSim paper. It has 30 scenes with 500 images each and one readout per image.
    #[must_use]
    pub const fn rhdd() -> Self {
        Self {
            sequences: 30,
            images_per_scene: 500,
            readouts_per_image: 1,
            label_every: 25,
            lighting: Vec::new(),
            flicker_hz: None,
            vehicles: None,
            speed_kmh: None,
            white_cd_m2: None,
            lock_exposure: false,
            ideal_lens: false,
            undistorted_labels: false,
            samples: SamplesPerPixel::Sixteen,
            npy: false,
            kitti: false,
            exr: false,
        }
    }

    /// Returns the number of readouts of one sequence.
    #[must_use]
    pub fn readouts(&self) -> u64 {
        u64::from(self.images_per_scene) * u64::from(self.readouts_per_image)
    }
}

/// What the pictures of a folder are.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Pictures {
    /// The frames of a video. Folders of unrelated pictures are rejected; see
    /// [`check_is_video`](spikelane_io::light::check_is_video).
    #[default]
    Auto,
    /// The frames of a video, whatever their names and contents are.
    Video,
    /// Every picture is a sequence of its own.
    Stills,
}

impl Pictures {
    fn is_auto(&self) -> bool {
        *self == Self::Auto
    }
}

/// Videos and image folders in a folder and its subfolders.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(deny_unknown_fields)]
pub struct InputContent {
    /// Folder that contains the inputs.
    pub folder: PathBuf,
    /// Text file with one path per line. Paths are relative to `folder`. If `None`, all inputs in `folder` and its
    /// subfolders are used.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub list: Option<PathBuf>,
    /// What the pictures of a folder are.
    #[serde(default, skip_serializing_if = "Pictures::is_auto")]
    pub pictures: Pictures,
    /// Number of readouts per frame. If `None`, the frame times or the frame rate determine the number; see
    /// [`FrameTiming`](spikelane_io::light::FrameTiming).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub readouts_per_frame: Option<u64>,
    /// How the light between frames is interpolated.
    #[serde(
        default = "default_interpolation",
        deserialize_with = "serde_text::deserialize_text",
        serialize_with = "serde_text::serialize_text"
    )]
    pub interpolation: Interpolation,
    /// How frames are resized to the camera's size.
    #[serde(
        default,
        deserialize_with = "serde_text::deserialize_text",
        serialize_with = "serde_text::serialize_text"
    )]
    pub resize_mode: ResizeMode,
    /// Transfer function of the inputs. It overrides the transfer function of the camera's front end.
    #[serde(
        default,
        deserialize_with = "serde_text::deserialize_optional_text",
        serialize_with = "serde_text::serialize_optional_text",
        skip_serializing_if = "Option::is_none"
    )]
    pub transfer: Option<Transfer>,
    /// The code or value of full scale of the inputs. If `None`, full scale is the code of white that a file states, the
    /// largest code, or 1.0 for floats.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub full_scale: Option<f64>,
    /// Whether the parts of damaged images and videos that can be decoded are used. Otherwise, the sequence of a damaged
    /// input fails.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub accept_damage: bool,
}

const fn default_interpolation() -> Interpolation {
    Interpolation::Linear
}

/// Source of the light of a dataset.
#[derive(Clone, Debug, PartialEq)]
pub enum Content {
    /// Random driving scenes.
    Scenes(SceneContent),
    /// Videos and images that the user provides.
    Inputs(InputContent),
}

impl DatasetLayout {
    /// Returns the rate that code 255 of the ground truth represents, in spikes per pixel and readout.
    ///
    /// Before a comparison, Spike-Zoo divides reconstructed rates by the `rate` of its configuration, which is 0.6 by
    /// default. The result is compared with code / 255. In SpikeCV, an image is the rate multiplied by 255, and the
    /// PSNR is computed from codes. SSL-CSC compares outputs with code / 255.
    #[must_use]
    pub const fn rate_at_255(self) -> f64 {
        match self {
            Self::SpikeCv | Self::SslCsc => 1.0,
            Self::SpikeZoo => 0.6,
        }
    }
}

/// Returns the name of a folder or file without the path to it, or `clip` if it has no name.
pub(crate) fn path_name(path: &Path) -> String {
    let path = std::fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
    path.file_name().map_or_else(|| "clip".to_owned(), |name| name.to_string_lossy().into_owned())
}

/// Returns a description of the ground-truth codes for manifests and records.
pub(crate) fn ground_truth_facts(structure: DatasetLayout) -> Value {
    json!({
        "file": "gt.png", "transfer": "linear", "rate_at_255": structure.rate_at_255(),
        "readout": "floor(readouts / 2), counted from 0",
    })
}
