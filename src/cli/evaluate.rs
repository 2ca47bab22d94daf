//! `spikelane evaluate`: how good a picture the spikes give, with and without its clear original.

use std::path::{Path, PathBuf};

use serde_json::{Value, json};
use spikelane::dataset::{Manifest, Record, Status};
use spikelane::formats::Reader;
use spikelane::light::picture::{Linear, read};
use spikelane::light::srgb_code;
use spikelane::reconstruct::{difference_noise, patch_noise, psnr, ssim, tfi, tfp};
use spikelane::simulate::Sidecar;
use spikelane::spikes::Packed;
use spikelane::{Error, Geometry, Kind, Result};

use super::output::Out;
use super::picture::around;
use super::stream::StreamArgs;

/// Readouts on either side that TFI searches.
const SEARCH: usize = 300;

/// Say how good the pictures are that a stream gives
///
/// TFP and TFI pictures of a stream: two estimates of their noise that need no original (patches:
/// Chen et al. 2015, smallest eigenvalues; differences: Immerkaer 1996) and the signal-to-noise ratio,
/// 20 log10 of mean over patch noise. With --clear, or for a dataset, also PSNR and SSIM against the
/// clear image, both as sRGB codes of linear light. FILE is a stream, or the folder of a dataset.
#[derive(clap::Args, Debug)]
pub struct Args {
    /// Stream file, or folder of a dataset
    file: PathBuf,
    #[command(flatten)]
    stream: StreamArgs,
    /// The clear image of the moment
    #[arg(long, value_name = "IMAGE")]
    clear: Option<PathBuf>,
    /// Readout to look at [default: the middle]
    #[arg(long, value_name = "READOUT")]
    at: Option<usize>,
    /// Readouts in the window of TFP; may be repeated
    #[arg(long, value_name = "READOUTS", default_values_t = [33, 129],
          value_parser = clap::value_parser!(u32).range(1..))]
    window: Vec<u32>,
    /// Rate of light 1.0, which the clear image shows white [default: from the sidecar]
    #[arg(long, value_name = "RATE")]
    full: Option<f32>,
}

/// What is said of one picture.
#[derive(Clone, Copy, Debug, Default)]
struct Marks {
    psnr_db: Option<f64>,
    ssim: Option<f64>,
    patch: f64,
    difference: f64,
    mean: f64,
}

impl Marks {
    /// Noise-free pictures have none.
    fn snr_db(self) -> f64 {
        20.0 * (self.mean / self.patch).log10()
    }

    fn json(self) -> Value {
        json!({
            "psnr_db": self.psnr_db, "ssim": self.ssim, "patch_noise": self.patch,
            "difference_noise": self.difference, "mean": self.mean, "snr_db": self.snr_db(),
        })
    }

    fn row(self, name: &str) -> String {
        let truth = |v: Option<f64>, n: usize| v.map_or("-".into(), |v| format!("{v:.n$}"));
        let share = |v: f64| 100.0 * v / self.mean;
        format!(
            "{name:<12} {:>8} {:>7} {:>10.3} {:>12.3} {:>8.2}\n",
            truth(self.psnr_db, 2),
            truth(self.ssim, 4),
            share(self.patch),
            share(self.difference),
            self.snr_db()
        )
    }

    /// The mean of several, term by term; noise as a share of its picture's mean.
    fn average(all: &[Self]) -> Self {
        let mean = |f: &dyn Fn(&Self) -> f64| all.iter().map(f).sum::<f64>() / all.len().max(1) as f64;
        let known = |f: fn(&Self) -> Option<f64>| {
            all.iter().all(|m| f(m).is_some()).then(|| mean(&|m| f(m).unwrap_or(0.0)))
        };
        Self {
            psnr_db: known(|m| m.psnr_db),
            ssim: known(|m| m.ssim),
            patch: mean(&|m| m.patch / m.mean),
            difference: mean(&|m| m.difference / m.mean),
            mean: 1.0,
        }
    }
}

/// Pictures of one stream by name.
type Named = Vec<(String, Marks)>;

const HEADER: &str = "picture      PSNR, dB    SSIM patches, % differences, %  SNR, dB\n";

/// A clear image, and the rate of its white.
struct Truth {
    light: Vec<f32>,
    codes: Vec<f32>,
    full: f32,
}

impl Truth {
    fn read(path: &Path, geometry: Geometry, full: f32) -> Result<Self> {
        let frame = read(path, &Linear::new(None))?;
        if frame.geometry() != geometry {
            return Err(Error::new(Kind::Input, path.display())
                .found(frame.geometry())
                .expected(format_args!("{geometry}, the size of the stream")));
        }
        let light = frame.to_f32();
        Ok(Self { codes: light.iter().copied().map(srgb_code).collect(), light, full })
    }
}

pub fn run(args: &Args, out: &Out) -> Result<()> {
    if args.full.is_some_and(|f| !(f.is_finite() && f > 0.0)) {
        return Err(Error::new(Kind::Usage, "--full").expected("a positive rate"));
    }
    if args.file.is_dir() { dataset(args, out) } else { stream(args, out) }
}

fn stream(args: &Args, out: &Out) -> Result<()> {
    let reader = args.stream.open(&args.file)?;
    let at = args.at.unwrap_or(reader.readouts() / 2);
    let truth = match &args.clear {
        None => None,
        Some(clear) => Some(Truth::read(clear, reader.geometry(), full(args, &args.file)?)?),
    };
    let mut text = format!("{}, readout {at}\n{HEADER}", args.file.display());
    let mut all = Vec::new();
    for (name, marks) in marks(args, &reader, at, truth.as_ref())? {
        text += &marks.row(&name);
        all.push(json!({ "picture": name, "marks": marks.json() }));
    }
    out.result(&json!({ "file": args.file.display().to_string(), "readout": at, "pictures": all }), &text)
}

/// The rate of full-scale light: given, or the camera's in the sidecar.
fn full(args: &Args, file: &Path) -> Result<f32> {
    let sidecar = || Ok(Sidecar::beside(file)?.and_then(|(_, s)| s.camera));
    let rate = match args.full {
        Some(full) => Some(full),
        None => sidecar()?.map(|c| c.sensor.thresholds_at_full_scale.min(1.0) as f32),
    };
    rate.ok_or_else(|| {
        Error::new(Kind::Usage, file.display())
            .found("no sidecar that names the camera")
            .expected("the rate that the clear image's white has")
            .remedy("give --full RATE")
    })
}

/// The pictures of `reader` around `at`, by name.
fn marks(args: &Args, reader: &Reader, at: usize, truth: Option<&Truth>) -> Result<Named> {
    let geometry = reader.geometry();
    let mut all = Vec::new();
    for window in &args.window {
        let half = (*window / 2) as usize;
        let (bytes, centre) = around(reader, at, half)?;
        let rates = tfp(Packed::new(geometry, &bytes)?, centre, half)?;
        all.push((format!("tfp {}", 2 * half + 1), judge(&rates, geometry, truth)?));
    }
    let (bytes, centre) = around(reader, at, SEARCH)?;
    let rates = tfi(Packed::new(geometry, &bytes)?, centre, SEARCH)?;
    all.push(("tfi".to_owned(), judge(&rates, geometry, truth)?));
    if let Some(truth) = truth {
        // What the estimates take for noise in a picture that has none.
        all.push(("clear image".to_owned(), judge(&truth.light, geometry, None)?));
    }
    Ok(all)
}

fn judge(rates: &[f32], geometry: Geometry, truth: Option<&Truth>) -> Result<Marks> {
    let mut marks = Marks {
        patch: patch_noise(rates, geometry)?,
        difference: difference_noise(rates, geometry)?,
        mean: rates.iter().map(|r| f64::from(*r)).sum::<f64>() / rates.len() as f64,
        ..Marks::default()
    };
    if let Some(truth) = truth {
        let codes: Vec<f32> = rates.iter().map(|r| srgb_code(r / truth.full)).collect();
        marks.psnr_db = Some(psnr(&codes, &truth.codes, 1.0)?);
        marks.ssim = Some(ssim(&codes, &truth.codes, geometry, 1.0)?);
    }
    Ok(marks)
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
    let mut kinds = [("noisy", Vec::<Named>::new()), ("clean", Vec::new())];
    for entry in &done {
        let folder = args.file.join("sequences").join(&entry.id);
        for ((kind, all), file) in kinds.iter_mut().zip(["stream.dat", "stream.clean.dat"]) {
            let marks = sequence(args, &folder, file)?;
            let pictures: Vec<_> =
                marks.iter().map(|(name, m)| json!({ "picture": name, "marks": m.json() })).collect();
            out.event(&json!({
                "sequence": entry.id, "split": entry.split, "stream": *kind, "pictures": pictures,
            }))?;
            all.push(marks);
        }
    }
    let mut text = format!("{}: means over {} sequences\n", args.file.display(), done.len());
    for (kind, all) in &kinds {
        let Some(first) = all.first() else { continue };
        text += &format!("{kind}\n{HEADER}");
        for (i, (name, _)) in first.iter().enumerate() {
            let column: Vec<Marks> = all.iter().map(|marks| marks[i].1).collect();
            text += &Marks::average(&column).row(name);
        }
    }
    if out.json() { Ok(()) } else { out.result(&Value::Null, &text) }
}

fn sequence(args: &Args, folder: &Path, file: &str) -> Result<Named> {
    let stream = folder.join(file);
    let record = Record::read(folder)?;
    let at = record.about["clear_readout"].as_u64().unwrap_or(0) as usize;
    let reader = args.stream.open(&stream)?;
    let truth = Truth::read(&folder.join("clear.png"), reader.geometry(), full(args, &stream)?)?;
    marks(args, &reader, at, Some(&truth))
}
