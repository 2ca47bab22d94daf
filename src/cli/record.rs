//! `spikelane record`: synthetic recording sets, and what their length will give.

use std::path::PathBuf;

use clap::{Args as ClapArgs, ValueEnum};

use spikelane::calibrate::{Protocol, predict};
use spikelane::draws::Seeds;
use spikelane::error::Result;
use spikelane::presets;

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
pub struct Args {
    /// Preset or camera file.
    camera: String,
    /// Folder for the recordings and recordings.toml.
    #[arg(short, long, default_value = "recordings")]
    out: PathBuf,
    /// Which recordings to make.
    #[arg(long, value_enum, default_value_t = Kind::Recommended)]
    protocol: Kind,
    /// Readouts of each recording.
    #[arg(long, default_value_t = 10_000)]
    readouts: u32,
    /// Seed of the camera's fixed pattern.
    #[arg(long, default_value_t = 1)]
    camera_seed: u64,
    /// Seed of the temporal noise.
    #[arg(long, default_value_t = 2)]
    shot_seed: u64,
    /// Only say which precision how many readouts will give.
    #[arg(long)]
    plan: bool,
    /// Replace existing files.
    #[arg(long)]
    force: bool,
}

/// Runs the command.
///
/// # Errors
/// When the camera is unknown, or a file cannot be written.
pub fn run(args: &Args) -> Result<()> {
    let camera = presets::load(&args.camera)?;
    let protocol = match args.protocol {
        Kind::Recommended => Protocol::recommended(args.readouts),
        Kind::Grey => Protocol::grey_levels(args.readouts),
    };
    println!("readouts a level   gain of a pixel   dark rate of a pixel");
    for readouts in [1_000, 3_000, 10_000, 30_000, 100_000] {
        if let Some(p) = predict(&protocol, &camera, readouts) {
            println!("{readouts:>16}   {:>13.5} %   {:>18.4} %", 100.0 * p.gain, 100.0 * p.dark);
        }
    }
    if args.plan {
        return Ok(());
    }
    println!("{} recordings, {:.2} GB", protocol.recordings.len(), protocol.bytes(&camera) as f64 / 1e9);
    let seeds = Seeds { camera: args.camera_seed, shot: args.shot_seed, sequence: 0 };
    let bar = indicatif::ProgressBar::new(1000);
    let path = protocol.record(&camera, seeds, &args.out, args.force, &mut |name, share| {
        bar.set_message(name.to_owned());
        bar.set_position((share * 1000.0) as u64);
    })?;
    bar.finish_and_clear();
    println!("{}", path.display());
    Ok(())
}
