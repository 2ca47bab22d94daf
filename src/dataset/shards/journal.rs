//! What a shard knows of its sequences: a line for each that is settled, and a manifest when all are.

use std::fs::{self, OpenOptions};
use std::io::{BufRead as _, BufReader, Write as _};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::packed::Packed;
use crate::dataset::manifest;
use crate::dataset::record::{self, Record};
use crate::dataset::stamp::{self, Stamp};
use crate::dataset::{Entry, Status};
use crate::error::{Error, Kind, Result};
use crate::storage::{self, Digest, steps, trees};

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
            times_ns.push(stamp::at(&folder.join(&file.path))?.time_ns);
        }
        Ok(Self { entry, seconds, times_ns })
    }

    /// Whether every file of the sequence in `folder` is there with its size and time; the record alone is read.
    pub(crate) fn holds(&self, folder: &Path) -> bool {
        let read = || -> Option<bool> {
            let text = fs::read(folder.join(record::NAME)).ok()?;
            if Some(Digest::of(&text)) != self.entry.digest {
                return None;
            }
            let record: Record = serde_json::from_slice(&text).ok()?;
            if self.times_ns.len() != record.files.len() + 1 {
                return None;
            }
            if stamp::at(&folder.join(record::NAME)).ok()?.time_ns != self.times_ns[0] {
                return None;
            }
            Some(record.files.iter().zip(&self.times_ns[1..]).all(|(file, &time_ns)| {
                stamp::at(&folder.join(&file.path)).is_ok_and(|s| s == Stamp { bytes: file.bytes, time_ns })
            }))
        };
        read().unwrap_or(false)
    }
}

/// The journal of a shard's folder.
pub(super) struct Journal {
    path: PathBuf,
}

impl Journal {
    pub(crate) fn of(folder: &Path) -> Self {
        Self { path: folder.join(NAME) }
    }

    /// Its lines; one that a kill cut short is none, and ends it.
    pub(crate) fn read(&self) -> Result<Vec<Line>> {
        match fs::read(&self.path) {
            Ok(bytes) => Ok(whole_lines(&bytes)),
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => Ok(Vec::new()),
            Err(e) => Err(Error::io(self.path.display(), e)),
        }
    }

    /// Begins it anew with `lines`.
    pub(crate) fn begin(&self, lines: &[Line]) -> Result<()> {
        let mut text = String::new();
        for line in lines {
            text += &json(line, &self.path)?;
        }
        storage::write_small(&self.path, text.as_bytes(), true)
    }

    /// Adds a line and brings it to the disk.
    pub(crate) fn add(&self, line: &Line) -> Result<()> {
        let io = |e| Error::io(self.path.display(), e);
        let mut file = OpenOptions::new().append(true).open(&self.path).map_err(io)?;
        file.write_all(json(line, &self.path)?.as_bytes()).map_err(io)?;
        steps::sync_file(&file, &self.path)
    }

    pub(crate) fn remove(&self) -> Result<()> {
        trees::remove(&self.path)
    }
}

fn json(line: &impl Serialize, path: &Path) -> Result<String> {
    let text = serde_json::to_string(line).map_err(|e| Error::new(Kind::Config, path.display()).found(e))?;
    Ok(text + "\n")
}

fn whole_lines(bytes: &[u8]) -> Vec<Line> {
    let whole = bytes.iter().rposition(|&b| b == b'\n').map_or(0, |at| at + 1);
    let lines = bytes[..whole].split(|&b| b == b'\n').filter(|l| !l.is_empty());
    lines.map_while(|line| serde_json::from_slice(line).ok()).collect()
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
pub(super) fn read_head(folder: &Path) -> Result<Option<Head>> {
    let path = folder.join(manifest::NAME);
    let file = match fs::File::open(&path) {
        Ok(file) => file,
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(None),
        Err(e) => return Err(Error::io(path.display(), e)),
    };
    let mut line = String::new();
    BufReader::new(file).read_line(&mut line).map_err(|e| Error::io(path.display(), e))?;
    serde_json::from_str(&line).map(Some).map_err(|e| Error::new(Kind::Corrupt, path.display()).found(e))
}

/// The manifest of a shard, if it is done.
pub(super) fn read_manifest(folder: &Path) -> Result<Option<(Head, Vec<Line>)>> {
    let Some(head) = read_head(folder)? else { return Ok(None) };
    let path = folder.join(manifest::NAME);
    let text = fs::read_to_string(&path).map_err(|e| Error::io(path.display(), e))?;
    let lines: Vec<Line> = text
        .lines()
        .skip(1)
        .map(serde_json::from_str)
        .collect::<Result<_, _>>()
        .map_err(|e| Error::new(Kind::Corrupt, path.display()).found(e))?;
    if lines.len() as u64 != head.sequences {
        return Err(Error::new(Kind::Corrupt, path.display())
            .found(format_args!("{} sequences", lines.len()))
            .expected(head.sequences)
            .remedy("remove it and run the shard again"));
    }
    Ok(Some((head, lines)))
}

/// Takes the manifest away before sequences are made again.
pub(super) fn withdraw_manifest(folder: &Path) -> Result<()> {
    trees::remove(&folder.join(manifest::NAME))?;
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
