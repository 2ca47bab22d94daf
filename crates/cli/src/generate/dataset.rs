//! Implements `spikelane dataset`.

mod merge;
mod messages;
mod plan;
mod preview;
mod progress;
mod run;
mod spec;
mod stats;
mod status;

use indicatif::DecimalBytes;

use crate::common::{Console, event, run_interruptible};
use messages::{print_copied_files, print_failures, print_skipped_files};
use progress::DatasetProgress;
use spec::DatasetSpec;
use spikelane::unstable::Count;
use spikelane::{Error, ErrorKind, Result};
use spikelane_dataset::{self as dataset, Content, DatasetEstimate, DatasetOptions, DatasetReport, config};
use spikelane_io::formats::Layout;

/// Generate a dataset from driving scenes, videos or image folders
///
/// Every sequence has its own noise, a noisy and a clean stream, and a record with the digests of all files. You can
/// interrupt the command at any time: --resume verifies the finished
/// sequences and generates the remaining sequences.
///
/// On several machines, use 'dataset plan', 'dataset run' for each shard, and 'dataset merge'.
#[derive(clap::Args, Clone, Debug)]
#[command(
    args_conflicts_with_subcommands = true,
    subcommand_negates_reqs = true,
    disable_help_subcommand = true
)]
pub(crate) struct Args {
    #[command(subcommand)]
    command: Option<Command>,
    #[command(flatten)]
    description: DatasetSpec,
    /// Print the dataset as a dataset.toml, and generate nothing
    #[arg(hide_short_help = true, long)]
    print_config: bool,
    /// Resume an interrupted dataset
    #[arg(long)]
    resume: bool,
    /// Only print the required readouts and bytes
    #[arg(long)]
    dry_run: bool,
}

#[derive(clap::Subcommand, Clone, Debug)]
enum Command {
    Plan(Box<plan::Args>),
    Run(run::Args),
    Status(status::Args),
    Merge(merge::Args),
    Stats(stats::Args),
    Preview(preview::Args),
}

/// Runs the command.
///
/// # Errors
/// Those of [`dataset::generate`]. After all sequences, [`ErrorKind::Input`] if sequences failed.
pub(crate) fn run(args: &Args, out: &Console) -> Result<()> {
    match &args.command {
        Some(Command::Plan(args)) => plan::run(args, out),
        Some(Command::Run(args)) => run::run(args, out),
        Some(Command::Status(args)) => status::run(args, out),
        Some(Command::Merge(args)) => merge::run(args, out),
        Some(Command::Stats(args)) => run_interruptible("nothing was written", || stats::run(args, out)),
        Some(Command::Preview(args)) => {
            run_interruptible("unfinished files are removed", || preview::run(args, out))
        }
        None => generate(args, out),
    }
}

fn generate(args: &Args, out: &Console) -> Result<()> {
    let options = DatasetOptions { resume: args.resume, ..args.description.options(out)? };
    if args.print_config {
        return print_config(&options, out);
    }
    let estimate = dataset::estimate(&options)?;
    if let Content::Inputs(inputs) = &options.content {
        print_skipped_files(inputs, &options, out)?;
    }
    if let Some(caveat) = Layout::Dat.caveat(options.camera.sensor.geometry) {
        out.print_message(format_args!("note: {caveat}"));
    }
    print_estimate(&estimate, args.dry_run, out)?;
    if args.dry_run {
        return Ok(());
    }
    let mut watcher = DatasetProgress::new(out)?;
    let report = dataset::generate(&options, &mut |p| watcher.update(p));
    watcher.bar.clear();
    print_report(&options, &report?, out)
}

/// Prints the dataset as a dataset.toml.
fn print_config(options: &DatasetOptions, out: &Console) -> Result<()> {
    options.check()?;
    let written = config::to_toml(options)?;
    if let Some((name, _)) = written.maps.first() {
        return Err(Error::new(ErrorKind::Usage, "--print-config")
            .found(format_args!("a camera with maps, such as {name}"))
            .expected("a camera without maps")
            .remedy(
                "write your own dataset.toml with the name of the camera file: camera = \"camera.toml\"",
            ));
    }
    out.print_bytes(written.text.as_bytes())
}

/// Prints the estimated size of the dataset. If `result` is true, the estimate is printed as the result of a dry run.
/// Otherwise it is printed as a message before the work starts.
fn print_estimate(estimate: &DatasetEstimate, result: bool, out: &Console) -> Result<()> {
    let unknown = match estimate.inputs_of_unknown_length {
        0 => String::new(),
        n => format!(", and {n} of unknown length"),
    };
    let text = format!(
        "{} to generate: {}, about {}{unknown}",
        Count(estimate.sequences, "sequence"),
        Count(estimate.readouts, "readout"),
        DecimalBytes(estimate.bytes),
    );
    let event = event("estimate", estimate)?;
    if result {
        return out.print_result(&event, &format!("{text}\n"));
    }
    out.print_message(text);
    out.print_event(&event)
}

fn print_report(options: &DatasetOptions, report: &DatasetReport, out: &Console) -> Result<()> {
    let place = options.output.display();
    let text = format!(
        "{place}: {} generated, {} verified, {} failed\n",
        report.generated, report.verified_sequences, report.failed_sequences
    );
    let text = format!("{text}digest {}\n", report.digest);
    let mut event = event("done", report)?;
    event["output"] = place.to_string().into();
    out.print_result(&event, &text)?;
    print_failures(&report.failures, &report.notes, out);
    print_copied_files(report.copied_files, out);
    if report.too_fast_scenes > 0 {
        out.print_message(format_args!(
            "{}: objects move by more than half a pixel from one readout to the next. Every readout of these scenes was rendered separately, which is exact but slow. For faster scenes, set --readout-hz to at least {}, use a smaller image or reduce --speed-kmh",
            Count(report.too_fast_scenes, "generated scene"),
            report.required_readout_hz,
        ));
    }
    if report.failed_sequences == 0 {
        return Ok(());
    }
    Err(Error::new(ErrorKind::Input, options.output.join("manifest.jsonl").display())
        .found(Count(report.failed_sequences, "failed sequence"))
        .expected("none")
        .remedy("correct the failed inputs, which the manifest lists with the reasons, then continue with --resume"))
}
