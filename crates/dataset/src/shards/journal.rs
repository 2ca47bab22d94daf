//! The state of a shard in a journal or a manifest. The journal has one line per processed sequence. When all sequences
//! are processed, the manifest replaces the journal.

use std::fs::OpenOptions;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::tar_file::ShardTar;
use crate::fingerprint::{self, Fingerprint};
use crate::manifest;
use crate::record::{self, SequenceRecord};
use crate::{SequenceEntry, SequenceStatus};
use spikelane::error::{Error, ErrorKind, Result};
use spikelane::unstable::Count;
use spikelane::unstable::inputs::{
    Access, InnerPath, InputFile, InputLines, MAX_TEXT_BYTES, not_found_as_none, read_bytes,
};
use spikelane_io::storage::open_no_follow;
use spikelane_io::storage::{self, Digest, folders, sync};

/// File name of the journal in the shard's folder. The journal exists until all sequences are processed.
const FILE_NAME: &str = "journal.jsonl";

/// A line of the journal, which describes one processed sequence.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
pub(super) struct JournalEntry {
    #[serde(flatten)]
    pub(crate) entry: SequenceEntry,
    /// Processing time in seconds.
    pub(crate) seconds: f64,
    /// Modification times in nanoseconds since the start of 1970. The first is the time of the record. The others are
    /// the times of the files in the order of the record.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(crate) mtimes_ns: Vec<i64>,
}

/// The first line of a shard's manifest.
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Serialize)]
pub(super) struct ShardManifestHead {
    pub(crate) shard: u64,
    pub(crate) sequences: u64,
    pub(crate) failed_sequences: u64,
    /// Total processing time of the sequences in seconds.
    pub(crate) seconds: f64,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) tar: Option<ShardTar>,
}

impl JournalEntry {
    /// Returns the line of a sequence that this process has just generated in `folder`.
    pub(crate) fn for_done_sequence(entry: SequenceEntry, seconds: f64, folder: &Path) -> Result<Self> {
        let record = SequenceRecord::read(folder, Access::Read)?;
        let mut times_ns = vec![fingerprint::file_fingerprint(&folder.join(record::FILE_NAME))?.mtime_ns];
        for file in &record.files {
            times_ns
                .push(fingerprint::file_fingerprint(&file.path.resolve_in(folder, Access::Read)?)?.mtime_ns);
        }
        Ok(Self { entry, seconds, mtimes_ns: times_ns })
    }

    /// Returns whether every file of the sequence in `folder` has the recorded size and modification time. Only the
    /// record is read.
    ///
    /// # Errors
    /// [`ErrorKind::Input`] if a file is a link to a file outside the folder, unless `access` allows such links.
    pub(crate) fn is_intact(&self, folder: &Path, access: Access) -> Result<bool> {
        let path = InnerPath::from(record::FILE_NAME).resolve_in(folder, access)?;
        let Ok(text) = read_bytes(&path, "a record", record::MAX_RECORD_BYTES) else { return Ok(false) };
        if Some(Digest::hash_bytes(&text)) != self.entry.digest {
            return Ok(false);
        }
        let Ok(record) = SequenceRecord::parse(&path, &text) else { return Ok(false) };
        let is_recorded = fingerprint::file_fingerprint(&path)
            .is_ok_and(|current| Some(&current.mtime_ns) == self.mtimes_ns.first());
        if !is_recorded || self.mtimes_ns.len() != record.files.len() + 1 {
            return Ok(false);
        }
        for (file, &time_ns) in record.files.iter().zip(&self.mtimes_ns[1..]) {
            let current = fingerprint::file_fingerprint(&file.path.resolve_in(folder, access)?);
            if !current.is_ok_and(|s| s == Fingerprint { bytes: file.bytes, mtime_ns: time_ns }) {
                return Ok(false);
            }
        }
        Ok(true)
    }
}

/// The journal in the folder of a shard.
pub(super) struct Journal {
    folder: PathBuf,
    path: PathBuf,
}

impl Journal {
    /// Opens the journal in `folder`. `access` determines whether links are allowed.
    pub(crate) fn open(folder: &Path, access: Access) -> Result<Self> {
        Ok(Self { folder: folder.to_owned(), path: InnerPath::from(FILE_NAME).resolve_in(folder, access)? })
    }

    /// Returns the lines of the journal before the first invalid line. If a process was killed during a write, the
    /// last line is incomplete and therefore invalid.
    pub(crate) fn read(&self) -> Result<Vec<JournalEntry>> {
        let Some(file) = not_found_as_none(InputFile::open(&self.path))? else { return Ok(Vec::new()) };
        let mut lines = InputLines::new(&file, MAX_TEXT_BYTES);
        let mut all = Vec::new();
        while let Some(line) = lines.next_line()?.and_then(|line| line.strip_suffix(b"\n")) {
            if line.is_empty() {
                continue;
            }
            let Ok(line) = serde_json::from_slice(line) else { break };
            all.push(line);
        }
        Ok(all)
    }

    /// Replaces the content of the journal with `lines`.
    pub(crate) fn rewrite(&self, lines: &[JournalEntry]) -> Result<()> {
        let mut text = String::new();
        for line in lines {
            text += &json_line(line, &self.path)?;
        }
        storage::write_small(&self.path, text.as_bytes(), true)
    }

    /// Appends a line and syncs the journal to the disk. A missing journal is not created, and a link is not followed.
    pub(crate) fn append(&self, line: &JournalEntry) -> Result<()> {
        let io = |e| Error::io(self.path.display(), e);
        let mut file = open_no_follow(OpenOptions::new().append(true), &self.path)?;
        file.write_all(json_line(line, &self.path)?.as_bytes()).map_err(io)?;
        sync::sync_file(&file, &self.path)
    }

    pub(crate) fn remove(&self) -> Result<()> {
        folders::remove(&self.folder, &InnerPath::from(FILE_NAME))
    }
}

fn json_line(line: &impl Serialize, path: &Path) -> Result<String> {
    let text =
        serde_json::to_string(line).map_err(|e| Error::new(ErrorKind::Config, path.display()).found(e))?;
    Ok(text + "\n")
}

/// Writes the manifest of a finished shard.
pub(super) fn write_manifest(folder: &Path, head: &ShardManifestHead, lines: &[JournalEntry]) -> Result<()> {
    let path = folder.join(manifest::FILE_NAME);
    let mut text = json_line(head, &path)?;
    for line in lines {
        text += &json_line(line, &path)?;
    }
    storage::write_small(&path, text.as_bytes(), true)
}

/// Returns the first line of a shard's manifest. Returns `None` if the shard is not finished.
pub(super) fn read_head(folder: &Path, access: Access) -> Result<Option<ShardManifestHead>> {
    let path = InnerPath::from(manifest::FILE_NAME).resolve_in(folder, access)?;
    let Some(file) = not_found_as_none(InputFile::open(&path))? else { return Ok(None) };
    parse_head(&mut InputLines::new(&file, MAX_TEXT_BYTES), &path).map(Some)
}

fn parse_head(lines: &mut InputLines<'_>, path: &Path) -> Result<ShardManifestHead> {
    serde_json::from_slice(lines.next_line()?.unwrap_or_default())
        .map_err(|e| Error::new(ErrorKind::Corrupt, path.display()).found(e))
}

/// Returns the manifest of a shard that has `sequences` sequences. Returns `None` if the shard is not finished.
pub(super) fn read_manifest(
    folder: &Path,
    sequences: u64,
    access: Access,
) -> Result<Option<(ShardManifestHead, Vec<JournalEntry>)>> {
    let path = InnerPath::from(manifest::FILE_NAME).resolve_in(folder, access)?;
    let Some(file) = not_found_as_none(InputFile::open(&path))? else { return Ok(None) };
    let mut text = InputLines::new(&file, MAX_TEXT_BYTES);
    let head = parse_head(&mut text, &path)?;
    let other = |found: u64| {
        Err(Error::new(ErrorKind::Corrupt, path.display())
            .found(Count(found, "sequence"))
            .expected(format_args!("{sequences}, as in the plan"))
            .remedy("remove the file and run the shard again"))
    };
    if head.sequences != sequences {
        return other(head.sequences);
    }
    let mut lines = Vec::new();
    while let Some(line) = text.next_line()? {
        let line: JournalEntry = serde_json::from_slice(line)
            .map_err(|e| Error::new(ErrorKind::Corrupt, path.display()).found(e))?;
        lines.push(line);
        if lines.len() as u64 > sequences {
            break;
        }
    }
    if lines.len() as u64 != sequences {
        return other(lines.len() as u64);
    }
    Ok(Some((head, lines)))
}

/// Removes the manifest. It must be removed before sequences of the shard are generated again.
pub(super) fn remove_manifest(folder: &Path) -> Result<()> {
    folders::remove(folder, &InnerPath::from(manifest::FILE_NAME))?;
    sync::sync_folder(folder)
}

impl ShardManifestHead {
    pub(crate) fn summarize(shard: u64, lines: &[JournalEntry], pack: Option<ShardTar>) -> Self {
        Self {
            shard,
            sequences: lines.len() as u64,
            failed_sequences: lines.iter().filter(|l| l.entry.status == SequenceStatus::Failed).count()
                as u64,
            seconds: lines.iter().map(|l| l.seconds).sum(),
            tar: pack,
        }
    }
}
