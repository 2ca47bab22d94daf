//! `spikelane measure`: what a recording says of its camera.

use std::path::PathBuf;

use clap::Args as ClapArgs;
use serde_json::json;

use spikelane::error::Result;
use spikelane_io::simulate::Sidecar;
use spikelane_io::storage::write_small;
use spikelane_measure::report::{Curve, Part, Table, bars, heat_map, page};
use spikelane_measure::{Line, MEANING, Motion, Recording, Summary, Told, TotalsLine, high_pass};

use crate::shared::output::{Out, recorded};
use crate::shared::outputs;
use crate::shared::progress::Files;
use crate::shared::stream::StreamArgs;

/// Measure a stream of a uniform, dark or static scene, in the words of EMVA 1288
///
/// Each value has two errors: what another recording of this sensor would differ by, and what another
/// sensor of this kind would. Twice an error covers 95 in 100.
#[derive(Debug, ClapArgs)]
pub(crate) struct Args {
    /// The stream.
    file: PathBuf,
    #[command(flatten)]
    stream: StreamArgs,
    /// Write an HTML page with plots and maps.
    #[arg(long)]
    report: Option<PathBuf>,
    /// Replace an existing report.
    #[arg(long)]
    force: bool,
}

/// Runs the command.
///
/// # Errors
/// When the stream cannot be read, or the report not be written.
pub(crate) fn run(args: &Args, out: &Out) -> Result<()> {
    let _claim = args.report.as_ref().map(|report| outputs::claim([report], args.force)).transpose()?;
    let reader = args.stream.open(&args.file, out)?;
    let mut progress = Files::new(out);
    let (name, all) = (reader.name().to_string(), reader.readouts().max(1) as f64);
    let recording = Recording::of_stream(&reader, &mut |done| progress.step(&name, done as f64 / all))?;
    drop(progress);
    let statistics = &recording.statistics;
    let said = recording.said()?;
    let hz = Sidecar::beside(&args.file).ok().flatten().and_then(|(_, sidecar)| sidecar.readout_hz);
    let mut rows = rows(&said.summary, &said.told);
    rows.push(["scene".to_owned(), moving(said.motion), String::new(), String::new()]);
    rows.extend(said.lines.iter().map(|l| line_row(l, hz)));
    let line = |r: &[String; 4]| format!("{:<52} {:<12} {:<12} {}", r[0], r[1], r[2], r[3]);
    let text: String = rows.iter().map(|r| line(r).trim_end().to_owned() + "\n").collect();
    let mut result = said.to_json()?;
    result["event"] = json!("done");
    out.result(&result, &format!("{MEANING}\n\n{text}"))?;
    let Some(path) = &args.report else { return Ok(()) };
    let mut table = Table::new(&["quantity", "value", "another recording", "another sensor"]);
    for row in rows {
        table.row(row);
    }
    let mut parts = vec![Part::text(MEANING), Part::Table(table)];
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
    let title = format!("Measured: {}", recorded(&args.file));
    write_small(path, page(&title, &parts).as_bytes(), args.force)
}

/// What the line is, and its place.
fn line_row(found: &TotalsLine, readout_hz: Option<f64>) -> [String; 4] {
    let Line { frequency, prominence, .. } = found.line;
    let what = match found.harmonic {
        None => "line in the spectrum of frame totals".to_owned(),
        Some(1) => "the pixels' own firing rate, in frame totals".to_owned(),
        Some(k) => format!("the pixels' own firing rate, harmonic {k}, in frame totals"),
    };
    let hz = readout_hz.map_or(String::new(), |hz| format!(" ({:.1} Hz)", hz * frequency));
    let value = format!("{frequency:.5} cycles per readout{hz}, {prominence:.0} times what is around it");
    [what, value, String::new(), String::new()]
}

fn moving(motion: Motion) -> String {
    let changed = format!("{:.1} % of the pixels changed beyond noise", 100.0 * motion.share);
    match motion.moves {
        true => {
            format!("moves: {changed} between the halves; errors and spreads are not those of a still one")
        }
        false => format!("still, as far as noise tells ({changed})"),
    }
}

fn rows(s: &Summary, told: &[Told]) -> Vec<[String; 4]> {
    let alone = |name: &str, value: String| [name.to_owned(), value, String::new(), String::new()];
    let mut rows = vec![alone("readouts", s.readouts.to_string())];
    rows.extend(told.iter().map(row));
    if s.temporal_of_rate.is_finite() {
        rows.push(alone("temporal noise of a pixel's rate", format!("{:.2e}", s.temporal_of_rate)));
    }
    let d = &s.defects;
    let defects = [("dead", &d.dead), ("stuck", &d.stuck), ("hot", &d.hot), ("weak", &d.weak)];
    rows.extend(defects.map(|(kind, p)| alone(&format!("defect pixels: {kind}"), p.len().to_string())));
    rows
}

/// Value and errors of one statistic; no error where none can be told.
fn row(told: &Told) -> [String; 4] {
    let value = match (told.value, told.below) {
        (Some(value), _) => format!("{value:.6}"),
        (None, Some(below)) => format!("below {below:.1e}"),
        (None, None) => "not measurable here".to_owned(),
    };
    let error = |sign: &str, e: Option<f64>| e.map_or(String::new(), |e| format!("{sign} {e:.1e}"));
    let sign = if told.at_most { "<=" } else { "+-" };
    [told.words.clone(), value, error(sign, told.recording_error), error("+-", told.sensor_error)]
}
