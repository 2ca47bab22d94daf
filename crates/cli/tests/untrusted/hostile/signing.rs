//! Updates the digests, lengths and times that are stored in files. An attacker could do this too.

use std::fs;
use std::os::unix::fs::MetadataExt as _;
use std::path::Path;

use serde_json::Value;
use spikelane_io::storage::Digest;

use super::mutations::files;

/// Updates the digests, lengths and times that are stored in files below `work`. Files that cannot be read are skipped.
pub(super) fn sign(work: &Path) {
    for path in files(work, &["json"]).into_iter().filter(|p| p.ends_with("record.json")) {
        let Some(mut record) = json(&path) else { continue };
        for file in record.get_mut("files").and_then(Value::as_array_mut).into_iter().flatten() {
            let Some(bytes) =
                file["path"].as_str().and_then(|name| read_small_file(&path.with_file_name(name)))
            else {
                continue;
            };
            file["bytes"] = bytes.len().into();
            file["digest"] = Digest::hash_bytes(&bytes).into();
        }
        fs::write(&path, record.to_string()).unwrap();
    }
    for path in files(work, &["jsonl"]) {
        let Ok(text) = fs::read_to_string(&path) else { continue };
        let lines = text.lines().map(|line| signed_line(&path, line) + "\n");
        let text: String = lines.collect();
        fs::write(&path, text).unwrap();
    }
    let list = read_small_file(&work.join("inputs.jsonl")).unwrap_or_default();
    let path = work.join("plan.json");
    let plan =
        fs::symlink_metadata(&path).is_ok_and(|m| m.is_file() && m.len() < 1 << 24).then(|| json(&path));
    let Some(Some(mut plan)) = plan else { return };
    if let (Some(sequences), Some(per_shard @ 1..)) =
        (plan["sequences"].as_u64(), plan["sequences_per_shard"].as_u64())
    {
        plan["shards"] = sequences.div_ceil(per_shard).into();
    }
    let mut offset = 0;
    let lines: Vec<&[u8]> = list.split_inclusive(|&b| b == b'\n').collect();
    for (piece, line) in plan.get_mut("pieces").and_then(Value::as_array_mut).into_iter().flatten().zip(lines)
    {
        if piece.is_object() && random_free(piece) {
            piece["bytes"] = line.len().into();
            piece["offset"] = offset.into();
            piece["digest"] = Digest::hash_bytes(line).into();
        }
        offset += line.len();
    }
    fs::write(&path, plan.to_string()).unwrap();
}

/// Whether the offset and length of a slice are below 2^20. Larger numbers are the result of an earlier random change.
fn random_free(piece: &Value) -> bool {
    ["bytes", "offset"].iter().all(|key| piece[key].as_u64().is_some_and(|n| n < 1 << 20))
}

fn json(path: &Path) -> Option<Value> {
    serde_json::from_slice(&read_small_file(path)?).ok()
}

/// Returns the bytes of a regular file that is smaller than 16 MiB.
pub(super) fn read_small_file(path: &Path) -> Option<Vec<u8>> {
    let metadata = fs::metadata(path).ok()?;
    if metadata.is_file() && metadata.len() < 1 << 24 { fs::read(path).ok() } else { None }
}

/// Returns a line of a manifest or journal with an updated digest and updated times.
fn signed_line(list: &Path, line: &str) -> String {
    let Ok(mut value) = serde_json::from_str::<Value>(line) else { return line.to_owned() };
    let Some(id) = value["id"].as_str() else { return line.to_owned() };
    let shard = value["shard"].as_str().map_or(String::new(), |shard| format!("shards/{shard}"));
    let folder = list.with_file_name(shard).join("sequences").join(id);
    let Some(bytes) = read_small_file(&folder.join("record.json")) else { return line.to_owned() };
    let Ok(record) = serde_json::from_slice::<Value>(&bytes) else { return line.to_owned() };
    value["digest"] = Digest::hash_bytes(&bytes).into();
    if value["mtimes_ns"].is_array() {
        let names = record["files"].as_array().into_iter().flatten();
        let names = ["record.json"].into_iter().chain(names.filter_map(|f| f["path"].as_str()));
        let time = |name: &str| {
            let metadata = fs::metadata(folder.join(name)).ok()?;
            Some(Value::from(metadata.mtime() * 1_000_000_000 + metadata.mtime_nsec()))
        };
        value["mtimes_ns"] = names.filter_map(time).collect::<Vec<_>>().into();
    }
    value.to_string()
}
