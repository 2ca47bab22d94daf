//! Records of the study: one file per sensor in a folder, and one file of lines with all records.
//!
//! The file of lines can be committed to git. Another machine can resume the study from this file.

use std::path::Path;

use serde_json::Value;

/// Keys that neither the tables nor the analysis of a failure require.
const OMITTED_KEYS: [&str; 4] = ["limits", "recommended_recordings", "undetectable", "notes"];

fn read_record(path: &Path) -> Option<Value> {
    serde_json::from_str(&std::fs::read_to_string(path).ok()?).ok()
}

fn is_of_this_version(record: &Value) -> bool {
    record["version"] == super::version::version_of_diagnosis(&record["diagnosis"]).as_str()
}

/// Returns whether a file contains a record of this version of the code.
pub(crate) fn is_current(path: &Path) -> bool {
    read_record(path).is_some_and(|r| is_of_this_version(&r))
}

/// Returns the records of this version of the code, sorted by file name, each with its score. Records of other versions
/// are skipped.
pub(crate) fn current_records(folder: &Path) -> Vec<Value> {
    let mut files: Vec<_> = std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().path()).collect();
    files.sort();
    let records = files.iter().filter(|p| p.extension().is_some_and(|e| e == "json"));
    records.filter_map(|p| read_record(p)).filter(is_of_this_version).map(with_score).collect()
}

/// Returns the record with a newly computed score. A changed scoring rule therefore applies to earlier diagnoses too.
fn with_score(mut record: Value) -> Value {
    record["score"] = super::score::score(&record["hidden"], &record["diagnosis"]);
    record
}

/// Writes the records of this version from `lines` to `folder`, unless `folder` already has them.
pub(crate) fn restore_records(lines: &Path, folder: &Path) {
    let text = spikelane_studies::lines::read(lines);
    let records = text.lines().filter_map(|line| serde_json::from_str::<Value>(line).ok());
    for record in records.filter(is_of_this_version) {
        let Some(id) = record["id"].as_str() else { continue };
        let file = folder.join(format!("{id}.json"));
        if !is_current(&file) {
            std::fs::write(&file, record.to_string()).unwrap();
        }
    }
}

/// Writes all records of this version, one per line.
pub(crate) fn write_lines(folder: &Path, lines: &Path) {
    let mut text = String::new();
    for record in current_records(folder) {
        text += &format!("{}\n", without_omitted_keys(record));
    }
    spikelane_studies::lines::write(lines, &text);
}

/// Returns a record without the keys that its line omits.
pub(crate) fn without_omitted_keys(mut record: Value) -> Value {
    if let Some(diagnosis) = record["diagnosis"].as_object_mut() {
        OMITTED_KEYS.iter().for_each(|key| drop(diagnosis.remove(*key)));
    }
    record
}
