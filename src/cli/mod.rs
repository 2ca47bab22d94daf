//! The command line: one file per command, on the library's public doors alone.

mod bench;
mod calibrate;
mod camera;
mod closing;
mod compare;
mod completions;
mod convert;
mod dataset;
mod diagnose;
mod effects;
mod evaluate;
mod first_run;
mod forecast;
mod images;
mod inspect;
mod light;
mod live;
mod man;
mod measure;
mod output;
mod picture;
mod preset;
mod progress;
mod range;
mod reconstruct;
mod record;
mod scene;
mod seeds;
mod simulate;
mod stem;
mod stream;
mod template;
mod threads;
mod verify;
mod video;
mod words;

use std::ffi::OsString;

use crate::Result;
use crate::kernels::Backend;
use clap::{Parser, Subcommand};

use output::Out;

/// Simulate spike cameras: light in, bit-packed spike streams out.
///
/// Without a command it draws a driving scene, simulates it into ./out and says what it did.
/// Exit codes: 0 done, 2 usage, 3 camera or preset, 4 input, 5 system, 6 no space,
/// 7 output exists, 8 ffmpeg, 9 digest does not match, 130 interrupted.
#[derive(Parser)]
#[command(name = "spikelane", version, max_term_width = 100)]
struct Cli {
    #[command(subcommand)]
    command: Option<Command>,
    /// Print one JSON object a line to standard output; text for people goes to standard error
    #[arg(long, global = true)]
    json: bool,
    /// Also say how the time was spent
    #[arg(short, long, global = true)]
    verbose: bool,
}

#[derive(Subcommand)]
enum Command {
    Simulate(Box<simulate::Args>),
    Live(Box<live::Args>),
    Inspect(inspect::Args),
    Convert(convert::Args),
    Verify(verify::Args),
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

/// Parses `args`, the program's name first, runs the command, and returns the exit code: what `main` of the
/// program does, for hosts that carry the command with them. It prints, and takes the process's Ctrl-C.
pub fn main(args: impl IntoIterator<Item = impl Into<OsString>>) -> u8 {
    let args: Vec<OsString> = args.into_iter().map(Into::into).collect();
    let cli = match words::parse(&args) {
        Ok(cli) => cli,
        Err(code) => return code,
    };
    output::remember_command(&args);
    let out = Out::new(cli.json, cli.verbose);
    // The library falls back to the fastest; who asks for a backend by name wants that one.
    match Backend::from_environment().and_then(|_| dispatch(cli.command, &out)) {
        Ok(()) => 0,
        Err(error) => {
            out.error(&error);
            error.kind().exit_code()
        }
    }
}

fn dispatch(command: Option<Command>, out: &Out) -> Result<()> {
    match command {
        None => first_run::run(out),
        Some(Command::Simulate(args)) => simulate::run(&args, out),
        Some(Command::Live(args)) => live::run(&args, out),
        Some(Command::Inspect(args)) => inspect::run(&args, out),
        Some(Command::Convert(args)) => convert::run(&args, out),
        Some(Command::Verify(args)) => verify::run(&args, out),
        Some(Command::Reconstruct(args)) => reconstruct::run(&args, out),
        Some(Command::Evaluate(args)) => evaluate::run(&args, out),
        Some(Command::Preset(args)) => preset::run(&args, out),
        Some(Command::Effects(args)) => effects::run(&args, out),
        Some(Command::Measure(args)) => measure::run(&args, out),
        Some(Command::Calibrate(args)) => calibrate::run(&args, out),
        Some(Command::Compare(args)) => compare::run(&args, out),
        Some(Command::Diagnose(args)) => diagnose::run(&args, out),
        Some(Command::Record(args)) => record::run(&args, out),
        Some(Command::Scene(args)) => scene::run(&args, out),
        Some(Command::Dataset(args)) => dataset::run(&args, out),
        Some(Command::Bench(args)) => bench::run(&args, out.json()),
        Some(Command::Completions(args)) => completions::run(&args, out),
        Some(Command::Man(args)) => man::run(&args, out),
    }
}
