//! The manifest of a dataset. The file contains JSON lines. The first line contains the options, and each other line
//! describes one sequence.

use std::fs::{self, File};
use std::io::{BufWriter, Write as _};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};

use crate::Split;
use spikelane::error::{Error, ErrorKind, Result};
use spikelane::unstable::inputs::{
    Access, InnerPath, InputFile, InputLines, MAX_TEXT_BYTES, PARTIAL_ENDING, PlainName, deserialize_digest,
};
use spikelane_io::storage::{Digest, folders, sync};

/// File name of the manifest in the dataset's folder.
pub(super) const FILE_NAME: &str = "manifest.jsonl";
const FORMAT_VERSION: u32 = 1;

/// State of a sequence.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum SequenceStatus {
    /// The sequence is not generated yet.
    #[default]
    Planned,
    /// The sequence is generated, and `digest` is set.
    Done,
    /// The generation failed, and `reason` is set.
    Failed,
}

/// A line of the manifest, which describes one sequence.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[non_exhaustive]
pub struct SequenceEntry {
    /// Name of the sequence and of its folder.
    pub id: PlainName,
    /// Purpose of the sequence.
    pub split: Split,
    /// Name of the shard that contains the sequence. `None` if the dataset was not generated in shards.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shard: Option<PlainName>,
    /// Path of the input, relative to the input folder. `None` for scenes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub input: Option<String>,
    /// Digest of the input when the input was read. For a file, it is the digest of the bytes. For a folder, it is the
    /// digest of the names and digests of the images.
    #[serde(default, deserialize_with = "deserialize_digest", skip_serializing_if = "Option::is_none")]
    pub input_digest: Option<String>,
    /// Seed of the scene.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scene_seed: Option<u64>,
    /// Seeds of the camera, the shot noise and the sequence.
    pub seeds: [u64; 3],
    /// Number of readouts of each stream. `None` if the number is unknown before the generation.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub readouts: Option<u64>,
    /// Number of bytes. For a planned sequence, this is the expected number. For a finished sequence, this is the
    /// actual number.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bytes: Option<u64>,
    /// Digest of the sequence's record.
    #[serde(default, deserialize_with = "deserialize_digest", skip_serializing_if = "Option::is_none")]
    pub digest: Option<String>,
    /// State of the sequence.
    pub status: SequenceStatus,
    /// Reason of the failure, if the sequence failed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reason: Option<String>,
}

/// Returns the path of sequence `id` in the folder of its dataset or shard.
pub(super) fn sequence_path(id: &PlainName) -> InnerPath {
    InnerPath::from("sequences").join(id)
}

impl SequenceEntry {
    /// Returns the entry of a planned sequence in the training split. All optional fields are `None`.
    pub(super) const fn new(id: PlainName, seeds: [u64; 3]) -> Self {
        Self {
            id,
            split: Split::Train,
            shard: None,
            input: None,
            input_digest: None,
            scene_seed: None,
            seeds,
            readouts: None,
            bytes: None,
            digest: None,
            status: SequenceStatus::Planned,
            reason: None,
        }
    }

    /// Returns the path of the sequence's folder, relative to the dataset's folder. If the sequence is in a packed
    /// shard, this folder does not exist.
    pub(crate) fn path(&self) -> InnerPath {
        match &self.shard {
            Some(shard) => InnerPath::from("shards").join(shard).join(sequence_path(&self.id)),
            None => sequence_path(&self.id),
        }
    }
}

/// The manifest of a dataset.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Manifest {
    /// Options that determine the bytes of the dataset.
    pub options: Value,
    /// All sequences.
    pub entries: Vec<SequenceEntry>,
}

impl Manifest {
    /// Reads the manifest in a dataset's folder. `access` determines whether the manifest may be a link to a file
    /// outside the folder.
    ///
    /// # Errors
    /// [`ErrorKind::Io`] if there is no manifest, [`ErrorKind::Config`] if it is invalid.
    pub fn read(folder: &Path, access: Access) -> Result<Self> {
        let path = InnerPath::from(FILE_NAME).resolve_in(folder, access)?;
        let file = InputFile::open(&path)?;
        let bad = |e: serde_json::Error| Error::new(ErrorKind::Config, path.display()).found(e);
        let mut lines = InputLines::new(&file, MAX_TEXT_BYTES);
        let mut head: Map<String, Value> =
            serde_json::from_slice(lines.next_line()?.unwrap_or_default()).map_err(bad)?;
        let version = head.remove("format_version").unwrap_or_default();
        if version != FORMAT_VERSION {
            return Err(Error::new(ErrorKind::Config, path.display())
                .found(format_args!("version {version} of the manifest format"))
                .expected(FORMAT_VERSION)
                .remedy("use the version of spikelane that wrote the dataset, or generate the dataset again in a new folder"));
        }
        let mut entries = Vec::new();
        while let Some(line) = lines.next_line()? {
            entries.push(serde_json::from_slice(line).map_err(bad)?);
        }
        Ok(Self { options: head.remove("options").unwrap_or_default(), entries })
    }

    /// Writes the manifest. If writing fails, the old manifest remains unchanged.
    ///
    /// # Errors
    /// [`ErrorKind::Space`] if the disk is full. Also other errors of the operating system.
    pub fn write(&self, folder: &Path) -> Result<()> {
        let mut list = ManifestWriter::begin(folder, &self.options)?;
        self.entries.iter().try_for_each(|entry| list.add(entry))?;
        list.finish()
    }

    /// Returns the digest of the dataset.
    ///
    /// Each finished sequence has one line "id record-digest", and the digest is computed from these lines. The lines
    /// are sorted, so the digest does not depend on the division into shards.
    #[must_use]
    pub fn dataset_digest(&self) -> String {
        let mut digest = DatasetDigest::default();
        self.entries.iter().for_each(|entry| digest.add(entry));
        digest.text()
    }

    /// Checks that a resumed dataset has the same options as the existing manifest.
    ///
    /// # Errors
    /// [`ErrorKind::Config`] if an option differs. The error names the first such option.
    pub(super) fn check_same_options(&self, options: &Value, folder: &Path) -> Result<()> {
        // The options are converted to text and back, so that numbers have the same precision as in the file.
        let options: Value = serde_json::from_str(&options.to_string())
            .map_err(|e| Error::new(ErrorKind::Config, folder.display()).found(e))?;
        if let Some((key, was, is)) = first_difference(&self.options, &options, "") {
            return Err(Error::new(ErrorKind::Config, folder.display())
                .found(format_args!("{key} = {is}"))
                .expected(format_args!("{was}, the value in the existing dataset"))
                .remedy("use the same options, or another output folder"));
        }
        Ok(())
    }
}

/// Writes a manifest line by line. The file is renamed to its final name after the last line.
pub(super) struct ManifestWriter {
    file: BufWriter<File>,
    hidden_path: PathBuf,
    path: PathBuf,
    is_finished: bool,
}

impl ManifestWriter {
    pub(crate) fn begin(folder: &Path, options: &Value) -> Result<Self> {
        let path = folder.join(FILE_NAME);
        let hidden = folder.join(format!(".{FILE_NAME}.{}{PARTIAL_ENDING}", std::process::id()));
        let file = folders::create(&hidden)?;
        let mut list = Self { file: BufWriter::new(file), hidden_path: hidden, path, is_finished: false };
        list.line(&json!({ "format_version": FORMAT_VERSION, "options": options }))?;
        Ok(list)
    }

    pub(crate) fn add(&mut self, entry: &SequenceEntry) -> Result<()> {
        self.line(entry)
    }

    fn line(&mut self, value: &impl Serialize) -> Result<()> {
        serde_json::to_writer(&mut self.file, value).map_err(|e| Error::io(self.path.display(), e.into()))?;
        self.file.write_all(b"\n").map_err(|e| Error::io(self.path.display(), e))
    }

    pub(crate) fn finish(mut self) -> Result<()> {
        self.file.flush().map_err(|e| Error::io(self.path.display(), e))?;
        sync::sync_file(self.file.get_ref(), &self.hidden_path)?;
        sync::rename(&self.hidden_path, &self.path)?;
        self.is_finished = true;
        sync::sync_folder(self.path.parent().unwrap_or(Path::new(".")))
    }
}

impl Drop for ManifestWriter {
    fn drop(&mut self) {
        if !self.is_finished {
            // `drop` cannot report an error, so errors are ignored.
            let _ = fs::remove_file(&self.hidden_path);
        }
    }
}

/// Computes the digest of a dataset.
#[derive(Default)]
pub(super) struct DatasetDigest {
    lines: Vec<String>,
}

impl DatasetDigest {
    /// Adds a sequence if its status is `Done`.
    pub(crate) fn add(&mut self, entry: &SequenceEntry) {
        if let (SequenceStatus::Done, Some(digest)) = (entry.status, &entry.digest) {
            self.lines.push(format!("{} {digest}\n", entry.id));
        }
    }

    /// Returns the digest of the sorted lines.
    pub(crate) fn text(mut self) -> String {
        self.lines.sort_unstable();
        let mut digest = Digest::new();
        self.lines.iter().for_each(|line| digest.update(line.as_bytes()));
        digest.to_text()
    }
}

/// Returns the text of an option's value for an error message. If the key of an option does not exist, `value` is
/// null.
fn option_text(value: &Value) -> String {
    if value.is_null() { "nothing".to_owned() } else { value.to_string() }
}

/// Returns the key of the first difference, the text of `was` and the text of `is`. If a text has several lines, such
/// as the text of a camera file, only the first line that differs is returned.
fn first_difference(was: &Value, is: &Value, key: &str) -> Option<(String, String, String)> {
    match (was, is) {
        (Value::Object(a), Value::Object(b)) => {
            let none = Value::Null;
            a.keys().chain(b.keys()).find_map(|k| {
                first_difference(a.get(k).unwrap_or(&none), b.get(k).unwrap_or(&none), &format!("{key}/{k}"))
            })
        }
        _ if was == is => None,
        (Value::String(a), Value::String(b)) if a.contains('\n') || b.contains('\n') => {
            let (mut a, mut b) = (a.lines(), b.lines());
            loop {
                // Texts that differ only in their last line break have no line that differs.
                let (was, is) = (a.next(), b.next());
                if was != is || was.is_none() {
                    let text =
                        |line: Option<&str>| line.map_or_else(|| "nothing".to_owned(), |l| format!("{l:?}"));
                    return Some((key.trim_start_matches('/').to_owned(), text(was), text(is)));
                }
            }
        }
        _ => Some((key.trim_start_matches('/').to_owned(), option_text(was), option_text(is))),
    }
}
