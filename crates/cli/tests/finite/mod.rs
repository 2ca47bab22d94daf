//! Searches the outputs of a program for numbers that are not finite.

pub(crate) mod inputs;

use std::path::{Path, PathBuf};

use serde_json::Value;

/// Words that represent non-finite numbers in text.
const NON_FINITE_WORDS: [&str; 4] = ["nan", "inf", "infinity", "infinite"];

/// Returns the lines of a text that contain one of [`NON_FINITE_WORDS`]. Lines are cut off at 160 characters.
pub(crate) fn text(text: &str) -> Vec<String> {
    let wrong = |line: &&str| {
        let lower = line.to_lowercase();
        let words = lower.split(|c: char| !c.is_alphanumeric() && c != '_');
        words.into_iter().any(|w| NON_FINITE_WORDS.contains(&w))
    };
    text.lines().filter(wrong).map(|l| l.chars().take(160).collect()).collect()
}

/// Returns the non-finite numbers in a JSON value. JSON writers store them as `null` or as a string.
pub(crate) fn json(place: &str, value: &Value) -> Vec<String> {
    match value {
        Value::Null => vec![format!("{place} is null")],
        Value::String(s) => text(s).into_iter().map(|l| format!("{place}: {l}")).collect(),
        Value::Array(all) => {
            all.iter().enumerate().flat_map(|(i, v)| json(&format!("{place}[{i}]"), v)).collect()
        }
        Value::Object(all) => all.iter().flat_map(|(k, v)| json(&format!("{place}.{k}"), v)).collect(),
        _ => Vec::new(),
    }
}

/// Returns the non-finite numbers in JSON text. The text contains a single value, or one value per line.
pub(crate) fn json_text(content: &str) -> Vec<String> {
    if let Ok(document) = serde_json::from_str::<Value>(content) {
        return json("", &document);
    }
    let line = |l: &str| match serde_json::from_str::<Value>(l) {
        Ok(value) => json("", &value),
        Err(e) => vec![format!("not JSON ({e}): {l}")],
    };
    content.lines().flat_map(line).collect()
}

/// Returns a message if a NumPy file of floats contains non-finite values.
pub(crate) fn npy(bytes: &[u8]) -> Vec<String> {
    let short = u16::from_le_bytes([bytes[8], bytes[9]]) as usize;
    let header = String::from_utf8_lossy(&bytes[10..10 + short]).into_owned();
    let data = &bytes[10 + short..];
    let bad = if header.contains("<f4") {
        let all = data.chunks_exact(4).map(|c| f32::from_le_bytes(c.try_into().unwrap()));
        all.filter(|v| !v.is_finite()).count()
    } else if header.contains("<f8") {
        let all = data.chunks_exact(8).map(|c| f64::from_le_bytes(c.try_into().unwrap()));
        all.filter(|v| !v.is_finite()).count()
    } else {
        0
    };
    if bad == 0 { Vec::new() } else { vec![format!("{bad} values of {header} are not finite")] }
}

/// Returns a message if a Middlebury flow file contains non-finite values. The file contains a tag and two sizes of four
/// bytes each, followed by floats.
pub(crate) fn flo(bytes: &[u8]) -> Vec<String> {
    let all = bytes[12..].chunks_exact(4).map(|c| f32::from_le_bytes(c.try_into().unwrap()));
    let bad = all.filter(|v| !v.is_finite()).count();
    if bad == 0 { Vec::new() } else { vec![format!("{bad} displacements are not finite")] }
}

fn exr(path: &Path) -> Vec<String> {
    let image = image::open(path).unwrap_or_else(|e| panic!("{}: {e}", path.display())).to_rgb32f();
    let bad = image.as_raw().iter().filter(|v| !v.is_finite()).count();
    if bad == 0 { Vec::new() } else { vec![format!("{bad} values are not finite")] }
}

/// Returns the non-finite numbers in all files below a folder. Files with other extensions than those in the `match`
/// contain only integers.
pub(crate) fn folder(root: &Path) -> Vec<String> {
    let mut wrong = Vec::new();
    for path in files(root) {
        let read = || std::fs::read(&path).unwrap();
        let string = || String::from_utf8(read()).unwrap();
        let faults = match path.extension().and_then(|e| e.to_str()).unwrap_or("") {
            "json" | "jsonl" => json_text(&string()),
            "html" | "toml" | "txt" | "md" | "yaml" | "csv" | "svg" => text(&string()),
            "npy" => npy(&read()),
            "exr" => exr(&path),
            "flo" => flo(&read()),
            _ => Vec::new(),
        };
        let name = path.strip_prefix(root).unwrap_or(&path).display().to_string();
        wrong.extend(faults.into_iter().map(|f| format!("{name}: {f}")));
    }
    wrong
}

fn files(root: &Path) -> Vec<PathBuf> {
    let mut all = Vec::new();
    for entry in std::fs::read_dir(root).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() { all.extend(files(&path)) } else { all.push(path) }
    }
    all.sort();
    all
}
