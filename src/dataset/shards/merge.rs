//! Shards become a dataset: verified, listed, split and described.

use std::path::PathBuf;

use super::journal;
use super::lock::{self, Lock};
use super::numbers;
use super::plan::Plan;
use crate::dataset::manifest::{self, DigestOf};
use crate::dataset::views::{self, Views};
use crate::dataset::{Entry, Record, Status, card};
use crate::error::{Error, Kind, Result};

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
    let missing = missing(plan)?;
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
        for entry in verified(plan, number, how)? {
            digest.add(&entry);
            counts.add(&entry);
            match entry.status {
                Status::Done => merged.sequences += 1,
                _ => {
                    let name = entry.input.clone().unwrap_or_else(|| entry.id.clone());
                    merged.set_aside.push((name, entry.reason.clone().unwrap_or_default()));
                }
            }
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

fn missing(plan: &Plan) -> Result<Vec<u64>> {
    let mut all = Vec::new();
    for number in 0..plan.shards() {
        if journal::read_head(&plan.shard_folder(number))?.is_none() {
            all.push(number);
        }
    }
    Ok(all)
}

/// The sequences of a shard that is as it was left.
fn verified(plan: &Plan, number: u64, how: &Merging) -> Result<Vec<Entry>> {
    let folder = plan.shard_folder(number);
    let again = |e: Error| e.remedy(format_args!("run the shard again: --shard {number} --verify"));
    let damaged = |place: PathBuf| {
        again(
            Error::new(Kind::Corrupt, place.display())
                .found("files missing, or of another size or time")
                .expected("what the shard's manifest lists"),
        )
    };
    let read = journal::read_manifest(&folder)?;
    let (head, lines) = read.ok_or_else(|| damaged(folder.clone()))?;
    if let Some(packed) = &head.pack {
        let path = plan.shard_pack(number);
        if !packed.holds(&path, !how.quick) {
            return Err(damaged(path));
        }
    }
    let mut entries = Vec::with_capacity(lines.len());
    for line in lines {
        let place = folder.join("sequences").join(&line.entry.id);
        if head.pack.is_none() && line.entry.status == Status::Done {
            if how.quick {
                if !line.holds(&place) {
                    return Err(damaged(place));
                }
            } else {
                let digest = line.entry.digest.as_deref().unwrap_or_default();
                Record::verify(&place, digest).map_err(again)?;
            }
        }
        entries.push(Entry { shard: Some(plan.shard_name(number)), ..line.entry });
    }
    Ok(entries)
}
