//! `spikelane dataset stats`.

use std::path::PathBuf;

use indicatif::DecimalBytes;
use serde_json::json;

use crate::shared::output::Out;
use crate::shared::outputs;
use spikelane::{Error, Kind, Result};
use spikelane_dataset::stats::{Stats, html, number, stats};
use spikelane_io::storage;

/// Say what a dataset holds: splits, light, cameras, rates, motion, boxes
#[derive(clap::Args, Clone, Debug)]
pub(crate) struct Args {
    /// Folder of the dataset
    #[arg(value_name = "DIR")]
    folder: PathBuf,
    /// Also write it as a page
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
    /// Overwrite the page
    #[arg(long)]
    force: bool,
    /// Read files through links that leave the folder; without it they are refused
    #[arg(long)]
    follow_links: bool,
}

/// Runs the command.
///
/// # Errors
/// As [`stats`]; [`Kind::Exists`] for a page that is there.
pub(crate) fn run(args: &Args, out: &Out) -> Result<()> {
    let _claim = args.report.as_ref().map(|report| outputs::claim([report], args.force)).transpose()?;
    let found = stats(&args.folder, args.follow_links)?;
    if let Some(path) = &args.report {
        let name = args.folder.file_name().unwrap_or_default().to_string_lossy();
        storage::write_small(path, html(&name, &found)?.as_bytes(), args.force)?;
    }
    let about =
        serde_json::to_value(&found).map_err(|e| Error::new(Kind::Config, args.folder.display()).found(e))?;
    out.result(&json!({"event": "stats", "stats": about}), &text(&found))
}

fn text(stats: &Stats) -> String {
    let mut text = format!(
        "{} sequences, {} readouts, {}, {} set aside\n",
        stats.splits.values().sum::<u64>(),
        stats.readouts,
        DecimalBytes(stats.bytes),
        stats.set_aside
    );
    for (what, counts) in [
        ("split", &stats.splits),
        ("light", &stats.lights),
        ("camera", &stats.cameras),
        ("boxes", &stats.boxes),
    ] {
        if !counts.is_empty() && counts.len() <= 12 {
            let each: Vec<_> = counts.iter().map(|(name, n)| format!("{name} {n}")).collect();
            text += &format!("{what:<8}{}\n", each.join(", "));
        }
    }
    text += &format!("{:<40}{:>12}{:>12}{:>12}\n", "", "least", "median", "greatest");
    for (name, s) in &stats.quantities {
        let [least, median, greatest] = [s.least, s.median, s.greatest].map(number);
        text += &format!("{name:<40}{least:>12}{median:>12}{greatest:>12}\n");
    }
    text + &format!("digest {}\n", stats.digest)
}
