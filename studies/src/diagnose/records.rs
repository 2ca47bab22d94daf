//! What was judged: one file a sensor in a folder, and all of it as a file of lines that can be committed, from which a
//! study goes on elsewhere.

use std::path::Path;

use serde_json::Value;

/// What neither a table nor a question about a failure needs.
const LEFT_OUT: [&str; 3] = ["settle", "not_testable", "notes"];

fn read(path: &Path) -> Option<Value> {
    serde_json::from_str(&std::fs::read_to_string(path).ok()?).ok()
}

fn of_this_version(record: &Value) -> bool {
    record["version"] == super::version::of(&record["said"]).as_str()
}

/// Whether a file holds what this version of the code said.
pub(crate) fn is_current(path: &Path) -> bool {
    read(path).is_some_and(|r| of_this_version(&r))
}

/// What this version of the code said, by name, with its score; records of other versions are left out.
pub(crate) fn all(folder: &Path) -> Vec<Value> {
    let mut files: Vec<_> = std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().path()).collect();
    files.sort();
    let records = files.iter().filter(|p| p.extension().is_some_and(|e| e == "json"));
    records.filter_map(|p| read(p)).filter(of_this_version).map(scored).collect()
}

/// How well it was said is no part of what was: a rule that changes holds for what was judged before.
fn scored(mut record: Value) -> Value {
    record["score"] = super::score::of(&record["hidden"], &record["said"]);
    record
}

/// Writes the records of this version that `lines` holds and `folder` does not.
pub(crate) fn restore(lines: &Path, folder: &Path) {
    let text = spikelane_studies::lines::read(lines);
    let records = text.lines().filter_map(|line| serde_json::from_str::<Value>(line).ok());
    for record in records.filter(of_this_version) {
        let Some(id) = record["id"].as_str() else { continue };
        let file = folder.join(format!("{id}.json"));
        if !is_current(&file) {
            std::fs::write(&file, record.to_string()).unwrap();
        }
    }
}

/// Writes all records of this version, one a line.
pub(crate) fn keep(folder: &Path, lines: &Path) {
    let mut text = String::new();
    for record in all(folder) {
        text += &format!("{}\n", kept(record));
    }
    spikelane_studies::lines::write(lines, &text);
}

/// A record with what its line holds.
pub(crate) fn kept(mut record: Value) -> Value {
    if let Some(said) = record["said"].as_object_mut() {
        LEFT_OUT.iter().for_each(|key| drop(said.remove(*key)));
    }
    record
}
