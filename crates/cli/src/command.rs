//! The commands and the global flags.

use clap::{Parser, Subcommand};

use super::benchmark;
use super::check;
use super::generate::{dataset, live, scene, simulate};
use super::meta::{effects, generated, preset};
use super::sensors::{calibrate, compare, diagnose, measure, record};
use super::speed;
use super::streams::{convert, evaluate, inspect, partials, reconstruct, verify, view};

/// Simulate spike cameras: convert light to bit-packed spike streams
///
/// Without a command, spikelane draws a driving scene, simulates it into ./out and prints a summary.
///
/// Exit codes: 0 success, 2 usage, 3 camera or preset, 4 input, 5 system, 6 disk full, 7 output exists, 8 ffmpeg, 9
/// digest mismatch, 10 locked by another process, 11 out of memory, 75 stopped (queue the command again), 130
/// interrupted.
#[derive(Parser)]
#[command(name = "spikelane", version, max_term_width = 100)]
pub(super) struct Cli {
    #[command(subcommand)]
    pub(super) command: Option<Command>,
    /// Print the result as JSON, one object per line
    ///
    /// With --json, messages for people are printed to standard error.
    #[arg(long, global = true)]
    pub(super) json: bool,
    /// Also print the run time of simulation parts
    ///
    /// With --verbose, the command simulate prints the time spent on waiting for light, on the kernels and on writing
    /// to the disk.
    #[arg(short, long, global = true)]
    pub(super) verbose: bool,
    /// Record absolute paths in sidecars and reports
    ///
    /// By default, only the file name of an absolute path is recorded.
    #[arg(long, global = true, hide_short_help = true)]
    pub(super) record_paths: bool,
}

#[derive(Subcommand)]
pub(super) enum Command {
    Simulate(Box<simulate::Args>),
    Live(Box<live::Args>),
    Inspect(inspect::Args),
    Convert(convert::Args),
    Verify(verify::Args),
    Partials(partials::Args),
    Reconstruct(reconstruct::Args),
    Evaluate(evaluate::Args),
    View(Box<view::Args>),
    Preset(preset::Args),
    Effects(effects::Args),
    Measure(measure::Args),
    Calibrate(calibrate::Args),
    Compare(compare::Args),
    Diagnose(diagnose::Args),
    Record(record::Args),
    Check(check::Args),
    Scene(scene::Args),
    Dataset(Box<dataset::Args>),
    Benchmark(Box<benchmark::Args>),
    Speed(speed::SpeedArgs),
    Completions(generated::CompletionsArgs),
    Man(generated::ManArgs),
}
