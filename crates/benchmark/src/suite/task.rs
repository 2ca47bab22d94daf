//! The tasks of the suites.

use serde::{Deserialize, Serialize};

use spikelane::error::Result;
use spikelane::reconstruct::ColorMatrix;
use spikelane_dataset::{Content, DatasetOptions, SceneContent};
use spikelane_io::simulate::ImageFormat;

use super::config_error;
use crate::Metric;

/// The depth of the trivial answer in meters.
pub(crate) const TRIVIAL_DEPTH_M: f32 = 20.0;

/// Smallest side of an image for which every metric is defined.
const MIN_SIDE_PIXELS: usize = 32;

/// The task of a method.
///
/// # Examples
/// ```
/// use spikelane_benchmark::suite::Task;
/// assert_eq!((Task::Flow.name(), Task::Flow.output_extension()), ("flow", ".npy"));
/// assert_eq!(Task::Reconstruction.reference_readout(41), 20);
/// ```
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Task {
    /// Reconstructs the image of the reference readout.
    Reconstruction,
    /// Reconstructs the color image of the reference readout from the stream of a color camera.
    Color,
    /// Estimates the displacement of each pixel from the reference readout to the next labeled readout.
    Flow,
    /// Estimates the depth of each pixel at the reference readout.
    Depth,
    /// Finds vehicles at the reference readout.
    Detection,
    /// Follows vehicles through all labeled readouts.
    Tracking,
}

impl Task {
    /// Returns the name in suite files.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Reconstruction => "reconstruction",
            Self::Color => "color",
            Self::Flow => "flow",
            Self::Depth => "depth",
            Self::Detection => "detection",
            Self::Tracking => "tracking",
        }
    }

    /// Returns the ending of the file that a method writes for each sequence.
    #[must_use]
    pub const fn output_extension(self) -> &'static str {
        match self {
            Self::Reconstruction | Self::Color | Self::Flow | Self::Depth => ".npy",
            Self::Detection | Self::Tracking => ".json",
        }
    }

    /// Returns the reference readout of a stream, which is in its middle.
    #[must_use]
    pub const fn reference_readout(self, readouts: u64) -> u64 {
        readouts / 2
    }

    /// Returns the answer that replaces a faulty output.
    #[must_use]
    pub const fn trivial_answer(self) -> &'static str {
        match self {
            Self::Reconstruction => "the TFP image of the whole stream",
            Self::Color => "the TFP image of the whole stream with bilinear demosaicing",
            Self::Flow => "zero flow",
            Self::Depth => "a depth of 20 m everywhere",
            Self::Detection | Self::Tracking => "no boxes",
        }
    }

    /// Returns whether a metric scores outputs of this task.
    #[must_use]
    pub fn has_metric(self, metric: &Metric) -> bool {
        let name = metric.name;
        let is_box = |name: &str| name == "ap" || name.starts_with("ap_") || name.starts_with("ar_");
        let is_track = |name: &str| matches!(name, "hota" | "det_a" | "ass_a" | "loc_a");
        match self {
            Self::Color => {
                matches!(name, "cpsnr" | "psnr_red" | "psnr_green" | "psnr_blue" | "ssim_color" | "ciede2000")
            }
            Self::Flow => name.starts_with("flow_"),
            Self::Depth => name.starts_with("depth_"),
            Self::Detection => is_box(name),
            Self::Tracking => is_track(name),
            Self::Reconstruction => ![Self::Color, Self::Flow, Self::Depth, Self::Detection, Self::Tracking]
                .iter()
                .any(|t| t.has_metric(metric)),
        }
    }

    /// Returns the names of the files of a sequence that methods and metrics read. The first file is the stream.
    pub(crate) fn files(self, readouts: u64) -> Vec<String> {
        let at = self.reference_readout(readouts);
        let further = match self {
            Self::Reconstruction | Self::Color => vec![format!("images/{at:06}.npy")],
            Self::Flow => {
                vec![format!("labels/{at:06}.forward.flo"), format!("labels/{at:06}.forward.occluded.npy")]
            }
            Self::Depth => vec![format!("labels/{at:06}.depth.npy")],
            Self::Detection | Self::Tracking => vec!["labels/labels.json".to_owned()],
        };
        std::iter::once("stream.dat".to_owned()).chain(further).collect()
    }

    /// Checks that a data set contains the references of the task.
    pub(super) fn check(self, options: &DatasetOptions) -> Result<()> {
        let Content::Scenes(scenes) = &options.content else {
            return Err(config_error("dataset").found("[inputs]").expected("[scenes]"));
        };
        let geometry = options.camera.sensor.geometry;
        if geometry.width().min(geometry.height()) < MIN_SIDE_PIXELS {
            return Err(config_error("dataset.camera")
                .found(geometry)
                .expected(format_args!("at least {MIN_SIDE_PIXELS} pixels per side")));
        }
        self.check_mosaic(options)?;
        let at = self.reference_readout(scenes.readouts());
        if matches!(self, Self::Reconstruction | Self::Color) {
            let images = options.images;
            let has_image = images.every.is_some_and(|every| every > 0 && at.is_multiple_of(every));
            if images.format == ImageFormat::F32 && has_image {
                return Ok(());
            }
            return Err(config_error("dataset.images")
                .found(format_args!(
                    "images every {} readouts in the format {}",
                    images.every.unwrap_or(0),
                    images.format.name()
                ))
                .expected(format_args!("format = \"f32\" and an image of readout {at}")));
        }
        let interval = interval_readouts(scenes);
        if interval > 0 && at.is_multiple_of(interval) && at + interval < scenes.readouts() {
            return Ok(());
        }
        Err(config_error("dataset.scenes.label_every")
            .found(format_args!("labels every {interval} of {} readouts", scenes.readouts()))
            .expected(format_args!("a label at readout {at} and a later label")))
    }

    /// Checks that a suite of color images has a color camera, and that a suite of gray images has none.
    fn check_mosaic(self, options: &DatasetOptions) -> Result<()> {
        let mosaic = options.camera.window_mosaic();
        let key = || config_error("dataset.camera.sensor.mosaic");
        match (self, mosaic) {
            (Self::Color, None) => Err(key().found("no mosaic").expected("the mosaic of a color camera")),
            // The baselines of this task need a color matrix.
            (Self::Color, Some(mosaic)) => ColorMatrix::from_response(&mosaic).map(|_| ()),
            (Self::Reconstruction, Some(mosaic)) => Err(key()
                .found(format_args!("the mosaic {mosaic}"))
                .expected("a gray camera")
                .remedy(format_args!("set the task {}", Self::Color))),
            _ => Ok(()),
        }
    }
}

/// Returns the number of readouts between two labeled readouts, or 0 without labels.
pub(crate) fn interval_readouts(scenes: &SceneContent) -> u64 {
    u64::from(scenes.label_every) * u64::from(scenes.readouts_per_image)
}

impl std::fmt::Display for Task {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}
