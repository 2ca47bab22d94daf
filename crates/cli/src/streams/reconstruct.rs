//! `spikelane reconstruct`.

use std::path::{Path, PathBuf};

use clap::ValueEnum;
use serde_json::json;
use spikelane::reconstruct::{isi_map, span, tfi_at, tfp};
use spikelane::spikes::Packed;
use spikelane::{Error, Kind, Result};
use spikelane_io::formats::Reader;

use crate::shared::output::Out;
use crate::shared::outputs;
use crate::shared::picture::{around, bright, moments};
use crate::shared::progress::{Progress, stop_flag};
use crate::shared::stream::StreamArgs;
use crate::shared::video::{Pictures, Video};
use spikelane::unstable::inputs;
use spikelane::unstable::threads;

mod array;
mod sinks;

use sinks::{Film, Folder, One, Shown, Sink};

/// Pictures that a thread makes before they are written.
const BATCH: usize = 4;

/// Make pictures of spikes
///
/// One picture (.png), an array of all (.npy, spikes per readout as f32; intervals in readouts for
/// isi), a folder of numbered PNGs, or a video through ffmpeg (.mp4, .mkv, .mov, .avi, .webm).
#[derive(clap::Args, Debug)]
pub(crate) struct Args {
    /// Stream file
    file: PathBuf,
    /// Where to write: .png, .npy, a video, or a folder
    #[arg(short, long, value_name = "OUT")]
    output: PathBuf,
    #[command(flatten)]
    stream: StreamArgs,
    /// tfp counts spikes in a window, span times its first to its last spike, tfi takes one over the
    /// interval around a moment, isi its length
    #[arg(long, value_enum, default_value_t = Method::Tfp)]
    method: Method,
    /// Readout to look at [default: the middle]
    #[arg(long, value_name = "READOUT", conflicts_with = "every")]
    at: Option<usize>,
    /// Readouts in the window of tfp and span; for tfi and isi, readouts searched on either side
    #[arg(long, value_name = "READOUTS", value_parser = clap::value_parser!(u32).range(1..))]
    window: Option<u32>,
    /// Make a picture every so many readouts (folder, .npy and video) [default there: the window]
    #[arg(long, value_name = "READOUTS", value_parser = clap::value_parser!(u32).range(1..))]
    every: Option<u32>,
    /// Value that is shown white [default: what one pixel in 500 of the first picture exceeds]
    #[arg(long, value_name = "RATE")]
    white: Option<f32>,
    /// Pictures per second of a video
    #[arg(long, value_name = "HZ", default_value_t = 25, value_parser = clap::value_parser!(u32).range(1..))]
    fps: u32,
    /// Overwrite files of the same name
    #[arg(long)]
    force: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Method {
    Tfp,
    Span,
    Tfi,
    Isi,
}

impl Method {
    const fn name(self) -> &'static str {
        match self {
            Self::Tfp => "tfp",
            Self::Span => "span",
            Self::Tfi => "tfi",
            Self::Isi => "isi",
        }
    }
}

impl Args {
    /// Readouts on either side that a picture needs.
    fn half(&self) -> usize {
        match (self.method, self.window) {
            (Method::Tfp | Method::Span, Some(window)) => (window / 2) as usize,
            (Method::Tfp | Method::Span, None) => 80,
            (_, Some(search)) => search as usize,
            (_, None) => 300,
        }
    }

    /// The picture at a readout, and whether the stream goes on far enough on both sides.
    fn picture(&self, reader: &Reader, at: usize) -> Result<(Vec<f32>, bool)> {
        let half = self.half();
        let (bytes, centre) = around(reader, at, half)?;
        let packed = Packed::new(reader.geometry(), &bytes)?;
        match self.method {
            Method::Tfp => Ok((tfp(packed, centre, half)?, true)),
            Method::Span => Ok((span(packed, centre, half)?, true)),
            Method::Tfi => {
                let tfi = tfi_at(packed, centre, half)?;
                let whole = tfi.is_measurable();
                Ok((tfi.rates, whole))
            }
            Method::Isi => {
                let lengths = isi_map(packed, centre)?.into_iter().map(|n| n as f32).collect();
                Ok((lengths, tfi_at(packed, centre, half)?.is_measurable()))
            }
        }
    }

    /// The readouts of the pictures: one, or one in each step, in its middle.
    fn moments(&self, readouts: usize, many: bool) -> Vec<usize> {
        if !many || self.at.is_some() {
            return vec![self.at.unwrap_or(readouts / 2)];
        }
        moments(readouts, self.every.map_or(2 * self.half() + 1, |n| n as usize))
    }
}

/// What the name of the output asks for.
enum Target {
    Png,
    Npy,
    Video,
    Folder,
}

fn target(path: &Path) -> Result<Target> {
    let ending = path.extension().map(|e| e.to_string_lossy().to_lowercase());
    match ending.as_deref() {
        Some("png") => Ok(Target::Png),
        Some("npy") => Ok(Target::Npy),
        Some("mp4" | "mkv" | "mov" | "avi" | "webm") => Ok(Target::Video),
        None => Ok(Target::Folder),
        Some(_) if path.is_dir() => Ok(Target::Folder),
        Some(other) => Err(Error::new(Kind::Usage, path.display())
            .found(format_args!("the ending .{other}"))
            .expected(".png, .npy, .mp4, .mkv, .mov, .avi, .webm, or a folder's name without an ending")),
    }
}

pub(crate) fn run(args: &Args, out: &Out) -> Result<()> {
    let target = target(&args.output)?;
    let reader = args.stream.open(&args.file, out)?;
    let geometry = reader.geometry();
    // A picture, its sorted copy, its levels and their code.
    inputs::check_memory(format_args!("picture of {geometry} pixels"), 28 * geometry.pixels())?;
    if args.white.is_some_and(|w| !(w.is_finite() && w > 0.0)) {
        return Err(Error::new(Kind::Usage, "--white").expected("a positive number"));
    }
    let many = match target {
        Target::Png if args.every.is_some() => {
            return Err(Error::new(Kind::Usage, "--every")
                .found("one picture to write")
                .expected("a folder, .npy or a video as output"));
        }
        Target::Png => false,
        Target::Npy => args.every.is_some(),
        Target::Video | Target::Folder => true,
    };
    let moments = args.moments(reader.readouts(), many);
    let _claim = match target {
        Target::Folder => {
            sinks::refuse_used(&args.output, args.force)?;
            outputs::claim_folder(&args.output)?
        }
        _ => outputs::claim([&args.output], args.force)?,
    };
    let first = args.picture(&reader, moments[0])?;
    let white = args.white.unwrap_or_else(|| bright(&first.0));
    let shown = Shown { white, geometry: reader.geometry() };
    let mut sink: Box<dyn Sink> = match target {
        Target::Png => Box::new(One { path: args.output.clone(), force: args.force, shown }),
        Target::Folder => Box::new(Folder { path: args.output.clone(), force: args.force, shown }),
        Target::Npy => Box::new(array::Npy::new(
            &args.output,
            args.force,
            reader.geometry(),
            many.then_some(moments.len()),
        )?),
        Target::Video => {
            let pictures = Pictures::Grey(reader.geometry());
            let video = Video::start(&args.output, pictures, f64::from(args.fps), args.force)?;
            Box::new(Film { video, shown })
        }
    };
    let mut progress = Progress::new(out, stop_flag()?);
    let mut cut = Vec::new();
    let mut done = 0;
    for batch in moments.chunks(BATCH * threads::count()) {
        let encode = |&at: &usize| {
            let (picture, whole) = if at == moments[0] { first.clone() } else { args.picture(&reader, at)? };
            Ok((at, whole, sink.encode(&picture)?))
        };
        // Kept one by one, so that what stands before a fault is written whoever was faster.
        let ready: Vec<Result<_>> = threads::map(batch, encode);
        for picture in ready {
            let (at, whole, encoded) = picture?;
            sink.put(at, &encoded).map_err(|e| progress.cause(e))?;
            cut.extend((!whole).then_some(at));
            done += 1;
            progress.step(done, Some(moments.len() as u64))?;
        }
    }
    sink.finish()?;
    drop(progress);
    out.say(format_args!("{}  {} of {}", args.output.display(), pictures(moments.len()), reader.geometry()));
    say_cut(&cut, out);
    out.event(&json!({
        "event": "done", "file": args.output.display().to_string(), "pictures": moments.len(),
        "method": args.method.name(), "white": white, "readouts": moments,
        "not_measurable": cut,
    }))
}

/// Warns of pictures that the ends of the stream leave open.
fn say_cut(cut: &[usize], out: &Out) {
    let (Some(first), Some(last)) = (cut.first(), cut.last()) else { return };
    let place =
        if first == last { format!("readout {first}") } else { format!("readouts {first} to {last}") };
    out.say(format_args!(
        "note: {} at {place} not to be trusted: the stream begins or ends within the intervals of too many pixels",
        pictures(cut.len())
    ));
}

fn pictures(n: usize) -> String {
    if n == 1 { "1 picture".into() } else { format!("{n} pictures") }
}
