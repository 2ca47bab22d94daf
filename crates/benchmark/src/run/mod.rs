//! Runs a method on every scored sequence of a generated suite.
//!
//! A method is a baseline, a command that is started once for each sequence, or a server that answers one request for
//! each sequence. The program that called this program can be the server. A method has no state between sequences: a command ends, and a server must reset its state.
//!
//! The folder of a run contains `run.json`, the outputs `outputs/GROUP/ID.npy`, and one file `results/GROUP/ID.json` for
//! each finished sequence. An interrupted run continues after the last finished sequence.

mod baseline;
mod command_template;
mod process;

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};
use serde_json::json;

use spikelane::error::{Error, ErrorKind, Result, Setting};
use spikelane::unstable::inputs::{Access, InnerPath, PlainName, not_found_as_none, read_bytes};
use spikelane::unstable::npy::{self, Element};
use spikelane_io::storage::{self, Digest, OutputSet, folders};

use crate::generated::{GeneratedSequence, GeneratedSuite};
use crate::suite::{TRIVIAL_DEPTH_M, Task};
use process::{Caller, ProcessOutcome, Server, run_process};

pub use baseline::Baseline;
pub use command_template::CommandTemplate;
pub(crate) use process::one_line;

/// Name of the file that describes a run.
const RUN_FILE: &str = "run.json";

/// Version of the format of `run.json`.
const FORMAT_VERSION: u32 = 1;

/// Maximum sizes of `run.json` and of a result in bytes.
const MAX_RUN_BYTES: u64 = 1 << 20;
const MAX_RESULT_BYTES: u64 = 64 << 10;

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
    pub digest: String,
    /// The method.
    pub method: Method,
    /// Longest time for one sequence in seconds.
    pub time_limit_s: f64,
}

/// The result of one sequence.
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Serialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct SequenceResult {
    /// Time in seconds.
    pub seconds: f64,
    /// Largest resident memory of the process in bytes. `None` if the system does not report it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub memory_peak_bytes: Option<u64>,
    /// Why the method failed, in one line.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fault: Option<String>,
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

/// The files of one sequence.
struct SequenceJob<'a> {
    sequence: &'a GeneratedSequence,
    stream: PathBuf,
    output: PathBuf,
}

/// Returns the path of an output in the folder of a run.
pub(crate) fn output_path(task: Task, group: &PlainName, id: &PlainName) -> InnerPath {
    InnerPath::from("outputs").join(group).join(id.with_ending(task.output_extension()))
}

fn result_path(group: &PlainName, id: &PlainName) -> InnerPath {
    InnerPath::from("results").join(group).join(id.with_ending(".json"))
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
/// * [`ErrorKind::Tool`] if the program of the method cannot be started.
pub fn run(
    data: &GeneratedSuite,
    options: &RunOptions,
    check_stop: &mut dyn FnMut() -> Result<()>,
    progress: &mut dyn FnMut(RunProgress<'_>) -> Result<()>,
) -> Result<RunReport> {
    options.method.check(data.suite.task)?;
    let _claim = OutputSet::claim_folder(&options.output)?;
    begin(data, options)?;
    let mut worker = Worker::new(data.suite.task, options)?;
    let total = data.scored().count() as u64;
    let mut report = RunReport::default();
    for (group, sequence) in data.scored() {
        let result_path = result_path(&group.name, &sequence.id);
        let name = format!("{}/{}", group.name, sequence.id);
        let old = read_result(&options.output, &group.name, &sequence.id)?;
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
                let output = folders::create_parents(&options.output, &inner)?;
                let job = SequenceJob { sequence, stream: absolute(&stream)?, output: absolute(&output)? };
                let outcome = worker.run(&job, check_stop)?;
                let result = SequenceResult {
                    seconds: outcome.seconds,
                    memory_peak_bytes: outcome.memory_peak_bytes,
                    fault: outcome.fault,
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
    let run: RunDescription =
        serde_json::from_slice(&text).map_err(|e| Error::new(ErrorKind::Config, path.display()).found(e))?;
    if run.format_version != FORMAT_VERSION {
        return Err(Error::new(ErrorKind::Config, path.display())
            .found(format_args!("version {} of the format", run.format_version))
            .expected(FORMAT_VERSION));
    }
    Ok(Some(run))
}

/// Reads the result of a sequence. Returns `None` if the sequence is not finished.
///
/// # Errors
/// [`ErrorKind::Config`] if the file is invalid.
pub(crate) fn read_result(
    folder: &Path,
    group: &PlainName,
    id: &PlainName,
) -> Result<Option<SequenceResult>> {
    let path = result_path(group, id).resolve_in(folder, Access::Read)?;
    let text = read_bytes(&path, "a result", MAX_RESULT_BYTES);
    let Some(text) = not_found_as_none(text)? else { return Ok(None) };
    serde_json::from_slice(&text).map(Some).map_err(|e| {
        Error::new(ErrorKind::Config, path.display()).found(e).expected("the result of a sequence")
    })
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

/// Returns the largest accepted size of an output: two values of 8 bytes for each pixel, and 1 MiB.
fn max_output_bytes(sequence: &GeneratedSequence) -> u64 {
    16 * u64::from(sequence.width) * u64::from(sequence.height) + (1 << 20)
}

fn absolute(path: &Path) -> Result<PathBuf> {
    std::path::absolute(path).map_err(|e| Error::io(path.display(), e))
}

/// Writes `run.json`, or compares it with the run to continue.
fn begin(data: &GeneratedSuite, options: &RunOptions) -> Result<()> {
    let description = RunDescription {
        format_version: FORMAT_VERSION,
        suite: data.suite.name.clone(),
        version: data.suite.version.clone(),
        digest: data.digest.clone(),
        method: options.method.clone(),
        time_limit_s: options.time_limit.as_secs_f64(),
    };
    let folder = options.output.display();
    match read_description(&options.output)? {
        None => {
            let path = folders::create_parents(&options.output, &RUN_FILE.into())?;
            let text = serde_json::to_vec_pretty(&description)
                .map_err(|e| Error::new(ErrorKind::Config, path.display()).found(e))?;
            storage::write_small(&path, &text, false)
        }
        Some(_) if !options.resume => Err(Error::new(ErrorKind::Exists, folder)
            .found("an existing run")
            .expected("a folder without a run")
            .remedy(format_args!(
                "set {} to continue this run, or choose another folder",
                Setting("resume")
            ))),
        Some(old) if old == description => Ok(()),
        Some(old) => Err(Error::new(ErrorKind::Config, folder)
            .found(format_args!(
                "a run of `{}` on {} {} with a limit of {} s",
                old.method.name(),
                old.suite,
                old.digest,
                old.time_limit_s
            ))
            .expected("the same method, suite and time limit")
            .remedy("choose another folder")),
    }
}

/// Runs the method on one sequence after another.
enum Worker {
    Baseline(Baseline, Task),
    Command(CommandTemplate, Duration),
    Server { words: Vec<String>, limit: Duration, server: Option<Server> },
    Caller(Caller, Duration),
    Nothing,
}

impl Worker {
    fn new(task: Task, options: &RunOptions) -> Result<Self> {
        let limit = options.time_limit;
        Ok(match &options.method {
            Method::Baseline(name) => Self::Baseline(Baseline::find(name, task)?, task),
            Method::Command(text) => Self::Command(CommandTemplate::parse(text)?, limit),
            Method::Server(text) => {
                Self::Server { words: CommandTemplate::parse(text)?.words().to_vec(), limit, server: None }
            }
            Method::Caller(_) => Self::Caller(Caller::new(), limit),
            Method::Outputs(_) => Self::Nothing,
        })
    }

    fn run(
        &mut self,
        job: &SequenceJob<'_>,
        check_stop: &mut dyn FnMut() -> Result<()>,
    ) -> Result<ProcessOutcome> {
        match self {
            Self::Nothing => Ok(ProcessOutcome::default()),
            Self::Baseline(baseline, task) => {
                let start = Instant::now();
                let bytes = baseline_output(*baseline, *task, job)?;
                let seconds = start.elapsed().as_secs_f64();
                storage::write_small_unsynced(&job.output, &bytes)?;
                Ok(ProcessOutcome { seconds, ..ProcessOutcome::default() })
            }
            Self::Caller(caller, limit) => caller.request(&request(job), *limit, check_stop),
            Self::Command(command, limit) => run_process(&command.words_for(job)?, *limit, check_stop),
            Self::Server { words, limit, server } => {
                let mut running = match server.take() {
                    Some(running) => running,
                    None => match Server::start(words, *limit, check_stop)? {
                        Ok(running) => running,
                        Err(fault) => {
                            return Ok(ProcessOutcome { fault: Some(fault), ..ProcessOutcome::default() });
                        }
                    },
                };
                let (outcome, is_usable) = running.request(&request(job), *limit, check_stop)?;
                *server = is_usable.then_some(running);
                Ok(outcome)
            }
        }
    }
}

/// Returns the request of a sequence as one line of JSON.
fn request(job: &SequenceJob<'_>) -> String {
    let s = job.sequence;
    json!({
        "stream": job.stream.display().to_string(), "output": job.output.display().to_string(), "width": s.width,
        "height": s.height, "readouts": s.readouts, "readout": s.reference_readout, "interval": s.interval_readouts, "readout_hz": s.readout_hz,
        "white_rate": s.white_rate, "mosaic": s.mosaic,
    })
    .to_string()
}

/// Returns the bytes of the output file of a baseline.
fn baseline_output(baseline: Baseline, task: Task, job: &SequenceJob<'_>) -> Result<Vec<u8>> {
    let shape = [u64::from(job.sequence.height), u64::from(job.sequence.width)];
    let array = |shape: &[u64], values: &[f32]| {
        npy::to_bytes(Element::F32, shape, values.iter().map(|v| v.to_le_bytes()))
    };
    let pixels = (shape[0] * shape[1]) as usize;
    match task {
        Task::Reconstruction => array(&shape, &baseline.image(&job.stream, job.sequence)?),
        Task::Color => array(&[shape[0], shape[1], 3], &baseline.color_image(&job.stream, job.sequence)?),
        Task::Flow => {
            array(&[shape[0], shape[1], 2], baseline.flow(&job.stream, job.sequence)?.as_flattened())
        }
        Task::Depth => array(&shape, &vec![TRIVIAL_DEPTH_M; pixels]),
        Task::Detection | Task::Tracking => Ok(b"[]\n".to_vec()),
    }
}
