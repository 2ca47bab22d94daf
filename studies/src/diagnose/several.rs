//! Sensors that have several effects.

use std::collections::BTreeMap;

use serde_json::Value;

/// What was found of effects above their smallest nameable strength, and what was said wrongly.
pub(crate) struct Several<'a> {
    /// Hidden and found, by name.
    pub rows: BTreeMap<&'a str, [usize; 2]>,
    pub wrong: BTreeMap<&'a str, usize>,
}

impl<'a> Several<'a> {
    pub(crate) fn of(records: &[&'a Value]) -> Self {
        let mut several = Self { rows: BTreeMap::new(), wrong: BTreeMap::new() };
        for record in records {
            let found = |name: &str| list(&record["score"]["found"]).any(|f| f == name);
            for hidden in list(&record["hidden"]) {
                if hidden["strength"].as_f64() < hidden["nameable"].as_f64() {
                    continue;
                }
                let name = hidden["name"].as_str().unwrap_or("?");
                let row = several.rows.entry(name).or_default();
                row[0] += 1;
                row[1] += usize::from(found(name));
            }
            for name in list(&record["score"]["wrong"]).filter_map(Value::as_str) {
                *several.wrong.entry(name).or_default() += 1;
            }
        }
        several
    }

    pub(crate) fn hidden(&self) -> usize {
        self.rows.values().map(|r| r[0]).sum()
    }

    pub(crate) fn found(&self) -> usize {
        self.rows.values().map(|r| r[1]).sum()
    }

    pub(crate) fn wrong(&self) -> usize {
        self.wrong.values().sum()
    }
}

fn list(value: &Value) -> impl Iterator<Item = &Value> {
    value.as_array().into_iter().flatten()
}
