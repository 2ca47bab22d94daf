//! The one list of all sequences: JSON lines, the options first.

use std::fs;
use std::path::Path;

use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use crate::error::{Error, Kind, Result};
use crate::storage;

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
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Entry {
    /// Name of the sequence and of its folder.
    pub id: String,
    /// `train` or `test`.
    pub split: String,
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
    /// Reads the manifest of a dataset's folder.
    ///
    /// # Errors
    /// [`Kind::Io`] when there is none, [`Kind::Config`] when it is none.
    pub fn read(folder: &Path) -> Result<Self> {
        let path = folder.join(NAME);
        let text = fs::read_to_string(&path).map_err(|e| Error::io(path.display(), e))?;
        let bad = |e: serde_json::Error| Error::new(Kind::Config, path.display()).found(e);
        let mut lines = text.lines();
        let head: Value = serde_json::from_str(lines.next().unwrap_or("")).map_err(bad)?;
        let entries = lines.map(serde_json::from_str).collect::<Result<_, _>>().map_err(bad)?;
        Ok(Self { options: head["options"].clone(), entries })
    }

    /// Writes it, whole or not at all.
    ///
    /// # Errors
    /// As [`storage::write_small`].
    pub fn write(&self, folder: &Path) -> Result<()> {
        let path = folder.join(NAME);
        let mut text = json!({ "dataset": 1, "options": self.options }).to_string();
        for entry in &self.entries {
            text.push('\n');
            text += &serde_json::to_string(entry)
                .map_err(|e| Error::new(Kind::Config, path.display()).found(e))?;
        }
        text.push('\n');
        storage::write_small(&path, text.as_bytes(), true)
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
