//! `spikelane compare`: models against a measured camera.

use std::path::PathBuf;

use clap::Args as ClapArgs;

use spikelane::calibrate::RecordingSet;
use spikelane::compare::{MODELS, grey_levels, static_scene};
use spikelane::draws::Seeds;
use spikelane::error::{Error, Kind, Result};
use spikelane::formats::{Layout, Reader};
use spikelane::presets;
use spikelane::spikes::Geometry;

/// Compare presets or camera files with a recording set (.toml) or one static recording.
#[derive(Debug, ClapArgs)]
pub struct Args {
    /// A recording set, or a stream.
    measured: PathBuf,
    /// Presets or camera files; the paper's five and `physical` when none is given.
    cameras: Vec<String>,
    /// Width of a headerless stream.
    #[arg(long)]
    width: Option<u32>,
    /// Height of a headerless stream.
    #[arg(long)]
    height: Option<u32>,
    /// Layout of the stream.
    #[arg(long)]
    layout: Option<String>,
    /// Longest simulation of a level, in readouts.
    #[arg(long, default_value_t = 2000)]
    longest: usize,
    /// Seed of the models.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Folder for comparison.json and comparison.html.
    #[arg(short, long, default_value = "comparison")]
    out: PathBuf,
    /// Replace existing files.
    #[arg(long)]
    force: bool,
}

/// Runs the command.
///
/// # Errors
/// When an input is bad, or a file cannot be written.
pub fn run(args: &Args) -> Result<()> {
    let names: Vec<&str> = if args.cameras.is_empty() {
        MODELS.to_vec()
    } else {
        args.cameras.iter().map(String::as_str).collect()
    };
    let cameras = names.into_iter().map(presets::load).collect::<Result<Vec<_>>>()?;
    let seeds = Seeds { camera: args.seed, shot: args.seed, sequence: 0 };
    let json_error = |e| Error::new(Kind::Config, "comparison").found(e);
    let is_set = args.measured.extension().is_some_and(|e| e == "toml");
    let (json, html) = if is_set {
        let set = RecordingSet::open(&args.measured)?;
        let found = grey_levels(&set, &cameras, seeds, args.longest)?;
        for model in &found.models {
            println!(
                "{:<14} response {:.5}, histograms {:.4?}",
                model.name, model.response_distance, model.histogram_distance
            );
        }
        println!("{:<14} response {:.5}, histograms {:.4?}", "noise floor", found.floor.0, found.floor.1);
        (serde_json::to_string_pretty(&found).map_err(json_error)?, found.page()?)
    } else {
        let geometry = args.width.zip(args.height).map(|(w, h)| Geometry::new(w, h)).transpose()?;
        let layout = args.layout.as_deref().map(Layout::parse).transpose()?;
        let found = static_scene(&Reader::open(&args.measured, layout, geometry)?, &cameras, seeds)?;
        println!(
            "{} static pixels, mean rate {:.4}, noise floor {:.3}",
            found.pixels, found.mean_rate, found.floor
        );
        for model in &found.models {
            println!(
                "{:<14} distance {:.3}, beyond lag 8 {:.3}",
                model.name, model.distance, model.slow_distance
            );
        }
        (serde_json::to_string_pretty(&found).map_err(json_error)?, found.page()?)
    };
    std::fs::create_dir_all(&args.out).map_err(|e| Error::io(args.out.display(), e))?;
    spikelane::storage::write_small(&args.out.join("comparison.json"), json.as_bytes(), args.force)?;
    spikelane::storage::write_small(&args.out.join("comparison.html"), html.as_bytes(), args.force)
}
