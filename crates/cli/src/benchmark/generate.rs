//! Implements `spikelane benchmark generate`.

use std::path::PathBuf;

use crate::common::{Console, CountProgress, ThreadArgs, event, stop_flag};
use indicatif::DecimalBytes;
use spikelane::Result;
use spikelane::unstable::Count;
use spikelane_benchmark::generated::{self, GenerateOptions, GenerateReport};
use spikelane_benchmark::suite::Suite;

/// Generate the streams, references and labels of a suite
///
/// The bits are the same on every machine, and the printed digest states them. After an interruption, --resume continues
/// after the last finished sequence.
#[derive(clap::Args, Debug)]
pub(crate) struct Args {
    /// Generate this suite: a name, or the path of a suite file
    suite: String,
    #[command(flatten)]
    output: GenerateArgs,
}

/// Flags of the commands that generate a suite.
#[derive(clap::Args, Debug)]
pub(super) struct GenerateArgs {
    /// Write the suite to this folder
    #[arg(short, long, value_name = "DIR")]
    pub(super) output: PathBuf,
    /// Also generate this split, such as train (repeatable)
    #[arg(long, value_name = "NAME")]
    split: Vec<String>,
    /// Continue an interrupted generation
    ///
    /// Existing sequences are verified, and changed sequences are generated again.
    #[arg(long)]
    resume: bool,
    /// Print the size of the suite and write nothing
    #[arg(long)]
    dry_run: bool,
    #[command(flatten)]
    threads: ThreadArgs,
}

/// Runs the command.
///
/// # Errors
/// Those of [`generated::generate`].
pub(crate) fn run(args: &Args, out: &Console) -> Result<()> {
    generate(&Suite::load(&args.suite)?, &args.output, out)
}

/// Generates a suite and prints its digest.
pub(super) fn generate(suite: &Suite, args: &GenerateArgs, out: &Console) -> Result<()> {
    let options = GenerateOptions {
        output: args.output.clone(),
        splits: args.split.clone(),
        threads: args.threads.thread_count(out),
        resume: args.resume,
    };
    if args.dry_run {
        let estimate = generated::estimate(suite, &options)?;
        let event = event("estimate", &estimate)?;
        let text = format!(
            "{} to generate: {}, about {}\n",
            Count(estimate.sequences, "sequence"),
            Count(estimate.readouts, "readout"),
            DecimalBytes(estimate.bytes)
        );
        return out.print_result(&event, &text);
    }
    let mut progress = CountProgress::with_unit(out, stop_flag()?, "sequences");
    let report = generated::generate(suite, &options, &mut |p| {
        progress.update(p.finished_sequences as u64, Some(p.sequence_count as u64))
    })?;
    drop(progress);
    print_report(suite, args, &report, out)
}

fn print_report(suite: &Suite, args: &GenerateArgs, report: &GenerateReport, out: &Console) -> Result<()> {
    if let Some(mismatch) = suite.publication_mismatch(&report.digest) {
        out.print_message(mismatch);
    }
    for note in &report.notes {
        out.print_message(format_args!("warning: {note}"));
    }
    let place = args.output.display();
    let text = format!("{place}: {} generated, {} verified\n", report.generated, report.verified);
    let mut event = event("done", report)?;
    event["output"] = place.to_string().into();
    if let Some(published) = suite.published_digest() {
        event["published_digest"] = published.into();
    }
    out.print_result(&event, &format!("{text}digest {}\n", report.digest))
}
