//! The origin of a report: command, date, program version and input files.

use std::path::Path;
use std::time::SystemTime;

use serde::Serialize;
use spikelane_io::storage::Digest;

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

/// Returns the current date in UTC as `year-month-day`.
#[must_use]
pub fn today() -> String {
    let seconds = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).map_or(0, |d| d.as_secs());
    // Converts days since 1970 to a Gregorian date. Years begin in March, so a leap day is the last day of its year.
    let days = seconds / 86_400 + 719_468;
    let (era, day) = (days / 146_097, days % 146_097);
    let year = (day - day / 1460 + day / 36_524 - day / 146_096) / 365;
    let day = day - (365 * year + year / 4 - year / 100);
    let month = (5 * day + 2) / 153;
    let date = day - (153 * month + 2) / 5 + 1;
    let month = if month < 10 { month + 3 } else { month - 9 };
    let year = year + era * 400 + u64::from(month <= 2);
    format!("{year}-{month:02}-{date:02}")
}

/// Returns whether `text` is a date as [`today`] writes it.
///
/// # Examples
/// ```
/// use spikelane_measure::report::is_date;
/// assert!(is_date("2024-02-29") && !is_date("2023-02-29") && !is_date("2024-2-29"));
/// ```
#[must_use]
pub fn is_date(text: &str) -> bool {
    let is_digit = |i: usize| text.as_bytes().get(i).is_some_and(u8::is_ascii_digit);
    if text.len() != 10 || ![0, 1, 2, 3, 5, 6, 8, 9].into_iter().all(is_digit) {
        return false;
    }
    let number = |range: std::ops::Range<usize>| text[range].parse().unwrap_or(0);
    let (year, month, day): (u32, u32, u32) = (number(0..4), number(5..7), number(8..10));
    let is_leap = year % 4 == 0 && (year % 100 != 0 || year % 400 == 0);
    let last = match month {
        2 => 28 + u32::from(is_leap),
        4 | 6 | 9 | 11 => 30,
        _ => 31,
    };
    text.as_bytes()[4] == b'-'
        && text.as_bytes()[7] == b'-'
        && (1..=12).contains(&month)
        && (1..=last).contains(&day)
}
