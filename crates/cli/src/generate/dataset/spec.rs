//! The specification of a dataset. It comes from flags or from a dataset.toml.

use std::path::{Path, PathBuf};

use clap::Args;
use clap::builder::PossibleValuesParser;

use crate::common::{CameraArgs, Console, LightingArg, SceneSeed, SeedArgs, ThreadArgs};
use spikelane::Result;
use spikelane_dataset::{
    Access, Content, DatasetLayout, DatasetOptions, InputContent, Pictures, ReferenceImageOptions,
    SceneContent, Splits, config,
};
use spikelane_io::light::{Interpolation, ResizeMode, Transfer};
use spikelane_io::simulate::ImageFormat;

/// The specification of a dataset.
#[derive(Args, Clone, Debug)]
#[command(mut_arg("config", conflict_with_description))]
pub(crate) struct DatasetSpec {
    /// Write the dataset to this folder
    #[arg(short, long, value_name = "DIR", required = true)]
    output: Option<PathBuf>,
    /// Generate the dataset of this dataset.toml
    ///
    /// --print-config prints a dataset.toml. --config cannot be combined with flags that describe the dataset.
    #[arg(hide_short_help = true, long, value_name = "FILE")]
    config: Option<PathBuf>,
    #[command(flatten)]
    description: DatasetDescription,
    /// Follow links to files outside the folder
    ///
    /// By default, a link to a file outside the folder is an error.
    #[arg(hide_short_help = true, long)]
    follow_links: bool,
    #[command(flatten)]
    threads: ThreadArgs,
}

/// Returns `--config` with a conflict with every flag that describes the dataset. A dataset.toml replaces all of them.
fn conflict_with_description(config: clap::Arg) -> clap::Arg {
    let flags = DatasetDescription::augment_args(clap::Command::new("dataset"));
    config.conflicts_with_all(flags.get_arguments().map(clap::Arg::get_id))
}

/// Flags that describe a dataset.
#[derive(Args, Clone, Debug)]
struct DatasetDescription {
    /// Convert the videos and images in this folder
    ///
    /// Folders inside this folder are searched too.
    #[arg(long, value_name = "DIR", group = "inputs")]
    from: Option<PathBuf>,
    /// Convert the videos and image folders that FILE lists
    ///
    /// FILE contains one path per line, relative to the folder of FILE.
    #[arg(hide_short_help = true, long, value_name = "FILE", group = "inputs")]
    from_list: Option<PathBuf>,
    /// Use 30 (rhdd) or 2 (tiny) scenes
    ///
    /// rhdd has 500 images per scene, and tiny has 40. Both have one readout per image.
    #[arg(long, hide_possible_values = true, value_name = "NAME", default_value = "rhdd", conflicts_with = "inputs",
          value_parser = PossibleValuesParser::new(SceneContent::PRESETS))]
    scene_preset: String,
    /// Write the light of every N-th readout as the image images/READOUT
    ///
    /// By default, every image of a driving scene is written, and no image of a converted input.
    #[arg(hide_short_help = true, long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    images_every: Option<u64>,
    /// Set the format of reference images: u8, u16 or f32
    ///
    /// u8 is a PNG in sRGB, u16 a linear PNG, and f32 a linear .npy array.
    #[arg(hide_short_help = true, long, value_name = "FORMAT", default_value = "u8")]
    images_format: ImageFormat,
    /// Write for the loader of spikecv, spike-zoo or ssl-csc
    ///
    /// In the ground truth, 255 is 1 spike per readout, and 0.6 for spike-zoo. ssl-csc requires the mosaic RGGB.
    #[arg(long, value_name = "NAME", default_value = "spikecv")]
    dataset_layout: DatasetLayout,
    /// Set the share of sequences for testing
    #[arg(hide_short_help = true, long, value_name = "SHARE", default_value_t = 0.2)]
    test_share: f64,
    /// Set the share of sequences for validation
    #[arg(hide_short_help = true, long, value_name = "SHARE", default_value_t = 0.0)]
    validation_share: f64,
    /// Record this version of the data in the dataset
    #[arg(hide_short_help = true, long, value_name = "VERSION")]
    data_version: Option<String>,
    /// Record the license of your data, such as CC-BY-4.0
    #[arg(hide_short_help = true, long, value_name = "SPDX")]
    license: Option<String>,
    #[command(flatten, next_help_heading = "Scenes")]
    scenes: SceneFlags,
    #[command(flatten, next_help_heading = "Conversion")]
    inputs: InputFlags,
    #[command(flatten, next_help_heading = None::<&'static str>)]
    camera: CameraArgs,
    #[command(flatten)]
    seeds: SeedArgs,
    #[command(flatten)]
    scene: SceneSeed,
}

/// Flags of driving scenes.
#[derive(Args, Clone, Debug)]
#[group(multiple = true, conflicts_with = "inputs")]
struct SceneFlags {
    /// Set the number of scenes [default: by preset]
    #[arg(long, value_name = "N")]
    sequences: Option<u32>,
    /// Set the images per scene [default: by preset]
    #[arg(long, value_name = "N")]
    images_per_scene: Option<u32>,
    /// Set the readouts from one image to the next [default: 1]
    ///
    /// The light changes at every readout.
    #[arg(hide_short_help = true, long, value_name = "N")]
    readouts_per_image: Option<u32>,
    /// Label every N-th image, or no image if N is 0 [default: 25 for rhdd, 20 for tiny]
    #[arg(hide_short_help = true, long, value_name = "N")]
    label_every: Option<u32>,
    /// Set the lighting, such as dusk
    ///
    /// The lighting is noon, low-sun, overcast, rain, tunnel, dusk, night, or random, which the scene seed selects.
    #[arg(long, hide_possible_values = true, value_name = "NAME", default_value = "random", value_parser = LightingArg::parser())]
    lighting: LightingArg,
    /// Set the flicker frequency of lamps in Hz [default: no flicker]
    #[arg(hide_short_help = true, long, value_name = "HZ")]
    flicker_hz: Option<f64>,
    /// Set the number of vehicles in each scene [default: random]
    #[arg(hide_short_help = true, long, value_name = "N")]
    vehicles: Option<u32>,
    /// Set the speed of the car with the camera in km/h [default: random]
    #[arg(hide_short_help = true, long, value_name = "KMH")]
    speed_kmh: Option<f64>,
    /// Set the luminance of full scale in cd/m2 [default: by the exposure of each scene]
    #[arg(hide_short_help = true, long, value_name = "CD_M2")]
    white_cd_m2: Option<f32>,
    /// Keep the exposure of each scene as it is at the start of the scene
    #[arg(hide_short_help = true, long, conflicts_with = "white_cd_m2")]
    lock_exposure: bool,
    /// Draw scenes without blur, glare, vignetting and distortion
    #[arg(hide_short_help = true, long)]
    ideal_lens: bool,
    /// Write the labels of a pinhole camera instead of labels that follow the distortion
    #[arg(hide_short_help = true, long)]
    undistorted_labels: bool,
    /// Also write reference images as linear float arrays
    #[arg(hide_short_help = true, long)]
    npy: bool,
    /// Also write depth and flow as 16-bit PNGs in the format of KITTI
    #[arg(hide_short_help = true, long)]
    kitti: bool,
    /// Also write the light of labeled images in color as EXR, in cd/m2
    #[arg(hide_short_help = true, long)]
    exr: bool,
    /// Apply --test-share and --validation-share to each lighting separately
    #[arg(hide_short_help = true, long)]
    stratify_by_lighting: bool,
}

/// Flags of converted inputs.
#[derive(Args, Clone, Debug)]
#[group(multiple = true, requires = "inputs")]
struct InputFlags {
    /// Read any folder of images as a video
    #[arg(hide_short_help = true, long, conflicts_with = "stills")]
    video: bool,
    /// Convert every image into its own sequence, with its folder as label
    #[arg(hide_short_help = true, long)]
    stills: bool,
    /// Set readouts per frame [default: by input or 20]
    ///
    /// By default, the times or the rate of the frames determine this number. Without both, it is 20, which is 1 ms at
    /// 20 kHz.
    #[arg(hide_short_help = true, long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    readouts_per_frame: Option<u64>,
    /// Interpolate the light between two frames: hold, linear or flow
    ///
    /// hold keeps each frame until the next one, linear changes each pixel linearly, and flow moves the light along an
    /// estimated motion.
    #[arg(hide_short_help = true, long, value_name = "MODE", default_value = "linear")]
    interpolation: Interpolation,
    /// Fit frames to the size of the camera: cover, stretch or crop
    ///
    /// cover scales the largest part with the aspect ratio of the camera, stretch scales the whole frame, and crop cuts
    /// out the center without scaling.
    #[arg(hide_short_help = true, long, value_name = "MODE", default_value = "cover")]
    resize_mode: ResizeMode,
    /// Set the transfer function from codes to light: linear, srgb, pq, hlg or an exponent such as 2.2
    ///
    /// The section [light] of the camera file sets the default. Without it, the default is what the input states, else
    /// srgb for images and video, and linear for arrays and float images.
    #[arg(hide_short_help = true, long, value_name = "TRANSFER")]
    transfer: Option<Transfer>,
    /// Set the code or value of full scale [default: the largest code, or 1.0]
    #[arg(hide_short_help = true, long, value_name = "VALUE")]
    full_scale: Option<f64>,
    /// Use the part of a damaged image or video that can be decoded
    ///
    /// By default, damage is an error. With this flag, a warning describes the damage.
    #[arg(hide_short_help = true, long)]
    accept_damage: bool,
}

impl DatasetSpec {
    /// Returns the options. They come from the flags, or from the dataset.toml of `--config`.
    pub(super) fn options(&self, out: &Console) -> Result<DatasetOptions> {
        let options = match &self.config {
            Some(path) => config::open(path, Access::for_reading(self.follow_links))?,
            None => self.description.options()?,
        };
        Ok(DatasetOptions {
            output: self.output.clone().unwrap_or_default(),
            threads: self.threads.thread_count(out),
            follow_links: self.follow_links,
            ..options
        })
    }
}

impl DatasetDescription {
    fn options(&self) -> Result<DatasetOptions> {
        Ok(DatasetOptions {
            images: ReferenceImageOptions { every: self.images_every, format: self.images_format },
            seed: self.seeds.seed,
            scene_seed: self.scene.scene_seed,
            camera_seed: self.seeds.camera_seed(),
            dataset_layout: self.dataset_layout,
            splits: Splits {
                validation: self.validation_share,
                test: self.test_share,
                stratify_by_lighting: self.scenes.stratify_by_lighting,
            },
            data_version: self.data_version.clone(),
            license: self.license.clone(),
            ..DatasetOptions::new(PathBuf::new(), self.content(), self.camera.camera()?)
        })
    }

    fn content(&self) -> Content {
        let listed = self.from_list.as_ref().map(|list| list.parent().unwrap_or(Path::new("")).to_owned());
        if let Some(folder) = self.from.clone().or(listed) {
            let flags = &self.inputs;
            return Content::Inputs(InputContent {
                folder,
                list: self.from_list.clone(),
                pictures: match (flags.video, flags.stills) {
                    (true, _) => Pictures::Video,
                    (_, true) => Pictures::Stills,
                    _ => Pictures::Auto,
                },
                readouts_per_frame: flags.readouts_per_frame,
                interpolation: flags.interpolation,
                resize_mode: flags.resize_mode,
                transfer: flags.transfer,
                full_scale: flags.full_scale,
                accept_damage: flags.accept_damage,
            });
        }
        let flags = &self.scenes;
        let known = SceneContent::from_preset(&self.scene_preset).unwrap_or_else(SceneContent::rhdd);
        Content::Scenes(SceneContent {
            sequences: flags.sequences.unwrap_or(known.sequences),
            images_per_scene: flags.images_per_scene.unwrap_or(known.images_per_scene),
            readouts_per_image: flags.readouts_per_image.unwrap_or(known.readouts_per_image),
            label_every: flags.label_every.unwrap_or(known.label_every),
            lighting: flags.lighting.fixed().into_iter().collect(),
            flicker_hz: flags.flicker_hz,
            vehicles: flags.vehicles,
            speed_kmh: flags.speed_kmh,
            white_cd_m2: flags.white_cd_m2,
            lock_exposure: flags.lock_exposure,
            ideal_lens: flags.ideal_lens,
            undistorted_labels: flags.undistorted_labels,
            npy: flags.npy,
            kitti: flags.kitti,
            exr: flags.exr,
            ..known
        })
    }
}
