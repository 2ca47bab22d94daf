//! What `evaluate` is asked.

use std::path::{Path, PathBuf};

use crate::shared::stream::StreamArgs;
use spikelane::{Error, Kind, Result};
use spikelane_io::formats::Reader;
use spikelane_io::light::Transfer;
use spikelane_io::simulate::Sidecar;

use super::picture::Wanted;
use super::truth::{Curve, Truth};

/// Say how good the pictures are that a stream gives
///
/// TFP, span and TFI pictures of a stream: two estimates of their noise that need no original (patches:
/// Chen et al. 2015, smallest eigenvalues; differences: Immerkaer 1996) and the signal-to-noise ratio,
/// 20 log10 of mean over patch noise. With --clear, or for a dataset, also PSNR and SSIM against the
/// clear image, both as codes of the image's transfer function, cut to 0 to 1, peak 1; and a second table,
/// in linear light after the line of least squares: PSNR, the share of the detail that is there (1 is sharp),
/// noise besides, pixels that stand out, with a blurred TFP as what is no improvement. --still gives that table
/// without a clear image. FILE is a stream, or the folder of a dataset. Of a stream one moment is looked at, or with --every, or
/// a folder of clear images, many, of which the tables have the means.
#[derive(clap::Args, Debug)]
pub(crate) struct Args {
    /// Stream file, or folder of a dataset
    pub(super) file: PathBuf,
    #[command(flatten)]
    pub(super) stream: StreamArgs,
    /// The clear image of the moment, or a folder of images that are named by their readouts; with --every one for all moments
    #[arg(long, value_name = "IMAGE")]
    pub(super) clear: Option<PathBuf>,
    /// How the clear image's codes stand for light: linear, srgb, or an exponent such as 2.2
    /// [default: what the sidecar or the dataset says of the image, else srgb, linear for EXR]
    #[arg(long, value_name = "FUNCTION")]
    pub(super) clear_transfer: Option<Transfer>,
    /// The scene stands still: the readouts before and behind those of a picture say what it should be, where nothing changes
    #[arg(long, conflicts_with = "clear")]
    pub(super) still: bool,
    /// Readout to look at [default: the middle]
    #[arg(long, value_name = "READOUT")]
    pub(super) at: Option<usize>,
    /// Look at every so many readouts
    #[arg(long, value_name = "READOUTS", conflicts_with = "at", value_parser = clap::value_parser!(u32).range(1..))]
    pub(super) every: Option<u32>,
    #[command(flatten)]
    pub(super) wanted: Wanted,
    /// Rate of light 1.0, which the clear image shows white [default: from the sidecar or the dataset]
    #[arg(long, value_name = "RATE")]
    pub(super) full: Option<f32>,
    /// Read files of a dataset through links that leave its folder; without it they are refused
    #[arg(long)]
    pub(super) follow_links: bool,
}

impl Args {
    /// A clear image of a moment of `stream`.
    pub(super) fn truth(&self, stream: &Path, clear: &Path, reader: &Reader) -> Result<Truth> {
        let (curve, full) = self.curve(stream, clear)?;
        Truth::read(clear, reader.geometry(), full, curve)
    }

    /// What the codes of a clear image stand for, and the rate of its white.
    pub(super) fn curve(&self, stream: &Path, clear: &Path) -> Result<(Curve, f32)> {
        let curve = Curve::found(stream, clear)?.or_given(self.clear_transfer);
        let full = match self.full.or(curve.full) {
            Some(full) => full,
            None => camera_full(stream)?,
        };
        Ok((curve, full))
    }
}

/// The rate of full-scale light of the camera in the sidecar.
fn camera_full(file: &Path) -> Result<f32> {
    let camera = Sidecar::beside(file)?.and_then(|(_, s)| s.camera);
    let wrong = |found: String| {
        Error::new(Kind::Usage, file.display())
            .found(found)
            .expected("the rate that the clear image's white has")
            .remedy("give --full RATE")
    };
    let Some(camera) = camera else { return Err(wrong("no sidecar that names the camera".into())) };
    let thresholds = camera.sensor.thresholds_at_full_scale;
    let rate = thresholds.min(1.0) as f32;
    if rate.is_finite() && rate > 0.0 {
        return Ok(rate);
    }
    Err(wrong(format!("a sidecar with {thresholds} thresholds per readout at full scale")))
}
