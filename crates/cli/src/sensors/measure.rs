//! Implements `spikelane measure`, which measures a recording.

use std::path::PathBuf;

use clap::Args as ClapArgs;
use serde_json::json;

use spikelane::error::Result;
use spikelane::unstable::Count;
use spikelane_measure::report::{
    Cell, PageElement, Plot, Report, ReportState, Table, heat_map, with_error, without_error,
};
use spikelane_measure::{
    CellSummary, ERROR_MEANING, FrameTotalLine, MeasuredRecording, MeasurementReport, ReportedStatistic,
    SceneMotion, SpectralLine, Summary, detect_mosaic, high_pass, map_histogram, pattern_spectra,
};

use crate::common::{
    Console, FileProgress, ReportFiles, StreamArgs, StreamMosaicArgs, detection_note, recorded_path,
    run_record, sidecar_beside,
};

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
    /// Also write an HTML report with plots and maps, and its numbers as JSON beside it
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
    let files = ReportFiles::claim(args.report.as_deref(), args.force)?;
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
    if let Some(patterns) = &detected {
        let effect = "pixels are compared with pixels of the same filter";
        out.print_message(detection_note(&name, patterns, effect));
    }
    let mosaic = declared.or_else(|| detected.map(|[first, _]| first));
    let measurement = recording.report_with_mosaic(mosaic.as_ref())?;
    let hz = sidecar_beside(&args.file)?.and_then(|(_, sidecar)| sidecar.readout_hz);
    let mut rows = statistic_rows(&measurement.summary, &measurement.statistics);
    rows.extend(measurement.cells.iter().map(cell_row));
    rows.push(["scene".to_owned(), motion_text(measurement.scene_motion), String::new(), String::new()]);
    rows.extend(measurement.frame_total_lines.iter().map(|l| spectral_line_row(l, hz)));
    let line = |r: &[String; 4]| format!("{:<52} {:<12} {:<12} {}", r[0], r[1], r[2], r[3]);
    let text: String = rows.iter().map(|r| line(r).trim_end().to_owned() + "\n").collect();
    let mut result = measurement.to_json()?;
    result["event"] = json!("done");
    out.print_result(&result, &format!("{ERROR_MEANING}\n\n{text}"))?;
    let Some(files) = files else { return Ok(()) };
    let html = report(args, &recording, &measurement)?.html(&run_record([&args.file]));
    files.write(&html, &measurement.to_json()?)
}

/// Returns the report of a measured recording.
fn report(args: &Args, recording: &MeasuredRecording, measurement: &MeasurementReport) -> Result<Report> {
    let summary = &measurement.summary;
    let motion = measurement.scene_motion;
    let defects = Count(summary.defects.count(), "defect pixel");
    let (state, word) =
        if motion.is_moving { (ReportState::Caution, "moving") } else { (ReportState::Good, "static") };
    let verdict = match motion.is_moving {
        true => format!("The scene moves, so the errors and spreads are not valid; {defects}."),
        false => format!("No motion was detected, so the errors are valid; {defects}."),
    };
    let title = format!("Measurement of {}", recorded_path(&args.file));
    let mut report = Report::new(title, state, word, verdict);
    let named = |key: &str| measurement.statistics.iter().find(|s| s.key == key);
    for (key, label, unit) in [
        ("mean-rate", "mean rate", "spikes per readout"),
        ("nonuniformity", "non-uniformity", "spikes per readout"),
        ("local-nonuniformity", "local non-uniformity", "spikes per readout"),
        ("interval-variance-1", "interval variance D(1)", "readouts²"),
    ] {
        if let Some((statistic, value)) = named(key).and_then(|s| Some((s, s.value?))) {
            report.push_estimate(label, value, statistic.recording_error.unwrap_or(f64::NAN), unit);
        }
    }
    report.push_key("defect pixels", summary.defects.count().to_string(), "");
    report.push_key("readouts", summary.readouts.to_string(), "");
    report.extend(figures(recording)?);
    report.push_table(statistic_table(measurement));
    let mut others = Table::new("Defects, motion and lines", &["quantity", "value"]);
    defect_rows(summary).into_iter().for_each(|(name, n)| others.push_row([Cell::from(name), Cell::from(n)]));
    others.push_row(["scene".to_owned(), motion_text(motion)]);
    for cell in &measurement.cells {
        let [what, value, ..] = cell_row(cell);
        others.push_row([what, value]);
    }
    let hz = sidecar_beside(&args.file)?.and_then(|(_, sidecar)| sidecar.readout_hz);
    for line in &measurement.frame_total_lines {
        let [what, value, ..] = spectral_line_row(line, hz);
        others.push_row([what, value]);
    }
    report.push_table(others);
    Ok(report)
}

/// Returns the maps, histograms and spectra of a recording.
fn figures(recording: &MeasuredRecording) -> Result<Vec<PageElement>> {
    let statistics = &recording.statistics;
    let width = statistics.geometry.width();
    let mut parts = Vec::new();
    if let Some(counts) = &statistics.counts {
        let rate = counts.rate();
        let local = high_pass(&rate, width);
        let bins = map_histogram(&rate, HISTOGRAM_BINS);
        let ends = [bins.first(), bins.last()].map(|b| without_error(b.map_or(0.0, |b| b.0)));
        let unit = "spikes per readout";
        parts.push(heat_map(
            &format!("Rates of 99.8 % of the pixels are between {} and {}", ends[0], ends[1]),
            &rate,
            width,
            unit,
            "Rate of each pixel. The colors span the 1st to the 99th percentile.",
        )?);
        parts.push(heat_map(
            "Local pattern of the rate",
            &local,
            width,
            unit,
            "Rate of each pixel minus the mean rate of the surrounding 5x5 pixels.",
        )?);
        let histogram =
            Plot::new("Distribution of the rates", unit, "share of the pixels").bars("pixels", bins);
        parts.push(histogram.figure("Between the 0.1th and the 99.9th percentile."));
        parts.push(spectrum_figure(&local, width));
    }
    if let Some(intervals) = &statistics.intervals {
        let counts = intervals.histogram().counts();
        let all = counts.iter().sum::<u64>().max(1) as f64;
        let last = counts.iter().rposition(|n| *n as f64 > 1e-4 * all).unwrap_or(1);
        let mode = counts.iter().enumerate().max_by_key(|(_, n)| **n).map_or(0, |(length, _)| length);
        let points = counts
            .iter()
            .take(last + 1)
            .enumerate()
            .skip(1)
            .map(|(n, c)| (n as f64, *c as f64 / all))
            .collect();
        let title = format!("The most frequent interval is {}", Count(mode, "readout"));
        let plot =
            Plot::new(title, "interval, readouts", "share of the intervals").bars("all pixels", points);
        parts.push(plot.figure("Lengths of the inter-spike intervals of all pixels."));
    }
    if let Some(frames) = &statistics.frames {
        parts.push(totals_figure(&frames.totals, statistics.geometry.pixels()));
    }
    Ok(parts)
}

/// Number of bins of a histogram.
const HISTOGRAM_BINS: usize = 60;

/// Largest number of points of the plot of frame totals.
const MAX_TOTALS: usize = 300;

/// Plots the spectra of the local pattern along rows and columns. A peak is a periodic pattern of columns or rows.
fn spectrum_figure(local: &[f64], width: usize) -> PageElement {
    let [rows, columns] = pattern_spectra(local, width);
    Plot::new("Spectrum of the local pattern", "frequency, cycles per pixel", "amplitude, spikes per readout")
        .line("along rows", rows)
        .line("along columns", columns)
        .figure("White noise has the same amplitude at all frequencies. A peak is a periodic pattern.")
}

/// Plots the share of pixels that fire at a readout over the readouts. Successive readouts are averaged.
fn totals_figure(totals: &[u32], pixels: usize) -> PageElement {
    let step = totals.len().div_ceil(MAX_TOTALS).max(1);
    let mean = |part: &[u32]| {
        part.iter().map(|t| f64::from(*t)).sum::<f64>() / part.len().max(1) as f64 / pixels.max(1) as f64
    };
    let points = totals.chunks(step).enumerate().map(|(i, part)| ((i * step) as f64, mean(part))).collect();
    Plot::new("Share of firing pixels over time", "readout", "share of the pixels")
        .line("all pixels", points)
        .figure(format!("Each point is the mean of {}.", Count(step, "readout")))
}

/// Returns the table of all statistics.
fn statistic_table(measurement: &MeasurementReport) -> Table {
    let mut table =
        Table::new("All statistics", &["quantity", "value, ± another recording", "± another sensor"])
            .with_note(ERROR_MEANING);
    for s in &measurement.statistics {
        let value = match (s.value, s.upper_limit) {
            (Some(value), _) => Cell::estimate(value, s.recording_error.unwrap_or(f64::NAN), ""),
            (None, Some(limit)) => Cell::from(format!("below {}", without_error(limit))),
            (None, None) => Cell::from("not measurable"),
        };
        let sensor = s
            .sensor_error
            .map_or(Cell::from(""), |e| Cell::number(e, with_error(s.value.unwrap_or(e), e).error_column()));
        table.push_row([Cell::from(&s.description), value, sensor]);
    }
    table
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
    let spread =
        if spread.is_finite() { format!(", local pattern {}", without_error(spread)) } else { String::new() };
    let value = format!(
        "mean rate {}{spread}, {}",
        without_error(summary.mean_rate.value),
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
    rows.extend(defect_rows(s).into_iter().map(|(name, n)| single_row(&name, n.to_string())));
    rows
}

/// Returns the number of defect pixels of each kind.
fn defect_rows(s: &Summary) -> [(String, usize); 4] {
    let d = &s.defects;
    let defects = [("dead", &d.dead), ("stuck", &d.stuck), ("hot", &d.hot), ("weak", &d.weak)];
    defects.map(|(kind, p)| (format!("defect pixels: {kind}"), p.len()))
}

/// Returns the table cells of one statistic. If an error of the statistic is unknown, its cell is empty.
fn statistic_row(statistic: &ReportedStatistic) -> [String; 4] {
    let value = match (statistic.value, statistic.upper_limit) {
        (Some(value), _) => with_error(value, statistic.recording_error.unwrap_or(f64::NAN)).value_column(),
        (None, Some(below)) => format!("below {below:.1e}"),
        (None, None) => "not measurable".to_owned(),
    };
    let error = |sign: &str, e: Option<f64>| {
        e.map_or(String::new(), |e| {
            // The error is rounded together with the value, so both have the same digits.
            format!("{sign} {}", with_error(statistic.value.unwrap_or(e), e).error_column())
        })
    };
    let sign = if statistic.recording_error_is_bound { "<=" } else { "+-" };
    [
        statistic.description.clone(),
        value,
        error(sign, statistic.recording_error),
        error("+-", statistic.sensor_error),
    ]
}
