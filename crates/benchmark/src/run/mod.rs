//! Runs a method on every scored sequence of a generated suite.
//!
//! A method is a baseline, a command that is started once for each sequence, or a server that answers one request for
//! each sequence. The program that called this program can be the server. A method has no state between sequences: a
//! command ends, and a server must reset its state.
//!
//! A method reads a copy of each stream in a private folder, which contains no reference. On Linux, a sandbox hides the
//! folders of the suite and of the run from commands and servers; see [`SandboxOptions`].
//!
//! The folder of a run contains `run.json`, the outputs `outputs/GROUP/ID.npy`, and one file `results/GROUP/ID.json` for
//! each finished sequence. An interrupted run continues after the last finished sequence.

mod baseline;
mod command_template;
mod orphans;
mod process;
mod result;
mod sandbox;
mod server;
mod worker;
mod workspace;

use std::path::{Path, PathBuf};
use std::time::Duration;

use serde::{Deserialize, Serialize};

use spikelane::error::{Error, ErrorKind, Result, Setting};
use spikelane::unstable::inputs::{
    Access, InnerPath, PlainName, deserialize_digest, not_found_as_none, read_bytes, utf8_bytes,
};
use spikelane_io::storage::{self, Digest, OutputSet, folders};

use crate::generated::{GeneratedSequence, GeneratedSuite};
use crate::suite::Task;
use result::result_path;
use worker::Worker;

pub use baseline::Baseline;
pub use command_template::CommandTemplate;
pub(crate) use process::one_line;
pub use result::SequenceResult;
pub(crate) use result::{is_positive, read_result};
pub use sandbox::{SandboxOptions, SandboxState};

/// Name of the file that describes a run.
const RUN_FILE: &str = "run.json";

/// Version of the format of `run.json`.
const FORMAT_VERSION: u32 = 1;

/// Maximum size of `run.json` in bytes.
const MAX_RUN_BYTES: u64 = 1 << 20;

/// The method of a run.
#[derive(Clone, Debug, Deserialize, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
#[non_exhaustive]
pub enum Method {
    /// A baseline of this crate.
    Baseline(String),
    /// A command that is started for each sequence; see [`CommandTemplate`].
    Command(String),
    /// A command that is started once and reads one request for each sequence.
    Server(String),
    /// The program that called this program. It answers requests like a server.
    Caller(String),
    /// Outputs that another program wrote into the folder of the run.
    Outputs(String),
}

impl Method {
    /// Returns the name in reports.
    #[must_use]
    pub fn name(&self) -> &str {
        let (Self::Baseline(text)
        | Self::Command(text)
        | Self::Server(text)
        | Self::Caller(text)
        | Self::Outputs(text)) = self;
        text
    }

    /// Checks the method for a task.
    ///
    /// # Errors
    /// [`ErrorKind::Usage`] if the baseline is unknown, or if the command is invalid or lacks a placeholder.
    pub fn check(&self, task: Task) -> Result<()> {
        let missing = |text: &str, found: &str, expected: &str| {
            Err(Error::new(ErrorKind::Usage, format_args!("command `{text}`"))
                .found(found)
                .expected(expected))
        };
        match self {
            Self::Baseline(name) => Baseline::find(name, task).map(drop),
            Self::Command(text) => {
                let command = CommandTemplate::parse(text)?;
                if command.has_placeholder("stream") && command.has_placeholder("output") {
                    return Ok(());
                }
                missing(
                    text,
                    "no {stream} or no {output}",
                    "both, for the paths of the stream and the output",
                )
            }
            Self::Server(text) => match CommandTemplate::parse(text)?.has_placeholders() {
                false => Ok(()),
                true => missing(text, "a placeholder", "none: a server reads the paths from its requests"),
            },
            Self::Caller(_) | Self::Outputs(_) => Ok(()),
        }
    }

    /// Returns whether a process that exceeds the time limit has a fault. A baseline has no limit.
    pub(crate) const fn has_time_limit(&self) -> bool {
        matches!(self, Self::Command(_) | Self::Server(_) | Self::Caller(_))
    }
}

/// How a method is run.
#[derive(Clone, Debug)]
pub struct RunOptions {
    /// Folder of the run.
    pub output: PathBuf,
    /// The method.
    pub method: Method,
    /// Longest time for one sequence.
    pub time_limit: Duration,
    /// Whether to continue an interrupted run.
    pub resume: bool,
    /// The files that the processes of a command or a server can read and write.
    pub sandbox: SandboxOptions,
    /// Whether to end processes that left the process group of the method. Only Linux supports this.
    ///
    /// This process then becomes the parent of all detached descendants, also after the run. It must not start other
    /// processes during the run, because they would be ended too.
    pub adopts_orphans: bool,
}

/// The content of `run.json`.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct RunDescription {
    format_version: u32,
    /// Name of the suite.
    pub suite: PlainName,
    /// Version of the suite.
    pub version: String,
    /// Digest of the suite.
    #[serde(deserialize_with = "deserialize_digest")]
    pub digest: String,
    /// The method.
    pub method: Method,
    /// Longest time for one sequence in seconds.
    pub time_limit_s: f64,
    /// Whether the processes were restricted. `None` if the method starts no process.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sandbox: Option<SandboxState>,
}

impl RunDescription {
    /// Returns the longest time of a sequence without a fault in seconds, or `None` without a limit.
    pub(crate) fn limit(&self) -> Option<f64> {
        self.method.has_time_limit().then_some(self.time_limit_s)
    }
}

/// The progress of a run.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct RunProgress<'a> {
    /// Number of finished sequences.
    pub finished: u64,
    /// Number of all sequences.
    pub total: u64,
    /// The last finished sequence and its fault, if it failed.
    pub fault: Option<(&'a str, &'a str)>,
}

/// The number of sequences of a run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct RunReport {
    /// Sequences that this call ran.
    pub run: u64,
    /// Sequences that an earlier call had finished.
    pub kept: u64,
    /// Sequences that failed, including those of earlier calls.
    pub failed: u64,
}

/// Returns the path of an output in the folder of a run.
pub(crate) fn output_path(task: Task, group: &PlainName, id: &PlainName) -> InnerPath {
    InnerPath::from("outputs").join(group).join(id.with_ending(task.output_extension()))
}

/// Runs a method on every scored sequence.
///
/// A failure of the method is recorded and costs only the score of its sequence. `check_stop` is called often, and its
/// error ends the run. Finished sequences remain.
///
/// # Errors
/// * [`ErrorKind::Corrupt`] if a stream was changed or shortened. The error names the stream.
/// * [`ErrorKind::Exists`] if the folder contains a run and `resume` is false.
/// * [`ErrorKind::Config`] if the folder contains a run of another suite or method.
/// * [`ErrorKind::Tool`] if the program of the method cannot be started, or if a process of the method does not end.
/// * [`ErrorKind::Usage`] if the method is invalid, or if the sandbox allows a folder of the suite or of the run.
pub fn run(
    data: &GeneratedSuite,
    options: &RunOptions,
    check_stop: &mut dyn FnMut() -> Result<()>,
    progress: &mut dyn FnMut(RunProgress<'_>) -> Result<()>,
) -> Result<RunReport> {
    options.method.check(data.suite.task)?;
    let _claim = OutputSet::claim_folder(&options.output)?;
    // An invalid method or sandbox leaves no run.
    let mut worker = Worker::new(data, options)?;
    let limit = begin(data, options)?.limit();
    let total = data.scored().count() as u64;
    let mut report = RunReport::default();
    for (group, sequence) in data.scored() {
        let result_path = result_path(&group.name, &sequence.id);
        let name = format!("{}/{}", group.name, sequence.id);
        let old = read_result(&options.output, &group.name, &sequence.id, limit)?;
        let result = match old {
            Some(result) => {
                report.kept += 1;
                result
            }
            None => {
                check_stop()?;
                let stream = sequence.stream().ok_or_else(|| {
                    Error::new(ErrorKind::Config, &name).found("no stream").expected("a generated sequence")
                })?;
                let stream = data.verified_path(&group.name, &sequence.id, stream)?;
                let inner = output_path(data.suite.task, &group.name, &sequence.id);
                folders::remove(&options.output, &inner)?;
                let outcome = worker.run(sequence, &stream, check_stop)?;
                if let Some(bytes) = &outcome.output {
                    storage::write_small_unsynced(&folders::create_parents(&options.output, &inner)?, bytes)?;
                }
                let result = SequenceResult {
                    seconds: outcome.process.seconds,
                    memory_peak_bytes: outcome.process.memory_peak_bytes,
                    fault: outcome.process.fault,
                };
                let path = folders::create_parents(&options.output, &result_path)?;
                let text = serde_json::to_vec(&result)
                    .map_err(|e| Error::new(ErrorKind::Config, path.display()).found(e))?;
                storage::write_small(&path, &text, true)?;
                report.run += 1;
                result
            }
        };
        report.failed += u64::from(result.fault.is_some());
        progress(RunProgress {
            finished: report.run + report.kept,
            total,
            fault: result.fault.as_deref().map(|fault| (name.as_str(), fault)),
        })?;
    }
    Ok(report)
}

/// Reads the description of a run. Returns `None` if the folder has no `run.json`.
///
/// # Errors
/// [`ErrorKind::Config`] if the file is invalid.
pub fn read_description(folder: &Path) -> Result<Option<RunDescription>> {
    let path = InnerPath::from(RUN_FILE).resolve_in(folder, Access::Read)?;
    let Some(text) = not_found_as_none(read_bytes(&path, "a run", MAX_RUN_BYTES))? else { return Ok(None) };
    let run: RunDescription = serde_json::from_slice(&utf8_bytes(&text))
        .map_err(|e| Error::new(ErrorKind::Config, path.display()).found(e))?;
    if run.format_version != FORMAT_VERSION {
        return Err(Error::new(ErrorKind::Config, path.display())
            .found(format_args!("version {} of the format", run.format_version))
            .expected(FORMAT_VERSION));
    }
    Ok(Some(run))
}

/// Returns the bytes and the digest of an output, or `None` if the file does not exist.
pub(crate) fn read_output(
    folder: &Path,
    task: Task,
    group: &PlainName,
    sequence: &GeneratedSequence,
) -> Result<Option<(Vec<u8>, String)>> {
    let path = output_path(task, group, &sequence.id).resolve_in(folder, Access::Read)?;
    let bytes = read_bytes(&path, "an output", max_output_bytes(sequence));
    let Some(bytes) = not_found_as_none(bytes)? else { return Ok(None) };
    let digest = Digest::hash_bytes(&bytes);
    Ok(Some((bytes, digest)))
}

/// Returns the largest accepted size of an output: three values of 8 bytes for each pixel, and 1 MiB.
fn max_output_bytes(sequence: &GeneratedSequence) -> u64 {
    24 * u64::from(sequence.width) * u64::from(sequence.height) + (1 << 20)
}

/// Writes `run.json`, or compares it with the run to continue.
fn begin(data: &GeneratedSuite, options: &RunOptions) -> Result<RunDescription> {
    let description = RunDescription {
        format_version: FORMAT_VERSION,
        suite: data.suite.name.clone(),
        version: data.suite.version.clone(),
        digest: data.digest.clone(),
        method: options.method.clone(),
        time_limit_s: options.time_limit.as_secs_f64(),
        sandbox: options.sandbox.state(&options.method)?,
    };
    let folder = options.output.display();
    match read_description(&options.output)? {
        None => {
            let path = folders::create_parents(&options.output, &RUN_FILE.into())?;
            let text = serde_json::to_vec_pretty(&description)
                .map_err(|e| Error::new(ErrorKind::Config, path.display()).found(e))?;
            storage::write_small(&path, &text, false)?;
            Ok(description)
        }
        Some(_) if !options.resume => Err(Error::new(ErrorKind::Exists, folder)
            .found("an existing run")
            .expected("a folder without a run")
            .remedy(format_args!(
                "set {} to continue this run, or choose another folder",
                Setting("resume")
            ))),
        Some(old) if old == description => Ok(old),
        Some(old) => Err(Error::new(ErrorKind::Config, folder)
            .found(format_args!(
                "a run of `{}` on {} {} with a limit of {} s and {}",
                old.method.name(),
                old.suite,
                old.digest,
                old.time_limit_s,
                old.sandbox.map_or("no sandbox".to_owned(), |state| format!("the sandbox {state}"))
            ))
            .expected("the same method, suite, time limit and sandbox")
            .remedy("choose another folder")),
    }
}
