//! Finds files in the folder of outputs that belong to no sequence of the suite.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use spikelane::error::{Error, ErrorKind, Result};
use spikelane::unstable::Count;
use spikelane::unstable::inputs::{Access, InnerPath};

use crate::generated::GeneratedSuite;
use crate::run::output_path;

/// Maximum number of names in a note.
const MAX_LISTED: usize = 3;

/// Returns a note about entries of the folder `outputs` that belong to no sequence of the suite.
///
/// # Errors
/// [`ErrorKind::Io`] if a folder cannot be listed.
pub(super) fn unexpected_outputs_note(data: &GeneratedSuite, folder: &Path) -> Result<Option<String>> {
    let expected: BTreeSet<PathBuf> = expected_outputs(data).map(|path| folder.join(path.as_str())).collect();
    let groups: BTreeSet<&Path> = expected.iter().filter_map(|path| path.parent()).collect();
    let mut unexpected = Vec::new();
    for entry in entries(&InnerPath::from("outputs").resolve_in(folder, Access::Read)?)? {
        if groups.contains(&*entry) {
            unexpected.extend(entries(&entry)?.into_iter().filter(|file| !expected.contains(file)));
        } else {
            unexpected.push(entry);
        }
    }
    if unexpected.is_empty() {
        return Ok(None);
    }
    let listed: Vec<String> =
        unexpected.iter().take(MAX_LISTED).map(|path| path.display().to_string()).collect();
    Ok(Some(format!(
        "{} of {} have no score, because the suite has no such sequence: {}{}; outputs are named such as {}",
        Count(unexpected.len() as u64, "entry"),
        folder.join("outputs").display(),
        listed.join(", "),
        if unexpected.len() > MAX_LISTED { ", ..." } else { "" },
        expected_outputs(data).next().map(|path| path.to_string()).unwrap_or_default(),
    )))
}

/// Checks that the folder contains an output of at least one scored sequence.
///
/// # Errors
/// [`ErrorKind::Input`] if it contains none. All scores would be those of the trivial answer.
pub(super) fn check_any_output(data: &GeneratedSuite, folder: &Path) -> Result<()> {
    let scored = data.scored().map(|(group, s)| output_path(data.suite.task, &group.name, &s.id));
    let scored: Vec<InnerPath> = scored.collect();
    if scored.is_empty() || scored.iter().any(|path| folder.join(path.as_str()).symlink_metadata().is_ok()) {
        return Ok(());
    }
    let all: Vec<String> = entries(folder)?
        .iter()
        .filter_map(|path| Some(path.file_name()?.to_string_lossy().into_owned()))
        .take(MAX_LISTED)
        .collect();
    Err(Error::new(ErrorKind::Input, folder.display())
        .found(if all.is_empty() {
            "an empty folder".to_owned()
        } else {
            format!("only other entries: {}", all.join(", "))
        })
        .expected(format_args!("files such as {}", scored[0]))
        .remedy(
            "move the folders of the groups into the folder outputs, and name each file after its sequence",
        ))
}

/// Returns the paths of the outputs of all sequences, scored or not.
fn expected_outputs(data: &GeneratedSuite) -> impl Iterator<Item = InnerPath> {
    data.groups.iter().flat_map(move |group| {
        group.sequences.iter().map(move |s| output_path(data.suite.task, &group.name, &s.id))
    })
}

/// Returns the visible entries of a folder, sorted. A missing folder has none.
fn entries(folder: &Path) -> Result<Vec<PathBuf>> {
    let io = |e| Error::io(folder.display(), e);
    if !folder.is_dir() {
        return Ok(Vec::new());
    }
    let mut all = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(io)? {
        let entry = entry.map_err(io)?;
        if !entry.file_name().as_encoded_bytes().starts_with(b".") {
            all.push(entry.path());
        }
    }
    all.sort();
    Ok(all)
}
