//! The recorded time, memory and fault of one sequence.

use std::path::Path;

use serde::{Deserialize, Serialize};
use spikelane::error::{Error, ErrorKind, Result};
use spikelane::unstable::inputs::{Access, InnerPath, PlainName, not_found_as_none, read_bytes, utf8_bytes};

/// Maximum size of a result in bytes.
const MAX_RESULT_BYTES: u64 = 64 << 10;

/// The result of one sequence.
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Serialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct SequenceResult {
    /// Time in seconds, above 0.
    pub seconds: f64,
    /// Largest resident memory of the process in bytes. `None` if the system does not report it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub memory_peak_bytes: Option<u64>,
    /// Why the method failed, in one line.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fault: Option<String>,
}

impl SequenceResult {
    /// Checks that the time is possible. `limit` is the longest time without a fault in seconds.
    ///
    /// # Errors
    /// [`ErrorKind::Config`] if the time is 0, negative or not finite, or if it exceeds the limit without a fault.
    pub(crate) fn check(&self, subject: impl std::fmt::Display, limit: Option<f64>) -> Result<()> {
        let error = |expected: &dyn std::fmt::Display| {
            Err(Error::new(ErrorKind::Config, subject.to_string())
                .found(format_args!("a time of {} s", self.seconds))
                .expected(expected))
        };
        match limit {
            _ if !is_positive(self.seconds) => error(&"a positive number of seconds"),
            Some(limit) if self.fault.is_none() && self.seconds > limit => {
                error(&format_args!("at most the time limit of {limit} s, or a fault"))
            }
            _ => Ok(()),
        }
    }
}

/// Returns whether a measured quantity is possible: above 0 and finite.
pub(crate) fn is_positive(value: f64) -> bool {
    value.is_finite() && value > 0.0
}

pub(super) fn result_path(group: &PlainName, id: &PlainName) -> InnerPath {
    InnerPath::from("results").join(group).join(id.with_ending(".json"))
}

/// Reads the result of a sequence. Returns `None` if the sequence is not finished.
///
/// # Errors
/// [`ErrorKind::Config`] if the file is invalid.
pub(crate) fn read_result(
    folder: &Path,
    group: &PlainName,
    id: &PlainName,
    limit: Option<f64>,
) -> Result<Option<SequenceResult>> {
    let path = result_path(group, id).resolve_in(folder, Access::Read)?;
    let text = read_bytes(&path, "a result", MAX_RESULT_BYTES);
    let Some(text) = not_found_as_none(text)? else { return Ok(None) };
    let result: SequenceResult = serde_json::from_slice(&utf8_bytes(&text)).map_err(|e| {
        Error::new(ErrorKind::Config, path.display()).found(e).expected("the result of a sequence")
    })?;
    result.check(path.display(), limit)?;
    Ok(Some(result))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn impossible_times_are_refused() {
        let result = |seconds, fault: Option<&str>| SequenceResult {
            seconds,
            memory_peak_bytes: None,
            fault: fault.map(str::to_owned),
        };
        for seconds in [0.0, -0.0, -1.0, f64::NAN, f64::INFINITY, 2.5] {
            let error = result(seconds, None).check("a.json", Some(2.0)).unwrap_err();
            assert_eq!(error.kind(), ErrorKind::Config, "{seconds}");
        }
        assert!(result(2.0, None).check("a.json", Some(2.0)).is_ok());
        assert!(result(2.5, Some("time limit")).check("a.json", Some(2.0)).is_ok());
        assert!(result(2.5, None).check("a.json", None).is_ok());
    }
}
