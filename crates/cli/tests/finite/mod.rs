//! Looks for numbers that are not finite in whatever a program leaves.

pub(crate) mod inputs;

use std::path::{Path, PathBuf};

use serde_json::Value;

/// Words that a number which is not finite becomes in text.
const WORDS: [&str; 4] = ["nan", "inf", "infinity", "infinite"];

/// What is wrong in a text: lines with such a word.
pub(crate) fn text(text: &str) -> Vec<String> {
    let wrong = |line: &&str| {
        let lower = line.to_lowercase();
        let words = lower.split(|c: char| !c.is_alphanumeric() && c != '_');
        words.into_iter().any(|w| WORDS.contains(&w))
    };
    text.lines().filter(wrong).map(|l| l.chars().take(160).collect()).collect()
}

/// What is wrong in a JSON value: a number that is not finite has become `null`, and some writers make a string of it.
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

/// What is wrong in a text of JSON objects, one a line or one in all.
pub(crate) fn json_text(content: &str) -> Vec<String> {
    if let Ok(whole) = serde_json::from_str::<Value>(content) {
        return json("", &whole);
    }
    let line = |l: &str| match serde_json::from_str::<Value>(l) {
        Ok(value) => json("", &value),
        Err(e) => vec![format!("not JSON ({e}): {l}")],
    };
    content.lines().flat_map(line).collect()
}

/// What is wrong in a NumPy file of floats.
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

/// What is wrong in a Middlebury flow file: a mark and two sizes of four bytes, then floats.
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

/// What is wrong in the files below a folder, by name; those of other kinds hold whole numbers.
pub(crate) fn folder(root: &Path) -> Vec<String> {
    let mut wrong = Vec::new();
    for path in files(root) {
        let read = || std::fs::read(&path).unwrap();
        let string = || String::from_utf8(read()).unwrap();
        let found = match path.extension().and_then(|e| e.to_str()).unwrap_or("") {
            "json" | "jsonl" => json_text(&string()),
            "html" | "toml" | "txt" | "md" | "yaml" | "csv" | "svg" => text(&string()),
            "npy" => npy(&read()),
            "exr" => exr(&path),
            "flo" => flo(&read()),
            _ => Vec::new(),
        };
        let name = path.strip_prefix(root).unwrap_or(&path).display().to_string();
        wrong.extend(found.into_iter().map(|f| format!("{name}: {f}")));
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
