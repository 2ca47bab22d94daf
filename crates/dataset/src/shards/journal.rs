//! What a shard knows of its sequences: a line for each that is settled, and a manifest when all are.

use std::fs::OpenOptions;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::packed::Packed;
use crate::manifest;
use crate::record::{self, Record};
use crate::stamp::{self, Stamp};
use crate::{Entry, Status};
use spikelane::error::{Error, Kind, Result};
use spikelane::unstable::inputs::{
    Access, InnerPath, InputFile, Lines, MAX_TEXT_BYTES, if_found, read_bytes,
};
use spikelane_io::storage::open_own;
use spikelane_io::storage::{self, Digest, steps, trees};

/// Its name in the shard's folder while sequences are missing.
const NAME: &str = "journal.jsonl";

/// A sequence that is settled.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
pub(super) struct Line {
    #[serde(flatten)]
    pub(crate) entry: Entry,
    /// How long it took, in seconds.
    pub(crate) seconds: f64,
    /// Times of its files in nanoseconds since 1970: of the record, then in the record's order.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(crate) times_ns: Vec<i64>,
}

/// The first line of a shard's manifest.
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Serialize)]
pub(super) struct Head {
    pub(crate) shard: u64,
    pub(crate) sequences: u64,
    pub(crate) failed: u64,
    /// How long its sequences took together, in seconds.
    pub(crate) seconds: f64,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) pack: Option<Packed>,
}

impl Line {
    /// A line about a sequence that was just made into `folder`.
    pub(crate) fn done(entry: Entry, seconds: f64, folder: &Path) -> Result<Self> {
        let record = Record::read(folder)?;
        let mut times_ns = vec![stamp::at(&folder.join(record::NAME))?.time_ns];
        for file in &record.files {
            times_ns.push(stamp::at(&file.path.below(folder, Access::Read)?)?.time_ns);
        }
        Ok(Self { entry, seconds, times_ns })
    }

    /// Whether every file of the sequence in `folder` is there with its size and time; the record alone is read.
    ///
    /// # Errors
    /// [`Kind::Input`] for a link that leaves the folder, unless `access` allows it.
    pub(crate) fn holds(&self, folder: &Path, access: Access) -> Result<bool> {
        let path = InnerPath::from(record::NAME).below(folder, access)?;
        let Ok(text) = read_bytes(&path, "a record", record::MAX_BYTES) else { return Ok(false) };
        if Some(Digest::of(&text)) != self.entry.digest {
            return Ok(false);
        }
        let Ok(record) = Record::parse(&path, &text) else { return Ok(false) };
        let is_recorded = stamp::at(&path).is_ok_and(|found| Some(&found.time_ns) == self.times_ns.first());
        if !is_recorded || self.times_ns.len() != record.files.len() + 1 {
            return Ok(false);
        }
        for (file, &time_ns) in record.files.iter().zip(&self.times_ns[1..]) {
            let found = stamp::at(&file.path.below(folder, access)?);
            if !found.is_ok_and(|s| s == Stamp { bytes: file.bytes, time_ns }) {
                return Ok(false);
            }
        }
        Ok(true)
    }
}

/// The journal of a shard's folder.
pub(super) struct Journal {
    folder: PathBuf,
    path: PathBuf,
}

impl Journal {
    /// The journal in `folder`, which is read as `access` allows.
    pub(crate) fn of(folder: &Path, access: Access) -> Result<Self> {
        Ok(Self { folder: folder.to_owned(), path: InnerPath::from(NAME).below(folder, access)? })
    }

    /// Its lines; one that a kill cut short is none, and ends it.
    pub(crate) fn read(&self) -> Result<Vec<Line>> {
        let Some(file) = if_found(InputFile::open(&self.path))? else { return Ok(Vec::new()) };
        let mut lines = Lines::new(&file, MAX_TEXT_BYTES);
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

    /// Begins it anew with `lines`.
    pub(crate) fn begin(&self, lines: &[Line]) -> Result<()> {
        let mut text = String::new();
        for line in lines {
            text += &json(line, &self.path)?;
        }
        storage::write_small(&self.path, text.as_bytes(), true)
    }

    /// Adds a line and brings it to the disk. The journal was begun before, so that it is a file of this program.
    pub(crate) fn add(&self, line: &Line) -> Result<()> {
        let io = |e| Error::io(self.path.display(), e);
        let mut file = open_own(OpenOptions::new().append(true), &self.path)?;
        file.write_all(json(line, &self.path)?.as_bytes()).map_err(io)?;
        steps::sync_file(&file, &self.path)
    }

    pub(crate) fn remove(&self) -> Result<()> {
        trees::remove(&self.folder, &InnerPath::from(NAME))
    }
}

fn json(line: &impl Serialize, path: &Path) -> Result<String> {
    let text = serde_json::to_string(line).map_err(|e| Error::new(Kind::Config, path.display()).found(e))?;
    Ok(text + "\n")
}

/// Writes the manifest of a shard that is done.
pub(super) fn write_manifest(folder: &Path, head: &Head, lines: &[Line]) -> Result<()> {
    let path = folder.join(manifest::NAME);
    let mut text = json(head, &path)?;
    for line in lines {
        text += &json(line, &path)?;
    }
    storage::write_small(&path, text.as_bytes(), true)
}

/// The head of the manifest of a shard, if it is done.
pub(super) fn read_head(folder: &Path, access: Access) -> Result<Option<Head>> {
    let path = InnerPath::from(manifest::NAME).below(folder, access)?;
    let Some(file) = if_found(InputFile::open(&path))? else { return Ok(None) };
    head(&mut Lines::new(&file, MAX_TEXT_BYTES), &path).map(Some)
}

fn head(lines: &mut Lines<'_>, path: &Path) -> Result<Head> {
    serde_json::from_slice(lines.next_line()?.unwrap_or_default())
        .map_err(|e| Error::new(Kind::Corrupt, path.display()).found(e))
}

/// The manifest of a shard of `sequences`, if it is done.
pub(super) fn read_manifest(
    folder: &Path,
    sequences: u64,
    access: Access,
) -> Result<Option<(Head, Vec<Line>)>> {
    let path = InnerPath::from(manifest::NAME).below(folder, access)?;
    let Some(file) = if_found(InputFile::open(&path))? else { return Ok(None) };
    let mut text = Lines::new(&file, MAX_TEXT_BYTES);
    let head = head(&mut text, &path)?;
    let other = |found: u64| {
        Err(Error::new(Kind::Corrupt, path.display())
            .found(format_args!("{found} sequences"))
            .expected(format_args!("{sequences}, as the plan has"))
            .remedy("remove it and run the shard again"))
    };
    if head.sequences != sequences {
        return other(head.sequences);
    }
    let mut lines = Vec::new();
    while let Some(line) = text.next_line()? {
        let line: Line =
            serde_json::from_slice(line).map_err(|e| Error::new(Kind::Corrupt, path.display()).found(e))?;
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

/// Takes the manifest away before sequences are made again.
pub(super) fn withdraw_manifest(folder: &Path) -> Result<()> {
    trees::remove(folder, &InnerPath::from(manifest::NAME))?;
    steps::sync_folder(folder)
}

impl Head {
    pub(crate) fn of(shard: u64, lines: &[Line], pack: Option<Packed>) -> Self {
        Self {
            shard,
            sequences: lines.len() as u64,
            failed: lines.iter().filter(|l| l.entry.status == Status::Failed).count() as u64,
            seconds: lines.iter().map(|l| l.seconds).sum(),
            pack,
        }
    }
}
