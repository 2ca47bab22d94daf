//! Implements `spikelane dataset preview`.

use std::path::PathBuf;

use image::{GrayImage, imageops};
use serde_json::json;

use crate::common::{
    Console, CountProgress, MovieFormat, MovieWriter, claim_files, gray_image, spikes_picture, stop_flag,
    white_rate,
};
use spikelane::reconstruct::tfp;
use spikelane::unstable::{Count, threads};
use spikelane::{Error, ErrorKind, Geometry, Result};
use spikelane_dataset::DatasetReader;
use spikelane_io::formats::{OpenOptions, StreamReader};

/// Frames per second of the movie.
const FPS: f64 = 25.0;

/// Frames that a thread prepares per batch. The frames of a batch are written when it is complete.
const BATCH_FRAMES: usize = 4;

/// Write a movie of sequences of a dataset
///
/// Each frame shows one readout of spikes, the noisy stream and the clean stream side by side. All sequences have the
/// same number of frames, evenly spaced. The pictures of both streams are means over readouts (TFP) with the same
/// brightness.
#[derive(clap::Args, Clone, Debug)]
pub(crate) struct Args {
    /// Show the dataset in this folder, or this packed shard
    #[arg(value_name = "DIR")]
    folder: PathBuf,
    /// Write the movie to this file
    ///
    /// The extension selects an animated image (.gif, .webp), or a video by ffmpeg (.mp4, .mkv, .mov, .avi, .webm).
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
/// * [`ErrorKind::Usage`] if the extension is not that of a movie.
/// * [`ErrorKind::Tool`] if ffmpeg is missing for a video.
/// * If a file cannot be read.
pub(crate) fn run(args: &Args, out: &Console) -> Result<()> {
    let format = MovieFormat::require(&args.output)?;
    let _claim = claim_files([&args.output], args.force)?;
    let dataset = DatasetReader::open(&args.folder, args.follow_links)?;
    let done = dataset.done_entries();
    let shown = done.len().min(args.sequences as usize);
    let chosen = (0..shown).map(|i| done[i * done.len() / shown]);
    let mut movie: Option<(MovieWriter, Geometry)> = None;
    let mut progress = CountProgress::new(out, stop_flag()?);
    let (mut written, total) = (0, shown as u64 * u64::from(args.frames_per_sequence));
    for entry in chosen {
        let files = dataset.sequence(entry)?;
        let open = |file| files.stream(file, &OpenOptions::default());
        let (noisy, clean) = (open("stream.dat")?, open("stream.clean.dat")?);
        let geometry = noisy.geometry();
        let wide = Geometry::new(3 * geometry.width() as u32, geometry.height() as u32)?;
        let (movie, _) = match &mut movie {
            Some(open) => open,
            None => movie
                .insert((MovieWriter::create(&args.output, format, wide, false, FPS, args.force)?, geometry)),
        };
        let readouts = noisy.readouts().min(clean.readouts());
        let moments = (args.frames_per_sequence as usize).min(readouts);
        let at =
            |moment: usize| ((2 * moment + 1) as u128 * readouts as u128 / (2 * moments) as u128) as usize;
        let all: Vec<usize> = (0..moments).map(at).collect();
        for batch in all.chunks(BATCH_FRAMES * threads::thread_count()) {
            let encode = |&at: &usize| format.encode_frame(wide, frame_row(&noisy, &clean, at)?);
            for frame in threads::map(batch, encode) {
                movie.push(&frame?).map_err(|e| progress.error_or_interrupt(e))?;
                written += 1;
                progress.update(written, Some(total))?;
            }
        }
    }
    let Some((movie, geometry)) = movie else {
        return Err(Error::new(ErrorKind::Input, args.folder.display())
            .found("no finished sequence")
            .expected("at least one finished sequence"));
    };
    movie.finish()?;
    drop(progress);
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
        let (frames, center) = reader.read_around(at, half)?;
        tfp(frames.view(), center, half)
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
