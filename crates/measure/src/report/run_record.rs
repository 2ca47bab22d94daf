//! The origin of a report: command, date, program version and input files.

use std::path::Path;

use serde::Serialize;
use spikelane_io::storage::Digest;

use super::today;

/// A file that a report depends on.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub struct InputRecord {
    /// Name as the report shows it.
    pub name: String,
    /// Digest of the file, as `blake3:<hex>`. `None` for an input that is not a regular file.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub digest: Option<String>,
}

/// The command that made a report, its date and its input files.
///
/// # Examples
/// ```
/// use spikelane_measure::report::RunRecord;
/// let run = RunRecord::now("spikelane measure a.dat");
/// assert!(run.files.is_empty() && run.date.len() == 10);
/// ```
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub struct RunRecord {
    /// The command line; empty if a library call made the report.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub command: String,
    /// The date in UTC as `year-month-day`; may be empty.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub date: String,
    /// The input files.
    pub files: Vec<InputRecord>,
}

impl RunRecord {
    /// Returns a record with today's date and without files. `command` may be empty.
    #[must_use]
    pub fn now(command: impl Into<String>) -> Self {
        Self { command: command.into(), date: today(), files: Vec::new() }
    }

    /// Adds the file at `path` under the name `name`. An input that cannot be read as a regular file, such as standard
    /// input, has no digest.
    #[must_use]
    pub fn with_file(mut self, path: &Path, name: impl Into<String>) -> Self {
        self.files.push(InputRecord { name: name.into(), digest: Digest::hash_file(path).ok() });
        self
    }
}
