//! Implements `spikelane benchmark verify`.

use std::path::{Path, PathBuf};
use std::time::Duration;

use serde_json::json;

use super::run::{SandboxArgs, print_state};
use super::{check_stop, open_suite};
use crate::common::{Console, CountProgress, stop_flag};
use spikelane::unstable::Count;
use spikelane::{Error, ErrorKind, Result};
use spikelane_benchmark::generated::GeneratedSuite;
use spikelane_benchmark::report::ScoredMethod;
use spikelane_benchmark::run::{self as benchmark_run, Method, RunOptions, SandboxOptions};
use spikelane_benchmark::score::{self as benchmark_score, NOT_VERIFIED, ScoreFile};

/// Verify a generated suite, or the scores of a run
///
/// For a folder, the command compares every stream, reference and label with its digest. For a score.json, the command
/// computes all scores again from the outputs beside the file and compares them to the last digit. It also computes the
/// cost again from the recorded seconds. Nothing can verify the seconds themselves, the computer, the date and the names.
#[derive(clap::Args, Debug)]
pub(crate) struct Args {
    /// Verify the suite in this folder, or this score.json
    path: PathBuf,
    /// Use the generated suite in this folder to verify a score.json
    #[arg(long, value_name = "DIR")]
    suite: Option<PathBuf>,
    /// Run the recorded method again into this folder
    ///
    /// The command is printed first. Run only commands that you trust.
    #[arg(long, value_name = "DIR", requires = "suite")]
    run: Option<PathBuf>,
    #[command(flatten)]
    sandbox: SandboxArgs,
}

/// Runs the command.
///
/// # Errors
/// [`ErrorKind::Corrupt`] if a file or a score differs.
pub(crate) fn run(args: &Args, out: &Console) -> Result<()> {
    if args.run.is_none() && args.sandbox.is_set() {
        return Err(Error::new(ErrorKind::Usage, "sandbox")
            .found("a flag of the sandbox without a run")
            .expected("a folder for the run")
            .remedy("set --run, or omit the flag"));
    }
    if args.path.is_dir() {
        return verify_suite(&args.path, out);
    }
    if !args.path.exists() {
        return Err(Error::io(args.path.display(), std::io::ErrorKind::NotFound.into())
            .expected("the folder of a generated suite, or a score file"));
    }
    let Some(suite) = &args.suite else {
        return Err(Error::new(ErrorKind::Usage, args.path.display())
            .found("a score file without a suite")
            .expected("the folder of the generated suite")
            .remedy("set --suite"));
    };
    let ScoredMethod { file, folder, .. } = ScoredMethod::read(&args.path)?;
    let data = open_suite(suite, out)?;
    let (kind, text) = match &file.method {
        Method::Baseline(text) => ("baseline", text),
        Method::Command(text) => ("command", text),
        Method::Server(text) => ("server", text),
        Method::Caller(text) => ("caller", text),
        Method::Outputs(text) => ("outputs of", text),
        _ => ("method", &args.path.display().to_string()),
    };
    out.print_message(format_args!("recorded {kind}: {text}"));
    verify_scores(&file, &data, &folder, &args.path, out)?;
    match &args.run {
        Some(folder) => run_again(&file, &data, folder, args.sandbox.options(), out),
        None => Ok(()),
    }
}

fn verify_suite(folder: &Path, out: &Console) -> Result<()> {
    let data = open_suite(folder, out)?;
    let total: usize = data.groups.iter().map(|group| group.sequences.len()).sum();
    let mut progress = CountProgress::with_unit(out, stop_flag()?, "sequences");
    let faults = data.verify(&mut |done| progress.update(done, Some(total as u64)))?;
    drop(progress);
    let place = folder.display();
    for fault in &faults {
        out.print_message(format_args!("changed  {fault}"));
    }
    let event = json!({
        "event": "verified", "suite": data.suite.name, "digest": data.digest, "sequences": total,
        "changed_files": faults.len(),
    });
    out.print_result(
        &event,
        &format!(
            "{place}: {} verified, {} changed\ndigest {}\n",
            Count(total, "sequence"),
            Count(faults.len(), "file"),
            data.digest
        ),
    )?;
    match faults.into_iter().next() {
        Some(first) => Err(first),
        None => Ok(()),
    }
}

fn verify_scores(
    file: &ScoreFile,
    data: &GeneratedSuite,
    folder: &Path,
    path: &Path,
    out: &Console,
) -> Result<()> {
    let stop = stop_flag()?;
    let differences = benchmark_score::verify(data, folder, file, &|| check_stop(&stop))?;
    for line in &differences {
        out.print_message(format_args!("differs  {line}"));
    }
    if let Some(first) = differences.first() {
        return Err(Error::new(ErrorKind::Corrupt, path.display())
            .found(format_args!("{}, such as {first}", Count(differences.len(), "difference")))
            .expected("the scores of the outputs and the cost of the run")
            .remedy("score the outputs again"));
    }
    let mut verified = vec!["scores", "means", "digests of streams, references and outputs"];
    if file.cost.is_some() {
        verified.push("cost and time limit as recorded in results and run.json");
    }
    let event = json!({
        "event": "verified", "file": path.display().to_string(), "sequences": file.sequences.len(),
        "verified": verified, "not_verified": NOT_VERIFIED,
    });
    let text = format!(
        "{}: all scores of {} are equal\nverified: {}\nnot verified: {}\n",
        path.display(),
        Count(file.sequences.len(), "sequence"),
        verified.join(", "),
        NOT_VERIFIED.join(", ")
    );
    out.print_result(&event, &text)
}

/// Runs the recorded method again and compares its scores with those of the file.
fn run_again(
    file: &ScoreFile,
    data: &GeneratedSuite,
    folder: &Path,
    sandbox: SandboxOptions,
    out: &Console,
) -> Result<()> {
    if let Method::Outputs(name) | Method::Caller(name) = &file.method {
        return Err(Error::new(ErrorKind::Usage, "--run")
            .found(format_args!("outputs of {name}, which no recorded command wrote"))
            .expected("a recorded baseline, command or server"));
    }
    let options = RunOptions {
        output: folder.to_owned(),
        method: file.method.clone(),
        time_limit: Duration::try_from_secs_f64(file.time_limit_s.unwrap_or(60.0))
            .map_err(|e| Error::new(ErrorKind::Config, "time_limit_s").found(e))?,
        resume: false,
        sandbox,
        adopts_orphans: true,
    };
    print_state(&options, out)?;
    let stop = stop_flag()?;
    benchmark_run::run(data, &options, &mut || check_stop(&stop), &mut |_| Ok(()))?;
    let again = benchmark_score::score(data, folder, file.method.name(), &|| check_stop(&stop))?;
    let changed: Vec<_> = file
        .sequences
        .iter()
        .zip(&again.sequences)
        .filter(|(a, b)| a.scores != b.scores)
        .map(|(a, _)| format!("{}/{}", a.group, a.id))
        .collect();
    if let Some(first) = changed.first() {
        return Err(Error::new(ErrorKind::Corrupt, folder.display())
            .found(format_args!("other scores of {}, such as {first}", Count(changed.len(), "sequence")))
            .expected("the scores of the file"));
    }
    let event = json!({"event": "run_again", "sequences": again.sequences.len()});
    out.print_result(&event, &format!("{}: the method gives the same scores\n", folder.display()))
}
