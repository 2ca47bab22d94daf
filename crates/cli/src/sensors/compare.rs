//! Implements `spikelane compare`, which compares models with a measured camera.

use std::path::{Path, PathBuf};

use clap::Args as ClapArgs;

use serde_json::{Value, json};
use spikelane::effects::Camera;
use spikelane::error::{Error, ErrorKind, Result};
use spikelane::presets;
use spikelane::unstable::Count;
use spikelane::unstable::draws::Seeds;
use spikelane::unstable::inputs;
use spikelane_calibrate::compare::{
    CameraDistance, DEFAULT_MODELS, GrayComparison, RealismComparison, RealismOptions, RealismRow,
    SceneComparison, SceneStatistics, WindowSize, compare_gray_levels, compare_realism, compare_static_scene,
};
use spikelane_calibrate::{ColorFilters, RecordingSet};
use spikelane_io::storage::FileGroup;

use crate::common::{
    Console, FileProgress, SeedArgs, StreamArgs, claim_files, marked, print_set_warnings, run_record,
    sidecar_beside, smallest, sparkline, text_table,
};

/// Compare camera models with a recording set (.toml) or a static recording
#[derive(Debug, ClapArgs)]
pub(crate) struct Args {
    /// Read this recording set or stream
    recording: PathBuf,
    /// Same as --camera
    #[arg(value_name = "CAMERA", conflicts_with = "camera")]
    positional_cameras: Vec<String>,
    /// Compare this camera; repeatable [default: 6 presets]
    ///
    /// The default presets are scsim-code, scsim-paper, neuspike, spikingsim, spcs and physical.
    #[arg(long, value_name = "NAME|FILE")]
    camera: Vec<String>,
    #[command(flatten)]
    stream: StreamArgs,
    /// Limit the readouts per simulation
    #[arg(long, value_name = "N", default_value_t = 2000)]
    max_readouts: usize,
    /// Test whether a classifier detects simulations
    ///
    /// The classifier compares windows of the recording and of simulations. The report lists the statistics that
    /// distinguish them.
    #[arg(long)]
    realism: bool,
    /// With --realism, set the side in pixels and the readouts of a window
    #[arg(hide_short_help = true, long, value_name = "SIDE,READOUTS", default_value = "32,100", requires = "realism",
          value_parser = parse_window)]
    window: WindowSize,
    /// With --realism, use only these rows, such as 100..180 [default: all rows]
    ///
    /// Row 0 is the top of the upright image. Row TO is not included.
    #[arg(hide_short_help = true, long, value_name = "FROM..TO", requires = "realism", value_parser = parse_rows)]
    rows: Option<std::ops::Range<usize>>,
    /// With --realism, simulate light that drifts like the light of the recording
    #[arg(hide_short_help = true, long, requires = "realism")]
    drifting_light: bool,
    /// With --realism, simulate N recordings per camera
    #[arg(hide_short_help = true, long, value_name = "N", default_value_t = 10, requires = "realism",
          value_parser = clap::value_parser!(u16).range(2..))]
    recordings_per_camera: u16,
    /// With --realism, compare this map of measured dark rates (.npy)
    ///
    /// The map has the dark rate of each pixel in spikes per readout. The report lists its quantiles and those of the
    /// simulated cameras.
    #[arg(hide_short_help = true, long, value_name = "FILE", requires = "realism")]
    dark_rates: Option<PathBuf>,
    #[command(flatten)]
    seeds: SeedArgs,
    /// Write reports to this folder
    ///
    /// The files are comparison.json and comparison.html, and with --realism also features.csv.
    #[arg(short, long, value_name = "DIR", default_value = "comparison")]
    output: PathBuf,
    /// Overwrite existing files
    #[arg(long)]
    force: bool,
}

/// Runs the command.
///
/// # Errors
/// If an input is invalid, or if a file cannot be written.
pub(crate) fn run(args: &Args, out: &Console) -> Result<()> {
    let files = ["comparison.json", "comparison.html", "features.csv"].map(|name| args.output.join(name));
    // The claim lasts until the last file has its final name.
    let _claim = claim_files(&files, args.force)?;
    let arguments = args.positional_cameras.iter().chain(&args.camera).map(String::as_str);
    let names: Vec<&str> =
        if arguments.clone().next().is_none() { DEFAULT_MODELS.to_vec() } else { arguments.collect() };
    let cameras = names.into_iter().map(presets::load).collect::<Result<Vec<_>>>()?;
    let seeds = args.seeds.seeds();
    let is_set = args.recording.extension().is_some_and(|e| e == "toml");
    let result = match (is_set, args.realism) {
        (true, false) => compare_gray(args, &cameras, seeds, out)?,
        (false, false) => compare_static(args, &cameras, seeds, out)?,
        (false, true) => compare_windows(args, &cameras, seeds, out)?,
        (true, true) => {
            return Err(Error::new(ErrorKind::Usage, args.recording.display())
                .found("a recording set")
                .expected("one recording of a scene for --realism")
                .remedy("use a stream of the set, or omit --realism"));
        }
    };
    let json_error = |e| Error::new(ErrorKind::Config, "comparison").found(e);
    let all = serde_json::to_string_pretty(&result.json).map_err(json_error)?;
    let texts = [Some(&*all), Some(&*result.html), result.features.as_deref()];
    let mut group = FileGroup::new(args.force);
    let mut names = Vec::new();
    for (path, text) in files.iter().zip(texts).filter_map(|(path, text)| Some((path, text?))) {
        group.write(path, text.as_bytes())?;
        names.push(path.display().to_string());
    }
    group.commit()?;
    let mut summary = result.summary;
    summary["event"] = json!("done");
    summary["files"] = json!(names);
    out.print_result(&summary, &format!("{}{}\n", result.text, names.join("\n")))
}

/// Output of a comparison: complete JSON, the HTML page, and the distances as JSON and as text.
struct ComparisonOutput {
    json: Value,
    html: String,
    summary: Value,
    text: String,
    /// The features of all windows as CSV, for other classifiers.
    features: Option<String>,
}

fn to_value(report: &impl serde::Serialize) -> Result<Value> {
    serde_json::to_value(report).map_err(|e| Error::new(ErrorKind::Config, "comparison").found(e))
}

fn compare_gray(args: &Args, cameras: &[Camera], seeds: Seeds, out: &Console) -> Result<ComparisonOutput> {
    let set = RecordingSet::open(&args.recording)?;
    print_set_warnings(&set, out)?;
    let run = run_record(std::iter::once(args.recording.clone()).chain(set.input_files()));
    let mut progress = FileProgress::new(out);
    let mut report_progress = |name: &str, share: f64| progress.update(name, share);
    let comparison = compare_gray_levels(&set, cameras, seeds, args.max_readouts, &mut report_progress)?;
    drop(progress);
    let entry = |name: &str, response: f64, histograms: &[f64]| json!({"name": name, "response": response, "histograms": histograms});
    let row = |m: &CameraDistance| entry(&m.name, m.response_distance, &m.histogram_distance);
    let models: Vec<Value> = comparison.models.iter().map(row).collect();
    let floor = entry("noise floor", comparison.noise_floor.response, &comparison.noise_floor.histograms);
    let text = gray_table(&comparison) + &comparison.verdict() + "\n";
    Ok(ComparisonOutput {
        json: to_value(&comparison)?,
        html: comparison.html_report(&run)?,
        summary: json!({"models": models, "noise_floor": floor}),
        text,
        features: None,
    })
}

/// Returns a table with the distances of each model and the noise floor.
fn gray_table(comparison: &GrayComparison) -> String {
    let models = &comparison.models;
    let best_response = smallest(models.iter().map(|m| m.response_distance));
    let best_interval =
        |i: usize| smallest(models.iter().filter_map(|m| m.histogram_distance.get(i).copied()));
    let cell = |x: f64, digits: usize, best: f64| marked(format!("{x:.digits$}"), x == best);
    let mut rows: Vec<Vec<String>> = Vec::new();
    for m in models {
        let intervals = m.histogram_distance.iter().enumerate().map(|(i, d)| cell(*d, 4, best_interval(i)));
        let response = cell(m.response_distance, 5, best_response);
        rows.push([m.name.clone(), response].into_iter().chain(intervals).collect());
    }
    let floor = &comparison.noise_floor;
    let intervals = floor.histograms.iter().map(|d| format!("{d:.4}"));
    let first = ["noise floor".to_owned(), format!("{:.5}", floor.response)];
    rows.push(first.into_iter().chain(intervals).collect());
    let lights: Vec<String> = comparison.histogram_lights.iter().map(|l| format!("at {l:.3}")).collect();
    let header: Vec<&str> =
        ["camera", "response"].into_iter().chain(lights.iter().map(String::as_str)).collect();
    let channels: String = match comparison.channels.is_empty() {
        true => String::new(),
        false => format!(", over the channels {}", comparison.channels.iter().collect::<String>()),
    };
    text_table(&header, &rows)
        + &format!("response: difference of the rates, spikes per readout{channels}\n")
        + "at LIGHT: difference of the intervals, 0 equal, 1 disjoint; * best\n"
}

/// Returns a table with the distance of each model, and its distances in the bands of rows as a sparkline.
fn scene_table(comparison: &SceneComparison) -> String {
    let models = &comparison.models;
    let highest = models.iter().flat_map(|m| &m.row_band_distances).copied().fold(0.0, f64::max);
    let best = smallest(models.iter().map(|m| m.distance));
    let row = |m: &SceneStatistics| {
        let nearest = comparison.row_bands.iter().filter(|b| b.nearest_model == m.name).count();
        vec![
            m.name.clone(),
            marked(format!("{:.3}", m.distance), m.distance == best),
            format!("{:.3}", m.long_lag_distance),
            format!("{nearest} of {}", comparison.row_bands.len()),
            sparkline(&m.row_band_distances, highest),
        ]
    };
    let rows: Vec<Vec<String>> = models.iter().map(row).collect();
    text_table(&["camera", "distance", "beyond lag 8", "nearest in", "outliers by rows"], &rows)
        + &format!(
            "outliers by rows: distance in bands from top to bottom, full height {highest:.2}; * best\n"
        )
}

fn compare_static(args: &Args, cameras: &[Camera], seeds: Seeds, out: &Console) -> Result<ComparisonOutput> {
    let run = run_record([&args.recording]);
    let recording = args.stream.open(&args.recording, out)?;
    let declared = sidecar_beside(&args.recording)?.and_then(|(_, sidecar)| sidecar.mosaic);
    let filters = match declared {
        Some(facts) => ColorFilters::Mosaic(facts.mosaic()?),
        None => ColorFilters::Unknown,
    };
    let comparison = compare_static_scene(&recording, &filters, cameras, seeds)?;
    let mut text = format!(
        "{}, mean rate {:.4} spikes per readout\ndistance: sum of |ln(model / measured)|; {:.3} are due to errors of the recording\n\n",
        Count(comparison.pixels, "static pixel"),
        comparison.mean_rate,
        comparison.noise_floor_distance,
    );
    if !comparison.channels.is_empty() {
        text += &format!("pixels of each color filter: {}\n\n", comparison.channel_text());
    }
    let row = |m: &SceneStatistics| {
        let (near, far) = (m.distance, m.long_lag_distance);
        json!({"name": m.name, "distance": near, "long_lag_distance": far, "excess_distance": m.excess_distance, "excess_distance_error": m.excess_distance_error})
    };
    let models: Vec<Value> = comparison.models.iter().map(row).collect();
    text += &format!("{}\n{}", scene_table(&comparison), comparison.verdict());
    text.push('\n');
    let summary = json!({"pixels": comparison.pixels, "mean_rate": comparison.mean_rate, "noise_floor_distance": comparison.noise_floor_distance, "models": models, "verdict": comparison.verdict()});
    Ok(ComparisonOutput {
        json: to_value(&comparison)?,
        html: comparison.html_report(&run)?,
        summary,
        text,
        features: None,
    })
}

/// Compares windows of the recording with windows of simulated recordings of every camera.
fn compare_windows(args: &Args, cameras: &[Camera], seeds: Seeds, out: &Console) -> Result<ComparisonOutput> {
    let options = RealismOptions {
        window: args.window,
        recordings_per_camera: usize::from(args.recordings_per_camera),
        max_readouts: args.max_readouts,
        rows: args.rows.clone(),
        drifting_light: args.drifting_light,
        seeds,
        dark_rates: args.dark_rates.as_deref().map(read_dark_rates).transpose()?,
    };
    let recording = args.stream.open(&args.recording, out)?;
    let mut progress = FileProgress::new(out);
    let comparison =
        compare_realism(&recording, cameras, &options, &mut |name, share| progress.update(name, share))?;
    drop(progress);
    let mut text = format!(
        "{} at {}, mean rate {:.4}; {:.1} % of the pixels are excluded\n",
        Count(comparison.windows, "window"),
        Count(comparison.places, "place"),
        comparison.mean_rate,
        100.0 * comparison.excluded_share
    );
    text += &format!("\n{}", realism_table(&comparison));
    let row = |r: &RealismRow| {
        let feature = r.features.first().map_or("", |t| t.name.as_str());
        json!({"name": r.name, "auc": r.auc, "self_auc": r.self_auc, "is_conclusive": r.is_conclusive(), "best_feature": feature})
    };
    let models: Vec<Value> = comparison.cameras.iter().map(row).collect();
    let lines = comparison.recording_statistics.iter().map(|n| n.table_row() + "\n").collect::<String>();
    let head = comparison.recording_statistics.first().map_or_else(String::new, |n| n.table_header() + "\n");
    text += &format!(
        "\n{head}{lines}(D in readouts squared; early and late intervals per million intervals)\n\n{}\n",
        comparison.verdict()
    );
    let summary = json!({
        "recording_statistics": comparison.recording_statistics,
        "windows": comparison.windows, "places": comparison.places, "mean_rate": comparison.mean_rate, "excluded_share": comparison.excluded_share,
        "models": models, "verdict": comparison.verdict(),
    });
    let (page, features) =
        (comparison.html_report(&run_record([&args.recording]))?, Some(comparison.features_csv.clone()));
    Ok(ComparisonOutput { json: to_value(&comparison)?, html: page, summary, text, features })
}

/// Returns a table with the distinguishability of each camera.
fn realism_table(comparison: &RealismComparison) -> String {
    let best = smallest(comparison.cameras.iter().map(|r| r.auc.value));
    let row = |r: &RealismRow| {
        vec![
            r.name.clone(),
            marked(format!("{:.3}", r.auc.value), r.auc.value == best),
            format!("{:.2} to {:.2}", r.auc.low, r.auc.high),
            format!("{:.3}", r.self_auc.value),
            if r.is_conclusive() { "yes" } else { "no" }.to_owned(),
        ]
    };
    let rows: Vec<Vec<String>> = comparison.cameras.iter().map(row).collect();
    let mut text = text_table(&["camera", "distinguishability", "95 %", "noise floor", "decided"], &rows)
        + "0.5: like the recording, 1: always distinguished; * best\n";
    for r in &comparison.cameras {
        if let Some(feature) = r.features.first() {
            text += &format!("{}: mainly by {}\n", r.name, feature.name);
        }
    }
    text
}

/// Reads the dark rate of every pixel.
fn read_dark_rates(path: &Path) -> Result<Vec<f64>> {
    let bytes = inputs::read_bytes(path, "dark rates", inputs::MAX_PICTURE_BYTES)?;
    let (_, rates) = spikelane::unstable::npy::read_values(&path.display().to_string(), &bytes)?;
    if rates.is_empty() || rates.iter().any(|r| !(0.0..=1.0).contains(r)) {
        return Err(Error::new(ErrorKind::Input, path.display())
            .found("rates outside 0 to 1, or none")
            .expected("dark rates in spikes per readout, one per pixel"));
    }
    Ok(rates)
}

/// Parses `SIDE,READOUTS`.
fn parse_window(text: &str) -> std::result::Result<WindowSize, String> {
    let parsed = text.split_once(',').and_then(|(side, readouts)| {
        Some(WindowSize { side: side.trim().parse().ok()?, readouts: readouts.trim().parse().ok()? })
    });
    parsed.filter(|w| w.side >= 4 && w.readouts >= 20).ok_or_else(|| {
        format!("`{text}`: expected SIDE,READOUTS with at least 4 pixels and 20 readouts, such as 32,100")
    })
}

/// Parses `FROM..TO`.
fn parse_rows(text: &str) -> std::result::Result<std::ops::Range<usize>, String> {
    let parsed =
        text.split_once("..").and_then(|(from, to)| Some(from.trim().parse().ok()?..to.trim().parse().ok()?));
    parsed.filter(|r| r.start < r.end).ok_or_else(|| format!("`{text}`: expected FROM..TO, such as 100..180"))
}
