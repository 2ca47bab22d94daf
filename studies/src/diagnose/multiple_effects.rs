//! Results for sensors with several effects.

use std::collections::BTreeMap;

use serde_json::Value;

/// Counts of hidden effects above their smallest detectable strength, of those that the diagnoses found, and of wrong
/// names.
pub(crate) struct MultipleEffects<'a> {
    /// Number of hidden and of found effects, by name.
    pub rows: BTreeMap<&'a str, [usize; 2]>,
    pub wrong_names: BTreeMap<&'a str, usize>,
}

impl<'a> MultipleEffects<'a> {
    pub(crate) fn from_records(records: &[&'a Value]) -> Self {
        let mut several = Self { rows: BTreeMap::new(), wrong_names: BTreeMap::new() };
        for record in records {
            let is_found = |name: &str| array_items(&record["score"]["found"]).any(|f| f == name);
            for hidden in array_items(&record["hidden"]) {
                if hidden["strength"].as_f64() < hidden["detectable_strength"].as_f64() {
                    continue;
                }
                let name = hidden["name"].as_str().unwrap_or("?");
                let row = several.rows.entry(name).or_default();
                row[0] += 1;
                row[1] += usize::from(is_found(name));
            }
            for name in array_items(&record["score"]["wrong"]).filter_map(Value::as_str) {
                *several.wrong_names.entry(name).or_default() += 1;
            }
        }
        several
    }

    pub(crate) fn hidden_count(&self) -> usize {
        self.rows.values().map(|r| r[0]).sum()
    }

    pub(crate) fn found_count(&self) -> usize {
        self.rows.values().map(|r| r[1]).sum()
    }

    pub(crate) fn wrong_count(&self) -> usize {
        self.wrong_names.values().sum()
    }
}

fn array_items(value: &Value) -> impl Iterator<Item = &Value> {
    value.as_array().into_iter().flatten()
}
