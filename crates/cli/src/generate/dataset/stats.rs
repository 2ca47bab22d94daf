//! Implements `spikelane dataset stats`.

use std::path::PathBuf;

use indicatif::DecimalBytes;
use serde_json::json;

use crate::common::{Console, ReportFiles, run_record};
use spikelane::unstable::Count;
use spikelane::{Error, ErrorKind, Result};
use spikelane_dataset::statistics::{
    DatasetStatistics, LIGHT_REFERENCES, dataset_statistics, format_number, html_report,
};

/// Summarize a dataset: splits, lighting, rates, motion and boxes
#[derive(clap::Args, Clone, Debug)]
pub(crate) struct Args {
    /// Read the dataset in this folder, or this packed shard
    #[arg(value_name = "DIR")]
    folder: PathBuf,
    /// Also write an HTML report, and its numbers as JSON beside it
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
    /// Overwrite existing files
    #[arg(long)]
    force: bool,
    /// Follow links to files outside the folder
    ///
    /// By default, a link to a file outside the folder is an error.
    #[arg(long)]
    follow_links: bool,
}

/// Runs the command.
///
/// # Errors
/// Those of [`dataset_statistics`]. [`ErrorKind::Exists`] if the HTML page exists.
pub(crate) fn run(args: &Args, out: &Console) -> Result<()> {
    let files = ReportFiles::claim(args.report.as_deref(), args.force)?;
    let statistics = dataset_statistics(&args.folder, args.follow_links)?;
    let value = serde_json::to_value(&statistics)
        .map_err(|e| Error::new(ErrorKind::Config, args.folder.display()).found(e))?;
    if let Some(files) = files {
        let name = args.folder.file_name().unwrap_or_default().to_string_lossy();
        let run = run_record(std::iter::empty::<&PathBuf>());
        files.write(&html_report(&name, &statistics, &run), &value)?;
    }
    out.print_result(&json!({"event": "stats", "stats": value}), &statistics_text(&statistics))
}

fn statistics_text(stats: &DatasetStatistics) -> String {
    let mut text = format!(
        "{}, {}, {}, {} failed\n",
        Count(stats.splits.values().sum::<u64>(), "sequence"),
        Count(stats.readouts, "readout"),
        DecimalBytes(stats.bytes),
        stats.failed_sequences
    );
    for (what, counts) in [
        ("split", &stats.splits),
        ("light", &stats.lighting),
        ("camera", &stats.cameras),
        ("boxes", &stats.boxes),
    ] {
        if !counts.is_empty() && counts.len() <= 12 {
            let each: Vec<_> = counts.iter().map(|(name, n)| format!("{name} {n}")).collect();
            text += &format!("{what:<8}{}\n", each.join(", "));
        }
    }
    text += &format!("{:<44}{:>12}{:>12}{:>12}\n", "", "minimum", "median", "maximum");
    for (name, s) in &stats.quantities {
        let [min, median, max] = [s.min, s.median, s.max].map(format_number);
        text += &format!("{name:<44}{min:>12}{median:>12}{max:>12}\n");
    }
    for (name, reference) in LIGHT_REFERENCES {
        if stats.quantities.keys().any(|quantity| quantity.starts_with(name)) {
            text += &format!("reference for '{name}': {reference}\n");
        }
    }
    text + &format!("digest {}\n", stats.digest)
}
