//! What is to be made, and by which shard: fixed before the first sequence, and never changed.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::list::{self, Frozen, Piece, freeze, frozen};
use crate::config;
use crate::entries::{new_input, planned_scene};
use crate::{DatasetOptions, Entry, Input, Inputs, Split, Stamp, Work};
use spikelane::error::{Error, Kind, Result};
use spikelane::unstable::inputs::{Access, InnerPath, PlainName, read_bytes};
use spikelane_io::storage::{self, OutputSet, trees};

/// The version of the plan's form.
const VERSION: u32 = 1;
const NAME: &str = "plan.json";

/// The most that a plan may hold, in bytes: a million shards of inputs have some 200 MB.
const MAX_BYTES: u64 = 256 << 20;

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

/// The keys of `plan.json` by which its other keys are known.
#[derive(Deserialize)]
struct Versions {
    plan: Option<serde_json::Value>,
    version: Option<serde_json::Value>,
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
        let existing = || -> Result<Option<Self>> {
            if !folder.join(NAME).exists() {
                return Ok(None);
            }
            let plan = Self::read(&folder)?;
            plan.same(&written.text, per_shard, pack)?;
            Ok(Some(plan))
        };
        if let Some(plan) = existing()? {
            return Ok((plan, true));
        }
        // A plan that is refused leaves no folder; one that is not empty stays.
        let _claim = OutputSet::claim_folder(&folder)?;
        // Another process may have made the plan meanwhile.
        if let Some(plan) = existing()? {
            return Ok((plan, true));
        }
        if folder.join(crate::manifest::NAME).exists() {
            return Err(Error::new(Kind::Exists, folder.display())
                .found("a dataset without a plan")
                .expected("a free folder"));
        }
        Self::begin(options, per_shard, pack, &written)?;
        Self::read(&folder).map(|plan| (plan, false))
    }

    fn begin(options: &DatasetOptions, per_shard: u64, pack: bool, written: &config::Written) -> Result<()> {
        let folder = &options.output;
        trees::remove_partials(folder, |_| true)?;
        for (name, bytes) in &written.maps {
            let name = PlainName::parse(Kind::Config, "map of a camera", name)?;
            storage::write_small(&trees::prepare(folder, &InnerPath::from(name))?, bytes, true)?;
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
        if bytes.len() as u64 > MAX_BYTES {
            return Err(Error::new(Kind::Usage, "--per-shard")
                .found(format_args!("a plan of {} bytes for {} shards", bytes.len(), on_disk.shards))
                .expected(format_args!("at most {MAX_BYTES} bytes"))
                .remedy("give each shard more sequences"));
        }
        storage::write_small(&path, &bytes, false)
    }

    /// Reads the plan of a folder. Links may not leave the folder.
    ///
    /// # Errors
    /// [`Kind::Io`] where there is none, [`Kind::Config`] for one of another version of its form or of the program, and for
    /// one whose numbers of sequences and shards are not those of its options.
    pub fn read(folder: &Path) -> Result<Self> {
        Self::read_with(folder, false)
    }

    /// The same; with `follow_links` links may leave the folder when its files are read.
    ///
    /// # Errors
    /// As [`Plan::read`].
    pub fn read_with(folder: &Path, follow_links: bool) -> Result<Self> {
        let access = Access::reading(follow_links);
        let path = InnerPath::from(NAME).below(folder, access)?;
        let text = read_bytes(&path, "a plan", MAX_BYTES).map_err(|e| match e.kind() {
            Kind::Io => e.expected("a plan").remedy("make one with 'spikelane dataset plan'"),
            _ => e,
        })?;
        let bad = |found: &dyn std::fmt::Display| Error::new(Kind::Config, path.display()).found(found);
        // The version first: another one may have other keys.
        let head: Versions = serde_json::from_slice(&text).map_err(|e| bad(&e))?;
        let own = env!("CARGO_PKG_VERSION");
        let shown = |value: Option<serde_json::Value>| value.unwrap_or_default().to_string();
        if head.plan != Some(VERSION.into()) {
            return Err(bad(&format_args!("version {} of the plan's form", shown(head.plan)))
                .expected(VERSION)
                .remedy("use the version of the program that planned it"));
        }
        if head.version != Some(own.into()) {
            return Err(bad(&format_args!("a plan of spikelane {}", shown(head.version)))
                .expected(own)
                .remedy("sequences of two versions may differ; use the one that planned it, or plan anew"));
        }
        let on_disk: OnDisk = serde_json::from_slice(&text).map_err(|e| bad(&e))?;
        let options = config::parse_with(&on_disk.options, folder, follow_links)
            .and_then(|options| options.check().map(|()| options))
            .map_err(|e| e.usage_as_config().within(path.display()))?;
        let options = DatasetOptions { output: folder.to_owned(), follow_links, ..options };
        let OnDisk { sequences, per_shard, pack, pieces, shards, .. } = on_disk;
        if per_shard == 0 || shards != sequences.div_ceil(per_shard) {
            return Err(bad(&format_args!("{shards} shards of {per_shard} for {sequences} sequences")));
        }
        match &options.work {
            Work::Drives(drives) if sequences != u64::from(drives.sequences) => {
                return Err(bad(&format_args!("{sequences} sequences"))
                    .expected(format_args!("{}, as its options have", drives.sequences))
                    .remedy("copy the plan again, or plan anew"));
            }
            Work::Drives(_) => {}
            Work::Inputs(_) => list::check(&pieces, shards).map_err(|e| e.within(path.display()))?,
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
        let each = planned_scene(&self.options, drives, 0)?.bytes;
        Ok(each.map(|bytes| bytes.saturating_mul(self.sequences)))
    }

    /// Number of shards.
    #[must_use]
    pub fn shards(&self) -> u64 {
        self.sequences.div_ceil(self.per_shard)
    }

    /// Sequences of shard `number`.
    #[must_use]
    pub fn sequences_of(&self, number: u64) -> u64 {
        let first = number.saturating_mul(self.per_shard);
        self.sequences.saturating_sub(first).min(self.per_shard)
    }

    /// The name of shard `number`: six digits, or as many as the last one needs.
    #[must_use]
    pub fn shard_name(&self, number: u64) -> PlainName {
        let width = self.shards().saturating_sub(1).to_string().len().max(6);
        PlainName::number(number, width)
    }

    /// The folder of shard `number`, for `access`.
    pub(super) fn shard_folder(&self, number: u64, access: Access) -> Result<PathBuf> {
        InnerPath::from("shards").join(self.shard_name(number)).below(&self.folder, access)
    }

    /// The tar that shard `number` becomes, if shards are packed, for `access`.
    pub(super) fn shard_pack(&self, number: u64, access: Access) -> Result<PathBuf> {
        InnerPath::from("shards").join(self.shard_name(number).with(".tar")).below(&self.folder, access)
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
        let sequences = self.sequences_of(number);
        let first = number.saturating_mul(self.per_shard);
        match &self.options.work {
            Work::Drives(drives) => (first..first + sequences)
                .map(|i| {
                    let mut entry = planned_scene(&self.options, drives, i)?;
                    entry.split = splits[i as usize];
                    Ok(Task { entry, stamp: None })
                })
                .collect(),
            Work::Inputs(inputs) => {
                let access = self.options.access();
                frozen(&self.folder, &self.pieces, number, sequences, access)?
                    .into_iter()
                    .map(|frozen| self.task(inputs, frozen))
                    .collect()
            }
        }
    }

    fn task(&self, inputs: &Inputs, frozen: Frozen) -> Result<Task> {
        let Frozen { id, path, frames, bytes, time_ns } = frozen;
        let mut entry = new_input(&self.options, inputs, Input { id, path, frames })?;
        entry.split = self.options.split_alone(entry.id.as_str());
        Ok(Task { entry, stamp: Some(Stamp { bytes, time_ns }) })
    }
}
