//! `spikelane preset`.

use std::path::PathBuf;

use clap::Subcommand;
use serde_json::json;
use spikelane::effects::Maps;
use spikelane::{Result, Seeds, presets};
use spikelane_io::simulate::{CameraFacts, save_camera};

use crate::shared::camera::Changes;
use crate::shared::output::Out;
use crate::shared::outputs;

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
    /// Print a camera as a file that --camera reads back
    Show(Show),
}

#[derive(clap::Args, Debug)]
struct Show {
    /// Preset, or camera file (.toml)
    name: String,
    #[command(flatten)]
    changes: Changes,
    /// Write DIR/camera.toml, with its maps beside it, instead of printing
    #[arg(short, long, value_name = "DIR")]
    output: Option<PathBuf>,
    /// Draw the fixed pattern of --camera-seed and keep it as maps: one camera instead of a kind
    #[arg(long, requires = "output")]
    maps: bool,
    /// Seed of the fixed pattern: which camera of its kind it is
    #[arg(long, value_name = "N", default_value_t = 0, requires = "maps")]
    camera_seed: u64,
    /// Overwrite files of the same name
    #[arg(long, requires = "output")]
    force: bool,
}

pub(crate) fn run(args: &Args, out: &Out) -> Result<()> {
    match &args.action {
        Action::List => list(out),
        Action::Show(args) => show(args, out),
    }
}

/// Which of them; `docs/reference/presets.md` says why.
const TAKE: &str = "\
To stand in for a real camera take physical, vidar-measured for one with the maps and the noise of the 400x250 camera, or
vidar-lowlight for one set up for low light.
The others reproduce a published model or a program, for comparison with its results (docs/reference/presets.md).

";

fn list(out: &Out) -> Result<()> {
    for preset in presets::ALL {
        let camera = presets::builtin(preset.name)?;
        let source = camera.source.split_whitespace().collect::<Vec<_>>().join(" ");
        let names: Vec<_> = camera.effects().iter().map(|e| e.name()).collect();
        out.result(
            &json!({"preset": preset.name, "source": source, "effects": names}),
            &format!("{:14} {source}\n", preset.name),
        )?;
    }
    if !out.json() {
        out.result(&json!(null), TAKE)?;
    }
    for format in presets::FORMATS {
        let (width, height) = format.size;
        out.result(
            &json!({"camera_format": format.name, "width": width, "height": height, "readout_hz": format.readout_hz}),
            &format!("--camera-format {:14} {width}x{height} at {} Hz\n", format.name, format.readout_hz),
        )?;
    }
    Ok(())
}

fn show(args: &Show, out: &Out) -> Result<()> {
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
        let _claim = outputs::claim([folder.join("camera.toml")], args.force)?;
        let path = save_camera(&camera, folder, args.force)?;
        out.say(path.display());
        return out.event(&json!({"event": "done", "file": path.display().to_string()}));
    }
    let facts = CameraFacts::new(&camera)?;
    let untouched =
        args.changes.are_none().then(|| presets::ALL.iter().find(|p| p.name == args.name)).flatten();
    // A preset nobody changed comes with its comments.
    let text = untouched.map_or(facts.toml.clone(), |preset| preset.text.to_owned());
    out.result(&json!({"camera": facts}), &text)
}
