//! The dataset as loaders of the field expect it: folders of links, tables of labels, and texts that describe them.

mod coco;
mod croissant;
mod kitti;
mod links;
mod metadata;
mod mot;
mod spikecv;

use crate::{DatasetOptions, Entry, Split, Status, frames};
use spikelane::error::Result;
use spikelane_io::storage::trees;

pub(super) use links::{clean, displace, place};
pub(super) use spikecv::config;

/// The tables over all sequences, in the making.
pub(super) struct Views {
    tables: metadata::Tables,
    /// Of each split, in the order of the type's variants.
    coco: [Option<coco::Merged>; 3],
}

impl Views {
    pub(super) fn new() -> Self {
        Self { tables: metadata::Tables::default(), coco: [None, None, None] }
    }

    /// Takes in a sequence that is done; returns how many files had to be copied.
    pub(super) fn add(&mut self, options: &DatasetOptions, entry: &Entry) -> Result<u64> {
        if entry.status != Status::Done {
            return Ok(0);
        }
        let split = entry.split as usize;
        self.tables.add(entry, split);
        let frames = frames::read(&entry.path().below(&options.output, options.access())?, options.access())?;
        let Some(first) = frames.first() else { return Ok(0) };
        mot::write(options, entry, &frames)?;
        kitti::write(options, entry, &first.camera, &frames)?;
        if self.coco[split].is_none() {
            self.coco[split] = Some(coco::Merged::begin(&options.output, entry.split)?);
        }
        if let Some(merged) = &mut self.coco[split] {
            merged.add(options, entry)?;
        }
        spikecv::link_labels(options, entry, &frames)
    }

    /// Writes what is written once, and describes it.
    pub(super) fn finish(self, options: &DatasetOptions, about: &str) -> Result<()> {
        for (split, merged) in Split::ALL.into_iter().zip(self.coco) {
            match merged {
                Some(merged) => merged.finish()?,
                None => trees::remove(&options.output, &coco::path(split))?,
            }
        }
        let written = self.tables.write(options)?;
        croissant::write(options, &written, about)
    }
}
