//! The whole dataset: plan, make what is not done, set aside what fails.

use std::path::PathBuf;

use crate::entries::{entries, expected_bytes};
use crate::from::located;
use crate::manifest::{self, sequence_path};
use crate::record::if_intact;
use crate::stamp;
use crate::views::{self, Views};
use crate::{DatasetOptions, Entry, Manifest, Record, Status, Work, card, sequence};
use spikelane::error::{Error, Kind, Result};
use spikelane::unstable::inputs::{Access, InnerPath};
use spikelane_io::storage::{self, OutputSet, trees};

/// How far a dataset is.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct Progress<'a> {
    /// Index of the sequence.
    pub index: usize,
    /// All sequences.
    pub of: usize,
    /// Its name.
    pub id: &'a str,
    /// Readouts of it that are done.
    pub readouts: u64,
    /// Its readouts, if known.
    pub total: Option<u64>,
    /// Whether a finished sequence is being verified.
    pub verifying: bool,
}

/// What a dataset will take.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Estimate {
    /// Sequences that are not done.
    pub sequences: usize,
    /// Their readouts; unknown ones (videos) are not counted.
    pub readouts: u64,
    /// Bytes on the disk, about.
    pub bytes: u64,
    /// Inputs whose length only their end will tell.
    pub unknown: usize,
}

/// What was done.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Report {
    /// Sequences made.
    pub made: usize,
    /// Sequences that were there and verified.
    pub verified: usize,
    /// Sequences set aside.
    pub failed: usize,
    /// Inputs that were set aside, and why.
    pub set_aside: Vec<(String, String)>,
    /// Scenes made whose picture moves by more than half a pixel from one readout to the next.
    pub too_fast: usize,
    /// Readouts a second at which none of them would; 0 when none does.
    pub needed_readout_hz: u64,
    /// What the user should know of the inputs of sequences made, one line each.
    pub notes: Vec<String>,
    /// Files that were copied into the loaders' folders, since the file system has no hard links.
    pub copied: u64,
    /// The digest of the dataset, see [`Manifest::digest`].
    pub digest: String,
}

/// What the dataset will take, without writing anything; on resume, what is left of it.
///
/// # Errors
/// As [`DatasetOptions::check`], and when inputs cannot be listed or the manifest differs.
pub fn estimate(options: &DatasetOptions) -> Result<Estimate> {
    let manifest = plan(options)?;
    let mut sum = Estimate::default();
    for entry in manifest.entries.iter().filter(|e| e.status != Status::Done) {
        sum.sequences += 1;
        sum.readouts = sum.readouts.saturating_add(entry.readouts.unwrap_or(0));
        sum.bytes = sum.bytes.saturating_add(expected_bytes(options, entry.readouts)?.unwrap_or(0));
        sum.unknown += usize::from(entry.readouts.is_none());
    }
    Ok(sum)
}

/// The most scenes of a dataset that one process makes: their entries are held in memory, some hundred bytes each.
const MAX_SEQUENCES: u64 = 1_000_000;

/// The manifest as it stands, or as it will begin; new inputs are added to an old one.
fn plan(options: &DatasetOptions) -> Result<Manifest> {
    options.check()?;
    if let Work::Drives(drives) = &options.work
        && u64::from(drives.sequences) > MAX_SEQUENCES
    {
        return Err(Error::new(Kind::Usage, "dataset")
            .found(format_args!("{} sequences", drives.sequences))
            .expected(format_args!("at most {MAX_SEQUENCES} that one process makes"))
            .remedy("plan the data set in shards ('spikelane dataset plan')"));
    }
    let facts = options.facts()?;
    let list = InnerPath::from(manifest::NAME).below(&options.output, Access::Write)?;
    let begun = list.symlink_metadata().is_ok();
    if begun && !options.resume {
        return Err(Error::new(Kind::Exists, options.output.display())
            .found("a dataset")
            .expected("a free folder")
            .remedy("go on with it (--resume), or choose another folder"));
    }
    let mut entries = entries(options)?;
    if begun {
        let old = Manifest::read_below(&options.output, options.access())?;
        old.same_options(&facts, &options.output)?;
        let mut known: std::collections::BTreeMap<_, _> =
            old.entries.into_iter().map(|e| (e.id.clone(), e)).collect();
        for entry in &mut entries {
            if let Some(old) = known.remove(&entry.id).filter(|e| e.status == Status::Done) {
                *entry = old;
            }
        }
        // Finished sequences whose input is gone stay.
        entries.extend(known.into_values().filter(|e| e.status == Status::Done));
    }
    Ok(Manifest { options: facts, entries })
}

/// Makes the dataset, or what is missing of it; `watch` hears of every batch, and its error
/// stops the work, which leaves finished sequences and nothing half-written.
///
/// A sequence that fails by its own input is set aside with the reason; a full disk, a refusing
/// system or a request to stop ends everything.
///
/// # Errors
/// See above, and as [`estimate`]; [`Kind::Space`] before the start when the estimate does not fit.
pub fn make(options: &DatasetOptions, watch: &mut dyn FnMut(Progress<'_>) -> Result<()>) -> Result<Report> {
    // Held to the end; it also shows beforehand that the folder takes files.
    let _claim = OutputSet::claim_folder(&options.output)?;
    let mut manifest = plan(options)?;
    let needed = estimate(options)?.bytes;
    if let Some(free) = storage::free_space(&options.output)?.filter(|&free| needed > free) {
        return Err(Error::new(Kind::Space, options.output.display())
            .found(format_args!("{free} bytes free"))
            .expected(format_args!("about {needed}"))
            .remedy("make fewer sequences, or choose another disk"));
    }
    trees::prepare(&options.output, &InnerPath::from("sequences/any"))?;
    views::clean(&options.output)?;
    manifest.write(&options.output)?;
    views::config(options)?;
    let mut report = Report::default();
    let of = manifest.entries.len();
    for index in 0..of {
        let entry = manifest.entries[index].clone();
        let id = entry.id.as_str();
        let at = |readouts, total, verifying| Progress { index, of, id, readouts, total, verifying };
        if entry.status == Status::Done {
            let mut stop = || watch(at(0, entry.readouts, true));
            stop()?;
            if verified(options, &entry, &mut stop)?
                && input_digest(options, &entry, &mut stop)? == entry.input_digest
            {
                report.copied += views::place(options, &entry)?;
                report.verified += 1;
                continue;
            }
        }
        views::displace(options, &entry.id)?;
        // Taken before it is read: a change meanwhile is then seen by the next --resume.
        let read = input_digest(options, &entry, &mut || watch(at(0, None, false)));
        let made = sequence::make(options, &entry, &mut |done, total| watch(at(done, total, false)));
        manifest.entries[index] = settle(entry, made, &mut report)?;
        manifest.entries[index].input_digest = read.unwrap_or(None);
        if manifest.entries[index].status == Status::Done {
            report.copied += views::place(options, &manifest.entries[index])?;
        } else {
            // A former attempt may have left a folder whose digests no longer hold.
            trees::remove(&options.output, &sequence_path(&manifest.entries[index].id))?;
        }
        manifest.write(&options.output)?;
    }
    let (mut counts, mut views) = (card::Counts::default(), Views::new());
    for entry in &manifest.entries {
        counts.add(entry);
        report.copied += views.add(options, entry)?;
    }
    views.finish(options, &card::origin(options))?;
    report.digest = manifest.digest();
    card::write(options, &counts, &report.digest)?;
    Ok(report)
}

/// Digest of the input as it is now; none for scenes, and for an input that is gone.
fn input_digest(
    options: &DatasetOptions,
    entry: &Entry,
    stop: &mut dyn FnMut() -> Result<()>,
) -> Result<Option<String>> {
    let (Work::Inputs(inputs), Some(name)) = (&options.work, &entry.input) else { return Ok(None) };
    let path = located(inputs, &PathBuf::from(name))?;
    if !path.exists() {
        // Nothing is left to make it from, so what was made stays.
        return Ok(entry.input_digest.clone());
    }
    stamp::digest(&path, stop).map(Some)
}

/// Whether every file of a finished sequence has its digest. A link that leaves the folder is an error, since what the
/// user put there must not be made again unasked.
fn verified(options: &DatasetOptions, entry: &Entry, stop: &mut dyn FnMut() -> Result<()>) -> Result<bool> {
    let Some(digest) = entry.digest.as_deref() else { return Ok(false) };
    let folder = sequence_path(&entry.id).below(&options.output, options.access())?;
    if_intact(Record::verify_below(&folder, digest, options.access(), stop)).map(|record| record.is_some())
}

/// The entry after an attempt; an error that would strike the next sequence too is passed on.
fn settle(mut entry: Entry, made: Result<(Record, String, u64)>, report: &mut Report) -> Result<Entry> {
    match made {
        Ok((record, digest, readouts)) => {
            entry.status = Status::Done;
            (entry.bytes, entry.digest, entry.readouts) =
                (Some(record.bytes()), Some(digest), Some(readouts));
            entry.reason = None;
            report.made += 1;
            let notes = record.about["notes"].as_array().into_iter().flatten();
            report.notes.extend(notes.filter_map(|n| n.as_str().map(str::to_owned)));
            if record.about["too_fast"] == true {
                let needed = record.about["needed_readout_hz"].as_u64().unwrap_or(0);
                report.too_fast += 1;
                report.needed_readout_hz = report.needed_readout_hz.max(needed);
            }
        }
        // A file that cannot be read is the input's fault; scenes have no input.
        Err(e)
            if entry.input.is_some()
                && matches!(e.kind(), Kind::Input | Kind::Usage | Kind::Tool | Kind::Io) =>
        {
            entry.status = Status::Failed;
            entry.digest = None;
            entry.reason = Some(e.to_string());
            report.failed += 1;
            report.set_aside.push((entry.input.clone().unwrap_or_default(), e.to_string()));
        }
        Err(e) if e.kind() == Kind::Space => {
            return Err(e.remedy("free some space, then go on with --resume; finished sequences are kept"));
        }
        Err(e) => return Err(e),
    }
    Ok(entry)
}
