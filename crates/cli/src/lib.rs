//! The command line: one file per command, on the library's public doors alone.

mod bench;
mod command;
mod making;
mod sensors;
mod shared;
mod streams;
mod words;

use std::ffi::OsString;

use spikelane::Result;
use spikelane::unstable::kernels::Backend;

use command::Command;
use making::{dataset, first_run, live, scene, simulate};
use sensors::{calibrate, compare, diagnose, measure, record};
use shared::output::{self, Out};
use shared::progress::{self, stoppable};
use streams::{convert, evaluate, inspect, partials, reconstruct, verify};
use words::{completions, effects, help, man, preset};

/// Parses `args`, the program's name first, runs the command, and returns the exit code: what `main` of the
/// program does, for hosts that carry the command with them. It prints, and takes the process's Ctrl-C.
pub fn main(args: impl IntoIterator<Item = impl Into<OsString>>) -> u8 {
    let args: Vec<OsString> = args.into_iter().map(Into::into).collect();
    let cli = match help::parse(&args) {
        Ok(cli) => cli,
        Err(code) => return code,
    };
    output::remember_command(&args, cli.record_paths);
    let out = Out::new(cli.json, cli.verbose);
    shared::limits::report_file_size();
    // The library falls back to the fastest; who asks for a backend by name wants that one.
    let done = Backend::from_environment().and_then(|_| dispatch(cli.command, &out));
    progress::release_signals();
    match done {
        Ok(()) => 0,
        Err(error) => {
            out.error(&error);
            error.kind().exit_code()
        }
    }
}

/// What stays of a command that was stopped.
const NOTHING: &str = "nothing was written";
const UNFINISHED: &str = "unfinished files are removed";

fn dispatch(command: Option<Command>, out: &Out) -> Result<()> {
    match command {
        None => first_run::run(out),
        Some(Command::Simulate(args)) => stoppable(UNFINISHED, || simulate::run(&args, out)),
        Some(Command::Live(args)) => live::run(&args, out),
        Some(Command::Inspect(args)) => stoppable(NOTHING, || inspect::run(&args, out)),
        Some(Command::Convert(args)) => stoppable(UNFINISHED, || convert::run(&args, out)),
        Some(Command::Verify(args)) => verify::run(&args, out),
        Some(Command::Partials(args)) => partials::run(&args, out),
        Some(Command::Reconstruct(args)) => stoppable(UNFINISHED, || reconstruct::run(&args, out)),
        Some(Command::Evaluate(args)) => stoppable(NOTHING, || evaluate::run(&args, out)),
        Some(Command::Preset(args)) => stoppable(NOTHING, || preset::run(&args, out)),
        Some(Command::Effects(args)) => effects::run(&args, out),
        Some(Command::Measure(args)) => stoppable(NOTHING, || measure::run(&args, out)),
        Some(Command::Calibrate(args)) => stoppable(NOTHING, || calibrate::run(&args, out)),
        Some(Command::Compare(args)) => stoppable(NOTHING, || compare::run(&args, out)),
        Some(Command::Diagnose(args)) => stoppable(args.kept(), || diagnose::run(&args, out)),
        Some(Command::Record(args)) => stoppable(args.kept(), || record::run(&args, out)),
        Some(Command::Scene(args)) => stoppable(UNFINISHED, || scene::run(&args, out)),
        Some(Command::Dataset(args)) => dataset::run(&args, out),
        Some(Command::Bench(args)) => bench::run(&args, out.json()),
        Some(Command::Completions(args)) => completions::run(&args, help::command(), out),
        Some(Command::Man(args)) => stoppable(UNFINISHED, || man::run(&args, help::command(), out)),
    }
}
