//! Implements `spikelane inspect`.

use std::path::{Path, PathBuf};

use indicatif::DecimalBytes;
use serde::Serialize;
use serde_json::{Value, json};
use spikelane::reconstruct::tfp;
use spikelane::sensor::{Channel, Mosaic};
use spikelane::spikes::SpikeFramesRef;
use spikelane::unstable::Count;
use spikelane::{Error, ErrorKind, Geometry, Result};
use spikelane_io::formats::{LayoutGuess, LayoutGuesses, StreamReader};
use spikelane_io::storage;
use spikelane_measure::report::insert_present;
use spikelane_measure::{Accumulator, MeasureOptions, detect_mosaic, summarize, summarize_mosaic};

use crate::common::{
    Console, OpenedStream, ReadoutRange, StreamArgs, StreamMosaicArgs, claim_files, encode_png, file_name,
    gray_image, is_dash, sidecar_beside, white_rate,
};
use spikelane::unstable::inputs;

/// Number of bytes of packed frames that one read returns.
const BATCH_BYTES: usize = 4 << 20;

/// Number of readouts before and after the middle of the stream that the preview includes.
const HALF_WINDOW_READOUTS: usize = 80;

/// Print size, layout, length, rates and defective pixels of a stream file
#[derive(clap::Args, Debug)]
pub(crate) struct Args {
    /// Inspect this stream file (.dat, .npy, .npz), or - for standard input
    file: PathBuf,
    #[command(flatten)]
    stream: StreamArgs,
    #[command(flatten)]
    mosaic: StreamMosaicArgs,
    /// Read these readouts, such as 0..1000 [default: all]
    ///
    /// The first readout has the number 0. Readout B is not included.
    #[arg(long, value_name = "A..B", default_value = "..", hide_default_value = true)]
    readouts: ReadoutRange,
    /// Compare the digest of the file with the sidecar
    #[arg(long)]
    digest: bool,
    /// Write a preview of the middle as a PNG file
    #[arg(long, value_name = "FILE")]
    png: Option<PathBuf>,
    /// Overwrite existing files
    #[arg(long)]
    force: bool,
}

/// Returns a layout guess as JSON. Unknown scores are omitted.
fn guess_json((r, is_selected): (&LayoutGuess, bool)) -> Value {
    let fields = json!({
        "layout": r.layout.name(), "width": r.geometry.width(), "height": r.geometry.height(),
        "readouts": r.readouts, "is_selected": is_selected,
    });
    let finite = |x: Option<f64>| x.filter(|x| x.is_finite()).map(|x| json!(x));
    insert_present(
        fields,
        [("rows_correlation", finite(r.row_correlation)), ("bytes_differ", finite(r.byte_edge_ratio))],
    )
}

/// Returns an error if the preview does not have the ending of its format.
fn check_png_ending(path: &Path) -> Result<()> {
    if path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("png")) {
        return Ok(());
    }
    Err(Error::new(ErrorKind::Usage, path.display())
        .found("another ending than .png")
        .expected("a PNG file for --png")
        .remedy(format_args!(
            "write {}, or use reconstruct for other formats",
            path.with_extension("png").display()
        )))
}

pub(crate) fn run(args: &Args, out: &Console) -> Result<()> {
    args.png.as_deref().map(check_png_ending).transpose()?;
    let _claim = args.png.as_ref().map(|png| claim_files([png], args.force)).transpose()?;
    if args.digest && is_dash(&args.file) {
        return Err(Error::new(ErrorKind::Usage, "--digest")
            .found("a stream from standard input")
            .expected("a file, whose sidecar has the digest"));
    }
    let OpenedStream { reader, guesses: readings, bytes } = args.stream.open_with_guesses(&args.file, out)?;
    let sidecar = sidecar_beside(&args.file)?;
    let range = args.readouts.resolve(reader.readouts());
    let measured = count_stream(
        &reader,
        range.clone(),
        args.mosaic.of_stream(&args.file)?,
        args.mosaic.mosaic.is_some(),
    )?;
    let digest = args.digest.then(|| storage::Digest::hash_file(&args.file)).transpose()?;
    let known = sidecar.as_ref().map(|(_, s)| &s.stream_facts(&file_name(&args.file)).digest);
    let matches = digest.as_ref().and_then(|d| known.map(|k| k == d));
    if let Some(path) = &args.png {
        let at = range.start + range.len() / 2;
        let (frames, center) = reader.read_around(at, HALF_WINDOW_READOUTS)?;
        let rates = tfp(frames.view(), center, HALF_WINDOW_READOUTS)?;
        let image = gray_image(&rates, white_rate(&rates), reader.geometry());
        storage::write_small(path, &encode_png(&image)?, args.force)?;
    }
    let (leading, trailing) = reader.partial_frame_bytes();
    let mut event = json!({
        "file": args.file.display().to_string(), "bytes": bytes, "layout": reader.layout().name(),
        "width": reader.geometry().width(), "height": reader.geometry().height(),
        "readouts": reader.readouts(), "dropped_bytes": leading + trailing,
        "measured_readouts": [range.start, range.end],
        "warnings": reader.warnings().iter().cloned().chain(readings.warning()).collect::<Vec<_>>(),
        "geometry_source": reader.origin().to_string(), "missing_frames": reader.missing_frames(),
        "layout_guesses": listed_guesses(&readings).map(guess_json).collect::<Vec<_>>(),
    });
    if let (Value::Object(event), Value::Object(measured)) = (&mut event, json!(measured)) {
        event.extend(measured);
    }
    let optional_fields = [
        ("digest", digest.as_ref().map(|d| json!(d))),
        ("digest_matches", matches.map(Into::into)),
        ("sidecar", sidecar.as_ref().map(|(path, _)| path.display().to_string().into())),
    ];
    let event = insert_present(event, optional_fields);
    let seconds = sidecar
        .as_ref()
        .and_then(|(_, s)| s.readout_hz)
        .map_or(String::new(), |hz| format!(", {:.4} s at {hz} Hz", reader.readouts() as f64 / hz));
    let mut text = format!(
        "{}: {} of {}{seconds}; layout {}, {}\nmean rate  {:.5} spikes per readout; pixels from {:.5} to {:.5}\npixels     {} silent (of which {} are dead: their neighbors fire), {} always firing, {} brighter and {} darker than their neighbors\n",
        args.file.display(),
        Count(reader.readouts(), "readout"),
        reader.geometry(),
        reader.layout(),
        DecimalBytes(bytes),
        measured.mean_rate,
        measured.min_rate,
        measured.max_rate,
        measured.silent_pixels,
        measured.dead_pixels,
        measured.stuck_pixels,
        measured.hot_pixels,
        measured.weak_pixels,
    );
    if let Some([first, second]) = &measured.detected {
        text += &format!(
            "mosaic     rows and columns alternate as in a color camera with the pattern {first} or {second}; pixels are compared with pixels of the same filter; to name the pattern, set --mosaic\n",
        );
    }
    if let Some(mosaic) = &measured.mosaic {
        text += &format!("mosaic     {mosaic}; pixels are compared with pixels of the same filter\n");
        for channel in &measured.channels {
            text += &channel.text();
        }
    }
    text += &format!("size       {}, {}\n", reader.geometry(), reader.origin());
    for (i, (reading, given)) in listed_guesses(&readings).enumerate() {
        let head = if i == 0 { "layouts" } else { "" };
        text += &format!("{head:<10} {}{}\n", guess_line(reading), if given { "  (as read)" } else { "" });
    }
    if leading + trailing > 0 {
        text +=
            &format!("ignored    {} before and {trailing} after the whole frames\n", Count(leading, "byte"));
    }
    if let Some(digest) = &digest {
        let verdict = match matches {
            Some(true) => "equal to the digest in the sidecar",
            Some(false) => "NOT equal to the digest in the sidecar",
            None => "no sidecar for comparison",
        };
        text += &format!("digest     {digest} ({verdict})\n");
    }
    out.print_result(&event, &text)
}

/// Returns the selected layout guess, followed by its alternatives.
fn listed_guesses(readings: &LayoutGuesses) -> impl Iterator<Item = (&LayoutGuess, bool)> {
    let others = readings.alternatives.iter().map(|reading| (reading, false));
    std::iter::once((&readings.current, true)).chain(others)
}

fn guess_line(reading: &LayoutGuess) -> String {
    let number = |c: Option<f64>| c.map_or("none".to_owned(), |c| format!("{c:.3}"));
    let bytes = reading.byte_edge_ratio.map_or(String::new(), |c| {
        format!(", difference across byte borders {c:.2} times that inside bytes")
    });
    let rows = number(reading.row_correlation);
    let (geometry, layout) = (reading.geometry.to_string(), reading.layout.name());
    format!("{geometry:<10} {layout:<12} {:>7} readouts, correlation of rows {rows}{bytes}", reading.readouts)
}

/// The rates of one channel of a color camera.
#[derive(Serialize)]
struct ChannelRates {
    name: char,
    pixels: usize,
    mean_rate: f64,
    #[serde(rename = "min_pixel_rate")]
    min_rate: f64,
    #[serde(rename = "max_pixel_rate")]
    max_rate: f64,
}

impl ChannelRates {
    /// Returns the rates of each channel of `mosaic`. Channels without pixels are omitted.
    fn all(counts: &[u32], geometry: Geometry, mosaic: &Mosaic, readouts: usize) -> Vec<Self> {
        let map = mosaic.channel_map(geometry);
        let channel = |(i, channel): (usize, &Channel)| {
            let own: Vec<u32> = counts.iter().zip(&map).filter(|(_, c)| **c == i).map(|(n, _)| *n).collect();
            let rate = |n: f64| n / readouts as f64;
            let total: u64 = own.iter().map(|n| u64::from(*n)).sum();
            Some(Self {
                name: channel.name,
                pixels: own.len(),
                mean_rate: rate(total as f64 / own.len() as f64),
                min_rate: rate(f64::from(*own.iter().min()?)),
                max_rate: rate(f64::from(*own.iter().max()?)),
            })
        };
        mosaic.channels().iter().enumerate().filter_map(channel).collect()
    }

    fn text(&self) -> String {
        format!(
            "channel {}  mean rate {:.5} spikes per readout; {} from {:.5} to {:.5}\n",
            self.name,
            self.mean_rate,
            Count(self.pixels, "pixel"),
            self.min_rate,
            self.max_rate,
        )
    }
}

/// The results of `inspect`, with the keys of the JSON output.
#[derive(Serialize)]
struct StreamCounts {
    /// The mosaic that determines which pixels are compared.
    #[serde(skip_serializing_if = "Option::is_none")]
    mosaic: Option<String>,
    /// The two possible patterns, if the mosaic was detected.
    #[serde(rename = "detected_mosaics", skip_serializing_if = "Option::is_none")]
    detected: Option<[String; 2]>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    channels: Vec<ChannelRates>,
    mean_rate: f64,
    #[serde(rename = "min_pixel_rate")]
    min_rate: f64,
    #[serde(rename = "max_pixel_rate")]
    max_rate: f64,
    silent_pixels: usize,
    dead_pixels: usize,
    stuck_pixels: usize,
    hot_pixels: usize,
    weak_pixels: usize,
}

/// Counts the spikes and the defects of a range of readouts.
///
/// If `declared` is `None`, a pattern of 2x2 filters is detected, unless the user set `--mosaic` (`is_set`).
fn count_stream(
    reader: &StreamReader,
    range: std::ops::Range<usize>,
    declared: Option<Mosaic>,
    is_set: bool,
) -> Result<StreamCounts> {
    let geometry = reader.geometry();
    // Memory for the counts, and for the maps in which defects are searched.
    inputs::check_memory(format_args!("counts of {geometry} pixels"), 100 * geometry.pixels())?;
    let options = MeasureOptions { frames: false, ..MeasureOptions::without_intervals() };
    let mut sums = Accumulator::new(geometry, &options)?;
    let step = (BATCH_BYTES / geometry.frame_bytes()).max(1);
    let mut packed = inputs::zeroed_vec(reader.name(), step * geometry.frame_bytes())?;
    // This call returns an error if the range extends past the end of the stream.
    reader.frames(range.clone())?;
    for first in range.clone().step_by(step) {
        let count = step.min(range.end - first);
        let packed = &mut packed[..count * geometry.frame_bytes()];
        reader.read_frames(first, packed)?;
        sums.push(SpikeFramesRef::new(geometry, packed)?)?;
    }
    let statistics = sums.finish();
    let known = statistics.counts.as_ref().map(|c| &*c.count).unwrap_or_default();
    let found = if declared.is_none() && !is_set { detect_mosaic(known, geometry.width()) } else { None };
    let detected = found.as_ref().map(|[a, b]| [a, b].map(ToString::to_string));
    let mosaic = declared.or_else(|| found.map(|[first, _]| first));
    let channels = match (&mosaic, &detected) {
        (Some(mosaic), None) => ChannelRates::all(known, geometry, mosaic, range.len()),
        _ => Vec::new(),
    };
    let defects = match &mosaic {
        Some(mosaic) => summarize_mosaic(&statistics, mosaic)?.defects,
        None => summarize(&statistics)?.defects,
    };
    let counts = statistics.counts.map(|c| c.count).unwrap_or_default();
    let rate = |n: u32| f64::from(n) / range.len() as f64;
    let total: u64 = counts.iter().map(|&n| u64::from(n)).sum();
    Ok(StreamCounts {
        mosaic: mosaic.filter(|_| detected.is_none()).map(|mosaic| mosaic.to_string()),
        detected,
        channels,
        mean_rate: total as f64 / range.len() as f64 / geometry.pixels() as f64,
        min_rate: rate(counts.iter().copied().min().unwrap_or(0)),
        max_rate: rate(counts.iter().copied().max().unwrap_or(0)),
        silent_pixels: counts.iter().filter(|n| **n == 0).count(),
        dead_pixels: defects.dead.len(),
        stuck_pixels: defects.stuck.len(),
        hot_pixels: defects.hot.len(),
        weak_pixels: defects.weak.len(),
    })
}
