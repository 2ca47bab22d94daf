//! Runs a method on one sequence after another.

use std::path::Path;
use std::time::{Duration, Instant};

use serde_json::json;
use spikelane::error::{Error, ErrorKind, Result};
use spikelane::unstable::npy::{self, Element};

use super::command_template::SequenceJob;
use super::orphans::Orphans;
use super::process::{Launcher, ProcessOutcome, run_process};
use super::sandbox::{RunFolders, Sandbox};
use super::server::{Caller, Server};
use super::workspace::Workspace;
use super::{Baseline, CommandTemplate, Method, RunOptions, max_output_bytes};
use crate::generated::{GeneratedSequence, GeneratedSuite};
use crate::suite::{TRIVIAL_DEPTH_M, Task};

/// The result of a sequence, and the bytes of its output.
pub(super) struct SequenceOutcome {
    pub process: ProcessOutcome,
    pub output: Option<Vec<u8>>,
}

/// Runs a method on one sequence after another.
pub(super) enum Worker {
    Baseline(Baseline, Task),
    Program(Box<ProgramWorker>),
}

/// Runs a method that reads its stream from a private folder, and writes its output there.
pub(super) struct ProgramWorker {
    task: Task,
    limit: Duration,
    // The program ends before its folder is removed.
    program: Program,
    workspace: Workspace,
}

enum Program {
    Command(CommandTemplate, Launcher),
    Server { words: Vec<String>, launcher: Launcher, server: Option<Server> },
    Caller(Caller),
}

impl Worker {
    /// Prepares a method. The folder of the run must exist.
    pub(super) fn new(data: &GeneratedSuite, options: &RunOptions) -> Result<Self> {
        let task = data.suite.task;
        let program = |program, workspace| {
            Self::Program(Box::new(ProgramWorker { task, limit: options.time_limit, program, workspace }))
        };
        Ok(match &options.method {
            Method::Baseline(name) => Self::Baseline(Baseline::find(name, task)?, task),
            Method::Command(text) => {
                let (template, workspace) = (CommandTemplate::parse(text)?, Workspace::create()?);
                program(Program::Command(template, launcher(data, options, &workspace)?), workspace)
            }
            Method::Server(text) => {
                let words = CommandTemplate::parse(text)?.words().to_vec();
                let workspace = Workspace::create()?;
                let launcher = launcher(data, options, &workspace)?;
                program(Program::Server { words, launcher, server: None }, workspace)
            }
            Method::Caller(_) => program(Program::Caller(Caller::new()), Workspace::create()?),
            Method::Outputs(name) => {
                return Err(Error::new(ErrorKind::Usage, "method")
                    .found(format_args!("outputs of {name}, which exist already"))
                    .expected("a baseline, a command, a server or a caller"));
            }
        })
    }

    /// Runs the method on a sequence. `stream` is a stream of the suite.
    pub(super) fn run(
        &mut self,
        sequence: &GeneratedSequence,
        stream: &Path,
        check_stop: &mut dyn FnMut() -> Result<()>,
    ) -> Result<SequenceOutcome> {
        match self {
            Self::Program(worker) => worker.run(sequence, stream, check_stop),
            Self::Baseline(baseline, task) => {
                let start = Instant::now();
                let output = baseline_output(*baseline, *task, sequence, stream)?;
                let seconds = start.elapsed().as_secs_f64();
                let process = ProcessOutcome { seconds, memory_peak_bytes: None, fault: None };
                Ok(SequenceOutcome { process, output: Some(output) })
            }
        }
    }
}

/// Prepares the processes of a method.
fn launcher(data: &GeneratedSuite, options: &RunOptions, workspace: &Workspace) -> Result<Launcher> {
    let real = |path: &Path| path.canonicalize().map_err(|e| Error::io(path.display(), e));
    let hidden = [real(&data.folder)?, real(&options.output)?];
    let folders = RunFolders { hidden: &hidden, readable: workspace.root(), writable: &workspace.work() };
    Ok(Launcher {
        sandbox: Sandbox::new(&options.sandbox, &folders)?,
        orphans: if options.adopts_orphans { Orphans::adopt() } else { Orphans::default() },
    })
}

impl ProgramWorker {
    fn run(
        &mut self,
        sequence: &GeneratedSequence,
        stream: &Path,
        check_stop: &mut dyn FnMut() -> Result<()>,
    ) -> Result<SequenceOutcome> {
        let Self { task, limit, program, workspace } = self;
        let job = workspace.prepare(stream, sequence, *task)?;
        let mut process = match program {
            Program::Caller(caller) => caller.request(&request(&job), *limit, check_stop)?,
            Program::Command(template, launcher) => {
                let temporary = workspace.create_temporary()?;
                run_process(launcher, &template.words_for(&job)?, &temporary, *limit, check_stop)?
            }
            Program::Server { words, launcher, server } => {
                let running = match server.take() {
                    Some(running) => Ok(running),
                    None => {
                        let temporary = workspace.create_temporary()?;
                        Server::start(launcher, words, &temporary, *limit, check_stop)?
                    }
                };
                match running {
                    Ok(mut running) => {
                        let (outcome, is_usable) = running.request(&request(&job), *limit, check_stop)?;
                        *server = is_usable.then_some(running);
                        outcome
                    }
                    Err(outcome) => outcome,
                }
            }
        };
        let output = match process.fault {
            None => Workspace::read_output(&job, max_output_bytes(sequence)),
            Some(_) => Ok(None),
        };
        let output = output.unwrap_or_else(|fault| {
            process.fault = Some(fault);
            None
        });
        match program {
            Program::Server { server: Some(_), .. } => workspace.remove_output(&job),
            _ => workspace.empty_work(),
        }
        Ok(SequenceOutcome { process, output })
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
fn baseline_output(
    baseline: Baseline,
    task: Task,
    sequence: &GeneratedSequence,
    stream: &Path,
) -> Result<Vec<u8>> {
    let shape = [u64::from(sequence.height), u64::from(sequence.width)];
    let array = |shape: &[u64], values: &[f32]| {
        npy::to_bytes(Element::F32, shape, values.iter().map(|v| v.to_le_bytes()))
    };
    let pixels = (shape[0] * shape[1]) as usize;
    match task {
        Task::Reconstruction => array(&shape, &baseline.image(stream, sequence)?),
        Task::Color => array(&[shape[0], shape[1], 3], &baseline.color_image(stream, sequence)?),
        Task::Flow => array(&[shape[0], shape[1], 2], baseline.flow(stream, sequence)?.as_flattened()),
        Task::Depth => array(&shape, &vec![TRIVIAL_DEPTH_M; pixels]),
        Task::Detection | Task::Tracking => Ok(b"[]\n".to_vec()),
    }
}
