//! Shards become a dataset: verified, listed, split and described.

use std::path::PathBuf;

use super::journal;
use super::lock::{self, Lock};
use super::numbers;
use super::plan::Plan;
use crate::manifest::{self, DigestOf, sequence_path};
use crate::views::{self, Views};
use crate::{Entry, Record, Status, card};
use spikelane::error::{Error, Kind, Result};

/// How shards are merged.
#[derive(Clone, Copy, Debug)]
pub struct Merging {
    /// Trust sizes and times; else every digest is verified.
    pub quick: bool,
    /// Link sequences into the folders that loaders read; packed ones have no files to link.
    pub links: bool,
    /// Take the folder's lock, see [`super::Running::lock`].
    pub lock: bool,
}

/// A merged dataset.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Merged {
    /// Sequences that are done.
    pub sequences: u64,
    /// Sequences set aside, and why.
    pub set_aside: Vec<(String, String)>,
    /// The digest of all records: the same however the work was cut.
    pub digest: String,
    /// Files that were copied into the loaders' folders, since the file system has no hard links.
    pub copied: u64,
}

/// Verifies every shard and writes `manifest.jsonl`, the folders of loaders, and the datasheet. `watch` hears of every
/// shard and of how many there are.
///
/// # Errors
/// [`Kind::Input`] with the numbers of the shards that are missing; [`Kind::Corrupt`] with the first that is damaged;
/// [`Kind::Busy`] while another process merges; those of reading and writing.
pub fn merge(plan: &Plan, how: &Merging, watch: &mut dyn FnMut(u64, u64) -> Result<()>) -> Result<Merged> {
    // One at a time: the next one removes what a killed one left.
    let _lock = how.lock.then(|| Lock::take(&lock::place(&plan.folder))).transpose()?;
    views::clean(&plan.folder)?;
    let missing = missing(plan, watch)?;
    if !missing.is_empty() {
        return Err(Error::new(Kind::Input, plan.folder.display())
            .found(format_args!("{} of {} shards missing", missing.len(), plan.shards()))
            .expected("all of them")
            .remedy(format_args!("run them: --array={}", numbers::text(&missing))));
    }
    let mut merged = Merged::default();
    let mut digest = DigestOf::default();
    let mut counts = card::Counts::default();
    let mut views = Views::new();
    let mut list = manifest::Listing::begin(&plan.folder, &plan.options.facts()?)?;
    for number in 0..plan.shards() {
        watch(number, plan.shards())?;
        for entry in verified(plan, number, how, &mut || watch(number, plan.shards()))? {
            digest.add(&entry);
            counts.add(&entry);
            match entry.status {
                Status::Done => merged.sequences += 1,
                _ => {
                    let name = entry.input.clone().unwrap_or_else(|| entry.id.to_string());
                    merged.set_aside.push((name, entry.reason.clone().unwrap_or_default()));
                }
            }
            watch(number, plan.shards())?;
            if how.links && !plan.pack && entry.status == Status::Done {
                merged.copied += views::place(&plan.options, &entry)?;
                merged.copied += views.add(&plan.options, &entry)?;
            }
            list.add(&entry)?;
        }
    }
    list.finish()?;
    if how.links && !plan.pack {
        views.finish(&plan.options, &card::origin(&plan.options))?;
    }
    views::config(&plan.options)?;
    merged.digest = digest.text();
    card::write(&plan.options, &counts, &merged.digest)?;
    Ok(merged)
}

fn missing(plan: &Plan, watch: &mut dyn FnMut(u64, u64) -> Result<()>) -> Result<Vec<u64>> {
    let access = plan.options.access();
    let mut all = Vec::new();
    for number in 0..plan.shards() {
        watch(0, plan.shards())?;
        if journal::read_head(&plan.shard_folder(number, access)?, access)?.is_none() {
            all.push(number);
        }
    }
    Ok(all)
}

/// The sequences of a shard that is as it was left; an error of `stop` ends it at once.
fn verified(
    plan: &Plan,
    number: u64,
    how: &Merging,
    stop: &mut dyn FnMut() -> Result<()>,
) -> Result<Vec<Entry>> {
    let access = plan.options.access();
    let folder = plan.shard_folder(number, access)?;
    // Other errors, such as a request to stop, have a remedy of their own.
    let again = |e: Error| match e.kind() {
        Kind::Corrupt | Kind::Config | Kind::Io => {
            e.remedy(format_args!("run the shard again: --shard {number} --verify"))
        }
        _ => e,
    };
    let damaged = |place: PathBuf| {
        again(
            Error::new(Kind::Corrupt, place.display())
                .found("files missing, or of another size or time")
                .expected("what the shard's manifest lists"),
        )
    };
    let read = journal::read_manifest(&folder, plan.sequences_of(number), access)?;
    let (head, lines) = read.ok_or_else(|| damaged(folder.clone()))?;
    if let Some(packed) = &head.pack {
        let path = plan.shard_pack(number, access)?;
        if !packed.holds(&path, !how.quick, stop)? {
            return Err(damaged(path));
        }
    }
    let mut entries = Vec::with_capacity(lines.len());
    for line in lines {
        stop()?;
        if head.pack.is_none() && line.entry.status == Status::Done {
            let place = sequence_path(&line.entry.id).below(&folder, access)?;
            if how.quick {
                if !line.holds(&place, access)? {
                    return Err(damaged(place));
                }
            } else {
                let digest = line.entry.digest.as_deref().unwrap_or_default();
                Record::verify_below(&place, digest, access, stop).map_err(again)?;
            }
        }
        entries.push(Entry { shard: Some(plan.shard_name(number)), ..line.entry });
    }
    Ok(entries)
}
