//! Exports the dataset for loaders. The exports are folders of links, tables of labels, and descriptions.

mod coco;
mod croissant;
mod kitti;
mod loader_links;
mod mot;
mod spikecv;
mod ssl_csc;

use crate::{DatasetOptions, SequenceEntry, SequenceFiles, SequenceStatus, Split};
use spikelane::error::Result;
use spikelane_io::storage::folders;

pub(super) use loader_links::{link_sequence, remove_partials, unlink_sequence};
pub(super) use spikecv::write_config;
pub(super) use ssl_csc::check_camera;

/// Collects the tables of all sequences.
pub(super) struct Exporters {
    tables: croissant::Tables,
    /// One writer per split, in the order of the variants of `Split`.
    coco: [Option<coco::CocoWriter>; 3],
}

impl Exporters {
    pub(super) fn new() -> Self {
        Self { tables: croissant::Tables::default(), coco: [None, None, None] }
    }

    /// Adds a sequence to the exports if its status is `Done`. Returns the number of files that were copied.
    pub(super) fn add(&mut self, options: &DatasetOptions, entry: &SequenceEntry) -> Result<u64> {
        if entry.status != SequenceStatus::Done {
            return Ok(0);
        }
        let split = entry.split as usize;
        self.tables.add(entry, split);
        let folder = entry.path().resolve_in(&options.output, options.access())?;
        let frames = SequenceFiles::in_folder(folder, options.access()).labeled_frames()?;
        let Some(first) = frames.first() else { return Ok(0) };
        mot::write(options, entry, &frames)?;
        kitti::write(options, entry, &first.camera, &frames)?;
        if self.coco[split].is_none() {
            self.coco[split] = Some(coco::CocoWriter::begin(&options.output, entry.split)?);
        }
        if let Some(merged) = &mut self.coco[split] {
            merged.add(options, entry)?;
        }
        spikecv::link_labels(options, entry, &frames)
    }

    /// Writes the files that contain data of all sequences.
    pub(super) fn finish(self, options: &DatasetOptions, description: &str) -> Result<()> {
        for (split, merged) in Split::ALL.into_iter().zip(self.coco) {
            match merged {
                Some(merged) => merged.finish()?,
                None => folders::remove(&options.output, &coco::path(split))?,
            }
        }
        let written = self.tables.write(options)?;
        croissant::write(options, &written, description)
    }
}
