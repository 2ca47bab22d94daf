//! What is said of inputs and copies, whichever way a dataset is made.

use std::path::{Path, PathBuf};

use crate::shared::output::Out;
use spikelane::Result;
use spikelane_dataset::shards::Plan;
use spikelane_dataset::{self as dataset, DatasetOptions, Inputs, Work};

/// Names the files of a folder of inputs that become no sequence.
pub(super) fn say_skipped(inputs: &Inputs, options: &DatasetOptions, out: &Out) -> Result<()> {
    if inputs.list.is_none() {
        let skipped = dataset::skipped(&inputs.folder, &options.output)?;
        if let Some(text) = named(&skipped) {
            out.say(format_args!("warning: {}: {text}", inputs.folder.display()));
        }
    }
    Ok(())
}

/// Names the folder of the inputs of a plan, if it is not below the plan's own folder: a plan may come from anybody.
pub(super) fn say_inputs(plan: &Plan, out: &Out) {
    let Work::Inputs(inputs) = &plan.options.work else { return };
    let whole = |folder: &Path| std::fs::canonicalize(folder).ok();
    let is_inside =
        whole(&inputs.folder).zip(whole(&plan.folder)).is_some_and(|(inputs, plan)| inputs.starts_with(plan));
    let folder = inputs.folder.display();
    match &inputs.list {
        // The paths of a list may lead anywhere.
        Some(_) => out.say(format_args!(
            "inputs are read below {folder} and at the paths of a list, which the plan names"
        )),
        None if !is_inside => out.say(format_args!("inputs are read below {folder}, which the plan names")),
        None => {}
    }
}

/// A line about files that become no sequence.
fn named(skipped: &[PathBuf]) -> Option<String> {
    const LISTED: usize = 3;
    let listed: Vec<String> = skipped.iter().take(LISTED).map(|p| p.display().to_string()).collect();
    let (files, are) = if skipped.len() == 1 { ("file", "is") } else { ("files", "are") };
    let more = if skipped.len() > LISTED { ", ..." } else { "" };
    (!skipped.is_empty()).then(|| {
        format!(
            "{} {files} {are} left out, as neither video nor one of several pictures: {}{more}",
            skipped.len(),
            listed.join(", ")
        )
    })
}

/// What was set aside, and what the user should know of inputs.
pub(super) fn say_apart(set_aside: &[(String, String)], notes: &[String], out: &Out) {
    for (input, why) in set_aside {
        out.say(format_args!("set aside  {input}: {why}"));
    }
    for note in notes {
        out.say(format_args!("warning: {note}"));
    }
}

pub(super) fn say_copied(copied: u64, out: &Out) {
    if copied > 0 {
        out.say(format_args!(
            "note: this file system has no hard links: {copied} files were copied into the folders of loaders"
        ));
    }
}
