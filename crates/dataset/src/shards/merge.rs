//! Merges shards into a dataset. The merge verifies the shards and writes the manifest, the links and the datasheet.

use std::path::PathBuf;

use serde::Serialize;

use super::finished::check_finished;
use super::journal;
use super::lock::{self, Lock};
use super::plan::ShardPlan;
use crate::exporters::{self, Exporters};
use crate::manifest::{self, DatasetDigest, sequence_path};
use crate::{SequenceEntry, SequenceFailure, SequenceRecord, SequenceStatus, datasheet};
use spikelane::error::{Error, ErrorKind, Result, Setting};

/// Options of a merge.
#[derive(Clone, Copy, Debug)]
pub struct MergeOptions {
    /// Whether the digest of every file is verified. If false, only sizes and modification times are compared.
    pub verify_digests: bool,
    /// Whether links to the files of the sequences are created in the loaders' folders. Packed sequences have no files
    /// that can be linked.
    pub create_links: bool,
    /// Whether the folder is locked; see [`ShardOptions::take_lock`](super::ShardOptions::take_lock).
    pub take_lock: bool,
}

/// Result of a merge.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct MergeReport {
    /// Number of finished sequences.
    pub sequences: u64,
    /// The sequences that failed.
    pub failures: Vec<SequenceFailure>,
    /// Digest of the records of all sequences. The digest does not depend on the division into shards.
    pub digest: String,
    /// Number of files that were copied to the loaders' folders because the file system does not support hard links.
    pub copied_files: u64,
}

/// Verifies every shard. Writes `manifest.jsonl`, the loaders' folders and the datasheet.
///
/// `progress` receives the number of the current shard and the number of all shards. If `progress` returns an error,
/// the merge stops.
///
/// # Errors
/// * [`ErrorKind::Input`] if shards are missing. The error lists the numbers of the missing shards.
/// * [`ErrorKind::Corrupt`] if a shard is damaged. The error names the first damaged shard.
/// * [`ErrorKind::Busy`] if another process is merging the shards.
/// * Errors of reading and writing.
pub fn merge(
    plan: &ShardPlan,
    options: &MergeOptions,
    progress: &mut dyn FnMut(u64, u64) -> Result<()>,
) -> Result<MergeReport> {
    // A merge removes the partial files of merges that were killed. Two merges at the same time would remove each
    // other's files.
    let _lock = options.take_lock.then(|| Lock::acquire(&lock::lock_path(&plan.folder))).transpose()?;
    exporters::remove_partials(&plan.folder)?;
    check_finished(plan, &mut || progress(0, plan.shards()))?;
    let mut merged = MergeReport::default();
    let mut digest = DatasetDigest::default();
    let mut counts = datasheet::Counts::default();
    let mut views = Exporters::new();
    let mut list = manifest::ManifestWriter::begin(&plan.folder, &plan.options.manifest_options()?)?;
    for number in 0..plan.shards() {
        progress(number, plan.shards())?;
        for entry in verified_entries(plan, number, options, &mut || progress(number, plan.shards()))? {
            digest.add(&entry);
            counts.add(&entry);
            match entry.status {
                SequenceStatus::Done => merged.sequences += 1,
                _ => merged.failures.push((&entry).into()),
            }
            progress(number, plan.shards())?;
            if options.create_links && !plan.pack_shards && entry.status == SequenceStatus::Done {
                merged.copied_files += exporters::link_sequence(&plan.options, &entry)?;
                merged.copied_files += views.add(&plan.options, &entry)?;
            }
            list.add(&entry)?;
        }
    }
    list.finish()?;
    if options.create_links && !plan.pack_shards {
        views.finish(&plan.options, &datasheet::content_description(&plan.options))?;
    }
    exporters::write_config(&plan.options)?;
    merged.digest = digest.text();
    datasheet::write(&plan.options, &counts, &merged.digest)?;
    Ok(merged)
}

/// Verifies a shard and returns its sequences. If `stop` returns an error, the verification ends immediately.
fn verified_entries(
    plan: &ShardPlan,
    number: u64,
    options: &MergeOptions,
    stop: &mut dyn FnMut() -> Result<()>,
) -> Result<Vec<SequenceEntry>> {
    let access = plan.options.access();
    let folder = plan.shard_folder(number, access)?;
    // The remedy is to run the shard again. For other errors, such as a request to stop, this remedy would be wrong.
    let again = |e: Error| match e.kind() {
        ErrorKind::Corrupt | ErrorKind::Config | ErrorKind::Io => e.remedy(format_args!(
            "run the shards again: set {} to {number} and enable {}",
            Setting("shards"),
            Setting("verify")
        )),
        _ => e,
    };
    let damaged = |place: PathBuf| {
        again(
            Error::new(ErrorKind::Corrupt, place.display())
                .found("missing files, or files with another size or time")
                .expected("the files in the manifest of the shard"),
        )
    };
    let read = journal::read_manifest(&folder, plan.shard_sequences(number), access)?;
    let (head, lines) = read.ok_or_else(|| damaged(folder.clone()))?;
    if let Some(packed) = &head.tar {
        let path = plan.shard_tar_path(number, access)?;
        if !packed.is_intact(&path, options.verify_digests, stop)? {
            return Err(damaged(path));
        }
    }
    let mut entries = Vec::with_capacity(lines.len());
    for line in lines {
        stop()?;
        if head.tar.is_none() && line.entry.status == SequenceStatus::Done {
            let place = sequence_path(&line.entry.id).resolve_in(&folder, access)?;
            if options.verify_digests {
                let digest = line.entry.digest.as_deref().unwrap_or_default();
                SequenceRecord::verify(&place, digest, access, stop).map_err(again)?;
            } else if !line.is_intact(&place, access)? {
                return Err(damaged(place));
            }
        }
        entries.push(SequenceEntry { shard: Some(plan.shard_name(number)), ..line.entry });
    }
    Ok(entries)
}
