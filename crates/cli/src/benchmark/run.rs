//! Implements `spikelane benchmark run`.

use std::path::PathBuf;
use std::time::Duration;

use serde_json::json;

use super::score::write_score;
use super::{check_stop, open_suite};
use crate::common::{Console, CountProgress, stop_flag};
use spikelane::Result;
use spikelane_benchmark::generated::GeneratedSuite;
use spikelane_benchmark::run::{self as benchmark_run, Method, RunOptions, SandboxOptions, SandboxState};

/// Run a method on every sequence of a suite and score the outputs
///
/// A missing or faulty output, a crash and an exceeded time limit cost only the score of their sequence: the sequence has
/// the scores of a trivial answer. The folder of the run contains the outputs and score.json.
///
/// The method reads a copy of each stream in a private folder. On Linux, a command or a server runs in a sandbox: it cannot
/// read the suite and the run, and it can write only to its private folder. All its processes end with the sequence or
/// with the server.
#[derive(clap::Args, Debug)]
#[command(override_usage = "spikelane benchmark run [OPTIONS] <DIR> --output <DIR> <METHOD>")]
pub(crate) struct Args {
    /// Run on the generated suite in this folder
    #[arg(value_name = "DIR")]
    suite: PathBuf,
    #[command(flatten)]
    method: MethodArgs,
    /// Write the run to this folder
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    /// Set the longest time for one sequence in seconds
    #[arg(long, value_name = "SECONDS", default_value_t = 60.0, value_parser = parse_seconds)]
    time_limit: f64,
    /// Continue an interrupted run
    #[arg(long)]
    resume: bool,
    #[command(flatten)]
    sandbox: SandboxArgs,
}

#[derive(clap::Args, Debug)]
#[group(required = true, multiple = false)]
struct MethodArgs {
    /// Start this command for each sequence
    ///
    /// No shell reads the command. Spaces separate words, and quotes enclose spaces. {stream} and {output} are the paths of
    /// the stream and of the output. {width}, {height}, {readouts}, {readout}, {interval}, {readout_hz} and {white_rate}
    /// describe the stream.
    #[arg(long, value_name = "COMMAND", allow_hyphen_values = true)]
    command: Option<String>,
    /// Start this command once and send it one request per sequence
    ///
    /// The server prints `ready`. Then it reads one line of JSON per sequence and answers each with the line `ok`.
    #[arg(long, value_name = "COMMAND", allow_hyphen_values = true)]
    server: Option<String>,
    /// Send the requests of a server to the calling program and set its name in reports
    ///
    /// Requests are lines of standard output, and answers are lines of standard input. The Python function
    /// `spikelane.benchmark.evaluate` uses this flag.
    #[arg(hide_short_help = true, long, value_name = "NAME")]
    caller: Option<String>,
    /// Run a baseline, such as tfp, tfi-blur or span
    #[arg(long, value_name = "NAME")]
    baseline: Option<String>,
}

fn parse_seconds(text: &str) -> std::result::Result<f64, String> {
    match text.parse::<f64>() {
        Ok(seconds) if seconds > 0.0 && seconds <= 1e6 => Ok(seconds),
        _ => Err("expected a number of seconds above 0 and up to 1000000".to_owned()),
    }
}

impl MethodArgs {
    fn method(&self) -> Method {
        match self {
            Self { command: Some(text), .. } => Method::Command(text.clone()),
            Self { server: Some(text), .. } => Method::Server(text.clone()),
            Self { caller: Some(name), .. } => Method::Caller(name.clone()),
            Self { baseline, .. } => Method::Baseline(baseline.clone().unwrap_or_default()),
        }
    }
}

/// Runs the command.
///
/// # Errors
/// Those of [`benchmark_run::run`] and [`spikelane_benchmark::score::score`].
pub(crate) fn run(args: &Args, out: &Console) -> Result<()> {
    let data = open_suite(&args.suite, out)?;
    let options = RunOptions {
        output: args.output.clone(),
        method: args.method.method(),
        time_limit: Duration::from_secs_f64(args.time_limit),
        resume: args.resume,
        sandbox: args.sandbox.options(),
        adopts_orphans: true,
    };
    run_and_score(&data, &options, out)
}

/// Runs a method, writes its score file and prints the scores.
pub(super) fn run_and_score(data: &GeneratedSuite, options: &RunOptions, out: &Console) -> Result<()> {
    print_state(options, out)?;
    let stop = stop_flag()?;
    let mut progress = CountProgress::with_unit(out, stop_flag()?, "sequences");
    let report = benchmark_run::run(data, options, &mut || check_stop(&stop), &mut |p| {
        if let Some((name, fault)) = p.fault {
            out.print_detail(format_args!("failed  {name}: {fault}"));
        }
        progress.update(p.finished, Some(p.total))
    })?;
    drop(progress);
    out.print_event(&json!({
        "event": "run", "output": options.output.display().to_string(), "run": report.run, "kept": report.kept,
        "failed": report.failed,
    }))?;
    write_score(data, &options.output, options.method.name(), true, out)
}

#[derive(clap::Args, Debug)]
pub(super) struct SandboxArgs {
    /// Let the method read only system folders and this folder (repeatable)
    ///
    /// Without this flag, the method can read all files except those of the suite and of the run.
    #[arg(long, value_name = "DIR", conflicts_with = "no_sandbox")]
    allow_read: Vec<PathBuf>,
    /// Also let the method write to this folder, such as a cache (repeatable)
    #[arg(long, value_name = "DIR", conflicts_with = "no_sandbox")]
    allow_write: Vec<PathBuf>,
    /// Run a method that you trust without a sandbox
    #[arg(long)]
    no_sandbox: bool,
}

impl SandboxArgs {
    /// Returns whether a flag is set.
    pub(super) fn is_set(&self) -> bool {
        self.no_sandbox || !self.allow_read.is_empty() || !self.allow_write.is_empty()
    }

    pub(super) fn options(&self) -> SandboxOptions {
        SandboxOptions {
            is_enabled: !self.no_sandbox,
            allow_read: self.allow_read.clone(),
            allow_write: self.allow_write.clone(),
        }
    }
}

/// Prints whether the processes of the method are restricted.
///
/// # Errors
/// Those of [`SandboxOptions::state`].
pub(super) fn print_state(options: &RunOptions, out: &Console) -> Result<()> {
    let Some(state) = options.sandbox.state(&options.method)? else { return Ok(()) };
    out.print_message(match state {
        SandboxState::Active => "sandbox active: the method cannot read the suite and the run",
        SandboxState::Off => "sandbox off: the method can read and change all files of this user",
        _ => {
            "sandbox absent: the method can read and change all files of this user; \
             a sandbox needs Linux 5.13 with Landlock"
        }
    });
    out.print_event(&json!({"event": "sandbox", "state": state}))
}
