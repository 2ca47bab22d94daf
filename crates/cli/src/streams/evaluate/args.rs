//! Flags of `evaluate`.

use std::path::{Path, PathBuf};

use crate::common::{StreamArgs, StreamMosaicArgs};
use spikelane::{Error, ErrorKind, Result};
use spikelane_io::light::Transfer;
use spikelane_io::simulate::{CameraFacts, Sidecar};

use super::picture::ReconstructionArgs;
use super::reference::ReferenceCurve;

/// Score the images reconstructed from a stream
///
/// FILE is a stream, the folder of a dataset, or a packed shard. The command scores TFP, span and TFI pictures at one readout. With
/// --every, or with a folder of reference images, the command scores many readouts and prints means.
///
/// The first table has three estimates of the noise that need no reference (patches: Chen et al. 2015; weak texture: Liu
/// et al. 2013; differences: Immerkaer 1996). The signal-to-noise ratio is 20 log10 of the mean divided by the patch
/// noise. With --reference, or for a dataset, the first table also has PSNR and SSIM. Both scores compare the codes of the picture
/// with the codes of the reference. All codes are computed with the transfer function of the reference and are between
/// 0 and 1. Brighter light is clipped to 1, and the peak is 1.
///
/// The second table requires a reference or --static-scene. For this table, the linear light of the picture is fitted to
/// the reference by a least-squares line. The columns are PSNR, the share of the detail that is present (1 is sharp),
/// noise, and the number of outlier pixels. The row of a blurred TFP shows how blur changes each score.
///
/// The stream of a color camera requires --reference with a color image. The table has PSNR and SSIM of each color and CPSNR,
/// the PSNR over all colors, for each method of demosaicing.
#[derive(clap::Args, Debug)]
pub(crate) struct Args {
    /// Score this stream, dataset or packed shard
    pub(super) file: PathBuf,
    #[command(flatten)]
    pub(super) stream: StreamArgs,
    #[command(flatten)]
    pub(super) mosaic: StreamMosaicArgs,
    /// Compare with this image or folder
    ///
    /// In a folder, the name of each image is the number of its readout. With --every, a single image is the reference
    /// for all readouts.
    #[arg(long, value_name = "IMAGE")]
    pub(super) reference: Option<PathBuf>,
    /// Set the transfer function of the reference: linear, srgb, pq, hlg or an exponent such as 2.2
    ///
    /// The default comes from the sidecar or the record of the dataset, else it is linear for EXR and srgb for other
    /// images.
    #[arg(hide_short_help = true, long, value_name = "TRANSFER")]
    pub(super) reference_transfer: Option<Transfer>,
    /// Compare with other readouts of a static scene
    ///
    /// The reference is computed from the readouts before and after the window. Only pixels whose surroundings do not
    /// change are compared.
    #[arg(long, conflicts_with = "reference")]
    pub(super) static_scene: bool,
    /// Score at this readout [default: the middle]
    #[arg(long, value_name = "READOUT")]
    pub(super) at: Option<usize>,
    /// Score one readout per this many readouts
    #[arg(long, value_name = "READOUTS", conflicts_with = "at", value_parser = clap::value_parser!(u32).range(1..))]
    pub(super) every: Option<u32>,
    #[command(flatten)]
    pub(super) reconstruction: ReconstructionArgs,
    /// Set the spikes per readout of white in the reference [default: from the sidecar]
    ///
    /// White is light 1.0 of the reference image.
    #[arg(hide_short_help = true, long, value_name = "RATE")]
    pub(super) full_scale_rate: Option<f32>,
    /// Also write an HTML report, and its numbers as JSON beside it
    #[arg(long, value_name = "FILE")]
    pub(super) report: Option<PathBuf>,
    /// Overwrite existing files
    #[arg(hide_short_help = true, long, requires = "report")]
    pub(super) force: bool,
    /// Follow links to files outside the folder
    ///
    /// By default, a link to a file outside the folder is an error.
    #[arg(hide_short_help = true, long)]
    pub(super) follow_links: bool,
}

impl Args {
    /// Returns the transfer function of a reference image, and the rate that corresponds to white in this image.
    pub(super) fn reference_curve(&self, stream: &Path, clear: &Path) -> Result<(ReferenceCurve, f32)> {
        let curve = ReferenceCurve::from_files(stream, clear)?;
        let camera = || Ok(Sidecar::read_beside(stream)?.and_then(|(_, sidecar)| sidecar.camera));
        self.with_full_scale_rate(stream, curve, camera)
    }

    /// Applies the flags to a transfer function. Returns it and the rate that corresponds to white.
    ///
    /// `camera` reads the camera from the sidecar of the stream.
    pub(super) fn with_full_scale_rate(
        &self,
        stream: &Path,
        curve: ReferenceCurve,
        camera: impl FnOnce() -> Result<Option<CameraFacts>>,
    ) -> Result<(ReferenceCurve, f32)> {
        let curve = curve.with_transfer(self.reference_transfer);
        let full = match self.full_scale_rate.or(curve.full_scale_rate) {
            Some(full) => full,
            None => camera_full_scale_rate(stream, camera()?)?,
        };
        Ok((curve, full))
    }
}

/// Returns the rate of full-scale light for the camera that the sidecar describes.
fn camera_full_scale_rate(file: &Path, camera: Option<CameraFacts>) -> Result<f32> {
    let wrong = |found: String| {
        Error::new(ErrorKind::Usage, file.display())
            .found(found)
            .expected("the spikes per readout of white in the reference image")
            .remedy("set --full-scale-rate")
    };
    let Some(camera) = camera else { return Err(wrong("no sidecar that names the camera".into())) };
    let thresholds = camera.sensor.thresholds_at_full_scale;
    let rate = thresholds.min(1.0) as f32;
    if rate.is_finite() && rate > 0.0 {
        return Ok(rate);
    }
    Err(wrong(format!("a sidecar with {thresholds} thresholds per readout at full scale")))
}
