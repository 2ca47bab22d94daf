//! `spikelane dataset`.

mod description;
mod merge;
mod plan;
mod preview;
mod run;
mod said;
mod stats;
mod status;
mod watcher;

use indicatif::DecimalBytes;
use serde_json::json;

use crate::shared::output::Out;
use crate::shared::progress::stoppable;
use description::Description;
use said::{say_apart, say_copied, say_skipped};
use spikelane::{Error, Kind, Result};
use spikelane_dataset::{self as dataset, DatasetOptions, Estimate, Report, Work, config};
use spikelane_io::formats::Layout;
use watcher::Watcher;

/// Make a dataset of random driving scenes, or of all videos and image folders below a folder
///
/// Every sequence gets noise of its own, a noisy and a clean stream, and a record with the digest
/// of every file. Interrupt it at any time; --resume verifies what is there and makes the rest.
/// On many machines: plan, run each shard, merge.
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
    description: Description,
    /// Print the data set as a dataset.toml, and make nothing
    #[arg(hide_short_help = true, long)]
    write: bool,
    /// Go on with a dataset that was begun
    #[arg(long)]
    resume: bool,
    /// Say what it would take, and write nothing
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
/// As [`dataset::make`]; [`Kind::Input`] at the end when sequences were set aside.
pub(crate) fn run(args: &Args, out: &Out) -> Result<()> {
    match &args.command {
        Some(Command::Plan(args)) => plan::run(args, out),
        Some(Command::Run(args)) => run::run(args, out),
        Some(Command::Status(args)) => status::run(args, out),
        Some(Command::Merge(args)) => merge::run(args, out),
        Some(Command::Stats(args)) => stoppable("nothing was written", || stats::run(args, out)),
        Some(Command::Preview(args)) => stoppable("unfinished files are removed", || preview::run(args, out)),
        None => make(args, out),
    }
}

fn make(args: &Args, out: &Out) -> Result<()> {
    let options = DatasetOptions { resume: args.resume, ..args.description.options(out)? };
    if args.write {
        return write(&options, out);
    }
    let estimate = dataset::estimate(&options)?;
    if let Work::Inputs(inputs) = &options.work {
        say_skipped(inputs, &options, out)?;
    }
    if let Some(caveat) = Layout::Dat.caveat(options.camera.sensor.geometry) {
        out.say(format_args!("note: {caveat}"));
    }
    forecast(&estimate, args.dry_run, out)?;
    if args.dry_run {
        return Ok(());
    }
    let mut watcher = Watcher::new(out)?;
    let report = dataset::make(&options, &mut |p| watcher.step(p));
    watcher.bar.finish_and_clear();
    tell(&options, &report?, out)
}

/// Prints the dataset as text.
fn write(options: &DatasetOptions, out: &Out) -> Result<()> {
    options.check()?;
    let written = config::write(options)?;
    if let Some((name, _)) = written.maps.first() {
        return Err(Error::new(Kind::Usage, "--write")
            .found(format_args!("a camera with maps, such as {name}"))
            .expected("a camera that is text alone")
            .remedy("name its file in a dataset.toml of your own: camera = \"camera.toml\""));
    }
    out.bytes(written.text.as_bytes())
}

/// What it will take: the result of a dry run, else said beforehand.
fn forecast(estimate: &Estimate, result: bool, out: &Out) -> Result<()> {
    let unknown = match estimate.unknown {
        0 => String::new(),
        n => format!(", and {n} of unknown length"),
    };
    let text = format!(
        "{} sequences to make: {} readouts, about {}{unknown}",
        estimate.sequences,
        estimate.readouts,
        DecimalBytes(estimate.bytes)
    );
    let event = json!({
        "event": "estimate", "sequences": estimate.sequences, "readouts": estimate.readouts,
        "bytes": estimate.bytes, "unknown": estimate.unknown,
    });
    if result {
        return out.result(&event, &format!("{text}\n"));
    }
    out.say(text);
    out.event(&event)
}

fn tell(options: &DatasetOptions, report: &Report, out: &Out) -> Result<()> {
    let place = options.output.display();
    let text =
        format!("{place}: {} made, {} verified, {} set aside\n", report.made, report.verified, report.failed);
    let text = format!("{text}digest {}\n", report.digest);
    let set_aside: Vec<_> =
        report.set_aside.iter().map(|(input, why)| json!({"input": input, "reason": why})).collect();
    let event = json!({
        "event": "done", "output": place.to_string(), "made": report.made, "verified": report.verified,
        "failed": report.failed, "set_aside": set_aside, "too_fast": report.too_fast, "needed_readout_hz": report.needed_readout_hz,
        "digest": report.digest, "copied": report.copied,
    });
    out.result(&event, &text)?;
    say_apart(&report.set_aside, &report.notes, out);
    say_copied(report.copied, out);
    if report.too_fast > 0 {
        out.say(format_args!(
            "warning: {} of the scenes made move by more than half a pixel from one readout to the next; \
             every readout was then drawn anew, which is slow but exact. From {} readouts a second \
             (--readout-hz) they would not, nor with a smaller picture or a lower --speed-kmh",
            report.too_fast, report.needed_readout_hz
        ));
    }
    if report.failed == 0 {
        return Ok(());
    }
    Err(Error::new(Kind::Input, options.output.join("manifest.jsonl").display())
        .found(format_args!("{} sequences set aside", report.failed))
        .expected("none")
        .remedy("the manifest says why; mend the inputs and go on with --resume"))
}
