//! The dataset as loaders of the field expect it: folders of links, tables of labels, and texts that describe them.

mod coco;
mod croissant;
mod kitti;
mod links;
mod metadata;
mod mot;
mod spikecv;

use std::fs;
use std::path::{Path, PathBuf};

use crate::dataset::{DatasetOptions, Entry, Split, Status, frames};
use crate::error::{Error, Result};

pub(super) use links::{clean, displace, place};
pub(super) use spikecv::config;

/// The tables over all sequences, in the making.
pub(super) struct Views {
    tables: metadata::Tables,
    coco: [Option<coco::Merged>; 3],
}

impl Views {
    pub(super) fn new() -> Self {
        Self { tables: metadata::Tables::default(), coco: [None, None, None] }
    }

    /// Takes in a sequence that is done; returns how many files had to be copied.
    pub(super) fn add(&mut self, options: &DatasetOptions, entry: &Entry) -> Result<u64> {
        let split = Split::ALL.iter().position(|s| s.name() == entry.split);
        let (Some(split), Status::Done) = (split, entry.status) else { return Ok(0) };
        self.tables.add(entry, split);
        let sequence = entry.folder(&options.output);
        let frames = frames::read(&sequence)?;
        let Some(first) = frames.first() else { return Ok(0) };
        let place = split_folder(options, split);
        mot::write(&place, entry, options.camera.sensor.readout_hz, &frames)?;
        kitti::write(&place, &sequence, entry, &first.camera, &frames)?;
        if self.coco[split].is_none() {
            self.coco[split] = Some(coco::Merged::begin(&place)?);
        }
        if let Some(merged) = &mut self.coco[split] {
            merged.add(options, entry)?;
        }
        spikecv::link_labels(options, entry, &frames)
    }

    /// Writes what is written once, and describes it.
    pub(super) fn finish(self, options: &DatasetOptions, about: &str) -> Result<()> {
        for (split, merged) in self.coco.into_iter().enumerate() {
            match merged {
                Some(merged) => merged.finish()?,
                None => remove(&split_folder(options, split).join(coco::NAME))?,
            }
        }
        let written = self.tables.write(options)?;
        croissant::write(options, &written, about)
    }
}

fn split_folder(options: &DatasetOptions, split: usize) -> PathBuf {
    options.output.join(Split::ALL[split].name())
}

fn remove(path: &Path) -> Result<()> {
    match fs::remove_file(path) {
        Err(e) if e.kind() != std::io::ErrorKind::NotFound => Err(Error::io(path.display(), e)),
        _ => Ok(()),
    }
}
