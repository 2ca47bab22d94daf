//! Implements `spikelane dataset preview`.

use std::path::PathBuf;

use image::{GrayImage, imageops};
use serde_json::json;

use crate::common::console::Console;
use crate::common::images::{frames_around, gray_image, spikes_picture, white_rate};
use crate::common::output_claims;
use crate::common::video::{FrameEncoding, VideoWriter};
use spikelane::reconstruct::tfp;
use spikelane::spikes::SpikeFramesRef;
use spikelane::unstable::Count;
use spikelane::{Error, ErrorKind, Geometry, Result};
use spikelane_dataset::DatasetReader;
use spikelane_io::formats::{OpenOptions, StreamReader};

/// Frames per second of the video.
const VIDEO_FPS: f64 = 25.0;

/// Write a video of sequences of a dataset
///
/// Each frame shows one readout of spikes, the noisy stream and the clean stream side by side. All sequences have the
/// same number of frames, evenly spaced. The pictures of both streams are means over readouts (TFP) with the same
/// brightness.
#[derive(clap::Args, Clone, Debug)]
pub(crate) struct Args {
    /// Show the dataset in this folder, or this packed shard
    #[arg(value_name = "DIR")]
    folder: PathBuf,
    /// Write the video to this file
    ///
    /// The extension of FILE determines the video format.
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// Set the number of sequences
    #[arg(long, value_name = "N", default_value_t = 8, value_parser = clap::value_parser!(u32).range(1..))]
    sequences: u32,
    /// Set the number of frames per sequence
    #[arg(long, value_name = "N", default_value_t = 25, value_parser = clap::value_parser!(u32).range(1..))]
    frames_per_sequence: u32,
    /// Overwrite existing files
    #[arg(long)]
    force: bool,
    /// Follow links to files outside the folder
    ///
    /// By default, a link to a file outside the folder is an error.
    #[arg(long)]
    follow_links: bool,
}

/// Runs the command.
///
/// # Errors
/// * Those of [`DatasetReader::open`].
/// * [`ErrorKind::Input`] if the dataset has no finished sequences.
/// * [`ErrorKind::Tool`] if ffmpeg is missing.
/// * If a file cannot be read.
pub(crate) fn run(args: &Args, out: &Console) -> Result<()> {
    let _claim = output_claims::claim([&args.output], args.force)?;
    let dataset = DatasetReader::open(&args.folder, args.follow_links)?;
    let done = dataset.done_entries();
    let shown = done.len().min(args.sequences as usize);
    let chosen = (0..shown).map(|i| done[i * done.len() / shown]);
    let mut video: Option<(VideoWriter, Geometry)> = None;
    for entry in chosen {
        spikelane::unstable::threads::check_stop();
        let files = dataset.sequence(entry)?;
        let open = |file| files.stream(file, &OpenOptions::default());
        let (noisy, clean) = (open("stream.dat")?, open("stream.clean.dat")?);
        let geometry = noisy.geometry();
        let (video, _) = match &mut video {
            Some(begun) => begun,
            None => {
                let wide = Geometry::new(3 * geometry.width() as u32, geometry.height() as u32)?;
                let begun =
                    VideoWriter::start(&args.output, FrameEncoding::Gray(wide), VIDEO_FPS, args.force)?;
                video.insert((begun, geometry))
            }
        };
        let readouts = noisy.readouts().min(clean.readouts());
        let moments = (args.frames_per_sequence as usize).min(readouts);
        for moment in 0..moments {
            let at = ((2 * moment + 1) as u128 * readouts as u128 / (2 * moments) as u128) as usize;
            video.push(&frame_row(&noisy, &clean, at)?)?;
        }
    }
    let Some((video, geometry)) = video else {
        return Err(Error::new(ErrorKind::Input, args.folder.display())
            .found("no finished sequence")
            .expected("at least one finished sequence"));
    };
    video.finish()?;
    let event = json!({
        "event": "preview", "output": args.output.display().to_string(), "sequences": shown,
        "width": 3 * geometry.width(), "height": geometry.height(),
    });
    out.print_result(
        &event,
        &format!("{}: {shown} of {}\n", args.output.display(), Count(done.len(), "sequence")),
    )
}

/// Returns one image with three pictures at the readout `at`. From left to right: the spikes, the noisy stream and the
/// clean stream.
fn frame_row(noisy: &StreamReader, clean: &StreamReader, at: usize) -> Result<Vec<u8>> {
    // In a short stream the TFP window is an eighth of the stream, so that different frames show different readouts.
    let half = (noisy.readouts() / 16).clamp(1, 80);
    let mean = |reader: &StreamReader| -> Result<Vec<f32>> {
        let at = at.min(reader.readouts() - 1);
        let (bytes, center) = frames_around(reader, at, half)?;
        tfp(SpikeFramesRef::new(reader.geometry(), &bytes)?, center, half)
    };
    let (geometry, truth) = (noisy.geometry(), mean(clean)?);
    let white = white_rate(&truth);
    let (width, height) = (geometry.width() as u32, geometry.height() as u32);
    let mut all = GrayImage::new(3 * width, height);
    let panels = [
        spikes_picture(noisy, at)?,
        gray_image(&mean(noisy)?, white, geometry),
        gray_image(&truth, white, geometry),
    ];
    for (i, panel) in (0i64..).zip(&panels) {
        imageops::replace(&mut all, panel, i * i64::from(width), 0);
    }
    Ok(all.into_raw())
}
