//! JSON for programs.

use serde_json::Value;

/// `object` with those of `further` that have a value. What is absent has no key: `null` is what JSON makes of a number that is not
/// finite, and programs read numbers where they find keys.
#[must_use]
pub fn with_known<const N: usize>(mut object: Value, further: [(&str, Option<Value>); N]) -> Value {
    for (key, value) in further {
        if let Some(value) = value {
            object[key] = value;
        }
    }
    object
}
