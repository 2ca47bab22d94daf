//! The plan of a dataset that is generated in shards. The plan is written before the first sequence is generated, and
//! never changes.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::input_list::{self, ListSlice, PlannedInput, read_inputs, write_list};
use crate::config;
use crate::entries::{planned_input_entry, planned_scene_entry};
use crate::fingerprint::exists;
use crate::{Content, DatasetOptions, Fingerprint, Input, InputContent, SequenceEntry, Split};
use spikelane::error::{Error, ErrorKind, Result, Setting};
use spikelane::unstable::Count;
use spikelane::unstable::inputs::{Access, InnerPath, PlainName, read_bytes, utf8_bytes};
use spikelane_io::storage::{self, OutputSet, folders};

/// Version of the format of `plan.json`.
const FORMAT_VERSION: u32 = 1;
/// Maximum size of a plan in bytes. A plan with a million shards of inputs has about 200 MB.
const MAX_PLAN_BYTES: u64 = 256 << 20;

/// The plan of a dataset that many machines generate. The plan is a folder that every shard reads and no shard
/// changes.
#[derive(Clone, Debug)]
pub struct ShardPlan {
    /// Folder of the dataset.
    pub folder: PathBuf,
    /// Options of the dataset. The output folder in the options is `folder`.
    pub options: DatasetOptions,
    /// Number of sequences in all shards.
    pub sequences: u64,
    /// Number of sequences per shard. The last shard may have fewer sequences.
    pub sequences_per_shard: u64,
    /// Whether each finished shard is converted to one tar file.
    pub pack_shards: bool,
    list_slices: Vec<ListSlice>,
}

/// The keys of `plan.json` that determine how the other keys are parsed.
#[derive(Deserialize)]
struct PlanVersions {
    format_version: Option<serde_json::Value>,
    program_version: Option<serde_json::Value>,
}

/// The content of `plan.json`.
#[derive(Deserialize, Serialize)]
struct PlanFile {
    format_version: u32,
    program_version: String,
    sequences: u64,
    sequences_per_shard: u64,
    shards: u64,
    pack_shards: bool,
    /// The text of `dataset.toml`.
    options: String,
    /// For each shard, the slice of the input list.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    list_slices: Vec<ListSlice>,
}

/// A sequence that a shard generates.
#[derive(Clone, Debug)]
pub(super) struct SequenceTask {
    pub entry: SequenceEntry,
    /// Size and modification time of the input when the plan was made. `None` for scenes.
    pub fingerprint: Option<Fingerprint>,
}

impl ShardPlan {
    /// File name of the plan in the dataset's folder.
    pub(crate) const FILE_NAME: &str = "plan.json";

    /// Creates the plan of the dataset `options` in the output folder. Each shard has `per_shard` sequences.
    ///
    /// The plan lists the names, sizes and modification times of the inputs. Only folders of images are examined; see
    /// [`Pictures`](crate::Pictures). If
    /// the same plan already exists, the existing plan and its list are used, and the second returned value is true.
    ///
    /// # Errors
    /// * The errors of [`DatasetOptions::check`].
    /// * [`ErrorKind::Exists`] if the folder contains another plan or a dataset.
    /// * Errors of listing the inputs and of writing the plan.
    pub fn create(options: &DatasetOptions, per_shard: u64, pack: bool) -> Result<(Self, bool)> {
        options.check()?;
        if per_shard == 0 {
            return Err(Error::new(ErrorKind::Usage, Setting("sequences_per_shard"))
                .found(0)
                .expected("at least one sequence"));
        }
        let folder = options.output.clone();
        let written = config::to_toml(options)?;
        let existing = || -> Result<Option<Self>> {
            if !exists(&folder.join(Self::FILE_NAME))? {
                return Ok(None);
            }
            let plan = Self::open(&folder, Access::Read)?;
            plan.check_same_plan(&written.text, per_shard, pack)?;
            Ok(Some(plan))
        };
        if let Some(plan) = existing()? {
            return Ok((plan, true));
        }
        // If the function returns an error, dropping `_claim` removes the folder, provided that the folder is empty.
        let _claim = OutputSet::claim_folder(&folder)?;
        // Another process may have written the plan before the folder was locked.
        if let Some(plan) = existing()? {
            return Ok((plan, true));
        }
        if exists(&folder.join(crate::manifest::FILE_NAME))? {
            return Err(Error::new(ErrorKind::Exists, folder.display())
                .found("a dataset without a plan")
                .expected("a folder without a dataset"));
        }
        Self::write_plan_files(options, per_shard, pack, &written)?;
        Self::open(&folder, Access::Read).map(|plan| (plan, false))
    }

    fn write_plan_files(
        options: &DatasetOptions,
        per_shard: u64,
        pack: bool,
        written: &config::DatasetText,
    ) -> Result<()> {
        let folder = &options.output;
        folders::remove_partials(folder, |_| true)?;
        for (name, bytes) in &written.maps {
            let name = PlainName::parse(ErrorKind::Config, "map of a camera", name)?;
            storage::write_small(&folders::create_parents(folder, &InnerPath::from(name))?, bytes, true)?;
        }
        let (sequences, pieces) = match &options.content {
            Content::Scenes(drives) => (u64::from(drives.sequences), Vec::new()),
            Content::Inputs(inputs) => write_list(options, inputs, per_shard)?,
        };
        let on_disk = PlanFile {
            format_version: FORMAT_VERSION,
            program_version: env!("CARGO_PKG_VERSION").to_owned(),
            sequences,
            sequences_per_shard: per_shard,
            shards: sequences.div_ceil(per_shard),
            pack_shards: pack,
            options: written.text.clone(),
            list_slices: pieces,
        };
        let path = folder.join(Self::FILE_NAME);
        let bytes = serde_json::to_vec_pretty(&on_disk)
            .map_err(|e| Error::new(ErrorKind::Config, path.display()).found(e))?;
        if bytes.len() as u64 > MAX_PLAN_BYTES {
            return Err(Error::new(ErrorKind::Usage, Setting("sequences_per_shard"))
                .found(format_args!(
                    "a plan of {} for {}",
                    Count(bytes.len(), "byte"),
                    Count(on_disk.shards, "shard"),
                ))
                .expected(format_args!("at most {MAX_PLAN_BYTES} bytes"))
                .remedy("increase the number of sequences per shard"));
        }
        storage::write_small(&path, &bytes, false)
    }

    /// Reads the plan in a folder. Links to files outside the folder are rejected.
    ///
    /// # Errors
    /// * [`ErrorKind::Io`] if there is no plan.
    /// * [`ErrorKind::Config`] if the version of the plan format or of the program that wrote the plan is different.
    /// * [`ErrorKind::Config`] if the numbers of sequences and shards in the plan do not match the options in the plan.
    pub fn open(folder: &Path, access: Access) -> Result<Self> {
        let path = InnerPath::from(Self::FILE_NAME).resolve_in(folder, access)?;
        let text = read_bytes(&path, "a plan", MAX_PLAN_BYTES).map_err(|e| match e.kind() {
            ErrorKind::Io => e.expected("a plan").remedy("plan the dataset first"),
            _ => e,
        })?;
        let bad = |found: &dyn std::fmt::Display| Error::new(ErrorKind::Config, path.display()).found(found);
        // The version is checked first, because a plan of another version may have other keys.
        let head: PlanVersions = serde_json::from_slice(&utf8_bytes(&text)).map_err(|e| bad(&e))?;
        let version = env!("CARGO_PKG_VERSION");
        let shown = |value: Option<serde_json::Value>| value.unwrap_or_default().to_string();
        if head.format_version != Some(FORMAT_VERSION.into()) {
            return Err(bad(&format_args!("version {} of the plan format", shown(head.format_version)))
                .expected(FORMAT_VERSION)
                .remedy("use the version of spikelane that wrote the plan"));
        }
        if head.program_version != Some(version.into()) {
            return Err(bad(&format_args!("a plan of spikelane {}", shown(head.program_version)))
                .expected(version)
                .remedy("sequences may differ between versions; use the version that wrote the plan, or plan again"));
        }
        let on_disk: PlanFile = serde_json::from_slice(&utf8_bytes(&text)).map_err(|e| bad(&e))?;
        let options = config::from_toml(&on_disk.options, folder, access)
            .and_then(|options| options.check().map(|()| options))
            .map_err(|e| e.usage_as_config().with_context(path.display()))?;
        let options = DatasetOptions { output: folder.to_owned(), ..options };
        let PlanFile {
            sequences,
            sequences_per_shard: per_shard,
            pack_shards: pack,
            list_slices: pieces,
            shards,
            ..
        } = on_disk;
        if per_shard == 0 || shards != sequences.div_ceil(per_shard) {
            return Err(bad(&format_args!(
                "{} of {per_shard} for {}",
                Count(shards, "shard"),
                Count(sequences, "sequence"),
            )));
        }
        match &options.content {
            Content::Scenes(drives) if sequences != u64::from(drives.sequences) => {
                return Err(bad(&Count(sequences, "sequence"))
                    .expected(format_args!("{}, as required by the options of the plan", drives.sequences))
                    .remedy("copy the plan again, or plan again"));
            }
            Content::Scenes(_) => {}
            Content::Inputs(_) => {
                input_list::check_slices(&pieces, shards).map_err(|e| e.with_context(path.display()))?
            }
        }
        Ok(Self {
            folder: folder.to_owned(),
            options,
            sequences,
            sequences_per_shard: per_shard,
            pack_shards: pack,
            list_slices: pieces,
        })
    }

    fn check_same_plan(&self, text: &str, per_shard: u64, pack: bool) -> Result<()> {
        let spec_text = config::to_toml(&self.options)?.text;
        let found = if spec_text != text {
            let differs = spec_text.lines().zip(text.lines()).find(|(a, b)| a != b);
            differs.map_or("other options".to_owned(), |(a, b)| format!("`{a}`, not `{b}`"))
        } else if self.sequences_per_shard != per_shard {
            format!("{} per shard, not {per_shard}", Count(self.sequences_per_shard, "sequence"))
        } else if self.pack_shards != pack {
            format!("pack = {}", self.pack_shards)
        } else {
            return Ok(());
        };
        Err(Error::new(ErrorKind::Exists, self.folder.join(Self::FILE_NAME).display())
            .found(format_args!("another plan: {found}"))
            .expected("this plan, or a folder without a plan")
            .remedy("plans are never changed; choose another folder"))
    }

    /// Returns the approximate number of bytes on disk. Returns `None` for inputs, because their length is unknown.
    ///
    /// # Errors
    /// [`ErrorKind::Config`] if a sequence has more than 2^64 - 1 bytes.
    pub fn estimated_bytes(&self) -> Result<Option<u64>> {
        let Content::Scenes(drives) = &self.options.content else { return Ok(None) };
        let each = planned_scene_entry(&self.options, drives, 0)?.bytes;
        Ok(each.map(|bytes| bytes.saturating_mul(self.sequences)))
    }

    /// Returns the number of shards.
    #[must_use]
    pub fn shards(&self) -> u64 {
        self.sequences.div_ceil(self.sequences_per_shard)
    }

    /// Returns the number of sequences of shard `number`.
    #[must_use]
    pub fn shard_sequences(&self, number: u64) -> u64 {
        let first = number.saturating_mul(self.sequences_per_shard);
        self.sequences.saturating_sub(first).min(self.sequences_per_shard)
    }

    /// Returns the name of shard `number`. The name has six digits, or more if the number of the last shard has more
    /// digits.
    #[must_use]
    pub fn shard_name(&self, number: u64) -> PlainName {
        let width = self.shards().saturating_sub(1).to_string().len().max(6);
        PlainName::from_number(number, width)
    }

    /// Returns the folder of shard `number`. `access` determines whether links are allowed.
    pub(super) fn shard_folder(&self, number: u64, access: Access) -> Result<PathBuf> {
        InnerPath::from("shards").join(self.shard_name(number)).resolve_in(&self.folder, access)
    }

    /// Returns the path of the tar file of shard `number`. The file exists only if shards are packed. `access`
    /// determines whether links are allowed.
    pub(super) fn shard_tar_path(&self, number: u64, access: Access) -> Result<PathBuf> {
        InnerPath::from("shards")
            .join(self.shard_name(number).with_ending(".tar"))
            .resolve_in(&self.folder, access)
    }

    /// Returns the split of every scene, indexed by scene number.
    ///
    /// For inputs, the result is empty, because the split of an input depends only on its name.
    pub(super) fn scene_splits(&self) -> Vec<Split> {
        match self.options.content {
            Content::Scenes(_) => self.options.scene_splits(),
            Content::Inputs(_) => Vec::new(),
        }
    }

    /// Returns the sequences of shard `number`. `splits` must be the result of [`Self::scene_splits`].
    pub(super) fn tasks(&self, number: u64, splits: &[Split]) -> Result<Vec<SequenceTask>> {
        let sequences = self.shard_sequences(number);
        let first = number.saturating_mul(self.sequences_per_shard);
        match &self.options.content {
            Content::Scenes(drives) => (first..first + sequences)
                .map(|i| {
                    let mut entry = planned_scene_entry(&self.options, drives, i)?;
                    entry.split = splits[i as usize];
                    Ok(SequenceTask { entry, fingerprint: None })
                })
                .collect(),
            Content::Inputs(inputs) => {
                let access = self.options.access();
                read_inputs(&self.folder, &self.list_slices, number, sequences, access)?
                    .into_iter()
                    .map(|frozen| self.input_task(inputs, frozen))
                    .collect()
            }
        }
    }

    fn input_task(&self, inputs: &InputContent, frozen: PlannedInput) -> Result<SequenceTask> {
        let PlannedInput { id, path, frames, bytes, mtime_ns: time_ns } = frozen;
        let mut entry = planned_input_entry(&self.options, inputs, Input { id, path, frames })?;
        entry.split = self.options.input_split(entry.id.as_str());
        Ok(SequenceTask { entry, fingerprint: Some(Fingerprint { bytes, mtime_ns: time_ns }) })
    }
}
