//! `spikelane measure`: what a recording says of its camera.

use std::path::PathBuf;

use clap::Args as ClapArgs;
use serde_json::json;

use crate::error::{Error, Kind, Result};
use crate::measure::{
    Line, MEANING, Motion, Recording, Statistics, Summary, Told, high_pass, spectrum, summarise,
};
use crate::report::{Curve, Part, Table, bars, heat_map, page};
use crate::simulate::Sidecar;

use super::output::Out;
use super::progress::Files;
use super::stream::StreamArgs;

/// Measure a stream of a uniform, dark or static scene, in the words of EMVA 1288
///
/// Each value has two errors: what another recording of this sensor would differ by, and what another
/// sensor of this kind would. Twice an error covers 95 in 100.
#[derive(Debug, ClapArgs)]
pub struct Args {
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
pub fn run(args: &Args, out: &Out) -> Result<()> {
    let reader = args.stream.open(&args.file, out)?;
    let mut progress = Files::new(out);
    let (name, all) = (reader.name().to_string(), reader.readouts().max(1) as f64);
    let recording = Recording::of_stream(&reader, &mut |done| progress.step(&name, done as f64 / all))?;
    drop(progress);
    let statistics = &recording.statistics;
    let summary = summarise(statistics)?;
    let (told, motion) = (recording.told()?, recording.motion());
    let lines = lines(statistics)?;
    let hz = Sidecar::beside(&args.file).ok().flatten().and_then(|(_, sidecar)| sidecar.readout_hz);
    let mut rows = rows(&summary, &told);
    rows.push(["scene".to_owned(), moving(motion), String::new(), String::new()]);
    rows.extend(lines.iter().map(|l| l.row(hz)));
    let line = |r: &[String; 4]| format!("{:<52} {:<12} {:<12} {}", r[0], r[1], r[2], r[3]);
    let text: String = rows.iter().map(|r| line(r).trim_end().to_owned() + "\n").collect();
    out.result(&result(&summary, &told, motion, &lines)?, &format!("{MEANING}\n\n{text}"))?;
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
    let title = format!("Measured: {}", args.file.display());
    crate::storage::write_small(path, page(&title, &parts)?.as_bytes(), args.force)
}

/// The result as JSON.
fn result(summary: &Summary, told: &[Told], motion: Motion, lines: &[Found]) -> Result<serde_json::Value> {
    let wrong = |e: serde_json::Error| Error::new(Kind::Config, "summary").found(e);
    let lines: Vec<_> = lines
        .iter()
        .map(|found| {
            let mut line = json!({
                "frequency": found.line.frequency, "power": found.line.power, "prominence": found.line.prominence,
            });
            if let Some(k) = found.harmonic {
                line["harmonic_of_pixel_rate"] = json!(k);
            }
            line
        })
        .collect();
    let mut result = json!({
        "event": "done", "meaning": MEANING, "readouts": summary.readouts,
        "statistics": serde_json::to_value(told).map_err(wrong)?,
        "defects": serde_json::to_value(&summary.defects).map_err(wrong)?,
        "scene": serde_json::to_value(motion).map_err(wrong)?,
        "frame_total_lines": lines,
    });
    if summary.temporal_of_rate.is_finite() {
        result["temporal_of_rate"] = json!(summary.temporal_of_rate);
    }
    Ok(result)
}

/// How far a line exceeds what is around it: far outside chance ([`crate::measure::Spectrum::lines`]).
const LINE: f64 = 30.0;

/// A line of the frame totals, and the harmonic of the pixels' rate that it is.
struct Found {
    line: Line,
    harmonic: Option<u32>,
}

/// The three strongest lines of the frame totals' spectrum: what the light, the supply, or pixels that fire in phase do at one
/// frequency.
fn lines(statistics: &Statistics) -> Result<Vec<Found>> {
    let (Some(frames), Some(counts)) = (&statistics.frames, &statistics.counts) else {
        return Ok(Vec::new());
    };
    // Several segments make lines of chance rare; short recordings have too little for any.
    let segment = (frames.totals.len() / 4).min(8192) & !1;
    if segment < 64 {
        return Ok(Vec::new());
    }
    let mut lines = spectrum(&frames.totals, segment)?.lines(LINE);
    // A scene that moves drifts, which the window spreads over the lowest bins. Totals that never differ have no spectrum.
    let told = |x: f64| x.is_finite() && x > 0.0;
    lines.retain(|l| l.frequency * segment as f64 > 3.5 && told(l.prominence) && told(l.power));
    lines.truncate(3);
    let rates = counts.rate_by_time();
    let harmonic = |line: Line| Found { line, harmonic: line.harmonic_of(&rates, 1.0 / segment as f64) };
    Ok(lines.into_iter().map(harmonic).collect())
}

impl Found {
    fn row(&self, readout_hz: Option<f64>) -> [String; 4] {
        let Line { frequency, prominence, .. } = self.line;
        let what = match self.harmonic {
            None => "line in the spectrum of frame totals".to_owned(),
            Some(1) => "the pixels' own firing rate, in frame totals".to_owned(),
            Some(k) => format!("the pixels' own firing rate, harmonic {k}, in frame totals"),
        };
        let hz = readout_hz.map_or(String::new(), |hz| format!(" ({:.1} Hz)", hz * frequency));
        let value = format!("{frequency:.5} cycles per readout{hz}, {prominence:.0} times what is around it");
        [what, value, String::new(), String::new()]
    }
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
