//! Generates a whole dataset. The module plans the sequences, generates missing sequences, and records failures.

use std::path::Path;

use serde::Serialize;

use crate::discover::input_path;
use crate::entries::{expected_bytes, planned_entries};
use crate::exporters::{self, Exporters};
use crate::exposure_note::ExposureFaults;
use crate::fingerprint::{self, exists};
use crate::manifest::{self, sequence_path};
use crate::record::intact_or_none;
use crate::sequence::GeneratedSequence;
use crate::{
    Content, DatasetOptions, Manifest, SequenceEntry, SequenceRecord, SequenceStatus, datasheet, sequence,
};
use spikelane::error::{Error, ErrorKind, Result, Setting};
use spikelane::unstable::Count;
use spikelane::unstable::inputs::{Access, InnerPath};
use spikelane_io::storage::{self, OutputSet, folders};

/// Progress of the generation of a dataset.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct SequenceProgress<'a> {
    /// Index of the current sequence.
    pub index: usize,
    /// Total number of sequences.
    pub sequence_count: usize,
    /// Name of the current sequence.
    pub id: &'a str,
    /// Number of readouts of the current sequence that are done.
    pub readouts: u64,
    /// Total number of readouts of the current sequence. `None` if the number is unknown.
    pub total_readouts: Option<u64>,
    /// Whether the current sequence is finished and is being verified.
    pub is_verifying: bool,
}

/// Estimated cost of a dataset.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct DatasetEstimate {
    /// Number of sequences that are not done.
    pub sequences: usize,
    /// Total number of readouts of the sequences that are not done. Videos whose number of readouts is unknown are not
    /// counted.
    pub readouts: u64,
    /// Approximate number of bytes on disk.
    pub bytes: u64,
    /// Number of inputs whose length is unknown until the inputs are read.
    pub inputs_of_unknown_length: usize,
}

/// A sequence that failed.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct SequenceFailure {
    /// Name of the input, or of the sequence if it has no input.
    pub input: String,
    /// Why the sequence failed, in one line.
    pub reason: String,
}

impl From<&SequenceEntry> for SequenceFailure {
    fn from(entry: &SequenceEntry) -> Self {
        let input = entry.input.clone().filter(|name| !name.is_empty());
        let reason = entry.reason.clone().unwrap_or_default();
        Self { input: input.unwrap_or_else(|| entry.id.to_string()), reason }
    }
}

/// Result of the generation of a dataset.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct DatasetReport {
    /// Number of sequences that were generated.
    pub generated: usize,
    /// Number of existing sequences that passed verification.
    pub verified_sequences: usize,
    /// Number of sequences that failed.
    pub failed_sequences: usize,
    /// The inputs that failed.
    pub failures: Vec<SequenceFailure>,
    /// Number of generated scenes in which a visible point moves by more than half a pixel between consecutive
    /// readouts.
    pub too_fast_scenes: usize,
    /// Lowest readout rate in Hz at which no visible point of any generated scene moves by more than half a pixel per
    /// readout. The value is 0 if the actual rate is sufficient for all generated scenes.
    pub required_readout_hz: u64,
    /// Notes for the user about the inputs and the light of generated sequences. Each note is one line.
    #[serde(skip)]
    pub notes: Vec<String>,
    /// Number of files that were copied to the loaders' folders because the file system does not support hard links.
    pub copied_files: u64,
    /// The digest of the dataset; see [`Manifest::dataset_digest`].
    pub digest: String,
}

/// Estimates the number of readouts and bytes of a dataset. Nothing is written. If the dataset is resumed, only the
/// remaining sequences are counted.
///
/// # Examples
/// ```
/// use std::path::Path;
/// use spikelane_dataset::{Access, DatasetOptions, config, estimate};
/// # let folder = tempfile::tempdir().map_err(|e| spikelane::Error::io("a folder", e))?;
/// let text = "format_version = 1\n[scenes]\npreset = \"tiny\"\nsequences = 3";
/// let options = config::from_toml(text, Path::new(""), Access::Read)?;
/// let options = DatasetOptions { output: folder.path().join("set"), ..options };
/// assert_eq!(estimate(&options)?.sequences, 3);
/// // An estimate writes nothing.
/// assert!(!options.output.exists());
/// # Ok::<(), spikelane::Error>(())
/// ```
///
/// # Errors
/// * The errors of [`DatasetOptions::check`].
/// * [`ErrorKind::Exists`] if the dataset exists and `resume` is false.
/// * [`ErrorKind::Config`] if the dataset is resumed and its manifest contains other options.
/// * [`ErrorKind::Io`] if the inputs cannot be listed.
/// * [`ErrorKind::Input`] if no input is found.
pub fn estimate(options: &DatasetOptions) -> Result<DatasetEstimate> {
    let manifest = planned_manifest(options)?;
    let mut sum = DatasetEstimate::default();
    for entry in manifest.entries.iter().filter(|e| e.status != SequenceStatus::Done) {
        sum.sequences += 1;
        sum.readouts = sum.readouts.saturating_add(entry.readouts.unwrap_or(0));
        sum.bytes = sum.bytes.saturating_add(expected_bytes(options, entry.readouts)?.unwrap_or(0));
        sum.inputs_of_unknown_length += usize::from(entry.readouts.is_none());
    }
    Ok(sum)
}

/// Maximum number of scenes that one process generates. The entries of all scenes are in memory, and each entry needs
/// a few hundred bytes.
const MAX_SEQUENCES: u64 = 1_000_000;

/// Returns the existing manifest or a new manifest. If inputs were added since the manifest was written, the result
/// also contains the new inputs.
fn planned_manifest(options: &DatasetOptions) -> Result<Manifest> {
    options.check()?;
    if let Content::Scenes(drives) = &options.content
        && u64::from(drives.sequences) > MAX_SEQUENCES
    {
        return Err(Error::new(ErrorKind::Usage, "dataset")
            .found(Count(drives.sequences, "sequence"))
            .expected(format_args!("at most {MAX_SEQUENCES} in one process"))
            .remedy("plan the dataset in shards"));
    }
    let facts = options.manifest_options()?;
    let list = InnerPath::from(manifest::FILE_NAME).resolve_in(&options.output, Access::Write)?;
    let begun = list.symlink_metadata().is_ok();
    if begun && !options.resume {
        return Err(Error::new(ErrorKind::Exists, options.output.display())
            .found("an existing dataset")
            .expected("a folder without a dataset")
            .remedy(format_args!(
                "set {} to continue this dataset, or choose another folder",
                Setting("resume")
            )));
    }
    let mut entries = planned_entries(options)?;
    if begun {
        let old = Manifest::read(&options.output, options.access())?;
        old.check_same_options(&facts, &options.output)?;
        let mut known: std::collections::BTreeMap<_, _> =
            old.entries.into_iter().map(|e| (e.id.clone(), e)).collect();
        for entry in &mut entries {
            if let Some(old) = known.remove(&entry.id).filter(|e| e.status == SequenceStatus::Done) {
                *entry = old;
            }
        }
        // If the input of a finished sequence no longer exists, the sequence remains in the manifest.
        entries.extend(known.into_values().filter(|e| e.status == SequenceStatus::Done));
    }
    Ok(Manifest { options: facts, entries })
}

/// Generates the missing sequences of a dataset. `progress` is called after every batch.
///
/// If `progress` returns an error, the generation stops. Finished sequences remain, and no partial file remains.
///
/// If a sequence fails because of its input, the sequence is marked as failed and the reason is recorded. A full disk,
/// another error of the operating system, or a request to stop ends the generation.
///
/// # Errors
/// * The errors of [`estimate`].
/// * [`ErrorKind::Space`] at the start if the estimate exceeds the free space.
/// * The errors that end the generation, such as a full disk.
pub fn generate(
    options: &DatasetOptions,
    progress: &mut dyn FnMut(SequenceProgress<'_>) -> Result<()>,
) -> Result<DatasetReport> {
    // The folder remains locked until this function returns. The lock also fails early if the folder is not writable.
    let _claim = OutputSet::claim_folder(&options.output)?;
    exporters::check_camera(options)?;
    let mut manifest = planned_manifest(options)?;
    let needed = estimate(options)?.bytes;
    if let Some(free) = storage::free_space(&options.output)?.filter(|&free| needed > free) {
        return Err(Error::new(ErrorKind::Space, options.output.display())
            .found(format_args!("{} free", Count(free, "byte")))
            .expected(format_args!("about {needed}"))
            .remedy("generate fewer sequences, or choose another disk"));
    }
    folders::create_parents(&options.output, &InnerPath::from("sequences/any"))?;
    exporters::remove_partials(&options.output)?;
    manifest.write(&options.output)?;
    exporters::write_config(options)?;
    let mut report = DatasetReport::default();
    let mut exposure = ExposureFaults::default();
    let sequences = manifest.entries.len();
    for index in 0..sequences {
        let entry = manifest.entries[index].clone();
        let id = entry.id.as_str();
        let at = |readouts, total, verifying| SequenceProgress {
            index,
            sequence_count: sequences,
            id,
            readouts,
            total_readouts: total,
            is_verifying: verifying,
        };
        if entry.status == SequenceStatus::Done {
            let mut stop = || progress(at(0, entry.readouts, true));
            stop()?;
            if is_verified(options, &entry, &mut stop)?
                && current_input_digest(options, &entry, &mut stop)? == entry.input_digest
            {
                report.copied_files += exporters::link_sequence(options, &entry)?;
                report.verified_sequences += 1;
                continue;
            }
        }
        exporters::unlink_sequence(options, &entry.id)?;
        // The digest is computed before the input is read. If the input changes during the generation, the next run
        // with `resume` therefore detects the change.
        let read = current_input_digest(options, &entry, &mut || progress(at(0, None, false)));
        let result =
            sequence::generate_sequence(options, &entry, &mut |done, total| progress(at(done, total, false)));
        if let Ok(generated) = &result {
            exposure.add(id, generated.exposure_fault);
        }
        manifest.entries[index] = record_outcome(entry, result, &mut report)?;
        manifest.entries[index].input_digest = read.unwrap_or(None);
        if manifest.entries[index].status == SequenceStatus::Done {
            report.copied_files += exporters::link_sequence(options, &manifest.entries[index])?;
        } else {
            // A previous attempt may have created a folder whose files no longer match their digests.
            folders::remove(&options.output, &sequence_path(&manifest.entries[index].id))?;
        }
        manifest.write(&options.output)?;
    }
    report.notes.extend(exposure.note());
    let (mut counts, mut views) = (datasheet::Counts::default(), Exporters::new());
    for entry in &manifest.entries {
        counts.add(entry);
        report.copied_files += views.add(options, entry)?;
    }
    views.finish(options, &datasheet::content_description(options))?;
    report.digest = manifest.dataset_digest();
    datasheet::write(options, &counts, &report.digest)?;
    Ok(report)
}

/// Returns the current digest of the input of a sequence.
///
/// Scenes have no input digest. If the input of a sequence no longer exists, the recorded digest is returned.
fn current_input_digest(
    options: &DatasetOptions,
    entry: &SequenceEntry,
    stop: &mut dyn FnMut() -> Result<()>,
) -> Result<Option<String>> {
    let (Content::Inputs(inputs), Some(name)) = (&options.content, &entry.input) else { return Ok(None) };
    let path = input_path(inputs, Path::new(name), options.access())?;
    if !exists(&path)? {
        // If the input of a sequence no longer exists, the sequence cannot be generated again. The recorded digest is
        // returned, so that the sequence counts as unchanged and remains.
        return Ok(entry.input_digest.clone());
    }
    fingerprint::input_digest(&path, options.follow_links, stop).map(Some)
}

/// Returns whether every file of a finished sequence matches its digest.
///
/// A link to a file outside the folder is an error. The user created this link, and the program must not replace it
/// unless the user requests it.
fn is_verified(
    options: &DatasetOptions,
    entry: &SequenceEntry,
    stop: &mut dyn FnMut() -> Result<()>,
) -> Result<bool> {
    let Some(digest) = entry.digest.as_deref() else { return Ok(false) };
    let folder = sequence_path(&entry.id).resolve_in(&options.output, options.access())?;
    intact_or_none(SequenceRecord::verify(&folder, digest, options.access(), stop))
        .map(|record| record.is_some())
}

/// Returns the entry of a sequence after an attempt to generate the sequence. Returns an error if the attempt failed
/// for a reason that would also stop the next sequence.
fn record_outcome(
    mut entry: SequenceEntry,
    result: Result<GeneratedSequence>,
    report: &mut DatasetReport,
) -> Result<SequenceEntry> {
    match result {
        Ok(GeneratedSequence { record, digest, readouts, .. }) => {
            entry.status = SequenceStatus::Done;
            (entry.bytes, entry.digest, entry.readouts) =
                (Some(record.bytes()), Some(digest), Some(readouts));
            entry.reason = None;
            report.generated += 1;
            let notes = record.facts["notes"].as_array().into_iter().flatten();
            report.notes.extend(notes.filter_map(|n| n.as_str().map(str::to_owned)));
            if record.facts["is_too_fast"] == true {
                let needed = record.facts["required_readout_hz"].as_u64().unwrap_or(0);
                report.too_fast_scenes += 1;
                report.required_readout_hz = report.required_readout_hz.max(needed);
            }
        }
        // If a file cannot be read, the input is the cause, and the sequence fails. Scenes have no input.
        Err(e)
            if entry.input.is_some()
                && matches!(
                    e.kind(),
                    ErrorKind::Input | ErrorKind::Usage | ErrorKind::Tool | ErrorKind::Io
                ) =>
        {
            entry.status = SequenceStatus::Failed;
            entry.digest = None;
            entry.reason = Some(e.to_string());
            report.failed_sequences += 1;
            report.failures.push((&entry).into());
        }
        Err(e) if e.kind() == ErrorKind::Space => {
            return Err(e.remedy(format_args!(
                "free some space, then set {} to continue; finished sequences are kept",
                Setting("resume")
            )));
        }
        Err(e) => return Err(e),
    }
    Ok(entry)
}
