//! The sequences of finished shards, before and without a merge.

use std::path::{Path, PathBuf};

use super::journal;
use super::plan::ShardPlan;
use super::shard_numbers;
use crate::SequenceEntry;
use spikelane::error::{Error, ErrorKind, Result};
use spikelane::unstable::Count;
use spikelane::unstable::inputs::{Access, InnerPath};

/// Returns the entries of the finished shard in `folder`, and the path of its tar if the shard is packed. Returns `None`
/// if the folder is not the folder of a finished shard.
pub(crate) fn read_shard_entries(
    folder: &Path,
    access: Access,
) -> Result<Option<(Vec<SequenceEntry>, Option<PathBuf>)>> {
    // The first line of the manifest of a dataset has other keys, and is an error here.
    let Ok(Some(head)) = journal::read_head(folder, access) else { return Ok(None) };
    let Some((head, lines)) = journal::read_manifest(folder, head.sequences, access)? else {
        return Ok(None);
    };
    let tar = match head.tar {
        Some(tar) => {
            let real = folder.canonicalize().map_err(|e| Error::io(folder.display(), e))?;
            let shards = real.parent().unwrap_or(&real);
            Some(InnerPath::from(tar.file).resolve_in(shards, access)?)
        }
        None => None,
    };
    let entries = lines.into_iter().map(|line| SequenceEntry { shard: None, ..line.entry }).collect();
    Ok(Some((entries, tar)))
}

/// Returns the entries of all sequences of a plan.
///
/// # Errors
/// [`ErrorKind::Input`] if shards are missing.
pub(crate) fn read_plan_entries(plan: &ShardPlan) -> Result<Vec<SequenceEntry>> {
    check_finished(plan, &mut || Ok(()))?;
    let access = plan.options.access();
    let mut entries = Vec::new();
    for number in 0..plan.shards() {
        let folder = plan.shard_folder(number, access)?;
        let (_, lines) = journal::read_manifest(&folder, plan.shard_sequences(number), access)?
            .ok_or_else(|| missing_error(plan, &[number]))?;
        let shard = plan.shard_name(number);
        entries
            .extend(lines.into_iter().map(|line| SequenceEntry { shard: Some(shard.clone()), ..line.entry }));
    }
    Ok(entries)
}

/// Checks that all shards of a plan are finished.
///
/// # Errors
/// [`ErrorKind::Input`] with the numbers of the missing shards. Errors of `watch`, which is called for each shard.
pub(super) fn check_finished(plan: &ShardPlan, watch: &mut dyn FnMut() -> Result<()>) -> Result<()> {
    let access = plan.options.access();
    let mut missing = Vec::new();
    for number in 0..plan.shards() {
        watch()?;
        if journal::read_head(&plan.shard_folder(number, access)?, access)?.is_none() {
            missing.push(number);
        }
    }
    if missing.is_empty() { Ok(()) } else { Err(missing_error(plan, &missing)) }
}

fn missing_error(plan: &ShardPlan, missing: &[u64]) -> Error {
    Error::new(ErrorKind::Input, plan.folder.display())
        .found(format_args!("{} of {} missing", missing.len(), Count(plan.shards(), "shard")))
        .expected("all shards")
        .remedy(format_args!("run the shards {}", shard_numbers::format_shards(missing)))
}
