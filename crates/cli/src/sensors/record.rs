//! Implements `spikelane record`, which simulates recording sets and predicts their precision.

use std::path::{Path, PathBuf};

use clap::{Args as ClapArgs, ValueEnum};

use indicatif::DecimalBytes;
use serde_json::{Value, json};
use spikelane::effects::Camera;
use spikelane::error::{Error, Result};
use spikelane::unstable::Count;
use spikelane_calibrate::{Protocol, predict_precision};
use spikelane_io::formats::Layout;
use spikelane_measure::report::insert_present;

use super::template;
use crate::common::{CameraArgs, Console, FileProgress, SeedArgs, claim_files, parse_size};

/// A calibration protocol.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum ProtocolKind {
    /// Dark, flats, steps and a checkerboard
    Recommended,
    /// The 25 gray levels of the SCSim paper
    Gray,
    /// Dark, and pairs of sources, each alone and both together
    Additive,
}

/// Simulate the recordings of a calibration protocol, or predict the precision
#[derive(Debug, ClapArgs)]
pub(crate) struct Args {
    /// Same as --camera
    #[arg(value_name = "CAMERA", conflicts_with = "camera")]
    positional_camera: Option<String>,
    #[command(flatten)]
    camera: CameraArgs,
    /// Write streams to this folder
    ///
    /// The command also writes recordings.toml, which lists the recordings with their light, to this folder.
    #[arg(short, long, value_name = "DIR", default_value = "recordings")]
    output: PathBuf,
    /// Choose recommended, gray or additive
    ///
    /// recommended is a dark recording, flat fields, steps and a checkerboard. gray is the 25 gray levels of the SCSim
    /// paper. additive is a dark recording and four pairs of sources, each alone and both together, without known light.
    #[arg(long, value_enum, value_name = "NAME", hide_possible_values = true, default_value_t = ProtocolKind::Recommended)]
    protocol: ProtocolKind,
    /// Set the readouts per recording
    #[arg(long, value_name = "N", default_value_t = 10_000)]
    readouts: u32,
    /// Simulate lamps that deviate by this share
    ///
    /// The share is the standard deviation of the light of each lamp or source, relative to the stated light.
    /// recordings.toml states it as the uncertainty.
    #[arg(long, value_name = "SHARE", default_value_t = 0.0)]
    lamp_error: f64,
    #[command(flatten)]
    seeds: SeedArgs,
    /// Only list your own recordings in DIR/recordings.toml
    ///
    /// In recordings.toml, replace the placeholder of each recording with the light of the recording.
    #[arg(long, value_name = "DIR", conflicts_with_all = ["dry_run", "output", "protocol", "lamp_error"])]
    template: Option<PathBuf>,
    /// Only print the precision by number of readouts
    #[arg(long)]
    dry_run: bool,
    /// Overwrite existing files
    #[arg(long)]
    force: bool,
}

impl Args {
    /// Returns the remedy of an interrupted command. It describes the remaining files.
    pub(crate) fn interrupt_message(&self) -> String {
        format!(
            "the unfinished recording is removed, and complete recordings remain in '{}'; run the command again with --force",
            self.output.display()
        )
    }
}

/// Runs the command.
///
/// # Errors
/// If the camera is unknown, or if a file cannot be written.
pub(crate) fn run(args: &Args, out: &Console) -> Result<()> {
    if let Some(folder) = &args.template {
        return write_template(folder, args, out);
    }
    let camera = args.camera.camera_or(args.positional_camera.as_deref())?;
    let mut protocol = match args.protocol {
        ProtocolKind::Recommended => Protocol::recommended(args.readouts),
        ProtocolKind::Gray => Protocol::gray_levels(args.readouts),
        ProtocolKind::Additive => Protocol::additive(args.readouts),
    };
    protocol.lamp_error = args.lamp_error;
    let (rows, mut text) = precision_table(&protocol, &camera);
    let bytes = protocol.recording_bytes(&camera);
    text += &format!("{}, {}\n", Count(protocol.recordings.len(), "recording"), DecimalBytes(bytes));
    if args.dry_run {
        return out.print_result(&json!({"event": "dry-run", "precision": rows, "bytes": bytes}), &text);
    }
    out.print_message(text.trim_end());
    if let Some(caveat) = Layout::Dat.caveat(camera.sensor.geometry) {
        out.print_message(format_args!("note: {caveat}"));
    }
    let names =
        protocol.recordings.iter().flat_map(|(stem, _)| ["dat", "json"].map(|e| format!("{stem}.{e}")));
    let files = names.chain(["recordings.toml".to_owned()]).map(|name| args.output.join(name));
    // The claim lasts until the last file has its final name.
    let _claim = claim_files(files, args.force)?;
    let mut progress = FileProgress::new(out);
    let recorded =
        protocol.record(&camera, args.seeds.seeds(), &args.output, args.force, &mut |name, share| {
            progress.update(name, share);
        })?;
    drop(progress);
    if let Some((stem, fault)) = recorded.exposure_faults.first() {
        out.print_message(format_args!(
            "warning: {} of {} have unsuitable light: {}",
            recorded.exposure_faults.len(),
            Count(protocol.recordings.len(), "recording"),
            fault.warning(stem)
        ));
    }
    let file = recorded.path.display().to_string();
    let event = json!({"event": "done", "file": file, "precision": rows, "bytes": bytes});
    out.print_result(&event, &format!("{file}\n"))
}

/// Writes a recording set for the recordings in a folder, and prints the next step.
fn write_template(folder: &Path, args: &Args, out: &Console) -> Result<()> {
    // The folder must exist, because its recordings are listed.
    std::fs::metadata(folder).map_err(|e| Error::io(folder.display(), e))?;
    let _claim = claim_files([folder.join("recordings.toml")], args.force)?;
    let changes = &args.camera.changes;
    let (size, hz) = (parse_size("size", changes.width, changes.height)?, changes.readout_hz);
    let file = template::write(folder, size, hz.map(|hz| hz.hz()), args.force)?.display().to_string();
    let text = format!("{file}: add the light of each recording, then run 'spikelane calibrate {file}'\n");
    out.print_result(&json!({"event": "done", "file": file}), &text)
}

/// Returns the predicted precision of a calibration for 1,000 to 100,000 readouts per level, and for the requested
/// number of readouts.
fn precision_table(protocol: &Protocol, camera: &Camera) -> (Vec<Value>, String) {
    let mut lengths = vec![1_000, 3_000, 10_000, 30_000, 100_000, protocol.readouts];
    lengths.sort_unstable();
    lengths.dedup();
    let mut text = "readouts per level   gain of a pixel   dark rate of a pixel\n".to_owned();
    let mut rows = Vec::new();
    for p in lengths.into_iter().filter_map(|n| predict_precision(protocol, camera, n)) {
        // Without dark current the dark rate is 0, so it has no relative error.
        let dark = p.dark_rate_error.is_finite().then_some(p.dark_rate_error);
        let dark_text = dark.map_or("no dark current".to_owned(), |d| format!("{:.4} %", 100.0 * d));
        text += &format!("{:>18}   {:>13.5} %   {dark_text:>20}\n", p.readouts, 100.0 * p.gain_error);
        let row = json!({"readouts": p.readouts, "gain_error": p.gain_error});
        rows.push(insert_present(row, [("dark_rate_error", dark.map(Into::into))]));
    }
    (rows, text)
}
