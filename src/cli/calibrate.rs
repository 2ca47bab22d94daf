//! `spikelane calibrate`: from recordings to a camera file.

use std::path::PathBuf;

use clap::Args as ClapArgs;

use spikelane::calibrate::{Options, RecordingSet, SneeOptions, calibrate, observe, snee, write};
use spikelane::error::Result;

/// Fit a camera to recordings of known light.
#[derive(Debug, ClapArgs)]
pub struct Args {
    /// The recording set (TOML).
    recordings: PathBuf,
    /// Folder for camera.toml with its maps, calibration.json and report.html.
    #[arg(short, long, default_value = "calibration")]
    out: PathBuf,
    /// Share of the first increment after a spike that the reset loses.
    #[arg(long, default_value_t = 0.002)]
    dead_time: f64,
    /// Relative uncertainty of the light levels.
    #[arg(long, default_value_t = 1e-3)]
    light_uncertainty: f64,
    /// Refuse a set that gives the gain of a pixel less precisely than this (relative).
    #[arg(long)]
    precision: Option<f64>,
    /// Also run the SCSim paper's estimator, and say what it could not identify.
    #[arg(long)]
    snee: bool,
    /// With --snee: take the conversion rate from the dynamic range, not from the levels.
    #[arg(long, requires = "snee")]
    levels_unknown: bool,
    /// Replace existing files.
    #[arg(long)]
    force: bool,
}

/// Runs the command.
///
/// # Errors
/// When the set is bad, or a file cannot be written.
pub fn run(args: &Args) -> Result<()> {
    let set = RecordingSet::open(&args.recordings)?;
    let bar = indicatif::ProgressBar::new(1000);
    let observed = observe(&set, &mut |name, share| {
        bar.set_message(name.to_owned());
        bar.set_position((share * 1000.0) as u64);
    })?;
    bar.finish_and_clear();
    let options = Options {
        lost_increment: args.dead_time,
        light_uncertainty: args.light_uncertainty,
        precision: args.precision,
        ..Options::default()
    };
    let calibration = calibrate(&observed, &options)?;
    let files = write(&calibration, &args.out, args.force)?;
    for note in &calibration.notes {
        println!("{note}");
    }
    println!("{}\n{}\n{}", files.camera.display(), files.json.display(), files.report.display());
    if args.snee {
        let options = SneeOptions { levels_known: !args.levels_unknown, ..SneeOptions::default() };
        let found = snee(&observed, &options)?;
        println!(
            "The paper's estimator put {:.1} % of the thresholds on the edge of its box of +-{:.0} %: there the split into C_S and V_S is the box, not a measurement.",
            100.0 * found.on_box,
            100.0 * options.box_width
        );
    }
    Ok(())
}
