//! `spikelane record`: synthetic recording sets, and what their length will give.

use std::path::{Path, PathBuf};

use clap::{Args as ClapArgs, ValueEnum};

use indicatif::DecimalBytes;
use serde_json::{Value, json};
use spikelane::effects::Camera;
use spikelane::error::{Error, Result};
use spikelane_calibrate::{Protocol, predict};
use spikelane_io::formats::Layout;
use spikelane_measure::report::with_known;

use super::template;
use crate::shared::camera::CameraArgs;
use crate::shared::output::Out;
use crate::shared::outputs;
use crate::shared::progress::Files;
use crate::shared::seeds::SeedArgs;
use crate::shared::stream;

/// Which recordings.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum Kind {
    /// Dark, flats, steps and a checkerboard.
    Recommended,
    /// The 25 grey levels of the SCSim paper.
    Grey,
}

/// Simulate all recordings of a calibration protocol, or plan their length.
#[derive(Debug, ClapArgs)]
pub(crate) struct Args {
    /// The same as --camera
    #[arg(value_name = "CAMERA", conflicts_with = "camera")]
    named: Option<String>,
    #[command(flatten)]
    camera: CameraArgs,
    /// Folder for the recordings and recordings.toml
    #[arg(short, long, value_name = "DIR", default_value = "recordings")]
    output: PathBuf,
    /// Which recordings to make.
    #[arg(long, value_enum, default_value_t = Kind::Recommended)]
    protocol: Kind,
    /// Readouts of each recording.
    #[arg(long, default_value_t = 10_000)]
    readouts: u32,
    #[command(flatten)]
    seeds: SeedArgs,
    /// Make no recording: write FOLDER/recordings.toml, which lists the recordings of your own camera in FOLDER and
    /// waits for the light of each
    #[arg(long, value_name = "FOLDER", conflicts_with_all = ["plan", "output", "protocol"])]
    template: Option<PathBuf>,
    /// Only say which precision how many readouts will give.
    #[arg(long)]
    plan: bool,
    /// Replace existing files.
    #[arg(long)]
    force: bool,
}

impl Args {
    /// What stays after a stop.
    pub(crate) fn kept(&self) -> String {
        format!(
            "the unfinished recording is removed, complete ones stay in '{}'; run the command again with --force",
            self.output.display()
        )
    }
}

/// Runs the command.
///
/// # Errors
/// When the camera is unknown, or a file cannot be written.
pub(crate) fn run(args: &Args, out: &Out) -> Result<()> {
    if let Some(folder) = &args.template {
        return of_own_recordings(folder, args, out);
    }
    let camera = args.camera.named(args.named.as_deref())?;
    let protocol = match args.protocol {
        Kind::Recommended => Protocol::recommended(args.readouts),
        Kind::Grey => Protocol::grey_levels(args.readouts),
    };
    let (rows, mut text) = plan(&protocol, &camera);
    let bytes = protocol.bytes(&camera);
    text += &format!("{} recordings, {}\n", protocol.recordings.len(), DecimalBytes(bytes));
    if args.plan {
        return out.result(&json!({"event": "plan", "precision": rows, "bytes": bytes}), &text);
    }
    out.say(text.trim_end());
    if let Some(caveat) = Layout::Dat.caveat(camera.sensor.geometry) {
        out.say(format_args!("note: {caveat}"));
    }
    let names =
        protocol.recordings.iter().flat_map(|(stem, _)| ["dat", "json"].map(|e| format!("{stem}.{e}")));
    let files = names.chain(["recordings.toml".to_owned()]).map(|name| args.output.join(name));
    // Held until the last file has its name.
    let _claim = outputs::claim(files, args.force)?;
    let mut progress = Files::new(out);
    let path =
        protocol.record(&camera, args.seeds.seeds(), &args.output, args.force, &mut |name, share| {
            progress.step(name, share);
        })?;
    drop(progress);
    let file = path.display().to_string();
    let event = json!({"event": "done", "file": file, "precision": rows, "bytes": bytes});
    out.result(&event, &format!("{file}\n"))
}

/// Writes the set of a folder of recordings, and says what is left to do.
fn of_own_recordings(folder: &Path, args: &Args, out: &Out) -> Result<()> {
    // The folder has to be there: its recordings are what is listed.
    std::fs::metadata(folder).map_err(|e| Error::io(folder.display(), e))?;
    let _claim = outputs::claim([folder.join("recordings.toml")], args.force)?;
    let changes = &args.camera.changes;
    let (size, hz) = (stream::size("size", changes.width, changes.height)?, changes.readout_hz);
    let file = template::write(folder, size, hz.map(|hz| hz.hz()), args.force)?.display().to_string();
    let text = format!("{file}: put in the light of each recording, then 'spikelane calibrate {file}'\n");
    out.result(&json!({"event": "done", "file": file}), &text)
}

/// The precision of lengths from 1,000 to 100,000 readouts, and the one asked for.
fn plan(protocol: &Protocol, camera: &Camera) -> (Vec<Value>, String) {
    let mut lengths = vec![1_000, 3_000, 10_000, 30_000, 100_000, protocol.readouts];
    lengths.sort_unstable();
    lengths.dedup();
    let mut text = "readouts a level   gain of a pixel   dark rate of a pixel\n".to_owned();
    let mut rows = Vec::new();
    for p in lengths.into_iter().filter_map(|n| predict(protocol, camera, n)) {
        // Of a camera without dark current no error is relative.
        let dark = p.dark.is_finite().then_some(p.dark);
        let said = dark.map_or("no dark current".to_owned(), |d| format!("{:.4} %", 100.0 * d));
        text += &format!("{:>16}   {:>13.5} %   {said:>20}\n", p.readouts, 100.0 * p.gain);
        let row = json!({"readouts": p.readouts, "gain": p.gain});
        rows.push(with_known(row, [("dark", dark.map(Into::into))]));
    }
    (rows, text)
}
