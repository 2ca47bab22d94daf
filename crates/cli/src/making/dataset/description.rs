//! What a dataset is asked to be, as flags or as a text.

use std::path::{Path, PathBuf};

use clap::builder::PossibleValuesParser;

use crate::shared::camera::CameraArgs;
use crate::shared::output::Out;
use crate::shared::seeds::{SceneSeed, SeedArgs};
use crate::shared::threads::ThreadArgs;
use spikelane::Result;
use spikelane_dataset::{Cameras, DatasetOptions, Drives, Images, Inputs, Splits, Structure, Work, config};
use spikelane_io::light::{Fit, Insertion, Transfer};
use spikelane_io::simulate::ImageForm;
use spikelane_scene::Lighting;

/// What a dataset is asked to be.
#[derive(clap::Args, Clone, Debug)]
pub(crate) struct Description {
    /// Folder that becomes the dataset
    #[arg(short, long, value_name = "DIR", required = true)]
    pub(crate) output: Option<PathBuf>,
    /// Make the dataset that FILE describes (see --write); no flag that says what is made goes beside it
    #[arg(hide_short_help = true, long, value_name = "FILE", conflicts_with_all = DESCRIBED)]
    pub(crate) config: Option<PathBuf>,
    /// Convert every video and image folder below DIR
    #[arg(long, value_name = "DIR", group = "inputs")]
    pub(crate) from: Option<PathBuf>,
    /// Convert the videos and image folders that FILE names, one path a line, relative to FILE
    #[arg(hide_short_help = true, long, value_name = "FILE", group = "inputs")]
    pub(crate) from_list: Option<PathBuf>,
    /// Kind of data set: rhdd is 30 scenes of 500 images, tiny 2 of 40, one readout per image
    #[arg(long, hide_possible_values = true, value_name = "NAME", default_value = "rhdd", conflicts_with = "inputs",
          value_parser = PossibleValuesParser::new(Drives::PRESETS))]
    pub(crate) kind: String,
    /// Number of scenes
    #[arg(long, value_name = "N", conflicts_with = "inputs", help_heading = "Scenes")]
    pub(crate) sequences: Option<u32>,
    /// Clear images of each
    #[arg(long, value_name = "M", conflicts_with = "inputs", help_heading = "Scenes")]
    pub(crate) images: Option<u32>,
    /// Readouts from one image to the next; the light follows every readout
    #[arg(
        hide_short_help = true,
        long,
        value_name = "N",
        conflicts_with = "inputs",
        help_heading = "Scenes"
    )]
    pub(crate) readouts_per_image: Option<u32>,
    /// Images from one labelled image to the next; 0 for no labels
    #[arg(
        hide_short_help = true,
        long,
        value_name = "N",
        conflicts_with = "inputs",
        help_heading = "Scenes"
    )]
    pub(crate) label_every: Option<u32>,
    /// Light of all scenes, such as dusk or tunnel [default: drawn for each]
    #[arg(long, hide_possible_values = true, conflicts_with = "inputs", help_heading = "Scenes",
          value_parser = PossibleValuesParser::new(Lighting::ALL.map(Lighting::name)))]
    pub(crate) lighting: Option<String>,
    /// Frequency with which lamps flicker, in hertz
    #[arg(
        hide_short_help = true,
        long,
        value_name = "HZ",
        conflicts_with = "inputs",
        help_heading = "Scenes"
    )]
    pub(crate) flicker_hz: Option<f64>,
    /// Vehicles in each scene
    #[arg(
        hide_short_help = true,
        long,
        value_name = "N",
        conflicts_with = "inputs",
        help_heading = "Scenes"
    )]
    pub(crate) vehicles: Option<u32>,
    /// Speed that the camera's car wishes to drive, in km/h
    #[arg(
        hide_short_help = true,
        long,
        value_name = "KMH",
        conflicts_with = "inputs",
        help_heading = "Scenes"
    )]
    pub(crate) speed_kmh: Option<f64>,
    /// Luminance of full scale in cd/m2 [default: each scene's own white]
    #[arg(
        hide_short_help = true,
        long,
        value_name = "CD_M2",
        conflicts_with = "inputs",
        help_heading = "Scenes"
    )]
    pub(crate) white: Option<f32>,
    /// Also keep the clear images as linear float arrays
    #[arg(hide_short_help = true, long, conflicts_with = "inputs", help_heading = "Scenes")]
    pub(crate) npy: bool,
    /// Also write depth and flow as KITTI's 16-bit PNGs
    #[arg(hide_short_help = true, long, conflicts_with = "inputs", help_heading = "Scenes")]
    pub(crate) kitti: bool,
    /// Also write the light of labelled images in colour as EXR, in cd/m2
    #[arg(hide_short_help = true, long, conflicts_with = "inputs", help_heading = "Scenes")]
    pub(crate) exr: bool,
    /// Readouts of every frame [default: as its times or its rate say, so that motion keeps its speed; 20 where the
    /// input says nothing, a millisecond at 20 kHz]
    #[arg(hide_short_help = true, long, value_name = "N", requires = "inputs", help_heading = "Conversion",
          value_parser = clap::value_parser!(u64).range(1..))]
    pub(crate) readouts_per_frame: Option<u64>,
    /// Light between two frames: hold, linear, or flow (along an estimated motion); held frames make all pixels jump at
    /// once where the scene moved
    #[arg(
        hide_short_help = true,
        long,
        default_value = "linear",
        requires = "inputs",
        help_heading = "Conversion"
    )]
    pub(crate) insertion: Insertion,
    /// How frames are brought to the camera's size: resize, stretch or crop
    #[arg(
        hide_short_help = true,
        long,
        default_value = "resize",
        requires = "inputs",
        help_heading = "Conversion"
    )]
    pub(crate) fit: Fit,
    /// How stored values become light: linear, srgb, or an exponent
    #[arg(hide_short_help = true, long, requires = "inputs", help_heading = "Conversion")]
    pub(crate) transfer: Option<Transfer>,
    #[command(flatten)]
    pub(crate) camera: CameraArgs,
    #[command(flatten)]
    pub(crate) seeds: SeedArgs,
    #[command(flatten)]
    pub(crate) scene: SceneSeed,
    /// Keep the clear light of every N-th readout as images/READOUT [default: of scenes every image, of given inputs none]
    #[arg(hide_short_help = true, long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pub(crate) images_every: Option<u64>,
    /// How clear images are stored: u8 (PNG, sRGB), u16 (PNG, linear) or f32 (npy, linear)
    #[arg(hide_short_help = true, long, value_name = "FORM", default_value = "u8")]
    pub(crate) images_as: ImageForm,
    /// Which loaders find their folders: spikecv (255 of ground truth is rate 1), or spike-zoo (rate 0.6)
    #[arg(long, default_value = "spikecv")]
    pub(crate) structure: Structure,
    /// Share of the sequences that are for testing
    #[arg(hide_short_help = true, long, value_name = "SHARE", default_value_t = 0.2)]
    pub(crate) test_share: f64,
    /// Share of the sequences that are for validation
    #[arg(hide_short_help = true, long, value_name = "SHARE", default_value_t = 0.0)]
    pub(crate) validation_share: f64,
    /// Give every light the shares, to within one scene
    #[arg(hide_short_help = true, long, conflicts_with = "inputs", help_heading = "Scenes")]
    pub(crate) split_by_light: bool,
    /// Version of the data, in your words
    #[arg(hide_short_help = true, long, value_name = "TEXT")]
    pub(crate) data_version: Option<String>,
    /// SPDX identifier under which you give the dataset on, such as CC-BY-4.0
    #[arg(hide_short_help = true, long, value_name = "SPDX")]
    pub(crate) licence: Option<String>,
    /// Read files through links that leave the dataset's folder; without it they are refused
    #[arg(hide_short_help = true, long)]
    pub(crate) follow_links: bool,
    #[command(flatten)]
    pub(crate) threads: ThreadArgs,
}

/// The flags that say what is made: a dataset.toml says all of it.
const DESCRIBED: [&str; 39] = [
    "from",
    "from_list",
    "kind",
    "sequences",
    "images",
    "readouts_per_image",
    "label_every",
    "lighting",
    "flicker_hz",
    "vehicles",
    "speed_kmh",
    "white",
    "npy",
    "kitti",
    "exr",
    "readouts_per_frame",
    "insertion",
    "fit",
    "transfer",
    "camera",
    "camera_format",
    "width",
    "height",
    "readout_hz",
    "exposure",
    "effect",
    "without",
    "seed",
    "camera_seed",
    "scene_seed",
    "images_every",
    "images_as",
    "structure",
    "test_share",
    "validation_share",
    "split_by_light",
    "data_version",
    "licence",
    "inputs",
];

impl Description {
    /// The options that the flags, or the text that they name, say.
    pub(super) fn options(&self, out: &Out) -> Result<DatasetOptions> {
        let output = self.output.clone().unwrap_or_default();
        let threads = self.threads.number(out);
        if let Some(path) = &self.config {
            return Ok(DatasetOptions { output, threads, ..config::read(path, self.follow_links)? });
        }
        Ok(DatasetOptions {
            output,
            work: self.work(),
            camera: self.camera.camera()?,
            images: Images { every: self.images_every, form: self.images_as },
            seed: self.seeds.seed,
            scene_seed: self.scene.scene_seed,
            camera_seed: self.seeds.camera_seed(),
            structure: self.structure,
            cameras: Cameras::One,
            splits: Splits {
                validation: self.validation_share,
                test: self.test_share,
                by_light: self.split_by_light,
            },
            data_version: self.data_version.clone(),
            licence: self.licence.clone(),
            threads,
            resume: false,
            follow_links: self.follow_links,
        })
    }

    fn work(&self) -> Work {
        let listed = self.from_list.as_ref().map(|list| list.parent().unwrap_or(Path::new("")).to_owned());
        if let Some(folder) = self.from.clone().or(listed) {
            return Work::Inputs(Inputs {
                folder,
                list: self.from_list.clone(),
                readouts_per_frame: self.readouts_per_frame,
                insertion: self.insertion,
                fit: self.fit,
                transfer: self.transfer,
            });
        }
        let known = Drives::preset(&self.kind).unwrap_or_else(Drives::rhdd);
        Work::Drives(Drives {
            sequences: self.sequences.unwrap_or(known.sequences),
            images: self.images.unwrap_or(known.images),
            readouts_per_image: self.readouts_per_image.unwrap_or(known.readouts_per_image),
            label_every: self.label_every.unwrap_or(known.label_every),
            lighting: self.lighting.as_deref().and_then(Lighting::from_name).into_iter().collect(),
            flicker_hz: self.flicker_hz,
            vehicles: self.vehicles,
            speed_kmh: self.speed_kmh,
            white_cd_m2: self.white,
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

    /// A flag that is missing from the list would be read beside `--config` and do nothing.
    #[test]
    fn every_flag_that_says_what_is_made_is_refused_beside_a_text_that_does() {
        let command = <Description as clap::Args>::augment_args(clap::Command::new("dataset"));
        let beside = ["output", "config", "threads", "follow_links"];
        let missing: Vec<&str> = command
            .get_arguments()
            .map(|arg| arg.get_id().as_str())
            .filter(|id| !beside.contains(id) && !DESCRIBED.contains(id))
            .collect();
        assert!(missing.is_empty(), "{missing:?}");
    }
}
