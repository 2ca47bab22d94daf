//! Implements `spikelane measure`, which measures a recording.

use std::path::PathBuf;

use clap::Args as ClapArgs;
use serde_json::json;

use spikelane::error::Result;
use spikelane::unstable::Count;
use spikelane_io::storage::write_small;
use spikelane_measure::report::{Curve, PageElement, Table, bar_plot, heat_map, page};
use spikelane_measure::{
    CellSummary, ERROR_MEANING, FrameTotalLine, MeasuredRecording, ReportedStatistic, SceneMotion,
    SpectralLine, Summary, detect_mosaic, high_pass,
};

use crate::common::console::{Console, recorded_path};
use crate::common::mosaic::StreamMosaicArgs;
use crate::common::output_claims;
use crate::common::progress::FileProgress;
use crate::common::stream::{StreamArgs, sidecar_beside};

/// Measure a stream of a uniform, dark or static scene in terms of EMVA 1288
///
/// Each value has two errors. The first error is the standard deviation between recordings by the same sensor. The
/// second error is the standard deviation between sensors of this kind. In 95 of 100 cases, the true value differs from
/// the measured value by less than two errors.
#[derive(Debug, ClapArgs)]
pub(crate) struct Args {
    /// Measure this stream file, or - for standard input
    file: PathBuf,
    #[command(flatten)]
    stream: StreamArgs,
    #[command(flatten)]
    mosaic: StreamMosaicArgs,
    /// Also write an HTML report with plots and maps
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
    /// Overwrite existing files
    #[arg(long)]
    force: bool,
}

/// Runs the command.
///
/// # Errors
/// If the stream cannot be read, or if the report cannot be written.
pub(crate) fn run(args: &Args, out: &Console) -> Result<()> {
    let _claim = args.report.as_ref().map(|report| output_claims::claim([report], args.force)).transpose()?;
    let reader = args.stream.open(&args.file, out)?;
    let mut progress = FileProgress::new(out);
    let (name, all) = (reader.name().to_string(), reader.readouts().max(1) as f64);
    let recording =
        MeasuredRecording::from_stream(&reader, &mut |done| progress.update(&name, done as f64 / all))?;
    drop(progress);
    let statistics = &recording.statistics;
    let declared = args.mosaic.of_stream(&args.file)?;
    let detected = match (&declared, &statistics.counts) {
        (None, Some(counts)) if args.mosaic.mosaic.is_none() => {
            detect_mosaic(&counts.count, reader.geometry().width())
        }
        _ => None,
    };
    if let Some([first, second]) = &detected {
        out.print_message(format_args!(
            "note: {name}: rows and columns alternate as in a color camera with the pattern {first} or {second}; pixels are compared with pixels of the same filter; to name the pattern, set --mosaic"
        ));
    }
    let mosaic = declared.or_else(|| detected.map(|[first, _]| first));
    let measurement = recording.report_with_mosaic(mosaic.as_ref())?;
    let hz = sidecar_beside(&args.file).and_then(|(_, sidecar)| sidecar.readout_hz);
    let mut rows = statistic_rows(&measurement.summary, &measurement.statistics);
    rows.extend(measurement.cells.iter().map(cell_row));
    rows.push(["scene".to_owned(), motion_text(measurement.scene_motion), String::new(), String::new()]);
    rows.extend(measurement.frame_total_lines.iter().map(|l| spectral_line_row(l, hz)));
    let line = |r: &[String; 4]| format!("{:<52} {:<12} {:<12} {}", r[0], r[1], r[2], r[3]);
    let text: String = rows.iter().map(|r| line(r).trim_end().to_owned() + "\n").collect();
    let mut result = measurement.to_json()?;
    result["event"] = json!("done");
    out.print_result(&result, &format!("{ERROR_MEANING}\n\n{text}"))?;
    let Some(path) = &args.report else { return Ok(()) };
    let mut table = Table::new(&["quantity", "value", "another recording", "another sensor"]);
    for row in rows {
        table.push_row(row);
    }
    let mut parts = vec![PageElement::text(ERROR_MEANING), PageElement::Table(table)];
    let width = reader.geometry().width();
    if let Some(counts) = &statistics.counts {
        let rate = counts.rate();
        parts.push(PageElement::figure(heat_map(&rate, width, "rate map")?, "Rate, 1st to 99th percentile."));
        parts.push(PageElement::figure(
            heat_map(&high_pass(&rate, width), width, "local pattern")?,
            "Rate of each pixel minus the mean rate of the surrounding 5x5 pixels.",
        ));
    }
    if let Some(intervals) = &statistics.intervals {
        let counts = intervals.histogram().counts();
        let all = counts.iter().sum::<u64>().max(1) as f64;
        let last = counts.iter().rposition(|n| *n as f64 > 1e-4 * all).unwrap_or(1);
        let points =
            counts.iter().take(last + 1).enumerate().map(|(n, c)| (n as f64, *c as f64 / all)).collect();
        let plot = bar_plot("Inter-spike intervals", "readouts", &[Curve { name: "all pixels", points }])?;
        parts.push(PageElement::figure(plot, "Share of intervals by length."));
    }
    let title = format!("Measured: {}", recorded_path(&args.file));
    write_small(path, page(&title, &parts).as_bytes(), args.force)
}

/// Returns the description, frequency and prominence of a spectral line as table cells.
fn spectral_line_row(line: &FrameTotalLine, readout_hz: Option<f64>) -> [String; 4] {
    let SpectralLine { frequency, prominence, .. } = line.line;
    let what = match line.harmonic {
        None => "line in the spectrum of frame totals".to_owned(),
        Some(1) => "firing rate of the pixels, in frame totals".to_owned(),
        Some(k) => format!("firing rate of the pixels, harmonic {k}, in frame totals"),
    };
    let hz = readout_hz.map_or(String::new(), |hz| format!(" ({:.1} Hz)", hz * frequency));
    let value =
        format!("{frequency:.5} cycles per readout{hz}, {prominence:.0} times the neighboring frequencies");
    [what, value, String::new(), String::new()]
}

/// Returns the mean rate and the number of defects of one cell of a mosaic as table cells.
fn cell_row(cell: &CellSummary) -> [String; 4] {
    let CellSummary { channel, row, col, summary, .. } = cell;
    let spread = summary.local_nonuniformity.value;
    let spread = if spread.is_finite() { format!(", local pattern {spread:.6}") } else { String::new() };
    let value = format!(
        "mean rate {:.6}{spread}, {}",
        summary.mean_rate.value,
        Count(summary.defects.count(), "defect pixel"),
    );
    [
        format!("channel {channel} (row {row}, column {col} of the mosaic)"),
        value,
        String::new(),
        String::new(),
    ]
}

fn motion_text(motion: SceneMotion) -> String {
    let changed = format!("{:.1} % of the pixels changed by more than noise", 100.0 * motion.moving_share);
    match motion.is_moving {
        true => {
            format!(
                "moving: {changed} between the halves of the recording; the errors and spreads are valid only for a static scene"
            )
        }
        false => format!("no motion detected ({changed})"),
    }
}

fn statistic_rows(s: &Summary, reported: &[ReportedStatistic]) -> Vec<[String; 4]> {
    let single_row = |name: &str, value: String| [name.to_owned(), value, String::new(), String::new()];
    let mut rows = vec![single_row("readouts", s.readouts.to_string())];
    rows.extend(reported.iter().map(statistic_row));
    if s.temporal_rate_sd.is_finite() {
        rows.push(single_row("temporal noise of a pixel's rate", format!("{:.2e}", s.temporal_rate_sd)));
    }
    let d = &s.defects;
    let defects = [("dead", &d.dead), ("stuck", &d.stuck), ("hot", &d.hot), ("weak", &d.weak)];
    rows.extend(defects.map(|(kind, p)| single_row(&format!("defect pixels: {kind}"), p.len().to_string())));
    rows
}

/// Returns the table cells of one statistic. If an error of the statistic is unknown, its cell is empty.
fn statistic_row(statistic: &ReportedStatistic) -> [String; 4] {
    let value = match (statistic.value, statistic.upper_limit) {
        (Some(value), _) => format!("{value:.6}"),
        (None, Some(below)) => format!("below {below:.1e}"),
        (None, None) => "not measurable".to_owned(),
    };
    let error = |sign: &str, e: Option<f64>| e.map_or(String::new(), |e| format!("{sign} {e:.1e}"));
    let sign = if statistic.recording_error_is_bound { "<=" } else { "+-" };
    [
        statistic.description.clone(),
        value,
        error(sign, statistic.recording_error),
        error("+-", statistic.sensor_error),
    ]
}
