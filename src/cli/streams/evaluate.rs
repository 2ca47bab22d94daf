//! `spikelane evaluate`: how good a picture the spikes give, with and without its clear original.

use std::path::{Path, PathBuf};

use crate::dataset::{Manifest, Record, Status};
use crate::formats::Reader;
use crate::light::Transfer;
use crate::reconstruct::{Tfi, span, tfi_at, tfp};
use crate::simulate::Sidecar;
use crate::spikes::Packed;
use crate::{Error, Kind, Result};
use serde_json::{Value, json};

use crate::cli::shared::output::Out;
use crate::cli::shared::picture::around;
use crate::cli::shared::stream::StreamArgs;

mod marks;
mod truth;

use crate::cli::streams::evaluate::marks::{HEADER, Marks};
use crate::cli::streams::evaluate::truth::{Curve, Truth};

/// Readouts on either side that TFI searches.
const SEARCH: usize = 300;

/// Say how good the pictures are that a stream gives
///
/// TFP, span and TFI pictures of a stream: two estimates of their noise that need no original (patches:
/// Chen et al. 2015, smallest eigenvalues; differences: Immerkaer 1996) and the signal-to-noise ratio,
/// 20 log10 of mean over patch noise. With --clear, or for a dataset, also PSNR and SSIM against the
/// clear image, both as codes of the image's transfer function, cut to 0 to 1, peak 1. FILE is a stream,
/// or the folder of a dataset.
#[derive(clap::Args, Debug)]
pub(crate) struct Args {
    /// Stream file, or folder of a dataset
    file: PathBuf,
    #[command(flatten)]
    stream: StreamArgs,
    /// The clear image of the moment
    #[arg(long, value_name = "IMAGE")]
    clear: Option<PathBuf>,
    /// How the clear image's codes stand for light: linear, srgb, or an exponent such as 2.2
    /// [default: what the sidecar or the dataset says of the image, else srgb, linear for EXR]
    #[arg(long, value_name = "FUNCTION")]
    clear_transfer: Option<Transfer>,
    /// Readout to look at [default: the middle]
    #[arg(long, value_name = "READOUT")]
    at: Option<usize>,
    /// Readouts in the window of TFP and span; may be repeated
    #[arg(long, value_name = "READOUTS", default_values_t = [33, 129],
          value_parser = clap::value_parser!(u32).range(1..))]
    window: Vec<u32>,
    /// Rate of light 1.0, which the clear image shows white [default: from the sidecar or the dataset]
    #[arg(long, value_name = "RATE")]
    full: Option<f32>,
}

/// A picture of a stream, or why there is none.
struct Picture {
    name: String,
    marks: Result<Marks, String>,
    /// What the reader should know of it.
    note: Option<String>,
}

impl Picture {
    fn json(&self) -> Value {
        let mut all = json!({ "picture": self.name, "measurable": self.marks.is_ok() });
        match &self.marks {
            Ok(marks) => all["marks"] = marks.json(),
            Err(reason) => all["reason"] = json!(reason),
        }
        if let Some(note) = &self.note {
            all["note"] = json!(note);
        }
        all
    }

    fn text(&self) -> String {
        match &self.marks {
            Ok(marks) => marks.row(&self.name),
            Err(reason) => format!("{:<12} not measurable here: {reason}\n", self.name),
        }
    }
}

pub(crate) fn run(args: &Args, out: &Out) -> Result<()> {
    if args.full.is_some_and(|f| !(f.is_finite() && f > 0.0)) {
        return Err(Error::new(Kind::Usage, "--full").expected("a positive rate"));
    }
    if args.file.is_dir() { dataset(args, out) } else { stream(args, out) }
}

fn stream(args: &Args, out: &Out) -> Result<()> {
    if args.clear_transfer.is_some() && args.clear.is_none() {
        return Err(Error::new(Kind::Usage, "--clear-transfer")
            .found("no clear image")
            .expected("--clear, whose codes it is about"));
    }
    let reader = args.stream.open(&args.file, out)?;
    let at = args.at.unwrap_or(reader.readouts() / 2);
    let truth = args.clear.as_ref().map(|clear| truth(args, &args.file, clear, &reader)).transpose()?;
    let pictures = pictures(args, &reader, at, truth.as_ref())?;
    let mut all = json!({
        "file": args.file.display().to_string(), "readout": at,
        "pictures": pictures.iter().map(Picture::json).collect::<Vec<_>>(),
    });
    let mut text = format!("{}, readout {at}\n", args.file.display());
    if let Some(truth) = &truth {
        all["clear"] = truth.json();
        text += &format!("{}\n", truth.line());
    }
    text += HEADER;
    text.extend(pictures.iter().map(Picture::text));
    text.extend(pictures.iter().filter_map(|p| Some(format!("note: {}: {}\n", p.name, p.note.as_ref()?))));
    out.result(&all, &text)
}

fn truth(args: &Args, stream: &Path, clear: &Path, reader: &Reader) -> Result<Truth> {
    let curve = Curve::found(stream, clear)?.or_given(args.clear_transfer);
    let full = match args.full.or(curve.full) {
        Some(full) => full,
        None => camera_full(stream)?,
    };
    Truth::read(clear, reader.geometry(), full, curve)
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

/// The pictures of `reader` around `at`.
fn pictures(args: &Args, reader: &Reader, at: usize, truth: Option<&Truth>) -> Result<Vec<Picture>> {
    type Make = fn(Packed, usize, usize) -> Result<Vec<f32>>;
    let geometry = reader.geometry();
    let mut all = Vec::new();
    for (kind, make) in [("tfp", tfp as Make), ("span", span as Make)] {
        for window in &args.window {
            let half = (*window / 2) as usize;
            let (bytes, centre) = around(reader, at, half)?;
            let packed = Packed::new(geometry, &bytes)?;
            let marks = Marks::of(&make(packed, centre, half)?, geometry, truth)?;
            let (wanted, there) = (2 * half + 1, packed.readouts());
            let note = (there < wanted).then(|| format!("the stream holds {there} of the {wanted} readouts"));
            all.push(Picture { name: format!("{kind} {wanted}"), marks: Ok(marks), note });
        }
    }
    let (bytes, centre) = around(reader, at, SEARCH)?;
    let tfi = tfi_at(Packed::new(geometry, &bytes)?, centre, SEARCH)?;
    let marks = match open(&tfi) {
        Some(reason) => Err(reason),
        None => Ok(Marks::of(&tfi.rates, geometry, truth)?),
    };
    all.push(Picture { name: "tfi".into(), marks, note: None });
    if let Some(truth) = truth {
        // What the estimates take for noise in a picture that has none.
        let marks = Marks::of(&truth.light, geometry, None)?;
        all.push(Picture { name: "clear image".into(), marks: Ok(marks), note: None });
    }
    Ok(all)
}

/// Why a TFI picture cannot be judged.
fn open(tfi: &Tfi) -> Option<String> {
    let (open, all) = (tfi.open_pixels, tfi.rates.len());
    (!tfi.is_measurable())
        .then(|| format!("the stream begins or ends within the interval of {open} of {all} pixels"))
}

/// Every finished sequence, and the mean over each kind of stream.
fn dataset(args: &Args, out: &Out) -> Result<()> {
    if args.clear.is_some() || args.at.is_some() {
        return Err(Error::new(Kind::Usage, args.file.display())
            .found("a dataset and --clear or --at")
            .expected("neither: every sequence knows its clear image and its readout"));
    }
    let manifest = Manifest::read(&args.file)?;
    let done: Vec<_> = manifest.entries.iter().filter(|e| e.status == Status::Done).collect();
    let mut kinds = [("noisy", Vec::<Vec<Picture>>::new()), ("clean", Vec::new())];
    for entry in &done {
        let folder = entry.unpacked(&args.file)?;
        for ((kind, all), file) in kinds.iter_mut().zip(["stream.dat", "stream.clean.dat"]) {
            let (pictures, truth) = sequence(args, &folder, file, out)?;
            out.event(&json!({
                "sequence": entry.id, "split": entry.split, "stream": *kind, "clear": truth.json(),
                "pictures": pictures.iter().map(Picture::json).collect::<Vec<_>>(),
            }))?;
            all.push(pictures);
        }
    }
    let mut text = format!("{}: means over {} sequences\n", args.file.display(), done.len());
    for (kind, all) in &kinds {
        let Some(first) = all.first() else { continue };
        text += &format!("{kind}\n{HEADER}");
        text.extend((0..first.len()).map(|i| mean(&all.iter().map(|p| &p[i]).collect::<Vec<_>>())));
    }
    if out.json() { Ok(()) } else { out.result(&Value::Null, &text) }
}

/// The row of one kind of picture: the mean over the sequences in which it can be judged, and how many those are.
fn mean(all: &[&Picture]) -> String {
    let marks: Vec<Marks> = all.iter().filter_map(|p| p.marks.as_ref().ok().copied()).collect();
    let name = &all[0].name;
    match marks.len() {
        0 => format!("{name:<12} not measurable in any of them: their streams end too near the readout\n"),
        n if n == all.len() => Marks::average(&marks).row(name),
        n => Marks::average(&marks).row(&format!("{name} ({n} of {})", all.len())),
    }
}

fn sequence(args: &Args, folder: &Path, file: &str, out: &Out) -> Result<(Vec<Picture>, Truth)> {
    let stream = folder.join(file);
    let record = Record::read(folder)?;
    let reader = args.stream.open(&stream, out)?;
    let at = record.about["clear_readout"].as_u64().map_or(reader.readouts() / 2, |at| at as usize);
    let truth = truth(args, &stream, &folder.join("clear.png"), &reader)?;
    Ok((pictures(args, &reader, at, Some(&truth))?, truth))
}
