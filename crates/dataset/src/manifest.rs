//! The one list of all sequences: JSON lines, the options first.

use std::fs::{self, File};
use std::io::{BufWriter, Write as _};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};

use crate::Split;
use spikelane::error::{Error, Kind, Result};
use spikelane::unstable::inputs::{Access, InnerPath, InputFile, Lines, MAX_TEXT_BYTES, PlainName};
use spikelane_io::storage::{Digest, steps, trees};

/// Its name in the dataset's folder.
pub(super) const NAME: &str = "manifest.jsonl";

/// How far a sequence is.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Status {
    /// Not made yet.
    #[default]
    Planned,
    /// Made; the digest tells.
    Done,
    /// Set aside; the reason tells.
    Failed,
}

/// A line.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Entry {
    /// Name of the sequence and of its folder.
    pub id: PlainName,
    /// What the sequence is for.
    pub split: Split,
    /// The shard that it lies in, of a dataset that was made in shards.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shard: Option<PlainName>,
    /// The input below the given folder; none for scenes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub input: Option<String>,
    /// Digest of the input when it was read: of a file, or of a folder's names and files.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub input_digest: Option<String>,
    /// Seed of the scene.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scene_seed: Option<u64>,
    /// Camera, shot and sequence seed.
    pub seeds: [u64; 3],
    /// Readouts of each stream, when known before the end.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub readouts: Option<u64>,
    /// Expected bytes while planned, found bytes when done.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bytes: Option<u64>,
    /// Digest of the sequence's record.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub digest: Option<String>,
    /// How far it is.
    pub status: Status,
    /// Why it was set aside.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reason: Option<String>,
}

/// The folder of sequence `id`, in the folder of its dataset or shard.
pub(super) fn sequence_path(id: &PlainName) -> InnerPath {
    InnerPath::from("sequences").join(id)
}

impl Entry {
    /// A sequence for training that is planned, of which nothing else is known.
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
            status: Status::Planned,
            reason: None,
        }
    }

    /// The folder of the sequence, below the dataset's folder; of a packed shard there is none.
    pub(crate) fn path(&self) -> InnerPath {
        match &self.shard {
            Some(shard) => InnerPath::from("shards").join(shard).join(sequence_path(&self.id)),
            None => sequence_path(&self.id),
        }
    }

    /// The folder of the sequence, where it is there; `access` says whether links may leave the dataset's folder.
    ///
    /// # Errors
    /// [`Kind::Input`] for a sequence of a packed shard, and for a link that leaves the folder.
    pub fn unpacked(&self, dataset: &Path, access: Access) -> Result<PathBuf> {
        let folder = self.path().below(dataset, access)?;
        if self.shard.is_none() || folder.exists() {
            return Ok(folder);
        }
        Err(Error::new(Kind::Input, folder.display())
            .found("a sequence in a pack")
            .expected("its folder")
            .remedy("plan the dataset without --pack for this, or unpack the tar"))
    }
}

/// The list.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Manifest {
    /// What decides bytes.
    pub options: Value,
    /// All sequences.
    pub entries: Vec<Entry>,
}

impl Manifest {
    /// Reads the manifest of a dataset's folder. Links may not leave the folder.
    ///
    /// # Errors
    /// [`Kind::Io`] when there is none, [`Kind::Config`] when it is none.
    pub fn read(folder: &Path) -> Result<Self> {
        Self::read_below(folder, Access::Read)
    }

    /// Reads the manifest of a dataset's folder; `access` says whether it may be a link that leaves the folder.
    ///
    /// # Errors
    /// As [`Manifest::read`].
    pub fn read_below(folder: &Path, access: Access) -> Result<Self> {
        let path = InnerPath::from(NAME).below(folder, access)?;
        let file = InputFile::open(&path)?;
        let bad = |e: serde_json::Error| Error::new(Kind::Config, path.display()).found(e);
        let mut lines = Lines::new(&file, MAX_TEXT_BYTES);
        let mut head: Map<String, Value> =
            serde_json::from_slice(lines.next_line()?.unwrap_or_default()).map_err(bad)?;
        let mut entries = Vec::new();
        while let Some(line) = lines.next_line()? {
            entries.push(serde_json::from_slice(line).map_err(bad)?);
        }
        Ok(Self { options: head.remove("options").unwrap_or_default(), entries })
    }

    /// Writes it, whole or not at all.
    ///
    /// # Errors
    /// [`Kind::Space`] when the disk is full, and what the operating system refuses.
    pub fn write(&self, folder: &Path) -> Result<()> {
        let mut list = Listing::begin(folder, &self.options)?;
        self.entries.iter().try_for_each(|entry| list.add(entry))?;
        list.finish()
    }

    /// One digest for the dataset: of the lines "id digest-of-the-record" of all sequences that are done, sorted. It is
    /// the same however the work was cut.
    #[must_use]
    pub fn digest(&self) -> String {
        let mut digest = DigestOf::default();
        self.entries.iter().for_each(|entry| digest.add(entry));
        digest.text()
    }

    /// Refuses to go on with other options than it was begun with.
    ///
    /// # Errors
    /// [`Kind::Config`] naming the first option that differs.
    pub(super) fn same_options(&self, options: &Value, folder: &Path) -> Result<()> {
        // Through text, so that numbers are compared as the file keeps them.
        let options: Value = serde_json::from_str(&options.to_string())
            .map_err(|e| Error::new(Kind::Config, folder.display()).found(e))?;
        if let Some((key, was, is)) = difference(&self.options, &options, "") {
            return Err(Error::new(Kind::Config, folder.display())
                .found(format_args!("{key} = {is}"))
                .expected(format_args!("{was}, with which this dataset was begun"))
                .remedy("give the same options, or another output folder"));
        }
        Ok(())
    }
}

/// A manifest that is written line by line; it has no name before its end.
pub(super) struct Listing {
    file: BufWriter<File>,
    hidden: PathBuf,
    path: PathBuf,
    kept: bool,
}

impl Listing {
    pub(crate) fn begin(folder: &Path, options: &Value) -> Result<Self> {
        let path = folder.join(NAME);
        let hidden = folder.join(format!(".{NAME}.{}.partial", std::process::id()));
        let file = trees::create(&hidden)?;
        let mut list = Self { file: BufWriter::new(file), hidden, path, kept: false };
        list.line(&json!({ "dataset": 1, "options": options }))?;
        Ok(list)
    }

    pub(crate) fn add(&mut self, entry: &Entry) -> Result<()> {
        self.line(entry)
    }

    fn line(&mut self, value: &impl Serialize) -> Result<()> {
        serde_json::to_writer(&mut self.file, value).map_err(|e| Error::io(self.path.display(), e.into()))?;
        self.file.write_all(b"\n").map_err(|e| Error::io(self.path.display(), e))
    }

    pub(crate) fn finish(mut self) -> Result<()> {
        self.file.flush().map_err(|e| Error::io(self.path.display(), e))?;
        steps::sync_file(self.file.get_ref(), &self.hidden)?;
        steps::rename(&self.hidden, &self.path)?;
        self.kept = true;
        steps::sync_folder(self.path.parent().unwrap_or(Path::new(".")))
    }
}

impl Drop for Listing {
    fn drop(&mut self) {
        if !self.kept {
            // Nobody is left to hear of a failure here.
            let _ = fs::remove_file(&self.hidden);
        }
    }
}

/// The digest of a dataset in the making.
#[derive(Default)]
pub(super) struct DigestOf {
    lines: Vec<String>,
}

impl DigestOf {
    /// Takes in a sequence, if it is done.
    pub(crate) fn add(&mut self, entry: &Entry) {
        if let (Status::Done, Some(digest)) = (entry.status, &entry.digest) {
            self.lines.push(format!("{} {digest}\n", entry.id));
        }
    }

    /// The digest of the sorted lines.
    pub(crate) fn text(mut self) -> String {
        self.lines.sort_unstable();
        let mut digest = Digest::new();
        self.lines.iter().for_each(|line| digest.update(line.as_bytes()));
        digest.text()
    }
}

/// An option that was not given has no key.
fn said(value: &Value) -> String {
    if value.is_null() { "nothing".to_owned() } else { value.to_string() }
}

fn difference(was: &Value, is: &Value, key: &str) -> Option<(String, String, String)> {
    match (was, is) {
        (Value::Object(a), Value::Object(b)) => {
            let none = Value::Null;
            a.keys().chain(b.keys()).find_map(|k| {
                difference(a.get(k).unwrap_or(&none), b.get(k).unwrap_or(&none), &format!("{key}/{k}"))
            })
        }
        _ if was == is => None,
        _ => Some((key.trim_start_matches('/').to_owned(), said(was), said(is))),
    }
}
