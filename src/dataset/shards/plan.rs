//! What is to be made, and by which shard: fixed before the first sequence, and never changed.

use std::fs;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::list::{Frozen, Piece, freeze, frozen};
use crate::dataset::config;
use crate::dataset::entries::{new_input, planned};
use crate::dataset::{DatasetOptions, Entry, Input, Inputs, Split, Stamp, Work};
use crate::error::{Error, Kind, Result};
use crate::storage::{self, trees};

/// The version of the plan's form.
const VERSION: u32 = 1;
const NAME: &str = "plan.json";

/// The work of many machines: a folder with a plan, which every shard reads and none writes.
#[derive(Clone, Debug)]
pub struct Plan {
    /// The folder of the dataset.
    pub folder: PathBuf,
    /// The options of the dataset; its output is the folder.
    pub options: DatasetOptions,
    /// Sequences of all shards.
    pub sequences: u64,
    /// Sequences of a shard; the last one may have fewer.
    pub per_shard: u64,
    /// Whether a finished shard becomes one tar.
    pub pack: bool,
    pieces: Vec<Piece>,
}

/// `plan.json`.
#[derive(Deserialize, Serialize)]
struct OnDisk {
    plan: u32,
    version: String,
    sequences: u64,
    per_shard: u64,
    shards: u64,
    pack: bool,
    /// The text of `dataset.toml`.
    options: String,
    /// Where each shard's part of the list of inputs lies.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pieces: Vec<Piece>,
}

/// A sequence of a shard.
#[derive(Clone, Debug)]
pub(super) struct Task {
    pub entry: Entry,
    /// How its input was when the plan was made.
    pub stamp: Option<Stamp>,
}

impl Plan {
    /// Plans the dataset of `options` in its output folder, `per_shard` sequences a shard. Of inputs names, sizes and
    /// times are listed and nothing is read. Where the same was planned before, that plan stays, with its list; the
    /// second value then is true.
    ///
    /// # Errors
    /// As [`DatasetOptions::check`]; [`Kind::Exists`] where another plan or a dataset is; those of listing and writing.
    pub fn make(options: &DatasetOptions, per_shard: u64, pack: bool) -> Result<(Self, bool)> {
        options.check()?;
        if per_shard == 0 {
            return Err(Error::new(Kind::Usage, "--per-shard").found(0).expected("at least one sequence"));
        }
        let folder = options.output.clone();
        let written = config::write(options)?;
        if folder.join(NAME).exists() {
            let old = Self::read(&folder)?;
            old.same(&written.text, per_shard, pack)?;
            return Ok((old, true));
        }
        if folder.join(crate::dataset::manifest::NAME).exists() {
            return Err(Error::new(Kind::Exists, folder.display())
                .found("a dataset without a plan")
                .expected("a free folder"));
        }
        let new = !folder.exists();
        fs::create_dir_all(&folder).map_err(|e| Error::io(folder.display(), e))?;
        let made = Self::begin(options, per_shard, pack, &written);
        if made.is_err() && new {
            // A plan that is refused leaves no folder; one that is not empty stays.
            let _ = fs::remove_dir(&folder);
        }
        made?;
        Self::read(&folder).map(|plan| (plan, false))
    }

    fn begin(options: &DatasetOptions, per_shard: u64, pack: bool, written: &config::Written) -> Result<()> {
        let folder = &options.output;
        trees::remove_partials(folder, |_| true)?;
        for (name, bytes) in &written.maps {
            storage::write_small(&folder.join(name), bytes, true)?;
        }
        let (sequences, pieces) = match &options.work {
            Work::Drives(drives) => (u64::from(drives.sequences), Vec::new()),
            Work::Inputs(inputs) => freeze(options, inputs, per_shard)?,
        };
        let on_disk = OnDisk {
            plan: VERSION,
            version: env!("CARGO_PKG_VERSION").to_owned(),
            sequences,
            per_shard,
            shards: sequences.div_ceil(per_shard),
            pack,
            options: written.text.clone(),
            pieces,
        };
        let path = folder.join(NAME);
        let bytes = serde_json::to_vec_pretty(&on_disk)
            .map_err(|e| Error::new(Kind::Config, path.display()).found(e))?;
        storage::write_small(&path, &bytes, false)
    }

    /// Reads the plan of a folder.
    ///
    /// # Errors
    /// [`Kind::Io`] where there is none, [`Kind::Config`] for one of another version of its form or of the program.
    pub fn read(folder: &Path) -> Result<Self> {
        let path = folder.join(NAME);
        let text = fs::read_to_string(&path).map_err(|e| {
            Error::io(path.display(), e).expected("a plan").remedy("make one with 'spikelane dataset plan'")
        })?;
        let bad = |found: &dyn std::fmt::Display| Error::new(Kind::Config, path.display()).found(found);
        // The version first: another one may have other keys.
        let head: serde_json::Value = serde_json::from_str(&text).map_err(|e| bad(&e))?;
        let own = env!("CARGO_PKG_VERSION");
        if head["plan"] != VERSION {
            return Err(bad(&format_args!("version {} of the plan's form", head["plan"]))
                .expected(VERSION)
                .remedy("use the version of the program that planned it"));
        }
        if head["version"] != own {
            return Err(bad(&format_args!("a plan of spikelane {}", head["version"]))
                .expected(own)
                .remedy("sequences of two versions may differ; use the one that planned it, or plan anew"));
        }
        let on_disk: OnDisk = serde_json::from_value(head).map_err(|e| bad(&e))?;
        let mut options = config::parse(&on_disk.options, folder).map_err(|e| e.within(path.display()))?;
        folder.clone_into(&mut options.output);
        let OnDisk { sequences, per_shard, pack, pieces, shards, .. } = on_disk;
        if per_shard == 0 || shards != sequences.div_ceil(per_shard) {
            return Err(bad(&format_args!("{shards} shards of {per_shard} for {sequences} sequences")));
        }
        Ok(Self { folder: folder.to_owned(), options, sequences, per_shard, pack, pieces })
    }

    fn same(&self, text: &str, per_shard: u64, pack: bool) -> Result<()> {
        let own = config::write(&self.options)?.text;
        let found = if own != text {
            let differs = own.lines().zip(text.lines()).find(|(a, b)| a != b);
            differs.map_or("other options".to_owned(), |(a, b)| format!("`{a}`, not `{b}`"))
        } else if self.per_shard != per_shard {
            format!("{} sequences a shard, not {per_shard}", self.per_shard)
        } else if self.pack != pack {
            format!("pack = {}", self.pack)
        } else {
            return Ok(());
        };
        Err(Error::new(Kind::Exists, self.folder.join(NAME).display())
            .found(format_args!("another plan: {found}"))
            .expected("this one, or a free folder")
            .remedy("a plan is never changed; choose another folder"))
    }

    /// Bytes on the disk, about; of drawn scenes, as the length of inputs is not known.
    ///
    /// # Errors
    /// When a file would exceed what can be counted.
    pub fn estimated_bytes(&self) -> Result<Option<u64>> {
        let Work::Drives(drives) = &self.options.work else { return Ok(None) };
        let each = planned(&self.options, self.options.scene_id(0), None, Some(drives.readouts()))?.bytes;
        Ok(each.map(|bytes| bytes.saturating_mul(self.sequences)))
    }

    /// Number of shards.
    #[must_use]
    pub fn shards(&self) -> u64 {
        self.sequences.div_ceil(self.per_shard)
    }

    /// The name of shard `number`: six digits, or as many as the last one needs.
    #[must_use]
    pub fn shard_name(&self, number: u64) -> String {
        let width = self.shards().saturating_sub(1).to_string().len().max(6);
        format!("{number:0width$}")
    }

    /// The folder of shard `number`.
    #[must_use]
    pub fn shard_folder(&self, number: u64) -> PathBuf {
        self.folder.join("shards").join(self.shard_name(number))
    }

    /// The tar that shard `number` becomes, if shards are packed.
    #[must_use]
    pub fn shard_pack(&self, number: u64) -> PathBuf {
        self.folder.join("shards").join(format!("{}.tar", self.shard_name(number)))
    }

    /// Splits of all sequences by their number; none for inputs, whose split needs their name alone.
    pub(super) fn scene_splits(&self) -> Vec<Split> {
        match self.options.work {
            Work::Drives(_) => self.options.scene_splits(),
            Work::Inputs(_) => Vec::new(),
        }
    }

    /// The sequences of shard `number`; `splits` are those of [`Self::scene_splits`].
    pub(super) fn tasks(&self, number: u64, splits: &[Split]) -> Result<Vec<Task>> {
        let first = number * self.per_shard;
        let last = (first + self.per_shard).min(self.sequences);
        match &self.options.work {
            Work::Drives(drives) => (first..last)
                .map(|i| {
                    let id = self.options.scene_id(i);
                    let mut entry = planned(&self.options, id, None, Some(drives.readouts()))?;
                    splits[i as usize].name().clone_into(&mut entry.split);
                    Ok(Task { entry, stamp: None })
                })
                .collect(),
            Work::Inputs(inputs) => frozen(&self.folder, &self.pieces, number)?
                .into_iter()
                .map(|frozen| self.task(inputs, frozen))
                .collect(),
        }
    }

    fn task(&self, inputs: &Inputs, frozen: Frozen) -> Result<Task> {
        let Frozen { id, path, frames, bytes, time_ns } = frozen;
        let mut entry = new_input(&self.options, inputs, Input { id, path, frames })?;
        self.options.split_alone(&entry.id).name().clone_into(&mut entry.split);
        Ok(Task { entry, stamp: Some(Stamp { bytes, time_ns }) })
    }
}
