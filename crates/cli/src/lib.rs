//! The command-line interface of spikelane. Each command has its own file. This crate uses only the public interfaces
//! of the libraries.

mod benchmark;
mod check;
mod command;
mod common;
mod generate;
mod meta;
mod sensors;
mod speed;
mod streams;

use std::ffi::OsString;

use spikelane::unstable::kernels::Backend;
use spikelane::{ErrorKind, Result};

use command::Command;
use common::{Console, console, progress, run_interruptible};
use generate::{dataset, first_run, live, scene, simulate};
use meta::{effects, generated, help, preset};
use sensors::{calibrate, compare, diagnose, measure, record};
use streams::{convert, evaluate, inspect, partials, reconstruct, verify, view};

/// Runs the command line of this process and returns the exit code.
///
/// The function allocates nothing before it has checked that memory is available. The arguments, the handler of failed
/// allocations and the stack need memory before any error can be reported.
#[must_use]
pub fn main_of_process() -> u8 {
    if common::limits::has_memory_to_start() {
        main(std::env::args_os())
    } else {
        ErrorKind::Memory.exit_code()
    }
}

/// Runs the command line `args` and returns the exit code. The first argument is the program name.
///
/// This function is the whole program. Host programs that embed the command line call it. It prints to the standard
/// output and standard error of the process and handles Ctrl-C.
pub fn main(args: impl IntoIterator<Item = impl Into<OsString>>) -> u8 {
    // The handler comes first, because every allocation can fail.
    #[cfg(unix)]
    let _abort_handler = common::limits::AbortHandler::new();
    let args: Vec<OsString> = args.into_iter().map(Into::into).collect();
    let cli = match help::parse(&args) {
        Ok(cli) => cli,
        Err(code) => return code,
    };
    console::remember_command(&args, cli.record_paths);
    let out = Console::new(cli.json, cli.verbose);
    common::limits::ignore_file_size_signal();
    // The library ignores an unknown name in `SPIKELANE_BACKEND`. The program reports the name as an error.
    let run = || Backend::from_environment().and_then(|_| dispatch(cli.command, &out));
    let done = common::limits::run_within_memory(run);
    progress::release_signals();
    match done {
        Ok(()) => 0,
        Err(error) => {
            out.print_error(&error);
            error.kind().exit_code()
        }
    }
}

/// Runs a command that can be interrupted and then has written nothing.
fn nothing_written(command: impl FnOnce() -> Result<()>) -> Result<()> {
    run_interruptible("nothing was written", command)
}

/// Runs a command that can be interrupted and then has removed its unfinished files.
fn unfinished_removed(command: impl FnOnce() -> Result<()>) -> Result<()> {
    run_interruptible("unfinished files are removed", command)
}

fn dispatch(command: Option<Command>, out: &Console) -> Result<()> {
    match command {
        None => first_run::run(out),
        Some(Command::Simulate(args)) => unfinished_removed(|| simulate::run(&args, out)),
        Some(Command::Live(args)) => live::run(&args, out),
        Some(Command::Inspect(args)) => nothing_written(|| inspect::run(&args, out)),
        Some(Command::Convert(args)) => unfinished_removed(|| convert::run(&args, out)),
        Some(Command::Verify(args)) => verify::run(&args, out),
        Some(Command::Partials(args)) => partials::run(&args, out),
        Some(Command::Reconstruct(args)) => unfinished_removed(|| reconstruct::run(&args, out)),
        Some(Command::Evaluate(args)) => nothing_written(|| evaluate::run(&args, out)),
        Some(Command::View(args)) => view::run(&args, out),
        Some(Command::Preset(args)) => nothing_written(|| preset::run(&args, out)),
        Some(Command::Effects(args)) => effects::run(&args, out),
        Some(Command::Measure(args)) => nothing_written(|| measure::run(&args, out)),
        Some(Command::Calibrate(args)) => nothing_written(|| calibrate::run(&args, out)),
        Some(Command::Compare(args)) => nothing_written(|| compare::run(&args, out)),
        Some(Command::Diagnose(args)) => {
            run_interruptible(args.interrupt_message(), || diagnose::run(&args, out))
        }
        Some(Command::Record(args)) => {
            run_interruptible(args.interrupt_message(), || record::run(&args, out))
        }
        Some(Command::Check(args)) => nothing_written(|| check::run(&args, out)),
        Some(Command::Scene(args)) => unfinished_removed(|| scene::run(&args, out)),
        Some(Command::Dataset(args)) => dataset::run(&args, out),
        Some(Command::Benchmark(args)) => benchmark::run(&args, out),
        Some(Command::Speed(args)) => speed::run(&args, out.json()),
        Some(Command::Completions(args)) => generated::print_completions(&args, help::command(), out),
        Some(Command::Man(args)) => {
            unfinished_removed(|| generated::print_manual(&args, help::command(), out))
        }
    }
}
