//! The means over many moments of a stream.

use std::path::{Path, PathBuf};

use crate::shared::output::Out;
use crate::shared::picture::moments;
use crate::shared::progress::{Progress, stop_flag};
use serde_json::json;
use spikelane::reconstruct::Reference;
use spikelane::unstable::threads;
use spikelane::{Error, Kind, Result};
use spikelane_io::formats::Reader;

use super::args::Args;
use super::picture::{Beside, INTERVAL, Mean, Method, Picture, means, pictures, tables};
use super::still::{self, Still};
use super::truth::{Curve, Truth};

/// Moments that a thread judges before they are told.
const BATCH: usize = 4;

/// A readout to look at, and its clear image where it has one of its own.
struct Moment {
    at: usize,
    clear: Option<PathBuf>,
}

/// What moments are compared with.
enum Originals {
    None,
    /// One clear image for all.
    One(Truth),
    /// Each its own, of one curve and one rate of white; the first of them.
    Own(Curve, f32, Truth),
    Still,
}

impl Originals {
    /// A clear image that says how all are read.
    fn example(&self) -> Option<&Truth> {
        match self {
            Self::One(truth) | Self::Own(_, _, truth) => Some(truth),
            Self::None | Self::Still => None,
        }
    }
}

/// Pictures at every so many readouts, or at those of the clear images in `folder`.
pub(super) fn run(args: &Args, reader: &Reader, folder: Option<&Path>, out: &Out) -> Result<()> {
    let all = all(args, reader, folder)?;
    let count = all.len();
    let moments = inside(args, reader, all)?;
    let originals = originals(args, reader, &moments)?;
    let means = means(&judge(args, reader, &originals, &moments, out)?);
    if args.still && !means.iter().any(Mean::has_detail) {
        return Err(still::without_detail(&args.file));
    }
    let file = args.file.display();
    let (first, last) = (moments[0].at, moments[moments.len() - 1].at);
    let mut text = format!("{file}: means over {} readouts, {first} to {last}\n", moments.len());
    let left_out = count - moments.len();
    if left_out > 0 {
        text += &format!("left out: {left_out} of {count}, whose windows reach beyond the stream\n");
    }
    if let Some(truth) = originals.example() {
        text += &format!("{}\n", truth.line());
    }
    text += &tables(&means);
    let told: Vec<_> = means.iter().map(Mean::json).collect();
    let mut event = json!({
        "event": "means", "file": file.to_string(), "moments": moments.len(), "left_out": left_out,
        "pictures": told,
    });
    if let Some(truth) = originals.example() {
        event["clear"] = truth.json();
    }
    out.result(&event, &text)
}

/// The moments that are asked for.
fn all(args: &Args, reader: &Reader, folder: Option<&Path>) -> Result<Vec<Moment>> {
    let Some(folder) = folder else {
        let step = args.every.map_or(1, |n| n as usize);
        return Ok(moments(reader.readouts(), step)
            .into_iter()
            .map(|at| Moment { at, clear: None })
            .collect());
    };
    if args.every.is_some() || args.at.is_some() {
        return Err(Error::new(Kind::Usage, folder.display())
            .found("a folder of clear images and --at or --every")
            .expected("the folder alone: the images' names say which readouts are looked at"));
    }
    named(folder, reader)
}

/// The images of a folder whose names are readouts, in their order.
fn named(folder: &Path, reader: &Reader) -> Result<Vec<Moment>> {
    let wrong = |found: String| {
        Error::new(Kind::Input, folder.display()).found(found).expected(
            "images named by their readouts, such as 000100.png, as `simulate --images-every` keeps them",
        )
    };
    let mut all = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(|e| Error::io(folder.display(), e))? {
        let path = entry.map_err(|e| Error::io(folder.display(), e))?.path();
        let name = path.file_stem().and_then(|stem| stem.to_str()).unwrap_or_default();
        if let Ok(at) = name.parse::<usize>() {
            all.push(Moment { at, clear: Some(path) });
        }
    }
    all.sort_by_key(|moment| moment.at);
    if all.is_empty() {
        return Err(wrong("no such image".into()));
    }
    if let Some(pair) = all.windows(2).find(|pair| pair[0].at == pair[1].at) {
        return Err(wrong(format!("two images of readout {}", pair[0].at)));
    }
    let readouts = reader.readouts();
    if let Some(beyond) = all.iter().find(|moment| moment.at >= readouts) {
        return Err(wrong(format!("an image of readout {}, of a stream of {readouts}", beyond.at)));
    }
    Ok(all)
}

/// The moments whose windows lie in the stream; with `--still`, with enough on either side of them.
fn inside(args: &Args, reader: &Reader, mut all: Vec<Moment>) -> Result<Vec<Moment>> {
    let windowed = args.wanted.method.iter().any(|method| *method != Method::Tfi);
    let half =
        args.wanted.window.iter().max().filter(|_| windowed).map_or(0, |window| (*window / 2) as usize);
    let margin = match (args.still, args.wanted.method.contains(&Method::Tfi)) {
        (true, true) => half.max(INTERVAL) + Reference::LEAST,
        (true, false) => half + Reference::LEAST,
        (false, _) => half,
    };
    let count = all.len();
    all.retain(|moment| moment.at >= margin && moment.at + margin < reader.readouts());
    if all.is_empty() {
        return Err(Error::new(Kind::Input, args.file.display())
            .found(format_args!(
                "{count} moments of {} readouts, none of them {margin} and more from either end",
                reader.readouts()
            ))
            .expected("moments whose windows lie in the stream")
            .remedy("give a smaller --window, or another --every"));
    }
    Ok(all)
}

fn originals(args: &Args, reader: &Reader, moments: &[Moment]) -> Result<Originals> {
    if args.still {
        return Ok(Originals::Still);
    }
    if let Some(clear) = &moments[0].clear {
        let (curve, full) = args.curve(&args.file, clear)?;
        return Ok(Originals::Own(curve, full, Truth::read(clear, reader.geometry(), full, curve)?));
    }
    match &args.clear {
        Some(clear) => Ok(Originals::One(args.truth(&args.file, clear, reader)?)),
        None => Ok(Originals::None),
    }
}

/// The pictures of every moment, each told as an event.
fn judge(
    args: &Args,
    reader: &Reader,
    originals: &Originals,
    moments: &[Moment],
    out: &Out,
) -> Result<Vec<Vec<Picture>>> {
    let mut progress = Progress::of(out, stop_flag()?, "moments");
    let mut all = Vec::with_capacity(moments.len());
    for batch in moments.chunks(BATCH * threads::count()) {
        let ready: Vec<_> = threads::map(batch, |moment| one(args, reader, originals, moment));
        for (moment, pictures) in batch.iter().zip(ready) {
            let pictures = pictures?;
            out.event(&json!({
                "event": "moment", "readout": moment.at,
                "pictures": pictures.iter().map(Picture::json).collect::<Vec<_>>(),
            }))?;
            all.push(pictures);
            progress.step(all.len() as u64, Some(moments.len() as u64))?;
        }
    }
    Ok(all)
}

fn one(args: &Args, reader: &Reader, originals: &Originals, moment: &Moment) -> Result<Vec<Picture>> {
    let at = moment.at;
    match (originals, &moment.clear) {
        (Originals::Own(curve, full, _), Some(clear)) => {
            let truth = Truth::read(clear, reader.geometry(), *full, *curve)?;
            pictures(&args.wanted, reader, at, Beside::Clear(&truth))
        }
        (Originals::One(truth), _) => pictures(&args.wanted, reader, at, Beside::Clear(truth)),
        (Originals::Still, _) => {
            pictures(&args.wanted, reader, at, Beside::Others(&Still::read(reader, at)?))
        }
        (Originals::None | Originals::Own(..), _) => pictures(&args.wanted, reader, at, Beside::Nothing),
    }
}
