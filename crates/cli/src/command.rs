//! The commands and what holds for all of them.

use clap::{Parser, Subcommand};

use super::bench;
use super::making::{dataset, live, scene, simulate};
use super::sensors::{calibrate, compare, diagnose, measure, record};
use super::streams::{convert, evaluate, inspect, partials, reconstruct, verify};
use super::words::{completions, effects, man, preset};

/// Simulate spike cameras: light in, bit-packed spike streams out.
///
/// Without a command it draws a driving scene, simulates it into ./out and says what it did.
/// Exit codes: 0 done, 2 usage, 3 camera or preset, 4 input, 5 system, 6 no space,
/// 7 output exists, 8 ffmpeg, 9 digest does not match, 10 another process writes it, 11 no
/// memory, 75 queue it again, 130 interrupted.
#[derive(Parser)]
#[command(name = "spikelane", version, max_term_width = 100)]
pub(super) struct Cli {
    #[command(subcommand)]
    pub(super) command: Option<Command>,
    /// Print one JSON object a line to standard output; text for people goes to standard error
    #[arg(long, global = true)]
    pub(super) json: bool,
    /// Also say how the time was spent
    #[arg(short, long, global = true)]
    pub(super) verbose: bool,
    /// Record absolute paths in sidecars and reports as they were given, not the file names alone
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
    Preset(preset::Args),
    Effects(effects::Args),
    Measure(measure::Args),
    Calibrate(calibrate::Args),
    Compare(compare::Args),
    Diagnose(diagnose::Args),
    Record(record::Args),
    Scene(scene::Args),
    Dataset(Box<dataset::Args>),
    Bench(bench::BenchArgs),
    Completions(completions::Args),
    Man(man::Args),
}
