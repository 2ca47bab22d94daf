//! Changes names, counts and values in the files of a folder.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use serde_json::Value;

use super::mutations::{Random, files, relative_name};
use super::signing::read_small_file;

/// Returns a file name. Most of these names point to another folder or file, or are invalid on every system.
fn name(random: &mut Random, around: &Path, is_folder: bool) -> String {
    // One to five steps up suffice to leave a dataset, a shard or a sequence.
    let up = "../".repeat(1 + random.number_below(5));
    let odd = [
        "",
        ".",
        "..",
        "/",
        "a/b",
        "a/../..",
        "a\\..\\b",
        "C:",
        "C:\\x",
        "\\\\host\\share",
        "nul",
        "CON.txt",
    ];
    let controls = ["x\0y", "x\ny", "\u{1b}[2Jx", "\u{9b}x", "\u{202e}x", " ", "a.", "~", "-rf", "%2e%2e"];
    let targets = [
        "/dev/zero",
        "/dev/null",
        "/proc/self/environ",
        "scene-0001",
        "train",
        "lock",
        ".x.spikelane.partial",
    ];
    let place = match (is_folder, random.number_below(8)) {
        (true, 0..=4) | (false, 0) => "home/alice",
        (true, 5..=6) => "sequence",
        (true, _) | (false, 1) => "record.json",
        (false, _) => "secret.txt",
    };
    match random.number_below(12) {
        0..=3 => format!("{up}around/{place}"),
        4..=8 => around.join(place).display().to_string(),
        9 => "x".repeat(*random.choose(&[255, 256, 5000, 1 << 20])),
        _ => {
            let all = *random.choose(&[&odd[..], &controls, &targets]);
            (*random.choose(all)).to_owned()
        }
    }
}

fn number(random: &mut Random) -> Value {
    let integers = [
        0,
        1,
        2,
        7,
        (1 << 31) - 1,
        1 << 31,
        (1 << 32) - 1,
        1 << 32,
        1 << 53,
        1 << 63,
        u64::MAX - 1,
        u64::MAX,
    ];
    match random.number_below(8) {
        0 => Value::from(-1),
        1 => Value::from(*random.choose(&[1e300, -1e300, 0.5, 1e19, f64::MIN_POSITIVE])),
        _ => Value::from(*random.choose(&integers)),
    }
}

/// `NAMES` are keys whose text becomes a path. `COUNTS` are keys whose number becomes a size or a loop count.
const NAMES: [&str; 8] = ["id", "path", "file", "folder", "shard", "split", "input", "list"];
const COUNTS: [&str; 9] = [
    "sequences",
    "sequences_per_shard",
    "shards",
    "bytes",
    "offset",
    "readouts",
    "readout",
    "reference_readout",
    "every",
];

/// Location of a value: file, line number, and JSON pointer.
type ValueLocation = (PathBuf, usize, String);

/// Files from which this program reads names and counts.
const LISTS: [&str; 7] =
    ["plan.json", "inputs.jsonl", "journal.jsonl", "manifest.jsonl", "record.json", "stream.json", "c.json"];

/// Changes a name in a record, list, journal, plan or sidecar. If `counts` is true, it changes a count instead.
pub(super) fn mutate_known_key(random: &mut Random, work: &Path, around: &Path, counts: bool) -> String {
    let keys: &[&str] = if counts { &COUNTS } else { &NAMES };
    // The values are grouped by file name and key. Otherwise labels, which have hundreds of equal keys, would be selected
    // more often than a plan, which has one of each key.
    let mut locations: BTreeMap<(String, String), Vec<ValueLocation>> = BTreeMap::new();
    for path in files(work, &["json", "jsonl"]) {
        let file = path.file_name().unwrap().to_string_lossy().into_owned();
        let Some(text) = read_small_file(&path).and_then(|bytes| String::from_utf8(bytes).ok()) else {
            continue;
        };
        let is_json = path.extension().is_some_and(|ending| ending == "json");
        let lines: Vec<&str> = if is_json { vec![&text] } else { text.lines().collect() };
        for (number, line) in lines.into_iter().enumerate() {
            let Ok(value) = serde_json::from_str::<Value>(line) else { continue };
            let mut places = Vec::new();
            collect(&value, String::new(), &mut places);
            for place in places {
                let key = place.rsplit('/').next().unwrap_or_default();
                // Exported files are skipped, because only data loaders read them. This program reads the lists,
                // records, plans and sidecars.
                let is_read = LISTS.contains(&&*file)
                    && !["/about", "/options"].iter().any(|part| place.starts_with(part))
                    && !(file == "record.json" && key == "id");
                if is_read
                    && keys.contains(&key)
                    && value.pointer(&place).is_some_and(|v| v.is_string() != counts)
                {
                    let all = locations.entry((file.clone(), key.to_owned())).or_default();
                    all.push((path.clone(), number, place));
                }
            }
        }
    }
    let groups: Vec<_> = locations.into_values().collect();
    if groups.is_empty() {
        return mutate_value(random, work, around);
    }
    let (path, number_of_line, place) = {
        let group = random.choose(&groups);
        random.choose(group).clone()
    };
    let is_folder = ["/id", "/shard", "/split", "/folder"].iter().any(|key| place.ends_with(key));
    let new: Value = if counts { number(random) } else { name(random, around, is_folder).into() };
    let description = cut_long(&format!("{}: {place} = {new}", relative_name(work, &path)));
    let text = fs::read_to_string(&path).unwrap();
    let is_json = path.extension().is_some_and(|ending| ending == "json");
    let changed = |line: &str| {
        let mut value: Value = serde_json::from_str(line).unwrap();
        *value.pointer_mut(&place).unwrap() = new.clone();
        value.to_string()
    };
    let is_added = random.number_below(3) == 0;
    let text = if is_json {
        changed(&text)
    } else if is_added {
        let line = text.lines().nth(number_of_line).unwrap_or_default();
        format!("{text}{}\n", changed(line))
    } else {
        let lines = text.lines().enumerate();
        lines
            .map(|(i, line)| if i == number_of_line { changed(line) } else { line.to_owned() } + "\n")
            .collect()
    };
    fs::write(&path, text).unwrap();
    description
}

/// Changes a name or count in a line of `camera.toml`, of `dataset.toml`, or of the options of a plan.
pub(super) fn mutate_setting(random: &mut Random, work: &Path, around: &Path) -> String {
    let plan = work.join("plan.json");
    let mut on_disk = read_small_file(&plan).and_then(|bytes| serde_json::from_slice::<Value>(&bytes).ok());
    let texts = files(work, &["toml"]);
    let planned = on_disk.as_ref().and_then(|plan| plan["options"].as_str()).map(str::to_owned);
    let (text, path) = match (planned, texts.is_empty()) {
        (Some(text), _) => (text, plan.clone()),
        (None, false) => {
            let path = random.choose(&texts).clone();
            (fs::read_to_string(&path).unwrap_or_default(), path)
        }
        (None, true) => return mutate_known_key(random, work, around, false),
    };
    let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
    // In most cases the changed value is a name: a map of a camera, a folder, or a list of inputs.
    let is_name =
        |line: &String| ["file", "folder", "list", "camera", ".npy"].iter().any(|k| line.contains(k));
    let all: Vec<usize> = (0..lines.len()).filter(|&i| lines[i].contains('=')).collect();
    let named: Vec<usize> = all.iter().copied().filter(|&i| is_name(&lines[i])).collect();
    let from = if named.is_empty() || random.number_below(3) == 0 { &all } else { &named };
    if from.is_empty() {
        return "nothing".to_owned();
    }
    let at = *random.choose(from);
    let new = if random.number_below(4) == 0 { number(random) } else { name(random, around, false).into() };
    let line = lines[at].clone();
    let quotes: Vec<usize> = line.match_indices('"').map(|(i, _)| i).collect();
    lines[at] = match (quotes.len() / 2, &new) {
        // Replaces one string of the line. If the line contains an inline table, its other strings do not change.
        (1.., Value::String(_)) => {
            let pair = 2 * random.number_below(quotes.len() / 2);
            format!("{}{new}{}", &line[..quotes[pair]], &line[quotes[pair + 1] + 1..])
        }
        _ => format!("{} = {new}", line.split('=').next().unwrap_or_default().trim()),
    };
    let description = cut_long(&lines[at]);
    let text = lines.join("\n") + "\n";
    match &mut on_disk {
        Some(on_disk) if path == plan => {
            on_disk["options"] = text.into();
            fs::write(&path, on_disk.to_string()).unwrap();
        }
        _ => fs::write(&path, text).unwrap(),
    }
    format!("{}: {description}", relative_name(work, &path))
}

/// Changes the value of one key in a text file.
pub(super) fn mutate_value(random: &mut Random, work: &Path, around: &Path) -> String {
    let all = files(work, &["json", "jsonl", "toml", "yaml"]);
    if all.is_empty() {
        return "nothing".to_owned();
    }
    let path = random.choose(&all).clone();
    let Ok(text) = fs::read_to_string(&path) else { return "nothing".to_owned() };
    let description = match path.extension().and_then(|e| e.to_str()) {
        Some("json") => {
            let Ok(mut value) = serde_json::from_str(&text) else { return "nothing".to_owned() };
            let description = leaf(random, &mut value, around);
            fs::write(&path, format!("{value:#}")).unwrap();
            description
        }
        Some("jsonl") => {
            let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
            if lines.is_empty() {
                return "nothing".to_owned();
            }
            let at = random.number_below(lines.len());
            let Ok(mut value) = serde_json::from_str(&lines[at]) else { return "nothing".to_owned() };
            let description = leaf(random, &mut value, around);
            match random.number_below(4) {
                0 => lines.push(value.to_string()),
                _ => lines[at] = value.to_string(),
            }
            fs::write(&path, lines.join("\n") + "\n").unwrap();
            description
        }
        _ => return mutate_setting(random, work, around),
    };
    format!("{}: {description}", relative_name(work, &path))
}

pub(super) fn packs(work: &Path) -> Vec<PathBuf> {
    files(work, &["tar"])
}

/// Changes the name of a file in a pack, or replaces a file in a pack with a symbolic link.
pub(super) fn mutate_pack(random: &mut Random, work: &Path, around: &Path) -> String {
    let path = random.choose(&packs(work)).clone();
    let mut bytes = fs::read(&path).unwrap();
    let headers: Vec<usize> =
        (0..bytes.len()).step_by(512).filter(|at| bytes[*at..].get(257..262) == Some(b"ustar")).collect();
    let header = &mut bytes[*random.choose(&headers)..][..512];
    let is_link = random.number_below(3) == 0;
    let field = if is_link { 157..257 } else { 0..100 };
    let name = name(random, around, false);
    header[field.clone()].fill(0);
    let len = name.len().min(field.len());
    header[field][..len].copy_from_slice(&name.as_bytes()[..len]);
    if is_link {
        header[156] = b'2';
    }
    header[148..156].fill(b' ');
    let sum: u32 = header.iter().map(|&byte| u32::from(byte)).sum();
    header[148..156].copy_from_slice(format!("{sum:06o}\0 ").as_bytes());
    fs::write(&path, bytes).unwrap();
    cut_long(&format!(
        "{}: a file {} {name}",
        relative_name(work, &path),
        if is_link { "links to" } else { "called" }
    ))
}

/// Changes or removes one value inside `value`.
fn leaf(random: &mut Random, value: &mut Value, around: &Path) -> String {
    let mut places = Vec::new();
    collect(value, String::new(), &mut places);
    if places.is_empty() {
        return "nothing".to_owned();
    }
    let place = random.choose(&places).clone();
    let Some(found) = value.pointer_mut(&place) else { return "nothing".to_owned() };
    let new = match (&*found, random.number_below(8)) {
        (_, 0) => Value::Null,
        (_, 1) => serde_json::json!([]),
        (Value::Number(_), 2..=6) => number(random),
        (Value::String(_), 2..=6) => name(random, around, false).into(),
        (_, 7) => number(random),
        _ => name(random, around, false).into(),
    };
    let description = format!("{place} = {new}");
    *found = new;
    cut_long(&description)
}

fn cut_long(text: &str) -> String {
    text.chars().take(120).collect()
}

fn collect(value: &Value, at: String, into: &mut Vec<String>) {
    let escaped = |key: &str| key.replace('~', "~0").replace('/', "~1");
    match value {
        Value::Object(all) => {
            for (key, inner) in all {
                let place = format!("{at}/{}", escaped(key));
                into.push(place.clone());
                collect(inner, place, into);
            }
        }
        Value::Array(all) => {
            for (index, inner) in all.iter().enumerate().take(4) {
                let place = format!("{at}/{index}");
                into.push(place.clone());
                collect(inner, place, into);
            }
        }
        _ => {}
    }
}
