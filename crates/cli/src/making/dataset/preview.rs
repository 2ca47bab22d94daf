//! `spikelane dataset preview`.

use std::path::PathBuf;

use image::{GrayImage, imageops};
use serde_json::json;

use crate::shared::output::Out;
use crate::shared::outputs;
use crate::shared::picture::{around, bright, grey, spikes_picture};
use crate::shared::video::{Pictures, Video};
use spikelane::reconstruct::tfp;
use spikelane::spikes::Packed;
use spikelane::unstable::inputs::{Access, InnerPath};
use spikelane::{Error, Geometry, Kind, Result};
use spikelane_dataset::{Entry, Manifest, Status};
use spikelane_io::formats::Reader;

/// Pictures a second of the video.
const FPS: f64 = 25.0;

/// Show sequences of a dataset as a video
///
/// Side by side: one readout of spikes, the noisy stream, the clean one. Of each sequence as many moments, evenly apart; pictures are means of readouts (TFP), as bright in both streams.
#[derive(clap::Args, Clone, Debug)]
pub(crate) struct Args {
    /// Folder of the dataset
    #[arg(value_name = "DIR")]
    folder: PathBuf,
    /// Video to write; ffmpeg knows its form by the ending
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// Sequences that are shown, evenly chosen
    #[arg(long, value_name = "N", default_value_t = 8, value_parser = clap::value_parser!(u32).range(1..))]
    sequences: u32,
    /// Moments of each
    #[arg(long, value_name = "N", default_value_t = 25, value_parser = clap::value_parser!(u32).range(1..))]
    moments: u32,
    /// Overwrite the video
    #[arg(long)]
    force: bool,
    /// Read files through links that leave the folder; without it they are refused
    #[arg(long)]
    follow_links: bool,
}

/// Runs the command.
///
/// # Errors
/// [`Kind::Input`] for a dataset without finished sequences, or packed; [`Kind::Tool`] without ffmpeg; those of reading.
pub(crate) fn run(args: &Args, out: &Out) -> Result<()> {
    let _claim = outputs::claim([&args.output], args.force)?;
    let access = Access::reading(args.follow_links);
    let manifest = Manifest::read_below(&args.folder, access)?;
    let done: Vec<&Entry> = manifest.entries.iter().filter(|e| e.status == Status::Done).collect();
    let shown = done.len().min(args.sequences as usize);
    let chosen = (0..shown).map(|i| done[i * done.len() / shown]);
    let mut video: Option<(Video, Geometry)> = None;
    for entry in chosen {
        spikelane::unstable::threads::check();
        let folder = entry.unpacked(&args.folder, access)?;
        let open =
            |file: &'static str| Reader::open(&InnerPath::from(file).below(&folder, access)?, None, None);
        let (noisy, clean) = (open("stream.dat")?, open("stream.clean.dat")?);
        let geometry = noisy.geometry();
        let (video, _) = match &mut video {
            Some(begun) => begun,
            None => {
                let wide = Geometry::new(3 * geometry.width() as u32, geometry.height() as u32)?;
                let begun = Video::start(&args.output, Pictures::Grey(wide), FPS, args.force)?;
                video.insert((begun, geometry))
            }
        };
        let readouts = noisy.readouts().min(clean.readouts());
        let moments = (args.moments as usize).min(readouts);
        for moment in 0..moments {
            let at = ((2 * moment + 1) as u128 * readouts as u128 / (2 * moments) as u128) as usize;
            video.push(&row(&noisy, &clean, at)?)?;
        }
    }
    let Some((video, geometry)) = video else {
        return Err(Error::new(Kind::Input, args.folder.display())
            .found("no finished sequence")
            .expected("at least one"));
    };
    video.finish()?;
    let event = json!({
        "event": "preview", "output": args.output.display().to_string(), "sequences": shown,
        "width": 3 * geometry.width(), "height": geometry.height(),
    });
    out.result(&event, &format!("{}: {shown} of {} sequences\n", args.output.display(), done.len()))
}

/// The three pictures of a moment, left to right.
fn row(noisy: &Reader, clean: &Reader, at: usize) -> Result<Vec<u8>> {
    // An eighth of a short stream on either side, so that moments differ.
    let half = (noisy.readouts() / 16).clamp(1, 80);
    let mean = |reader: &Reader| -> Result<Vec<f32>> {
        let at = at.min(reader.readouts() - 1);
        let (bytes, centre) = around(reader, at, half)?;
        tfp(Packed::new(reader.geometry(), &bytes)?, centre, half)
    };
    let (geometry, truth) = (noisy.geometry(), mean(clean)?);
    let white = bright(&truth);
    let (width, height) = (geometry.width() as u32, geometry.height() as u32);
    let mut all = GrayImage::new(3 * width, height);
    let panels =
        [spikes_picture(noisy, at)?, grey(&mean(noisy)?, white, geometry), grey(&truth, white, geometry)];
    for (i, panel) in (0i64..).zip(&panels) {
        imageops::replace(&mut all, panel, i * i64::from(width), 0);
    }
    Ok(all.into_raw())
}
