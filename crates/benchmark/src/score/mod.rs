//! Scores of a run, and their verification.
//!
//! `score.json` contains every score of every sequence, the digests of the streams and outputs, the means with 95 %
//! bootstrap intervals over sequences, and the cost. [`verify()`] computes all scores again from the outputs, and the cost
//! from the recorded times.

mod boxes;
mod dense;
mod difference;
mod evaluation;
mod output_units;
mod summary;
mod unexpected_outputs;

use std::collections::BTreeMap;
use std::path::Path;

use serde::{Deserialize, Serialize};

use spikelane::error::{Error, ErrorKind, Result};
use spikelane::unstable::inputs::{PlainName, deserialize_digest, read_bytes, utf8_bytes};
use spikelane::unstable::threads;
use spikelane_measure::report::{is_date, today};

use crate::generated::{GeneratedGroup, GeneratedSequence, GeneratedSuite};
use crate::run::{self, Method, RunDescription, SandboxState, SequenceResult, is_positive};
use crate::suite::CurvePoint;

pub(crate) use dense::decode_image;
pub(crate) use evaluation::reference_image;
pub use evaluation::{Evaluation, evaluate_output};
pub use summary::{Cost, GroupSummary, MetricSummary, ScoreInterval};

/// Maximum size of a reference in bytes.
const MAX_REFERENCE_BYTES: u64 = 1 << 30;

/// Version of the format of `score.json`.
const FORMAT_VERSION: u32 = 1;

/// Maximum size of `score.json` in bytes.
const MAX_SCORE_BYTES: u64 = 64 << 20;

/// The name of the group that contains all scored splits.
pub const OVERALL: &str = "overall";

/// The scores of one sequence.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct SequenceScore {
    /// Name of the group.
    pub group: PlainName,
    /// Name of the sequence.
    pub id: PlainName,
    /// Digest of the stream.
    #[serde(deserialize_with = "deserialize_digest")]
    pub stream_digest: String,
    /// Digest of the output, or `None` if there is no output.
    #[serde(default, deserialize_with = "deserialize_digest", skip_serializing_if = "Option::is_none")]
    pub output_digest: Option<String>,
    /// Why the sequence has the scores of the trivial answer, in one line.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fault: Option<String>,
    /// Time and memory of the method.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub result: Option<SequenceResult>,
    /// The score of each metric.
    pub scores: BTreeMap<String, f64>,
}

/// The computer of a run.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct Environment {
    /// Version of spikelane.
    pub spikelane: String,
    /// Operating system and architecture.
    pub system: String,
    /// Number of processors.
    pub processors: u64,
    /// Name of the processor. `None` if the system does not report it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub processor: Option<String>,
    /// Date of the scoring in UTC.
    pub date: String,
}

/// The content of `score.json`.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct ScoreFile {
    /// Version of the format.
    pub format_version: u32,
    /// Name of the suite.
    pub suite: PlainName,
    /// Version of the suite.
    pub version: String,
    /// Digest of the suite.
    #[serde(deserialize_with = "deserialize_digest")]
    pub digest: String,
    /// The commitment of a sealed suite.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sealed: Option<String>,
    /// Identifiers of the metrics. The first metric is the primary metric.
    pub metrics: Vec<String>,
    /// The answer whose scores a faulty output has.
    pub trivial_answer: String,
    /// The method.
    pub method: Method,
    /// Longest time for one sequence in seconds.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub time_limit_s: Option<f64>,
    /// Whether the processes of the method were restricted. `None` if the method started no process.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sandbox: Option<SandboxState>,
    /// The computer.
    pub environment: Environment,
    /// Time and memory.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cost: Option<Cost>,
    /// The means of [`OVERALL`], of each split and of each point of a curve.
    pub summaries: Vec<GroupSummary>,
    /// The scores of all sequences.
    pub sequences: Vec<SequenceScore>,
    /// Notes for the user about the outputs, one line each. The file does not contain them.
    #[serde(skip)]
    pub notes: Vec<String>,
}

/// Scores the outputs in the folder of a run.
///
/// `name` is the name of the method if the folder has no `run.json`.
///
/// # Errors
/// * [`ErrorKind::Corrupt`] if a stream or a reference was changed.
/// * [`ErrorKind::Config`] if the run belongs to another suite, or if a recorded time is impossible.
/// * [`ErrorKind::Input`] if sequences of the run are not finished, or if the folder has neither `run.json` nor an output
///   of a sequence.
pub fn score(
    data: &GeneratedSuite,
    folder: &Path,
    name: &str,
    check_stop: &(dyn Fn() -> Result<()> + Sync),
) -> Result<ScoreFile> {
    let description = run::read_description(folder)?;
    if let Some(description) = &description
        && description.digest != data.digest
    {
        return Err(Error::new(ErrorKind::Config, folder.display())
            .found(format_args!("a run on the suite {} {}", description.suite, description.digest))
            .expected(format_args!("{} {}", data.suite.name, data.digest))
            .remedy("run the method on this suite"));
    }
    let of_run = description.as_ref().filter(|d| !matches!(d.method, Method::Outputs(_)));
    if of_run.is_none() {
        unexpected_outputs::check_any_output(data, folder)?;
    }
    let all: Vec<(&GeneratedGroup, &GeneratedSequence)> = data.scored().collect();
    let scored = threads::try_map(all, |(group, sequence)| {
        check_stop()?;
        score_sequence(data, folder, of_run, group, sequence)
    })?;
    let method = description.as_ref().map_or_else(|| Method::Outputs(name.to_owned()), |d| d.method.clone());
    let results: Vec<&SequenceResult> = scored.iter().filter_map(|(s, _)| s.result.as_ref()).collect();
    let summaries = summary::summarize_groups(data, &scored)?;
    let images = scored.iter().map(|(s, e)| (format!("{}/{}", s.group, s.id), e.other_unit.as_ref()));
    let mut notes = output_units::unit_notes(images);
    notes.extend(unexpected_outputs::unexpected_outputs_note(data, folder)?);
    Ok(ScoreFile {
        format_version: FORMAT_VERSION,
        suite: data.suite.name.clone(),
        version: data.suite.version.clone(),
        digest: data.digest.clone(),
        sealed: data.suite.sealed.clone(),
        metrics: data.suite.metrics.iter().map(|metric| metric.id()).collect(),
        trivial_answer: data.suite.task.trivial_answer().to_owned(),
        method,
        time_limit_s: description.as_ref().map(|d| d.time_limit_s),
        sandbox: description.and_then(|d| d.sandbox),
        environment: Environment::current(),
        cost: Cost::from_results(&results),
        summaries,
        sequences: scored.into_iter().map(|(score, _)| score).collect(),
        notes,
    })
}

/// Scores the output of one sequence.
fn score_sequence(
    data: &GeneratedSuite,
    folder: &Path,
    of_run: Option<&RunDescription>,
    group: &GeneratedGroup,
    sequence: &GeneratedSequence,
) -> Result<(SequenceScore, Evaluation)> {
    let read = |run: &RunDescription| run::read_result(folder, &group.name, &sequence.id, run.limit());
    let result = of_run.map(read).transpose()?.flatten();
    if of_run.is_some() && result.is_none() {
        return Err(Error::new(ErrorKind::Input, folder.display())
            .found(format_args!("no result of {}/{}", group.name, sequence.id))
            .expected("a finished run")
            .remedy("continue the run"));
    }
    // An unreadable output changes only its own score. A fault of the system is an error and changes no score.
    let (output, unreadable) = match run::read_output(folder, data.suite.task, &group.name, sequence) {
        Ok(output) => (output, None),
        Err(error) if is_system_fault(&error) => return Err(error),
        Err(error) => (None, Some(error.to_string())),
    };
    let fault = result.as_ref().and_then(|r| r.fault.clone()).or(unreadable);
    let (bytes, output_digest) = output.unzip();
    let evaluation = evaluate_output(data, group, sequence, bytes.as_deref(), fault.as_deref())?;
    let stream_digest = sequence.stream().map(|file| file.digest.clone()).unwrap_or_default();
    let score = SequenceScore {
        group: group.name.clone(),
        id: sequence.id.clone(),
        stream_digest,
        output_digest,
        fault: evaluation.fault.clone(),
        result,
        scores: evaluation.scores.clone(),
    };
    Ok((score, evaluation))
}

/// Returns whether an output could not be read although the file may be right.
fn is_system_fault(error: &Error) -> bool {
    let denied = |e: &std::io::Error| e.kind() == std::io::ErrorKind::PermissionDenied;
    error.kind() == ErrorKind::Memory || error.io_error().is_some_and(|e| !denied(e))
}

impl ScoreFile {
    /// Reads a `score.json`. The file can come from a stranger.
    ///
    /// # Errors
    /// [`ErrorKind::Config`] if the file is invalid, and [`ErrorKind::Input`] if it is too large.
    pub fn read(path: &Path) -> Result<Self> {
        let text = read_bytes(path, "a score file", MAX_SCORE_BYTES)?;
        let invalid = |found: &dyn std::fmt::Display| {
            Error::new(ErrorKind::Config, path.display()).found(found).expected("a score file")
        };
        let file: Self = serde_json::from_slice(&utf8_bytes(&text)).map_err(|e| invalid(&e))?;
        if file.format_version != FORMAT_VERSION {
            return Err(invalid(&format_args!("version {} of the format", file.format_version))
                .expected(FORMAT_VERSION));
        }
        file.check_cost(path)?;
        if !is_date(&file.environment.date) {
            return Err(invalid(&format_args!("the date {:?}", file.environment.date))
                .expected("a date such as 2026-01-31"));
        }
        Ok(file)
    }

    /// Checks that the recorded times and the cost are possible.
    fn check_cost(&self, path: &Path) -> Result<()> {
        let limit = self.time_limit_s.filter(|_| self.method.has_time_limit());
        for sequence in &self.sequences {
            if let Some(result) = &sequence.result {
                result
                    .check(format_args!("{}: {}/{}", path.display(), sequence.group, sequence.id), limit)?;
            }
        }
        let is_possible = self.time_limit_s.is_none_or(is_positive)
            && self.cost.is_none_or(|cost| {
                is_positive(cost.outputs_per_second)
                    && cost.latency_seconds.into_iter().all(is_positive)
                    && cost.latency_seconds.is_sorted()
            });
        if is_possible {
            return Ok(());
        }
        Err(Error::new(ErrorKind::Config, path.display())
            .found("an impossible cost or time limit")
            .expected("positive numbers, and percentiles in ascending order"))
    }

    /// Returns the text of the file.
    ///
    /// # Errors
    /// [`ErrorKind::Config`] if a value cannot be written.
    pub fn to_json(&self) -> Result<Vec<u8>> {
        let mut text = serde_json::to_vec_pretty(self).map_err(unwritable)?;
        text.push(b'\n');
        Ok(text)
    }

    fn to_value(&self) -> Result<serde_json::Value> {
        serde_json::to_value(self).map_err(unwritable)
    }

    /// Returns the number of sequences that have the scores of the trivial answer.
    #[must_use]
    pub fn faults(&self) -> usize {
        self.sequences.iter().filter(|sequence| sequence.fault.is_some()).count()
    }

    /// Returns the summary of a group.
    #[must_use]
    pub fn summary(&self, group: &str) -> Option<&GroupSummary> {
        self.summaries.iter().find(|summary| summary.group == group)
    }

    /// Returns the points of the curves, in the order of the file.
    pub fn points(&self) -> impl Iterator<Item = (&CurvePoint, &GroupSummary)> {
        self.summaries.iter().filter_map(|summary| Some((summary.point.as_ref()?, summary)))
    }
}

fn unwritable(error: serde_json::Error) -> Error {
    Error::new(ErrorKind::Config, "score file").found(error)
}

impl Environment {
    fn current() -> Self {
        let processors = std::thread::available_parallelism().map_or(1, |n| n.get() as u64);
        let cpuinfo = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
        let name = cpuinfo.lines().find_map(|line| line.strip_prefix("model name")?.split_once(':'));
        Self {
            spikelane: env!("CARGO_PKG_VERSION").to_owned(),
            system: format!("{} {}", std::env::consts::OS, std::env::consts::ARCH),
            processors,
            processor: name.map(|(_, name)| name.trim().to_owned()),
            date: today(),
        }
    }
}

/// What [`verify()`] cannot compute again.
pub const NOT_VERIFIED: [&str; 4] = ["measured seconds and memory", "computer", "date", "names"];

/// Computes the scores and the cost of a run again and compares them with a score file, to the last digit.
///
/// Returns one line for each difference. The cost follows from the times in the folder of the run. Nothing determines the
/// items of [`NOT_VERIFIED`], so a stranger can choose them.
///
/// # Errors
/// The errors of [`score`], and [`ErrorKind::Config`] if the score file belongs to another suite.
pub fn verify(
    data: &GeneratedSuite,
    folder: &Path,
    file: &ScoreFile,
    check_stop: &(dyn Fn() -> Result<()> + Sync),
) -> Result<Vec<String>> {
    if file.digest != data.digest {
        return Err(Error::new(ErrorKind::Config, "score file")
            .found(format_args!("suite {} {} {}", file.suite, file.version, file.digest))
            .expected(format_args!("{} {} {}", data.suite.name, data.suite.version, data.digest))
            .remedy("generate the suite of the score file, or score the outputs again"));
    }
    let again = score(data, folder, file.method.name(), check_stop)?;
    let again = ScoreFile { environment: file.environment.clone(), ..again };
    Ok(difference::difference_lines(&file.to_value()?, &again.to_value()?))
}
