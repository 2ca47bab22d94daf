//! Implements `spikelane preset`.

use std::path::PathBuf;

use clap::Subcommand;
use serde_json::json;
use spikelane::effects::Maps;
use spikelane::{Result, Seeds, presets};
use spikelane_io::simulate::{CameraFacts, save_camera};

use crate::common::{CameraChanges, Console, claim_files};

/// List and print cameras
#[derive(clap::Args, Debug)]
pub(crate) struct Args {
    #[command(subcommand)]
    action: Action,
}

#[derive(Subcommand, Debug)]
enum Action {
    /// List presets and known camera formats
    List,
    /// Print a camera in the format that --camera reads
    Show(Box<ShowArgs>),
}

#[derive(clap::Args, Debug)]
struct ShowArgs {
    /// Print this preset or camera file (.toml)
    name: String,
    #[command(flatten)]
    changes: CameraChanges,
    /// Write DIR/camera.toml and maps [default: print]
    ///
    /// By default, the camera file is printed.
    #[arg(short, long, value_name = "DIR")]
    output: Option<PathBuf>,
    /// Also store a fixed pattern as maps
    ///
    /// The camera file then describes the individual camera that --camera-seed selects, instead of a kind of camera.
    #[arg(long, requires = "output")]
    maps: bool,
    /// Set the seed of the fixed pattern
    #[arg(long, value_name = "N", default_value_t = 0, requires = "maps")]
    camera_seed: u64,
    /// Overwrite existing files
    #[arg(long, requires = "output")]
    force: bool,
}

pub(crate) fn run(args: &Args, out: &Console) -> Result<()> {
    match &args.action {
        Action::List => list_presets(out),
        Action::Show(args) => show_camera(args, out),
    }
}

/// Advice on selecting a preset. `docs/reference/presets.md` contains the reasons.
const PRESET_ADVICE: &str = "\
Use physical in place of a real camera. Use vidar-measured for a camera with the maps and the noise of a measured
400x250 camera, and vidar-lowlight for a camera that is configured for low light. The other presets reproduce a published
model or program, for comparison with its results (docs/reference/presets.md).

";

fn list_presets(out: &Console) -> Result<()> {
    for preset in presets::ALL {
        let camera = presets::builtin(preset.name)?;
        let source = camera.source.split_whitespace().collect::<Vec<_>>().join(" ");
        let names: Vec<_> = camera.effects().iter().map(|e| e.name()).collect();
        out.print_result(
            &json!({"preset": preset.name, "source": source, "effects": names}),
            &format!("{:14} {source}\n", preset.name),
        )?;
    }
    if !out.json() {
        out.print_result(&json!(null), PRESET_ADVICE)?;
    }
    for format in presets::SENSOR_FORMATS {
        let (width, height) = format.size;
        out.print_result(
            &json!({"camera_format": format.name, "width": width, "height": height, "readout_hz": format.readout_hz}),
            &format!("--camera-format {:14} {width}x{height} at {} Hz\n", format.name, format.readout_hz),
        )?;
    }
    Ok(())
}

fn show_camera(args: &ShowArgs, out: &Console) -> Result<()> {
    let mut camera = args.changes.apply(presets::load(&args.name)?)?;
    if args.maps {
        let seeds = Seeds { camera: args.camera_seed, ..Seeds::default() };
        let circuit = camera.model(seeds)?.circuit;
        camera.maps = Maps {
            gain: Some(circuit.gain),
            dark_pa: Some(circuit.dark_pa),
            capacitance_ff: Some(circuit.capacitance_ff),
            swing_v: Some(circuit.swing_v),
        };
    }
    if let Some(folder) = &args.output {
        let _claim = claim_files([folder.join("camera.toml")], args.force)?;
        let path = save_camera(&camera, folder, args.force)?;
        out.print_message(path.display());
        return out.print_event(&json!({"event": "done", "file": path.display().to_string()}));
    }
    let facts = CameraFacts::new(&camera)?;
    let untouched =
        args.changes.is_empty().then(|| presets::ALL.iter().find(|p| p.name == args.name)).flatten();
    // A preset without changes is printed as its original text, which contains comments.
    let text = untouched.map_or(facts.toml.clone(), |preset| preset.text.to_owned());
    out.print_result(&json!({"camera": facts}), &text)
}
