//! Implements `spikelane benchmark`.

mod generate;
mod list;
mod report;
mod run;
mod score;
mod seal;
mod verify;

use std::path::Path;
use std::sync::atomic::Ordering;

use clap::Subcommand;

use crate::common::{Console, StopSignal, run_interruptible};
use spikelane::{Error, ErrorKind, Result};
use spikelane_benchmark::generated::GeneratedSuite;

/// Score spike pipelines on suites of scenes
///
/// A suite is a text file with scenes, cameras and seeds. `generate` writes the same bits on every machine, `run` runs a
/// method on every stream and scores its outputs, and `report` compares methods.
#[derive(clap::Args, Debug)]
pub(crate) struct Args {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand, Debug)]
enum Command {
    List(list::Args),
    Generate(generate::Args),
    Run(run::Args),
    Score(score::Args),
    Report(report::Args),
    Verify(verify::Args),
    Seal(seal::SealArgs),
    Reveal(seal::RevealArgs),
}

const SEQUENCES_KEPT_MESSAGE: &str = "finished sequences are kept; continue with --resume";
const NOTHING_WRITTEN_MESSAGE: &str = "nothing was written";

/// Opens a generated suite, and prints a message if its digest differs from the published digest.
fn open_suite(folder: &Path, out: &Console) -> Result<GeneratedSuite> {
    let data = GeneratedSuite::open(folder)?;
    if let Some(mismatch) = data.suite.publication_mismatch(&data.digest) {
        out.print_message(mismatch);
    }
    Ok(data)
}

/// Returns an error if the stop flag is set.
fn check_stop(stop: &StopSignal) -> Result<()> {
    if stop.load(Ordering::Relaxed) {
        return Err(Error::new(ErrorKind::Interrupted, "stopped on request").remedy(SEQUENCES_KEPT_MESSAGE));
    }
    Ok(())
}

/// Runs the command.
///
/// # Errors
/// The errors of the subcommands.
pub(crate) fn run(args: &Args, out: &Console) -> Result<()> {
    match &args.command {
        Command::List(args) => list::run(args, out),
        Command::Generate(args) => run_interruptible(SEQUENCES_KEPT_MESSAGE, || generate::run(args, out)),
        Command::Run(args) => run_interruptible(SEQUENCES_KEPT_MESSAGE, || run::run(args, out)),
        Command::Score(args) => run_interruptible(NOTHING_WRITTEN_MESSAGE, || score::run(args, out)),
        Command::Report(args) => run_interruptible(NOTHING_WRITTEN_MESSAGE, || report::run(args, out)),
        Command::Verify(args) => run_interruptible(NOTHING_WRITTEN_MESSAGE, || verify::run(args, out)),
        Command::Seal(args) => run_interruptible(NOTHING_WRITTEN_MESSAGE, || seal::run_seal(args, out)),
        Command::Reveal(args) => run_interruptible(SEQUENCES_KEPT_MESSAGE, || seal::run_reveal(args, out)),
    }
}
