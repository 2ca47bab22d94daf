//! `spikelane compare`: models against a measured camera.

use std::path::PathBuf;

use clap::Args as ClapArgs;

use crate::calibrate::RecordingSet;
use crate::compare::{CameraDistance, MODELS, SceneComparison, SceneRow, grey_levels, static_scene};
use crate::draws::Seeds;
use crate::effects::Camera;
use crate::error::{Error, Kind, Result};
use crate::presets;
use crate::storage::{refuse_existing, write_small};
use serde_json::{Value, json};

use super::output::Out;
use super::progress::Files;
use super::seeds::SeedArgs;
use super::stream::{StreamArgs, warn_of_set};

/// Compare presets or camera files with a recording set (.toml) or one static recording.
#[derive(Debug, ClapArgs)]
pub struct Args {
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
    /// Longest simulation of a level, in readouts.
    #[arg(long, default_value_t = 2000)]
    longest: usize,
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
pub fn run(args: &Args, out: &Out) -> Result<()> {
    refuse_existing(&args.output, &["comparison.json", "comparison.html"], args.force)?;
    let given = args.named.iter().chain(&args.camera).map(String::as_str);
    let names: Vec<&str> = if given.clone().next().is_none() { MODELS.to_vec() } else { given.collect() };
    let cameras = names.into_iter().map(presets::load).collect::<Result<Vec<_>>>()?;
    let seeds = args.seeds.seeds();
    let is_set = args.measured.extension().is_some_and(|e| e == "toml");
    let found = if is_set { grey(args, &cameras, seeds, out)? } else { still(args, &cameras, seeds, out)? };
    std::fs::create_dir_all(&args.output).map_err(|e| Error::io(args.output.display(), e))?;
    let put = |name: &str, text: &str| {
        let path = args.output.join(name);
        write_small(&path, text.as_bytes(), args.force).map(|()| path.display().to_string())
    };
    let json_error = |e| Error::new(Kind::Config, "comparison").found(e);
    let all = serde_json::to_string_pretty(&found.all).map_err(json_error)?;
    let files = [put("comparison.json", &all)?, put("comparison.html", &found.page)?];
    let mut summary = found.summary;
    summary["event"] = json!("done");
    summary["files"] = json!(files);
    out.result(&summary, &format!("{}{}\n{}\n", found.text, files[0], files[1]))
}

/// What a comparison leaves: everything, the page, and the distances as JSON and as text.
struct Found {
    all: Value,
    page: String,
    summary: Value,
    text: String,
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
        text += &format!("{name:<14} response {response:.5}, histograms {}\n", cells.join(" "));
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
        "{} static pixels, mean rate {:.4}, noise floor {:.3}\n",
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
    Ok(Found { all: to_value(&found)?, page: found.page()?, summary, text })
}
