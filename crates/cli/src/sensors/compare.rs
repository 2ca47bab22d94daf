//! `spikelane compare`: models against a measured camera.

use std::path::{Path, PathBuf};

use clap::Args as ClapArgs;

use serde_json::{Value, json};
use spikelane::effects::Camera;
use spikelane::error::{Error, Kind, Result};
use spikelane::presets;
use spikelane::unstable::draws::Seeds;
use spikelane_calibrate::RecordingSet;
use spikelane_calibrate::compare::{
    CameraDistance, MODELS, RealismOptions, RealismRow, SceneComparison, SceneRow, Window, grey_levels,
    realism, static_scene,
};
use spikelane_io::storage::FileGroup;

use crate::shared::output::Out;
use crate::shared::outputs;
use crate::shared::progress::Files;
use crate::shared::seeds::SeedArgs;
use crate::shared::stream::{StreamArgs, warn_of_set};

/// Compare presets or camera files with a recording set (.toml) or one static recording.
#[derive(Debug, ClapArgs)]
pub(crate) struct Args {
    /// A recording set, or a stream.
    measured: PathBuf,
    /// The same as --camera
    #[arg(value_name = "CAMERA", conflicts_with = "camera")]
    named: Vec<String>,
    /// Preset or camera file; may be repeated [default: the paper's five and physical]
    #[arg(long, value_name = "NAME|FILE")]
    camera: Vec<String>,
    #[command(flatten)]
    stream: StreamArgs,
    /// Longest simulation, in readouts: of a level, or of a recording
    #[arg(long, default_value_t = 2000)]
    longest: usize,
    /// Ask whether a discriminator tells simulated windows from real ones, and by what
    #[arg(long)]
    realism: bool,
    /// With --realism: side in pixels and readouts of a window
    #[arg(long, value_name = "SIDE,READOUTS", default_value = "32,100", requires = "realism",
          value_parser = window)]
    window: Window,
    /// With --realism: only rows from FROM up to TO of the upright picture
    #[arg(long, value_name = "FROM..TO", requires = "realism", value_parser = rows)]
    rows: Option<std::ops::Range<usize>>,
    /// With --realism: simulated light drifts as the recording's does
    #[arg(long, requires = "realism")]
    drifting: bool,
    /// With --realism: recordings simulated by each camera
    #[arg(long, value_name = "N", default_value_t = 10, requires = "realism",
          value_parser = clap::value_parser!(u16).range(2..))]
    simulated: u16,
    /// With --realism: a map of a real camera's dark rates (.npy, spikes a readout), listed beside those of the cameras
    #[arg(long, value_name = "FILE", requires = "realism")]
    dark: Option<PathBuf>,
    #[command(flatten)]
    seeds: SeedArgs,
    /// Folder for comparison.json and comparison.html.
    #[arg(short, long, value_name = "DIR", default_value = "comparison")]
    output: PathBuf,
    /// Replace existing files.
    #[arg(long)]
    force: bool,
}

/// Runs the command.
///
/// # Errors
/// When an input is bad, or a file cannot be written.
pub(crate) fn run(args: &Args, out: &Out) -> Result<()> {
    let files = ["comparison.json", "comparison.html", "features.csv"].map(|name| args.output.join(name));
    // Held until the last file has its name.
    let _claim = outputs::claim(&files, args.force)?;
    let given = args.named.iter().chain(&args.camera).map(String::as_str);
    let names: Vec<&str> = if given.clone().next().is_none() { MODELS.to_vec() } else { given.collect() };
    let cameras = names.into_iter().map(presets::load).collect::<Result<Vec<_>>>()?;
    let seeds = args.seeds.seeds();
    let is_set = args.measured.extension().is_some_and(|e| e == "toml");
    let found = match (is_set, args.realism) {
        (true, false) => grey(args, &cameras, seeds, out)?,
        (false, false) => still(args, &cameras, seeds, out)?,
        (false, true) => windows(args, &cameras, seeds, out)?,
        (true, true) => {
            return Err(Error::new(Kind::Usage, args.measured.display())
                .found("a recording set")
                .expected("one recording of a scene for --realism")
                .remedy("give a stream of the set, or leave --realism out"));
        }
    };
    let json_error = |e| Error::new(Kind::Config, "comparison").found(e);
    let all = serde_json::to_string_pretty(&found.all).map_err(json_error)?;
    let texts = [Some(&*all), Some(&*found.page), found.features.as_deref()];
    let mut group = FileGroup::new(args.force);
    let mut names = Vec::new();
    for (path, text) in files.iter().zip(texts).filter_map(|(path, text)| Some((path, text?))) {
        group.write(path, text.as_bytes())?;
        names.push(path.display().to_string());
    }
    group.commit()?;
    let mut summary = found.summary;
    summary["event"] = json!("done");
    summary["files"] = json!(names);
    out.result(&summary, &format!("{}{}\n", found.text, names.join("\n")))
}

/// What a comparison leaves: everything, the page, and the distances as JSON and as text.
struct Found {
    all: Value,
    page: String,
    summary: Value,
    text: String,
    /// Windows as a table for other discriminators.
    features: Option<String>,
}

fn to_value(found: &impl serde::Serialize) -> Result<Value> {
    serde_json::to_value(found).map_err(|e| Error::new(Kind::Config, "comparison").found(e))
}

fn grey(args: &Args, cameras: &[Camera], seeds: Seeds, out: &Out) -> Result<Found> {
    let set = RecordingSet::open(&args.measured)?;
    warn_of_set(&set, out)?;
    let mut progress = Files::new(out);
    let mut tell = |name: &str, share: f64| progress.step(name, share);
    let found = grey_levels(&set, cameras, seeds, args.longest, &mut tell)?;
    drop(progress);
    let mut text = String::new();
    let mut line = |name: &str, response: f64, histograms: &[f64]| {
        let cells: Vec<String> = histograms.iter().map(|d| format!("{d:.4}")).collect();
        text += &format!(
            "{name:<14} response off by {response:.5} spikes a readout, histograms by {} (0 equal, 1 disjoint)\n",
            cells.join(" ")
        );
        json!({"name": name, "response": response, "histograms": histograms})
    };
    let row = |m: &CameraDistance| line(&m.name, m.response_distance, &m.histogram_distance);
    let models: Vec<Value> = found.models.iter().map(row).collect();
    let floor = line("noise floor", found.floor.response, &found.floor.histograms);
    Ok(Found {
        all: to_value(&found)?,
        page: found.page()?,
        summary: json!({"models": models, "floor": floor}),
        text,
        features: None,
    })
}

/// Share of outliers and distance in every band of rows.
fn bands(found: &SceneComparison) -> String {
    let mut text = format!("\n{:<12}{:>9}", "rows", "measured");
    found.models.iter().for_each(|m| text += &format!("{:>17}", m.name));
    for (i, area) in found.areas.iter().enumerate() {
        let [first, last] = area.rows;
        text += &format!("\n{:<12}{:>9.1e}", format!("{first} to {last}"), area.outliers);
        for m in &found.models {
            text += &format!("{:>10.1e} ({:.2})", m.area_outliers[i], m.area_distances[i]);
        }
    }
    text += "\n(share of outliers, and distance in brackets)\n";
    text
}

fn still(args: &Args, cameras: &[Camera], seeds: Seeds, out: &Out) -> Result<Found> {
    let found = static_scene(&args.stream.open(&args.measured, out)?, cameras, seeds)?;
    let mut text = format!(
        "{} static pixels, mean rate {:.4} spikes a readout; distances are sums of |ln(model / measured)|, of the recording's own errors {:.3}\n",
        found.pixels, found.mean_rate, found.floor
    );
    let mut row = |m: &SceneRow| {
        let (near, far) = (m.distance, m.slow_distance);
        text += &format!("{:<14} distance {near:.3}, beyond lag 8 {far:.3}\n", m.name);
        json!({"name": m.name, "distance": near, "slow_distance": far, "behind": m.behind, "behind_error": m.behind_error})
    };
    let models: Vec<Value> = found.models.iter().map(&mut row).collect();
    text += &format!("{}\n{}", bands(&found), found.verdict());
    text.push('\n');
    let summary = json!({"pixels": found.pixels, "mean_rate": found.mean_rate, "floor": found.floor, "models": models, "verdict": found.verdict()});
    Ok(Found { all: to_value(&found)?, page: found.page()?, summary, text, features: None })
}

/// Windows of the recording and of every camera, told apart.
fn windows(args: &Args, cameras: &[Camera], seeds: Seeds, out: &Out) -> Result<Found> {
    let options = RealismOptions {
        window: args.window,
        simulated: usize::from(args.simulated),
        longest: args.longest,
        rows: args.rows.clone(),
        drifting: args.drifting,
        seeds,
        dark: args.dark.as_deref().map(dark_map).transpose()?,
    };
    let recording = args.stream.open(&args.measured, out)?;
    let mut progress = Files::new(out);
    let found = realism(&recording, cameras, &options, &mut |name, share| progress.step(name, share))?;
    drop(progress);
    let mut text = format!(
        "{} windows at {} places, mean rate {:.4}; {:.1} % of the pixels left out\n",
        found.windows,
        found.places,
        found.rate,
        100.0 * found.left_out
    );
    let mut row = |r: &RealismRow| {
        let tell = r.tells.first().map_or("", |t| t.name.as_str());
        let open = if r.is_decided() { "" } else { "; not decided with this much data" };
        text += &format!(
            "{:<14} told {:.3} ({:.2} to {:.2}), floor {:.3}; most by {tell}{open}\n",
            r.name, r.auc.value, r.auc.low, r.auc.high, r.floor.value
        );
        json!({"name": r.name, "auc": r.auc, "floor": r.floor, "decided": r.is_decided(), "tell": tell})
    };
    let models: Vec<Value> = found.rows.iter().map(&mut row).collect();
    let lines = found.numbers.iter().map(|n| n.text() + "\n").collect::<String>();
    let head = found.numbers.first().map_or_else(String::new, |n| n.head() + "\n");
    text += &format!(
        "\n{head}{lines}(D in readouts squared; early and late intervals in a million)\n\n{}\n",
        found.verdict()
    );
    let summary = json!({
        "numbers": found.numbers,
        "windows": found.windows, "places": found.places, "rate": found.rate, "left_out": found.left_out,
        "models": models, "verdict": found.verdict(),
    });
    let (page, features) = (found.page()?, Some(found.features.clone()));
    Ok(Found { all: to_value(&found)?, page, summary, text, features })
}

/// Rates of every pixel in the dark.
fn dark_map(path: &Path) -> Result<Vec<f64>> {
    let bytes = std::fs::read(path).map_err(|e| Error::io(path.display(), e))?;
    let (_, rates) = spikelane::unstable::npy::read_values(&path.display().to_string(), &bytes)?;
    if rates.is_empty() || rates.iter().any(|r| !(0.0..=1.0).contains(r)) {
        return Err(Error::new(Kind::Input, path.display())
            .found("rates outside of 0 to 1, or none")
            .expected("spikes a readout in the dark, one per pixel"));
    }
    Ok(rates)
}

/// `SIDE,READOUTS`.
fn window(text: &str) -> std::result::Result<Window, String> {
    let parsed = text.split_once(',').and_then(|(side, readouts)| {
        Some(Window { side: side.trim().parse().ok()?, readouts: readouts.trim().parse().ok()? })
    });
    parsed.filter(|w| w.side >= 4 && w.readouts >= 20).ok_or_else(|| {
        format!("`{text}`: give SIDE,READOUTS with 4 pixels and 20 readouts or more, such as 32,100")
    })
}

/// `FROM..TO`.
fn rows(text: &str) -> std::result::Result<std::ops::Range<usize>, String> {
    let parsed =
        text.split_once("..").and_then(|(from, to)| Some(from.trim().parse().ok()?..to.trim().parse().ok()?));
    parsed.filter(|r| r.start < r.end).ok_or_else(|| format!("`{text}`: give FROM..TO, such as 100..180"))
}
