//! `spikelane measure`: what a recording says of its camera.

use std::path::PathBuf;

use crate::error::{Error, Kind, Result};
use crate::measure::{
    Estimate, Line, Named, Options, Summary, frame_total_lines, high_pass, list, of_stream, summarise,
};
use crate::report::{Curve, Part, Table, bars, heat_map, page};
use crate::simulate::Sidecar;
use clap::Args as ClapArgs;
use serde_json::json;

use super::output::Out;
use super::progress::Files;
use super::stream::StreamArgs;

/// Measure a stream of a uniform, dark or static scene, in the words of EMVA 1288.
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
    let statistics =
        of_stream(&reader, &Options::default(), &mut |done| progress.step(&name, done as f64 / all))?;
    drop(progress);
    let summary = summarise(&statistics)?;
    let wrong = |e: serde_json::Error| Error::new(Kind::Config, "summary").found(e);
    let mut result = serde_json::to_value(&summary).map_err(wrong)?;
    result["event"] = json!("done");
    let all = list(&statistics)?;
    result["statistics"] = serde_json::to_value(&all).map_err(wrong)?;
    let lines = frame_total_lines(&statistics)?;
    result["frame_total_lines"] = serde_json::to_value(&lines).map_err(wrong)?;
    let hz = Sidecar::beside(&args.file).ok().flatten().and_then(|(_, sidecar)| sidecar.readout_hz);
    let mut rows = rows(&summary, &all);
    rows.extend(lines.iter().map(|l| ("line in the spectrum of frame totals".to_owned(), told(l, hz))));
    let text: String = rows.iter().map(|(name, value)| format!("{name:<52} {value}\n")).collect();
    out.result(&result, &text)?;
    let Some(path) = &args.report else { return Ok(()) };
    let mut table = Table::new(&["quantity", "value"]);
    for (name, value) in rows {
        table.row([name, value]);
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
    crate::storage::write_small(path, page(&title, &parts)?.as_bytes(), args.force)
}

fn told(line: &Line, readout_hz: Option<f64>) -> String {
    let hz = readout_hz.map_or(String::new(), |hz| format!(" ({:.1} Hz)", hz * line.frequency));
    format!("{:.5} cycles per readout{hz}, {:.0} times what is around it", line.frequency, line.prominence)
}

fn rows(s: &Summary, all: &[Named]) -> Vec<(String, String)> {
    let number = |e: Estimate| match e.value.is_finite() {
        true => format!("{:.6} +- {:.1e}", e.value, e.error),
        false => "not measurable here".to_owned(),
    };
    let mut rows = vec![("readouts".to_owned(), s.readouts.to_string())];
    rows.extend(all.iter().map(|n| (n.words.clone(), number(n.estimate))));
    rows.push(("temporal noise of a pixel's rate".to_owned(), format!("{:.2e}", s.temporal_of_rate)));
    let d = &s.defects;
    let defects = [("dead", &d.dead), ("stuck", &d.stuck), ("hot", &d.hot), ("weak", &d.weak)];
    rows.extend(defects.map(|(kind, pixels)| (format!("defect pixels: {kind}"), pixels.len().to_string())));
    rows
}
