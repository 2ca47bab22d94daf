//! Implements `spikelane benchmark score`.

use std::path::{Path, PathBuf};

use serde_json::json;

use super::{check_stop, open_suite};
use crate::common::{Console, stop_flag};
use spikelane::unstable::Count;
use spikelane::{Error, ErrorKind, Result};
use spikelane_benchmark::generated::GeneratedSuite;
use spikelane_benchmark::score::{self as benchmark_score, GroupSummary, OVERALL, ScoreFile};
use spikelane_io::storage;

/// Name of the score file in the folder of a run.
const SCORE_FILE: &str = "score.json";

/// Score the outputs in a folder
///
/// The folder contains outputs/GROUP/ID.npy. The command writes score.json into it.
#[derive(clap::Args, Debug)]
pub(crate) struct Args {
    /// Compare with the generated suite in this folder
    #[arg(value_name = "DIR")]
    suite: PathBuf,
    /// Score the outputs in this folder
    #[arg(value_name = "RUN")]
    run: PathBuf,
    /// Set the name of the method in reports [default: the name of the folder]
    #[arg(long, value_name = "NAME")]
    name: Option<String>,
    /// Overwrite an existing score.json
    #[arg(long)]
    force: bool,
}

/// Runs the command.
///
/// # Errors
/// Those of [`benchmark_score::score`].
pub(crate) fn run(args: &Args, out: &Console) -> Result<()> {
    storage::refuse_existing(&args.run, &[SCORE_FILE], args.force)?;
    let data = open_suite(&args.suite, out)?;
    if !args.run.is_dir() {
        return Err(Error::new(ErrorKind::Input, args.run.display())
            .found("no folder")
            .expected("a folder with the subfolder outputs"));
    }
    let folder_name = args.run.file_name().unwrap_or_default().to_string_lossy().into_owned();
    write_score(&data, &args.run, args.name.as_ref().unwrap_or(&folder_name), args.force, out)
}

/// Scores the outputs of a run, writes `score.json` and prints the scores.
pub(super) fn write_score(
    data: &GeneratedSuite,
    folder: &Path,
    name: &str,
    force: bool,
    out: &Console,
) -> Result<()> {
    let stop = stop_flag()?;
    let file = benchmark_score::score(data, folder, name, &|| check_stop(&stop))?;
    let path = folder.join(SCORE_FILE);
    storage::write_small(&path, &file.to_json()?, force)?;
    print_scores(&file, &path, out)
}

fn print_scores(file: &ScoreFile, path: &Path, out: &Console) -> Result<()> {
    let mut text = format!(
        "{}: {} {}, {}, {} with the scores of {}\n",
        path.display(),
        file.suite,
        file.version,
        Count(file.sequences.len(), "sequence"),
        file.faults(),
        file.trivial_answer
    );
    for summary in &file.summaries {
        text += &summary_text(file, summary);
    }
    if let Some(cost) = &file.cost {
        let [p50, p95, p99] = cost.latency_seconds.map(|s| 1e3 * s);
        text += &format!(
            "cost: {:.2} outputs/s, latency {p50:.1}, {p95:.1}, {p99:.1} ms (percentiles 50, 95, 99)",
            cost.outputs_per_second
        );
        text += &cost.memory_peak_bytes.map_or("\n".into(), |b| format!(", {:.0} MB\n", b as f64 / 1e6));
    }
    let faults: Vec<_> = file
        .sequences
        .iter()
        .filter_map(|s| Some(json!({"group": s.group, "id": s.id, "fault": s.fault.as_ref()?})))
        .collect();
    for s in &file.sequences {
        if let Some(fault) = &s.fault {
            out.print_message(format_args!("trivial answer  {}/{}: {fault}", s.group, s.id));
        }
    }
    for note in &file.notes {
        out.print_message(format_args!("warning: {note}"));
    }
    let overall = file.summary(OVERALL).and_then(|summary| serde_json::to_value(summary).ok());
    let event = json!({
        "event": "scores", "file": path.display().to_string(), "suite": file.suite, "digest": file.digest,
        "overall": overall, "faults": faults, "notes": file.notes, "cost": file.cost.and_then(|cost| serde_json::to_value(cost).ok()),
    });
    out.print_result(&event, &text)
}

/// Returns the mean of the primary metric for a point of a curve, and the means of all metrics otherwise.
fn summary_text(file: &ScoreFile, summary: &GroupSummary) -> String {
    let mut text = String::new();
    for (index, id) in file.metrics.iter().enumerate() {
        let name = id.split('/').next().unwrap_or_default();
        let Some(metric) = summary.metrics.get(name) else { continue };
        if index > 0 && summary.group != OVERALL {
            break;
        }
        text += &format!("{:<24} {name:<20} {}\n", summary.group, metric.pooled);
    }
    text
}
