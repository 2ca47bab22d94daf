//! Helpers for JSON output.

use serde_json::Value;

/// Returns `object` with the entries of `further` whose value is `Some`.
///
/// A value that is `None` has no key, because programs that read the JSON expect a number at every key. `serde_json`
/// would write `null` for a number that is not finite.
#[must_use]
pub fn insert_present<const N: usize>(mut object: Value, entries: [(&str, Option<Value>); N]) -> Value {
    for (key, value) in entries {
        if let Some(value) = value {
            object[key] = value;
        }
    }
    object
}
