//! Baselines: simple methods that every other method should exceed.

use std::path::Path;

use spikelane::error::{Error, ErrorKind, Result};
use spikelane::reconstruct::{ColorMatrix, Demosaic, demosaic, gaussian_blur, span_rates, tfi, tfp};
use spikelane::{Geometry, SpikeFrames};
use spikelane_io::formats::{Layout, OpenOptions};

use crate::block_matching::flow_between_readouts;
use crate::generated::GeneratedSequence;
use crate::suite::Task;

/// Standard deviation of the Gaussian blur in pixels.
const BLUR_SIGMA_PX: f64 = 1.0;

/// A simple method.
///
/// # Examples
/// ```
/// use spikelane_benchmark::run::Baseline;
/// use spikelane_benchmark::suite::Task;
/// let baseline = Baseline::find("tfp-blur", Task::Reconstruction)?;
/// assert_eq!(baseline.name(), "tfp-blur");
/// assert!(Baseline::find("median", Task::Reconstruction).is_err());
/// # Ok::<(), spikelane::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Baseline {
    /// The number of spikes in the whole stream.
    Tfp,
    /// [`Baseline::Tfp`] with a Gaussian blur of 1 pixel.
    TfpBlur,
    /// The interval between the spikes around the reference readout.
    Tfi,
    /// [`Baseline::Tfi`] with a Gaussian blur of 1 pixel.
    TfiBlur,
    /// The rate between the first and the last spike of the stream.
    Span,
    /// [`Baseline::Span`] with a Gaussian blur of 1 pixel.
    SpanBlur,
    /// [`Baseline::Tfp`] with bilinear demosaicing.
    TfpBilinear,
    /// [`Baseline::Tfp`] with the demosaicing of Malvar, He and Cutler.
    TfpMalvar,
    /// [`Baseline::Tfp`] with the demosaicing of Menon, Andriani and Calvagno.
    TfpMenon,
    /// [`Baseline::Span`] with bilinear demosaicing.
    SpanBilinear,
    /// [`Baseline::Span`] with the demosaicing of Malvar, He and Cutler.
    SpanMalvar,
    /// [`Baseline::Span`] with the demosaicing of Menon, Andriani and Calvagno.
    SpanMenon,
    /// Optical flow by [block matching](crate::block_matching), scaled from the centers of two windows to the interval.
    BlockMatching,
    /// The trivial answer of a task with labels; see [`Task::trivial_answer`].
    Trivial,
}

impl Baseline {
    /// Returns the baselines of a task. The first baseline is the trivial answer.
    #[must_use]
    pub const fn all(task: Task) -> &'static [Self] {
        match task {
            Task::Reconstruction => {
                &[Self::Tfp, Self::TfpBlur, Self::Tfi, Self::TfiBlur, Self::Span, Self::SpanBlur]
            }
            Task::Color => &[
                Self::TfpBilinear,
                Self::TfpMalvar,
                Self::TfpMenon,
                Self::SpanBilinear,
                Self::SpanMalvar,
                Self::SpanMenon,
            ],
            Task::Flow => &[Self::Trivial, Self::BlockMatching],
            Task::Depth | Task::Detection | Task::Tracking => &[Self::Trivial],
        }
    }

    /// Returns the name.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Tfp => "tfp",
            Self::TfpBlur => "tfp-blur",
            Self::Tfi => "tfi",
            Self::TfiBlur => "tfi-blur",
            Self::Span => "span",
            Self::SpanBlur => "span-blur",
            Self::TfpBilinear => "tfp-bilinear",
            Self::TfpMalvar => "tfp-malvar",
            Self::TfpMenon => "tfp-menon",
            Self::SpanBilinear => "span-bilinear",
            Self::SpanMalvar => "span-malvar",
            Self::SpanMenon => "span-menon",
            Self::BlockMatching => "block-matching",
            Self::Trivial => "trivial",
        }
    }

    /// Returns the baseline of `task` with the name `name`.
    ///
    /// # Errors
    /// [`ErrorKind::Usage`] if there is no such baseline.
    pub fn find(name: &str, task: Task) -> Result<Self> {
        let all = Self::all(task);
        all.iter().copied().find(|b| b.name() == name).ok_or_else(|| {
            Error::new(ErrorKind::Usage, "baseline")
                .found(format_args!("`{name}`"))
                .expected(all.iter().map(|b| b.name()).collect::<Vec<_>>().join(", "))
                .with_suggestion(name, all.iter().map(|b| b.name()))
        })
    }

    /// Returns the image of the reference readout in linear light. The light 1 is white.
    ///
    /// # Errors
    /// The errors of reading the stream.
    pub fn image(self, stream: &Path, sequence: &GeneratedSequence) -> Result<Vec<f32>> {
        let frames = read_stream(stream, sequence)?;
        let (view, geometry) = (frames.view(), frames.geometry());
        let at = sequence.reference_readout as usize;
        let whole = view.readouts();
        let rates = match self {
            Self::Tfi | Self::TfiBlur => tfi(view, at, (whole / 2).max(1))?,
            Self::Span | Self::SpanBlur | Self::SpanBilinear | Self::SpanMalvar | Self::SpanMenon => {
                span_rates(view, at, whole)?
            }
            _ => tfp(view, at, whole)?,
        };
        let white = sequence.white_rate as f32;
        let light: Vec<f32> = rates.into_iter().map(|rate| rate / white).collect();
        Ok(match self {
            Self::TfpBlur | Self::TfiBlur | Self::SpanBlur => gaussian_blur(&light, geometry, BLUR_SIGMA_PX),
            _ => light,
        })
    }

    /// Returns the color image of the reference readout: red, green and blue of each pixel in linear sRGB. The light 1 is
    /// white.
    ///
    /// # Errors
    /// * [`ErrorKind::Config`] if the camera has no mosaic, or its response does not separate three colors.
    /// * [`ErrorKind::Usage`] if the method of demosaicing does not support the mosaic.
    /// * The errors of reading the stream.
    pub fn color_image(self, stream: &Path, sequence: &GeneratedSequence) -> Result<Vec<f32>> {
        let mosaic = sequence.mosaic.as_ref().ok_or_else(|| {
            Error::new(ErrorKind::Config, sequence.id.as_str()).found("no mosaic").expected("a color camera")
        })?;
        let mosaic = mosaic.mosaic()?;
        let method = match self {
            Self::TfpMalvar | Self::SpanMalvar => Demosaic::Malvar,
            Self::TfpMenon | Self::SpanMenon => Demosaic::Menon,
            _ => Demosaic::Bilinear,
        };
        let light = self.image(stream, sequence)?;
        let geometry = Geometry::new(sequence.width, sequence.height)?;
        Ok(ColorMatrix::from_response(&mosaic)?.apply(&demosaic(&light, geometry, &mosaic, method)?))
    }

    /// Returns the displacement of every pixel from the reference readout to the next labeled readout, in pixels to the
    /// right and downward.
    ///
    /// # Errors
    /// The errors of reading the stream.
    pub fn flow(self, stream: &Path, sequence: &GeneratedSequence) -> Result<Vec<[f32; 2]>> {
        let pixels = sequence.width as usize * sequence.height as usize;
        if self != Self::BlockMatching {
            return Ok(vec![[0.0; 2]; pixels]);
        }
        let frames = read_stream(stream, sequence)?;
        let (at, interval) = (sequence.reference_readout as usize, sequence.interval_readouts as usize);
        // A stream can end at the next labeled readout. Windows that are complete and do not overlap have their centers at
        // readouts with a known distance.
        let last = frames.view().readouts().saturating_sub(1);
        let half_window = (interval / 4).min(last.saturating_sub(at) / 3);
        let second = (at + interval).min(last - half_window);
        let flow = flow_between_readouts(
            frames.view(),
            [at, second],
            half_window,
            crate::block_matching::BlockMatching::default(),
        )?;
        let scale = interval as f32 / (second - at).max(1) as f32;
        Ok(flow.into_iter().map(|displacement| displacement.map(|px| scale * px)).collect())
    }
}

fn read_stream(stream: &Path, sequence: &GeneratedSequence) -> Result<SpikeFrames> {
    let geometry = Geometry::new(sequence.width, sequence.height)?;
    let reader =
        OpenOptions::default().with_layout(Some(Layout::Dat)).with_geometry(Some(geometry)).open(stream)?;
    reader.read(0..reader.readouts())
}
