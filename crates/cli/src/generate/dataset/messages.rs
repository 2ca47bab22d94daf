//! Messages about inputs and copies. Several dataset commands use them.

use std::path::{Path, PathBuf};

use crate::common::Console;
use spikelane::Result;
use spikelane::unstable::Count;
use spikelane_dataset::shards::ShardPlan;
use spikelane_dataset::{self as dataset, Content, DatasetOptions, InputContent, SequenceFailure};

/// Prints a warning about files in the input folder that are not converted to a sequence.
pub(super) fn print_skipped_files(
    inputs: &InputContent,
    options: &DatasetOptions,
    out: &Console,
) -> Result<()> {
    if inputs.list.is_none() {
        let skipped = dataset::skipped_files(inputs, &options.output)?;
        if let Some(text) = skipped_line(&skipped) {
            out.print_message(format_args!("warning: {}: {text}", inputs.folder.display()));
        }
    }
    Ok(())
}

/// Prints the input folder of a plan if it is outside the plan's folder. Users should check it, because a plan can come
/// from anyone.
pub(super) fn print_outside_inputs(plan: &ShardPlan, out: &Console) {
    let Content::Inputs(inputs) = &plan.options.content else { return };
    let canonical = |folder: &Path| std::fs::canonicalize(folder).ok();
    let is_inside = canonical(&inputs.folder)
        .zip(canonical(&plan.folder))
        .is_some_and(|(inputs, plan)| inputs.starts_with(plan));
    let folder = inputs.folder.display();
    match &inputs.list {
        // The paths in a list can point to any folder.
        Some(_) => out.print_message(format_args!(
            "inputs are read from {folder} and from the paths of a list, as stated in the plan"
        )),
        None if !is_inside => {
            out.print_message(format_args!("inputs are read from {folder}, as stated in the plan"))
        }
        None => {}
    }
}

/// Returns a line about files that are not converted to a sequence, or `None` if there are no such files.
fn skipped_line(skipped: &[PathBuf]) -> Option<String> {
    const MAX_LISTED_FILES: usize = 3;
    let listed: Vec<String> =
        skipped.iter().take(MAX_LISTED_FILES).map(|p| p.display().to_string()).collect();
    let (files, reason) = match skipped.len() {
        1 => ("file is", "is neither a video nor an image of a sequence"),
        _ => ("files are", "are neither videos nor images of a sequence"),
    };
    let more = if skipped.len() > MAX_LISTED_FILES { ", ..." } else { "" };
    (!skipped.is_empty())
        .then(|| format!("{} {files} ignored, which {reason}: {}{more}", skipped.len(), listed.join(", ")))
}

/// Prints the failed sequences and the notes about inputs.
pub(super) fn print_failures(failures: &[SequenceFailure], notes: &[String], out: &Console) {
    for SequenceFailure { input, reason } in failures {
        out.print_message(format_args!("failed  {input}: {reason}"));
    }
    for note in notes {
        out.print_message(format_args!("warning: {note}"));
    }
}

pub(super) fn print_copied_files(copied: u64, out: &Console) {
    if copied > 0 {
        out.print_message(format_args!(
            "note: this file system has no hard links, so the folders for data loaders contain copies of {}",
            Count(copied, "file"),
        ));
    }
}
