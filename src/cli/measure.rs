//! `spikelane measure`: what a recording says of its camera.

use std::path::PathBuf;

use clap::Args as ClapArgs;

use spikelane::error::{Error, Kind, Result};
use spikelane::formats::{Layout, Reader};
use spikelane::measure::{
    Accumulator, Estimate, Line, Options, Statistics, Summary, high_pass, spectrum, summarise,
};
use spikelane::report::{Curve, Part, Table, bars, heat_map, page};
use spikelane::simulate::Sidecar;
use spikelane::spikes::{Geometry, Packed};

/// Measure a stream of a uniform, dark or static scene, in the words of EMVA 1288.
#[derive(Debug, ClapArgs)]
pub struct Args {
    /// The stream.
    file: PathBuf,
    /// Width of a headerless stream.
    #[arg(long)]
    width: Option<u32>,
    /// Height of a headerless stream.
    #[arg(long)]
    height: Option<u32>,
    /// Layout of the stream.
    #[arg(long)]
    layout: Option<String>,
    /// Write an HTML page with plots and maps.
    #[arg(long)]
    report: Option<PathBuf>,
    /// Replace an existing report.
    #[arg(long)]
    force: bool,
}

/// How far a line exceeds what is around it: far outside chance ([`spikelane::measure::Spectrum::lines`]).
const LINE: f64 = 30.0;

/// Runs the command.
///
/// # Errors
/// When the stream cannot be read, or the report not be written.
pub fn run(args: &Args, json: bool) -> Result<()> {
    let geometry = args.width.zip(args.height).map(|(w, h)| Geometry::new(w, h)).transpose()?;
    let layout = args.layout.as_deref().map(Layout::parse).transpose()?;
    let reader = Reader::open(&args.file, layout, geometry)?;
    let mut accumulator = Accumulator::new(reader.geometry(), &Options::default())?;
    let mut buffer = vec![0; 496 * reader.geometry().frame_bytes()];
    let mut at = 0;
    while at < reader.readouts() {
        let now = 496.min(reader.readouts() - at);
        let bytes = &mut buffer[..now * reader.geometry().frame_bytes()];
        reader.read_frames(at, bytes)?;
        accumulator.push(Packed::new(reader.geometry(), bytes)?)?;
        reader.release(at..at + now);
        at += now;
    }
    let statistics = accumulator.finish();
    let summary = summarise(&statistics)?;
    let lines = lines(&statistics)?;
    let hz = Sidecar::beside(&args.file).ok().flatten().and_then(|(_, sidecar)| sidecar.readout_hz);
    let mut rows = rows(&summary);
    rows.extend(lines.iter().map(|line| ("line in the spectrum of frame totals", told(line, hz))));
    if json {
        let bad = |e| Error::new(Kind::Config, "summary").found(e);
        let mut value = serde_json::to_value(&summary).map_err(bad)?;
        value["frame_total_lines"] = serde_json::to_value(&lines).map_err(bad)?;
        println!("{}", serde_json::to_string_pretty(&value).map_err(bad)?);
    } else {
        for (name, value) in &rows {
            println!("{name:<52} {value}");
        }
    }
    let Some(path) = &args.report else { return Ok(()) };
    let mut table = Table::new(&["quantity", "value"]);
    for (name, value) in &rows {
        table.row([(*name).to_owned(), value.clone()]);
    }
    let mut parts = vec![Part::Table(table)];
    let width = reader.geometry().width();
    if let Some(counts) = &statistics.counts {
        let rate = counts.rate();
        parts.push(Part::figure(heat_map(&rate, width, "rate map")?, "Rate, 1st to 99th percentile."));
        parts.push(Part::figure(
            heat_map(&high_pass(&rate, width), width, "local pattern")?,
            "Rate less its 5x5 surroundings.",
        ));
    }
    if let Some(intervals) = &statistics.intervals {
        let counts = intervals.lengths().counts();
        let all = counts.iter().sum::<u64>().max(1) as f64;
        let last = counts.iter().rposition(|n| *n as f64 > 1e-4 * all).unwrap_or(1);
        let points =
            counts.iter().take(last + 1).enumerate().map(|(n, c)| (n as f64, *c as f64 / all)).collect();
        let plot = bars("Inter-spike intervals", "readouts", &[Curve { name: "all pixels", points }])?;
        parts.push(Part::figure(plot, "Share of intervals by length."));
    }
    let title = format!("Measured: {}", args.file.display());
    spikelane::storage::write_small(path, page(&title, &parts)?.as_bytes(), args.force)
}

/// The three strongest lines of the frame totals' spectrum: what the light, or the supply, does at one
/// frequency.
fn lines(statistics: &Statistics) -> Result<Vec<Line>> {
    let Some(frames) = &statistics.frames else { return Ok(Vec::new()) };
    // Several segments make lines of chance rare; short recordings have too little for any.
    let segment = (frames.totals.len() / 4).min(8192) & !1;
    if segment < 64 {
        return Ok(Vec::new());
    }
    let mut lines = spectrum(&frames.totals, segment)?.lines(LINE);
    // A scene that moves drifts, which the window spreads over the lowest bins.
    lines.retain(|line| line.frequency * segment as f64 > 3.5);
    lines.truncate(3);
    Ok(lines)
}

fn told(line: &Line, readout_hz: Option<f64>) -> String {
    let hz = readout_hz.map_or(String::new(), |hz| format!(" ({:.1} Hz)", hz * line.frequency));
    format!("{:.5} cycles per readout{hz}, {:.0} times what is around it", line.frequency, line.prominence)
}

fn rows(s: &Summary) -> Vec<(&'static str, String)> {
    let number = |e: Estimate| format!("{:.6} +- {:.1e}", e.value, e.error);
    let mut rows = vec![
        ("readouts", s.readouts.to_string()),
        ("mean rate (spikes per readout)", number(s.mean_rate)),
        ("signal: rate without defect pixels", number(s.signal)),
        ("non-uniformity (DSNU of a dark, PRNU of a flat)", number(s.nonuniformity)),
        ("local non-uniformity (5x5 high-pass, robust)", number(s.local_nonuniformity)),
        ("row non-uniformity", number(s.row_nonuniformity)),
        ("column non-uniformity", number(s.column_nonuniformity)),
        ("temporal noise of a pixel's rate", format!("{:.2e}", s.temporal_of_rate)),
        ("defect pixels: dead", s.defects.dead.len().to_string()),
        ("defect pixels: stuck", s.defects.stuck.len().to_string()),
        ("defect pixels: hot", s.defects.hot.len().to_string()),
        ("defect pixels: weak", s.defects.weak.len().to_string()),
    ];
    if let Some(v) = s.interval_variance {
        rows.push(("interval variance D(1) (readouts squared)", number(v)));
    }
    if let Some(noise) = s.phase_noise {
        rows.push(("growth of spike time variance per spike", number(noise.per_spike)));
    }
    rows
}
