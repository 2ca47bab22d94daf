//! The specification of a dataset. It comes from flags or from a dataset.toml.

use std::path::{Path, PathBuf};

use clap::builder::PossibleValuesParser;

use crate::common::camera::CameraArgs;
use crate::common::console::Console;
use crate::common::lighting::LightingArg;
use crate::common::seeds::{SceneSeed, SeedArgs};
use crate::common::threads::ThreadArgs;
use spikelane::Result;
use spikelane_dataset::{
    Access, Cameras, Content, DatasetLayout, DatasetOptions, InputContent, Pictures, ReferenceImageOptions,
    SceneContent, Splits, config,
};
use spikelane_io::light::{Interpolation, ResizeMode, Transfer};
use spikelane_io::simulate::ImageFormat;

/// The specification of a dataset.
#[derive(clap::Args, Clone, Debug)]
pub(crate) struct DatasetSpec {
    /// Write the dataset to this folder
    #[arg(short, long, value_name = "DIR", required = true)]
    pub(crate) output: Option<PathBuf>,
    /// Generate the dataset of this dataset.toml
    ///
    /// --print-config prints a dataset.toml. --config cannot be combined with flags that describe the dataset.
    #[arg(hide_short_help = true, long, value_name = "FILE", conflicts_with_all = SPEC_FLAGS)]
    pub(crate) config: Option<PathBuf>,
    /// Convert the videos and images in this folder
    ///
    /// Folders inside this folder are searched too.
    #[arg(long, value_name = "DIR", group = "inputs")]
    pub(crate) from: Option<PathBuf>,
    /// Convert the videos and image folders that FILE lists
    ///
    /// FILE contains one path per line, relative to the folder of FILE.
    #[arg(hide_short_help = true, long, value_name = "FILE", group = "inputs")]
    pub(crate) from_list: Option<PathBuf>,
    /// Use 30 (rhdd) or 2 (tiny) scenes
    ///
    /// rhdd has 500 images per scene, and tiny has 40. Both have one readout per image.
    #[arg(long, hide_possible_values = true, value_name = "NAME", default_value = "rhdd", conflicts_with = "inputs",
          value_parser = PossibleValuesParser::new(SceneContent::PRESETS))]
    pub(crate) scene_preset: String,
    /// Set the number of scenes [default: by preset]
    #[arg(long, value_name = "N", conflicts_with = "inputs", help_heading = "Scenes")]
    pub(crate) sequences: Option<u32>,
    /// Set the images per scene [default: by preset]
    #[arg(long, value_name = "N", conflicts_with = "inputs", help_heading = "Scenes")]
    pub(crate) images_per_scene: Option<u32>,
    /// Set the readouts from one image to the next [default: 1]
    ///
    /// The light changes at every readout.
    #[arg(
        hide_short_help = true,
        long,
        value_name = "N",
        conflicts_with = "inputs",
        help_heading = "Scenes"
    )]
    pub(crate) readouts_per_image: Option<u32>,
    /// Label every N-th image, or no image if N is 0 [default: 25 for rhdd, 20 for tiny]
    #[arg(
        hide_short_help = true,
        long,
        value_name = "N",
        conflicts_with = "inputs",
        help_heading = "Scenes"
    )]
    pub(crate) label_every: Option<u32>,
    /// Set the lighting, such as dusk
    ///
    /// The lighting is noon, low-sun, overcast, rain, tunnel, dusk, night, or random, which the scene seed selects.
    #[arg(long, hide_possible_values = true, value_name = "NAME", default_value = "random", conflicts_with = "inputs",
          help_heading = "Scenes", value_parser = LightingArg::parser())]
    pub(crate) lighting: LightingArg,
    /// Set the flicker frequency of lamps in Hz [default: no flicker]
    #[arg(
        hide_short_help = true,
        long,
        value_name = "HZ",
        conflicts_with = "inputs",
        help_heading = "Scenes"
    )]
    pub(crate) flicker_hz: Option<f64>,
    /// Set the number of vehicles in each scene [default: random]
    #[arg(
        hide_short_help = true,
        long,
        value_name = "N",
        conflicts_with = "inputs",
        help_heading = "Scenes"
    )]
    pub(crate) vehicles: Option<u32>,
    /// Set the speed of the car with the camera in km/h [default: random]
    #[arg(
        hide_short_help = true,
        long,
        value_name = "KMH",
        conflicts_with = "inputs",
        help_heading = "Scenes"
    )]
    pub(crate) speed_kmh: Option<f64>,
    /// Set the luminance of full scale in cd/m2 [default: by the exposure of each scene]
    #[arg(
        hide_short_help = true,
        long,
        value_name = "CD_M2",
        conflicts_with = "inputs",
        help_heading = "Scenes"
    )]
    pub(crate) white_cd_m2: Option<f32>,
    /// Keep the exposure of each scene as it is at the start of the scene
    #[arg(hide_short_help = true, long, conflicts_with_all = ["inputs", "white_cd_m2"], help_heading = "Scenes")]
    pub(crate) lock_exposure: bool,
    /// Draw scenes without blur, glare, vignetting and distortion
    #[arg(hide_short_help = true, long, conflicts_with = "inputs", help_heading = "Scenes")]
    pub(crate) ideal_lens: bool,
    /// Write the labels of a pinhole camera instead of labels that follow the distortion
    #[arg(hide_short_help = true, long, conflicts_with = "inputs", help_heading = "Scenes")]
    pub(crate) undistorted_labels: bool,
    /// Also write reference images as linear float arrays
    #[arg(hide_short_help = true, long, conflicts_with = "inputs", help_heading = "Scenes")]
    pub(crate) npy: bool,
    /// Also write depth and flow as 16-bit PNGs in the format of KITTI
    #[arg(hide_short_help = true, long, conflicts_with = "inputs", help_heading = "Scenes")]
    pub(crate) kitti: bool,
    /// Also write the light of labeled images in color as EXR, in cd/m2
    #[arg(hide_short_help = true, long, conflicts_with = "inputs", help_heading = "Scenes")]
    pub(crate) exr: bool,
    /// Read any folder of images as a video
    #[arg(
        hide_short_help = true,
        long,
        requires = "inputs",
        conflicts_with = "stills",
        help_heading = "Conversion"
    )]
    pub(crate) video: bool,
    /// Convert every image into its own sequence, with its folder as label
    #[arg(hide_short_help = true, long, requires = "inputs", help_heading = "Conversion")]
    pub(crate) stills: bool,
    /// Set readouts per frame [default: by input or 20]
    ///
    /// By default, the times or the rate of the frames determine this number. Without both, it is 20, which is 1 ms at
    /// 20 kHz.
    #[arg(hide_short_help = true, long, value_name = "N", requires = "inputs", help_heading = "Conversion",
          value_parser = clap::value_parser!(u64).range(1..))]
    pub(crate) readouts_per_frame: Option<u64>,
    /// Interpolate the light between two frames: hold, linear or flow
    ///
    /// hold keeps each frame until the next one, linear changes each pixel linearly, and flow moves the light along an
    /// estimated motion.
    #[arg(
        hide_short_help = true,
        long,
        value_name = "MODE",
        default_value = "linear",
        requires = "inputs",
        help_heading = "Conversion"
    )]
    pub(crate) interpolation: Interpolation,
    /// Fit frames to the size of the camera: cover, stretch or crop
    ///
    /// cover scales the largest part with the aspect ratio of the camera, stretch scales the whole frame, and crop cuts
    /// out the center without scaling.
    #[arg(
        hide_short_help = true,
        long,
        value_name = "MODE",
        default_value = "cover",
        requires = "inputs",
        help_heading = "Conversion"
    )]
    pub(crate) resize_mode: ResizeMode,
    /// Set the transfer function from codes to light: linear, srgb, pq, hlg or an exponent such as 2.2
    ///
    /// The section [light] of the camera file sets the default. Without it, the default is what the input states, else
    /// srgb for images and video, and linear for arrays and float images.
    #[arg(
        hide_short_help = true,
        long,
        value_name = "TRANSFER",
        requires = "inputs",
        help_heading = "Conversion"
    )]
    pub(crate) transfer: Option<Transfer>,
    /// Set the code or value of full scale [default: the largest code, or 1.0]
    #[arg(
        hide_short_help = true,
        long,
        value_name = "VALUE",
        requires = "inputs",
        help_heading = "Conversion"
    )]
    pub(crate) full_scale: Option<f64>,
    /// Use the part of a damaged image or video that can be decoded
    ///
    /// By default, damage is an error. With this flag, a warning describes the damage.
    #[arg(hide_short_help = true, long, requires = "inputs", help_heading = "Conversion")]
    pub(crate) accept_damage: bool,
    #[command(flatten)]
    pub(crate) camera: CameraArgs,
    #[command(flatten)]
    pub(crate) seeds: SeedArgs,
    #[command(flatten)]
    pub(crate) scene: SceneSeed,
    /// Write the light of every N-th readout as the image images/READOUT
    ///
    /// By default, every image of a driving scene is written, and no image of a converted input.
    #[arg(hide_short_help = true, long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pub(crate) images_every: Option<u64>,
    /// Set the format of reference images: u8, u16 or f32
    ///
    /// u8 is a PNG in sRGB, u16 a linear PNG, and f32 a linear .npy array.
    #[arg(hide_short_help = true, long, value_name = "FORMAT", default_value = "u8")]
    pub(crate) images_format: ImageFormat,
    /// Write for the loader of spikecv, spike-zoo or ssl-csc
    ///
    /// In the ground truth, 255 is 1 spike per readout, and 0.6 for spike-zoo. ssl-csc requires the mosaic RGGB.
    #[arg(long, value_name = "NAME", default_value = "spikecv")]
    pub(crate) dataset_layout: DatasetLayout,
    /// Set the share of sequences for testing
    #[arg(hide_short_help = true, long, value_name = "SHARE", default_value_t = 0.2)]
    pub(crate) test_share: f64,
    /// Set the share of sequences for validation
    #[arg(hide_short_help = true, long, value_name = "SHARE", default_value_t = 0.0)]
    pub(crate) validation_share: f64,
    /// Apply --test-share and --validation-share to each lighting separately
    #[arg(hide_short_help = true, long, conflicts_with = "inputs", help_heading = "Scenes")]
    pub(crate) stratify_by_lighting: bool,
    /// Record this version of the data in the dataset
    #[arg(hide_short_help = true, long, value_name = "VERSION")]
    pub(crate) data_version: Option<String>,
    /// Record the license of your data, such as CC-BY-4.0
    #[arg(hide_short_help = true, long, value_name = "SPDX")]
    pub(crate) license: Option<String>,
    /// Follow links to files outside the folder
    ///
    /// By default, a link to a file outside the folder is an error.
    #[arg(hide_short_help = true, long)]
    pub(crate) follow_links: bool,
    #[command(flatten)]
    pub(crate) threads: ThreadArgs,
}

/// Flags that describe the dataset. With `--config` a dataset.toml replaces all of them.
const SPEC_FLAGS: [&str; 47] = [
    "from",
    "from_list",
    "scene_preset",
    "sequences",
    "images_per_scene",
    "readouts_per_image",
    "label_every",
    "lighting",
    "flicker_hz",
    "vehicles",
    "speed_kmh",
    "white_cd_m2",
    "lock_exposure",
    "ideal_lens",
    "undistorted_labels",
    "npy",
    "kitti",
    "exr",
    "video",
    "stills",
    "readouts_per_frame",
    "interpolation",
    "resize_mode",
    "transfer",
    "full_scale",
    "accept_damage",
    "camera",
    "camera_format",
    "width",
    "height",
    "readout_hz",
    "exposure",
    "mosaic",
    "effect",
    "disable_effect",
    "seed",
    "camera_seed",
    "scene_seed",
    "images_every",
    "images_format",
    "dataset_layout",
    "test_share",
    "validation_share",
    "stratify_by_lighting",
    "data_version",
    "license",
    "inputs",
];

impl DatasetSpec {
    /// Returns the options. They come from the flags, or from the dataset.toml of `--config`.
    pub(super) fn options(&self, out: &Console) -> Result<DatasetOptions> {
        let output = self.output.clone().unwrap_or_default();
        let threads = self.threads.thread_count(out);
        if let Some(path) = &self.config {
            return Ok(DatasetOptions {
                output,
                threads,
                ..config::open(path, Access::for_reading(self.follow_links))?
            });
        }
        Ok(DatasetOptions {
            output,
            content: self.content(),
            camera: self.camera.camera()?,
            images: ReferenceImageOptions { every: self.images_every, format: self.images_format },
            seed: self.seeds.seed,
            scene_seed: self.scene.scene_seed,
            camera_seed: self.seeds.camera_seed(),
            dataset_layout: self.dataset_layout,
            cameras: Cameras::Single,
            splits: Splits {
                validation: self.validation_share,
                test: self.test_share,
                stratify_by_lighting: self.stratify_by_lighting,
            },
            data_version: self.data_version.clone(),
            license: self.license.clone(),
            threads,
            resume: false,
            follow_links: self.follow_links,
        })
    }

    fn content(&self) -> Content {
        let listed = self.from_list.as_ref().map(|list| list.parent().unwrap_or(Path::new("")).to_owned());
        if let Some(folder) = self.from.clone().or(listed) {
            return Content::Inputs(InputContent {
                folder,
                list: self.from_list.clone(),
                pictures: match (self.video, self.stills) {
                    (true, _) => Pictures::Video,
                    (_, true) => Pictures::Stills,
                    _ => Pictures::Auto,
                },
                readouts_per_frame: self.readouts_per_frame,
                interpolation: self.interpolation,
                resize_mode: self.resize_mode,
                transfer: self.transfer,
                full_scale: self.full_scale,
                accept_damage: self.accept_damage,
            });
        }
        let known = SceneContent::from_preset(&self.scene_preset).unwrap_or_else(SceneContent::rhdd);
        Content::Scenes(SceneContent {
            sequences: self.sequences.unwrap_or(known.sequences),
            images_per_scene: self.images_per_scene.unwrap_or(known.images_per_scene),
            readouts_per_image: self.readouts_per_image.unwrap_or(known.readouts_per_image),
            label_every: self.label_every.unwrap_or(known.label_every),
            lighting: self.lighting.fixed().into_iter().collect(),
            flicker_hz: self.flicker_hz,
            vehicles: self.vehicles,
            speed_kmh: self.speed_kmh,
            white_cd_m2: self.white_cd_m2,
            lock_exposure: self.lock_exposure,
            ideal_lens: self.ideal_lens,
            undistorted_labels: self.undistorted_labels,
            npy: self.npy,
            kitti: self.kitti,
            exr: self.exr,
            ..known
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Tests that `SPEC_FLAGS` is complete. A flag that is missing in `SPEC_FLAGS` could be combined with `--config`
    /// but would have no effect.
    #[test]
    fn every_spec_flag_conflicts_with_config() {
        let command = <DatasetSpec as clap::Args>::augment_args(clap::Command::new("dataset"));
        let other_flags = ["output", "config", "threads", "follow_links"];
        let missing: Vec<&str> = command
            .get_arguments()
            .map(|arg| arg.get_id().as_str())
            .filter(|id| !other_flags.contains(id) && !SPEC_FLAGS.contains(id))
            .collect();
        assert!(missing.is_empty(), "{missing:?}");
    }
}
