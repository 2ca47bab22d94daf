//! `spikelane evaluate`: how good a picture the spikes give, with and without its clear original.

use std::ops::Range;
use std::path::{Path, PathBuf};

use crate::dataset::{Manifest, Record, Status};
use crate::formats::Reader;
use crate::light::Transfer;
use crate::reconstruct::{Tfi, blurred, span, tfi_at, tfp};
use crate::simulate::Sidecar;
use crate::spikes::Packed;
use crate::{Error, Geometry, Kind, Result};
use serde_json::{Value, json};

use crate::cli::shared::output::Out;
use crate::cli::shared::picture::around;
use crate::cli::shared::stream::StreamArgs;

mod marks;
mod still;
mod truth;

use crate::cli::streams::evaluate::marks::{DETAIL, HEADER, Marks};
use crate::cli::streams::evaluate::still::Still;
use crate::cli::streams::evaluate::truth::{Curve, Truth};

/// Readouts on either side that TFI searches.
const SEARCH: usize = 300;

/// Readouts on either side that are taken for those of a TFI picture: intervals are rarely longer.
const INTERVAL: usize = 20;

/// Deviation of the Gaussian, in pixels, of the picture that only looks better.
const BLUR: f64 = 1.0;

/// Say how good the pictures are that a stream gives
///
/// TFP, span and TFI pictures of a stream: two estimates of their noise that need no original (patches:
/// Chen et al. 2015, smallest eigenvalues; differences: Immerkaer 1996) and the signal-to-noise ratio,
/// 20 log10 of mean over patch noise. With --clear, or for a dataset, also PSNR and SSIM against the
/// clear image, both as codes of the image's transfer function, cut to 0 to 1, peak 1; and a second table,
/// in linear light after the line of least squares: PSNR, the share of the detail that is there (1 is sharp),
/// noise besides, pixels that stand out, with a blurred TFP as what is no improvement. --still gives that table
/// without a clear image. FILE is a stream, or the folder of a dataset.
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
    /// The scene stands still: the readouts before and behind those of a picture say what it should be, where nothing changes
    #[arg(long, conflicts_with = "clear")]
    still: bool,
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
            Err(reason) => format!("{:<14} not measurable here: {reason}\n", self.name),
        }
    }

    /// The row of the second table, where there is something to compare with.
    fn detail(&self) -> Option<String> {
        self.marks.as_ref().ok()?.detail_row(&self.name)
    }
}

/// What pictures are compared with.
#[derive(Clone, Copy)]
enum Beside<'a> {
    Nothing,
    Clear(&'a Truth),
    Others(&'a Still),
}

impl Beside<'_> {
    /// The truth of a picture made of the readouts `own`.
    fn marks(self, rates: &[f32], geometry: Geometry, own: Range<usize>) -> Result<Marks> {
        match self {
            Self::Nothing => Marks::of(rates, geometry, None, None),
            Self::Clear(truth) => Marks::of(rates, geometry, Some(truth), Some(&truth.reference())),
            // A window that leaves too few readouts has its first table alone.
            Self::Others(still) => Marks::of(rates, geometry, None, still.reference(own).ok().as_ref()),
        }
    }

    fn is_something(self) -> bool {
        !matches!(self, Self::Nothing)
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
    let still = args.still.then(|| Still::read(&reader, at)).transpose()?;
    let beside = match (&truth, &still) {
        (Some(truth), _) => Beside::Clear(truth),
        (None, Some(still)) => Beside::Others(still),
        (None, None) => Beside::Nothing,
    };
    let pictures = pictures(args, &reader, at, beside)?;
    let mut all = json!({
        "file": args.file.display().to_string(), "readout": at,
        "pictures": pictures.iter().map(Picture::json).collect::<Vec<_>>(),
    });
    let mut text = format!("{}, readout {at}\n", args.file.display());
    if let Some(truth) = &truth {
        all["clear"] = truth.json();
        text += &format!("{}\n", truth.line());
    }
    if let Some(still) = &still {
        all["still"] = json!({ "share_of_pixels": still.share() });
        text += &format!(
            "still scene: {:.1} % of the pixels, around which nothing changes, are compared\n",
            100.0 * still.share()
        );
    }
    text += HEADER;
    text.extend(pictures.iter().map(Picture::text));
    let second = details(pictures.iter().map(Picture::detail));
    if let (Some(still), true) = (&still, second.is_empty()) {
        still.reference(at..at + 1)?;
        return Err(Error::new(Kind::Input, args.file.display())
            .found("windows that leave too few readouts, or a scene without detail")
            .expected("a scene with structure, and 20 readouts before and behind each window")
            .remedy("give a smaller --window"));
    }
    text += &second;
    text.extend(pictures.iter().filter_map(|p| Some(format!("note: {}: {}\n", p.name, p.note.as_ref()?))));
    out.result(&all, &text)
}

/// The second table, if it has a row.
fn details(rows: impl Iterator<Item = Option<String>>) -> String {
    let rows: String = rows.flatten().collect();
    if rows.is_empty() { rows } else { format!("{DETAIL}{rows}") }
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
fn pictures(args: &Args, reader: &Reader, at: usize, beside: Beside<'_>) -> Result<Vec<Picture>> {
    type Make = fn(Packed, usize, usize) -> Result<Vec<f32>>;
    let geometry = reader.geometry();
    let near = |half: usize| at.saturating_sub(half)..(at + half + 1).min(reader.readouts());
    let mut all = Vec::new();
    for (kind, make) in [("tfp", tfp as Make), ("span", span as Make)] {
        for window in &args.window {
            let half = (*window / 2) as usize;
            let (bytes, centre) = around(reader, at, half)?;
            let packed = Packed::new(geometry, &bytes)?;
            let (wanted, there) = (2 * half + 1, packed.readouts());
            let rates = make(packed, centre, half)?;
            let note = (there < wanted).then(|| format!("the stream holds {there} of the {wanted} readouts"));
            let marks = Ok(beside.marks(&rates, geometry, near(half))?);
            all.push(Picture { name: format!("{kind} {wanted}"), marks, note });
            if kind == "tfp" && beside.is_something() {
                let rates = blurred(&rates, geometry, BLUR);
                let marks = Ok(beside.marks(&rates, geometry, near(half))?);
                all.push(Picture { name: format!("{kind} {wanted} blurred"), marks, note: None });
            }
        }
    }
    let (bytes, centre) = around(reader, at, SEARCH)?;
    let tfi = tfi_at(Packed::new(geometry, &bytes)?, centre, SEARCH)?;
    let marks = match open(&tfi) {
        Some(reason) => Err(reason),
        None => Ok(beside.marks(&tfi.rates, geometry, near(INTERVAL))?),
    };
    all.push(Picture { name: "tfi".into(), marks, note: None });
    if let Beside::Clear(truth) = beside {
        // What the estimates take for noise in a picture that has none.
        let marks = Marks::of(&truth.light, geometry, None, None)?;
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
    if args.clear.is_some() || args.at.is_some() || args.still {
        return Err(Error::new(Kind::Usage, args.file.display())
            .found("a dataset and --clear, --still or --at")
            .expected("none of them: every sequence knows its clear image and its readout"));
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
        let means: Vec<_> =
            (0..first.len()).map(|i| mean(&all.iter().map(|p| &p[i]).collect::<Vec<_>>())).collect();
        text.extend(means.iter().map(|(row, _)| row.as_str()));
        text += &details(means.into_iter().map(|(_, detail)| detail));
    }
    if out.json() { Ok(()) } else { out.result(&Value::Null, &text) }
}

/// The rows of one kind of picture: the mean over the sequences in which it can be judged, and how many those are.
fn mean(all: &[&Picture]) -> (String, Option<String>) {
    let marks: Vec<Marks> = all.iter().filter_map(|p| p.marks.as_ref().ok().copied()).collect();
    let name = match marks.len() {
        n if n == all.len() => all[0].name.clone(),
        n => format!("{} ({n} of {})", all[0].name, all.len()),
    };
    if marks.is_empty() {
        let reason = "not measurable in any of them: their streams end too near the readout";
        return (format!("{:<14} {reason}\n", all[0].name), None);
    }
    let average = Marks::average(&marks);
    (average.row(&name), average.detail_row(&name))
}

fn sequence(args: &Args, folder: &Path, file: &str, out: &Out) -> Result<(Vec<Picture>, Truth)> {
    let stream = folder.join(file);
    let record = Record::read(folder)?;
    let reader = args.stream.open(&stream, out)?;
    let at = record.about["clear_readout"].as_u64().map_or(reader.readouts() / 2, |at| at as usize);
    let truth = truth(args, &stream, &folder.join("clear.png"), &reader)?;
    Ok((pictures(args, &reader, at, Beside::Clear(&truth))?, truth))
}
