//! `spikelane inspect`.

use std::path::PathBuf;

use indicatif::DecimalBytes;
use serde_json::json;
use spikelane::Result;
use spikelane::reconstruct::tfp;
use spikelane::spikes::Packed;
use spikelane_io::formats::{Reader, Reading, Readings};
use spikelane_io::simulate::Sidecar;
use spikelane_io::storage;
use spikelane_measure::report::with_known;
use spikelane_measure::{Accumulator, MeasureOptions, summarise};

use crate::shared::output::Out;
use crate::shared::outputs;
use crate::shared::picture::{around, bright, grey, png};
use crate::shared::range::Readouts;
use crate::shared::stream::{StreamArgs, file_name};
use spikelane::unstable::inputs;

/// Bytes of packed frames in hand at a time.
const BATCH: usize = 4 << 20;

/// Readouts on either side of the middle that the first look counts.
const HALF_WINDOW: usize = 80;

/// Say what a stream file holds
///
/// Geometry, layout, number of readouts, rates, and pixels that stand out.
#[derive(clap::Args, Debug)]
pub(crate) struct Args {
    /// Stream file (.dat, .npy, .npz)
    file: PathBuf,
    #[command(flatten)]
    stream: StreamArgs,
    /// Measure only these readouts, such as 0..1000
    #[arg(long, value_name = "A..B", default_value = "..")]
    readouts: Readouts,
    /// Also compute the digest of the file and compare it with the sidecar's
    #[arg(long)]
    digest: bool,
    /// Write a first look, the middle of the stream as grey levels
    #[arg(long, value_name = "PNG")]
    png: Option<PathBuf>,
    /// Overwrite the picture
    #[arg(long)]
    force: bool,
}

/// A reading and its scores, those that can be told.
fn as_json((r, given): (&Reading, bool)) -> serde_json::Value {
    let about = json!({
        "layout": r.layout.name(), "width": r.geometry.width(), "height": r.geometry.height(),
        "readouts": r.readouts, "given": given,
    });
    let told = |x: Option<f64>| x.filter(|x| x.is_finite()).map(|x| json!(x));
    with_known(about, [("rows_correlation", told(r.rows)), ("bytes_differ", told(r.bytes))])
}

pub(crate) fn run(args: &Args, out: &Out) -> Result<()> {
    let _claim = args.png.as_ref().map(|png| outputs::claim([png], args.force)).transpose()?;
    let (reader, readings) = args.stream.open_compared(&args.file, out)?;
    let sidecar = Sidecar::beside(&args.file).ok().flatten();
    let range = args.readouts.of(reader.readouts());
    let measured = measure(&reader, range.clone())?;
    let digest = args.digest.then(|| storage::Digest::of_file(&args.file)).transpose()?;
    let known = sidecar.as_ref().map(|(_, s)| &s.facts(&file_name(&args.file)).digest);
    let matches = digest.as_ref().and_then(|d| known.map(|k| k == d));
    if let Some(path) = &args.png {
        let at = range.start + range.len() / 2;
        let (bytes, centre) = around(&reader, at, HALF_WINDOW)?;
        let rates = tfp(Packed::new(reader.geometry(), &bytes)?, centre, HALF_WINDOW)?;
        let image = grey(&rates, bright(&rates), reader.geometry());
        storage::write_small(path, &png(&image)?, args.force)?;
    }
    let bytes = std::fs::metadata(&args.file).map_or(0, |m| m.len());
    let (leading, trailing) = reader.dropped_bytes();
    let about = json!({
        "file": args.file.display().to_string(), "bytes": bytes, "layout": reader.layout().name(),
        "width": reader.geometry().width(), "height": reader.geometry().height(),
        "readouts": reader.readouts(), "dropped_bytes": leading + trailing,
        "measured_readouts": [range.start, range.end],
        "mean_rate": measured.mean, "least_pixel_rate": measured.least, "greatest_pixel_rate": measured.greatest,
        "silent_pixels": measured.silent, "dead_pixels": measured.dead, "stuck_pixels": measured.stuck,
        "hot_pixels": measured.hot, "weak_pixels": measured.weak,
        "warnings": reader.warnings().iter().cloned().chain(readings.warning()).collect::<Vec<_>>(),
        "geometry_from": reader.origin().to_string(), "lost_readouts": reader.lost(),
        "readings": listed(&readings).map(as_json).collect::<Vec<_>>(),
    });
    let beside = [
        ("digest", digest.as_ref().map(|d| json!(d))),
        ("digest_matches", matches.map(Into::into)),
        ("sidecar", sidecar.as_ref().map(|(path, _)| path.display().to_string().into())),
    ];
    let event = with_known(about, beside);
    let seconds = sidecar
        .as_ref()
        .and_then(|(_, s)| s.readout_hz)
        .map_or(String::new(), |hz| format!(", {:.4} s at {hz} Hz", reader.readouts() as f64 / hz));
    let mut text = format!(
        "{}: {} readouts of {}{seconds}; layout {}, {}\n\
         mean rate  {:.5} spikes per readout; pixels from {:.5} to {:.5}\n\
         pixels     {} silent ({} of them dead: their neighbours make silence impossible), {} always firing, {} brighter and {} darker than their neighbours\n",
        args.file.display(),
        reader.readouts(),
        reader.geometry(),
        reader.layout(),
        DecimalBytes(bytes),
        measured.mean,
        measured.least,
        measured.greatest,
        measured.silent,
        measured.dead,
        measured.stuck,
        measured.hot,
        measured.weak,
    );
    text += &format!("size       {}, {}\n", reader.geometry(), reader.origin());
    for (i, (reading, given)) in listed(&readings).enumerate() {
        let head = if i == 0 { "readings" } else { "" };
        text += &format!("{head:<10} {}{}\n", line(reading), if given { "  (as read)" } else { "" });
    }
    if leading + trailing > 0 {
        text += &format!("left out   {leading} bytes before and {trailing} behind the whole frames\n");
    }
    if let Some(digest) = &digest {
        let verdict = match matches {
            Some(true) => "as the sidecar says",
            Some(false) => "NOT the sidecar's",
            None => "no sidecar to compare it with",
        };
        text += &format!("digest     {digest} ({verdict})\n");
    }
    out.result(&event, &text)
}

/// The reading that was taken, and others of the same bytes.
fn listed(readings: &Readings) -> impl Iterator<Item = (&Reading, bool)> {
    let others = readings.others.iter().map(|reading| (reading, false));
    std::iter::once((&readings.given, true)).chain(others)
}

fn line(reading: &Reading) -> String {
    let number = |c: Option<f64>| c.map_or("none".to_owned(), |c| format!("{c:.3}"));
    let bytes = reading.bytes.map_or(String::new(), |c| format!(", bytes differ {c:.2} times"));
    let rows = number(reading.rows);
    let (geometry, layout) = (reading.geometry.to_string(), reading.layout.name());
    format!("{geometry:<10} {layout:<12} {:>7} readouts, correlation of rows {rows}{bytes}", reading.readouts)
}

struct Measured {
    mean: f64,
    least: f64,
    greatest: f64,
    silent: usize,
    dead: usize,
    stuck: usize,
    hot: usize,
    weak: usize,
}

fn measure(reader: &Reader, range: std::ops::Range<usize>) -> Result<Measured> {
    let geometry = reader.geometry();
    // Counts, and the maps in which defects are searched.
    inputs::check_memory(format_args!("counts of {geometry} pixels"), 100 * geometry.pixels())?;
    let options = MeasureOptions { frames: false, ..MeasureOptions::without_intervals() };
    let mut sums = Accumulator::new(geometry, &options)?;
    let step = (BATCH / geometry.frame_bytes()).max(1);
    let mut packed = inputs::zeroed(reader.name(), step * geometry.frame_bytes())?;
    // Refuses a range beyond the end.
    reader.frames(range.clone())?;
    for first in range.clone().step_by(step) {
        let count = step.min(range.end - first);
        let packed = &mut packed[..count * geometry.frame_bytes()];
        reader.read_frames(first, packed)?;
        sums.push(Packed::new(geometry, packed)?)?;
    }
    let statistics = sums.finish();
    let defects = summarise(&statistics)?.defects;
    let counts = statistics.counts.map(|c| c.count).unwrap_or_default();
    let of = |n: u32| f64::from(n) / range.len() as f64;
    let total: u64 = counts.iter().map(|&n| u64::from(n)).sum();
    Ok(Measured {
        mean: total as f64 / range.len() as f64 / geometry.pixels() as f64,
        least: of(counts.iter().copied().min().unwrap_or(0)),
        greatest: of(counts.iter().copied().max().unwrap_or(0)),
        silent: counts.iter().filter(|n| **n == 0).count(),
        dead: defects.dead.len(),
        stuck: defects.stuck.len(),
        hot: defects.hot.len(),
        weak: defects.weak.len(),
    })
}
