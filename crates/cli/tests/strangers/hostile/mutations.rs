//! What a stranger may change in a folder.

use std::collections::BTreeSet;
use std::fs::{self, File};
use std::os::unix::fs::{MetadataExt as _, symlink};
use std::path::{Path, PathBuf};

use serde_json::Value;
use spikelane_io::storage::Digest;

/// A sequence of numbers that follows from a seed (splitmix64).
pub(super) struct Random(u64);

impl Random {
    pub(super) const fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(0x2545_f491_4f6c_dd1d))
    }

    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// A number below `n`.
    pub(super) fn below(&mut self, n: usize) -> usize {
        (self.next() % n as u64) as usize
    }

    fn of<'a, T>(&mut self, all: &'a [T]) -> &'a T {
        &all[self.below(all.len())]
    }
}

/// Changes one to three things in the folder `work` and returns what was changed.
pub(super) fn apply(random: &mut Random, work: &Path, around: &Path) -> Vec<String> {
    let mut changes = Vec::new();
    // More changes make it likelier that the first one read ends the command.
    for _ in 0..*random.of(&[1, 1, 1, 1, 2, 2, 3]) {
        changes.push(match random.below(16) {
            0..=6 => aimed(random, work, around),
            7..=8 => value(random, work, around),
            9..=11 => link(random, work, around),
            12..=13 => kind(random, work),
            14 => cut(random, work),
            _ => bytes(random, work),
        });
    }
    // A stranger computes digests too.
    if random.below(4) > 0 {
        sign(work);
        changes.push("signed".to_owned());
    }
    changes
}

/// Files and folders below `work`, in the order of their names; links are not followed.
fn paths(work: &Path) -> Vec<PathBuf> {
    let (mut all, mut folders) = (Vec::new(), vec![work.to_owned()]);
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).unwrap() {
            let entry = entry.unwrap();
            if entry.file_type().unwrap().is_dir() {
                folders.push(entry.path());
            }
            all.push(entry.path());
        }
    }
    all.sort();
    all
}

fn files(work: &Path, endings: &[&str]) -> Vec<PathBuf> {
    let mut all = paths(work);
    all.retain(|path| {
        let ending = path.extension().unwrap_or_default().to_string_lossy().into_owned();
        let is_file = fs::symlink_metadata(path).unwrap().is_file();
        is_file && (endings.is_empty() || endings.contains(&&*ending))
    });
    all
}

fn shown(work: &Path, path: &Path) -> String {
    path.strip_prefix(work).unwrap_or(path).display().to_string()
}

/// Names that lead elsewhere, or that no system has.
fn name(random: &mut Random, around: &Path) -> String {
    let up = "../".repeat(1 + random.below(5));
    let fixed = [
        "",
        ".",
        "..",
        "/",
        "a/b",
        "a/../..",
        "a\\..\\b",
        "C:",
        "C:x",
        "C:\\x",
        "\\\\host\\share",
        "nul",
        "CON.txt",
        "x\0y",
        "x\ny",
        "\u{1b}[2Jx",
        "\u{9b}x",
        " ",
        "a.",
        "~",
        "-rf",
        "/dev/zero",
        "/dev/null",
        "/proc/self/environ",
        "scene-0001",
        "train",
        "lock",
        ".x.partial",
        "sequences",
        "%2e%2e",
        "\u{202e}x",
    ];
    match random.below(10) {
        0 => format!("{up}around/home/alice"),
        1 => format!("{up}around/secret.txt"),
        2..=6 => around.join(*random.of(&["secret.txt", "home/alice", "home/alice"])).display().to_string(),
        7 => "x".repeat(*random.of(&[255, 256, 5000, 1 << 20])),
        _ => (*random.of(&fixed)).to_owned(),
    }
}

fn number(random: &mut Random) -> Value {
    let whole = [
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
    match random.below(8) {
        0 => Value::from(-1),
        1 => Value::from(*random.of(&[1e300, -1e300, 0.5, 1e19, f64::MIN_POSITIVE])),
        _ => Value::from(*random.of(&whole)),
    }
}

/// Keys whose text becomes a path, and keys whose number becomes a size or a loop.
const NAMES: [&str; 7] = ["id", "path", "file", "folder", "shard", "split", "input"];
const COUNTS: [&str; 9] =
    ["sequences", "per_shard", "shards", "bytes", "offset", "readouts", "readout", "clear_readout", "every"];

/// Another name or count in one of the keys that become paths, sizes or loops.
fn aimed(random: &mut Random, work: &Path, around: &Path) -> String {
    let mut found: Vec<(String, PathBuf, usize, String)> = Vec::new();
    for path in files(work, &["json", "jsonl"]) {
        let Some(text) = own(&path).and_then(|bytes| String::from_utf8(bytes).ok()) else { continue };
        let whole = path.extension().is_some_and(|ending| ending == "json");
        let lines: Vec<&str> = if whole { vec![&text] } else { text.lines().collect() };
        for (number, line) in lines.into_iter().enumerate() {
            let Ok(value) = serde_json::from_str::<Value>(line) else { continue };
            let mut places = Vec::new();
            collect(&value, String::new(), &mut places);
            for place in places {
                let key = place.rsplit('/').next().unwrap_or_default().to_owned();
                if NAMES.contains(&&*key) || COUNTS.contains(&&*key) {
                    found.push((key, path.clone(), number, place));
                }
            }
        }
    }
    let keys: BTreeSet<String> = found.iter().map(|(key, ..)| key.clone()).collect();
    let mut keys: Vec<String> = keys.into_iter().collect();
    let paths: Vec<String> = keys.iter().filter(|key| NAMES[..3].contains(&key.as_str())).cloned().collect();
    keys.extend([paths.clone(), paths].concat());
    if keys.is_empty() {
        return value(random, work, around);
    }
    // The key first: labels have hundreds of the same, a plan one of each.
    let key = random.of(&keys).clone();
    found.retain(|(own, ..)| *own == key);
    let (_, path, number_of_line, place) = random.of(&found).clone();
    let new: Value = if NAMES.contains(&&*key) { name(random, around).into() } else { number(random) };
    let said = cut_long(&format!("{}: {place} = {new}", shown(work, &path)));
    let text = fs::read_to_string(&path).unwrap();
    let whole = path.extension().is_some_and(|ending| ending == "json");
    let changed = |line: &str| {
        let mut value: Value = serde_json::from_str(line).unwrap();
        *value.pointer_mut(&place).unwrap() = new.clone();
        value.to_string()
    };
    let text = if whole {
        changed(&text)
    } else {
        let lines = text.lines().enumerate();
        lines
            .map(|(i, line)| if i == number_of_line { changed(line) } else { line.to_owned() } + "\n")
            .collect()
    };
    fs::write(&path, text).unwrap();
    said
}

/// Another value of one key of a text file.
fn value(random: &mut Random, work: &Path, around: &Path) -> String {
    let all = files(work, &["json", "jsonl", "toml", "yaml"]);
    if all.is_empty() {
        return "nothing".to_owned();
    }
    let path = random.of(&all).clone();
    let Ok(text) = fs::read_to_string(&path) else { return "nothing".to_owned() };
    let said = match path.extension().and_then(|e| e.to_str()) {
        Some("json") => {
            let Ok(mut value) = serde_json::from_str(&text) else { return "nothing".to_owned() };
            let said = leaf(random, &mut value, around);
            fs::write(&path, format!("{value:#}")).unwrap();
            said
        }
        Some("jsonl") => {
            let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
            if lines.is_empty() {
                return "nothing".to_owned();
            }
            let at = random.below(lines.len());
            let Ok(mut value) = serde_json::from_str(&lines[at]) else { return "nothing".to_owned() };
            let said = leaf(random, &mut value, around);
            match random.below(4) {
                0 => lines.push(value.to_string()),
                _ => lines[at] = value.to_string(),
            }
            fs::write(&path, lines.join("\n") + "\n").unwrap();
            said
        }
        _ => {
            let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
            let keys: Vec<usize> = (0..lines.len()).filter(|&i| lines[i].contains([':', '='])).collect();
            if keys.is_empty() {
                return "nothing".to_owned();
            }
            let at = *random.of(&keys);
            let mark = if lines[at].contains('=') { " = " } else { ": " };
            let key = lines[at].split([':', '=']).next().unwrap_or_default().trim().to_owned();
            let value = if random.below(2) == 0 { number(random) } else { name(random, around).into() };
            lines[at] = format!("{key}{mark}{value}");
            fs::write(&path, lines.join("\n") + "\n").unwrap();
            cut_long(&lines[at])
        }
    };
    format!("{}: {said}", shown(work, &path))
}

/// Keys that become paths, sizes or loops, which are changed more often than others.
const KEYS: [&str; 22] = [
    "id",
    "split",
    "shard",
    "path",
    "file",
    "folder",
    "options",
    "sequences",
    "per_shard",
    "shards",
    "offset",
    "bytes",
    "readouts",
    "readout",
    "input",
    "status",
    "pack",
    "times_ns",
    "images",
    "annotations",
    "clear_readout",
    "pieces",
];

/// Changes or removes one value inside of `value`.
fn leaf(random: &mut Random, value: &mut Value, around: &Path) -> String {
    let mut places = Vec::new();
    collect(value, String::new(), &mut places);
    let wanted = |place: &&String| KEYS.iter().any(|key| place.rsplit('/').next() == Some(*key));
    let special: Vec<String> = places.iter().filter(wanted).cloned().collect();
    let all = if special.is_empty() || random.below(3) == 0 { &places } else { &special };
    if all.is_empty() {
        return "nothing".to_owned();
    }
    let place = random.of(all).clone();
    let Some(found) = value.pointer_mut(&place) else { return "nothing".to_owned() };
    // The text of a data set inside of a plan has keys of its own.
    if let (Value::String(text), true, true) = (&mut *found, place == "/options", random.below(4) > 0) {
        let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
        let keys: Vec<usize> = (0..lines.len()).filter(|&i| lines[i].contains('=')).collect();
        let at = *random.of(&keys);
        let key = lines[at].split('=').next().unwrap_or_default().trim().to_owned();
        let new = if random.below(2) == 0 { number(random) } else { name(random, around).into() };
        lines[at] = format!("{key} = {new}");
        let said = cut_long(&lines[at]);
        *found = (lines.join("\n") + "\n").into();
        return format!("options: {said}");
    }
    let new = match (&*found, random.below(8)) {
        (_, 0) => Value::Null,
        (_, 1) => serde_json::json!([]),
        (Value::Number(_), 2..=6) => number(random),
        (Value::String(_), 2..=6) => name(random, around).into(),
        (_, 7) => number(random),
        _ => name(random, around).into(),
    };
    let said = format!("{place} = {new}");
    *found = new;
    cut_long(&said)
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

fn remove(path: &Path) {
    match fs::symlink_metadata(path) {
        Ok(found) if found.is_dir() => fs::remove_dir_all(path).unwrap(),
        Ok(_) => fs::remove_file(path).unwrap(),
        Err(_) => {}
    }
}

/// A path of the folder, or one that a command may make there.
fn any(random: &mut Random, work: &Path) -> PathBuf {
    let locks = ["shards/000000/lock", "shards/000001/lock", "lock"];
    if random.below(4) == 0 && fs::symlink_metadata(work.join("plan.json")).is_ok() {
        return work.join(random.of(&locks));
    }
    let planned = [
        "shards",
        "shards/000000/sequences",
        "shards/000000/journal.jsonl",
        "shards/000000.tar",
        "shards/000001",
        "shards/000001/sequences",
        "shards/000001/journal.jsonl",
        "shards/000001/sequences/.scene-0001.partial",
    ];
    let listed = [
        "manifest.jsonl",
        "sequences",
        "sequences/.scene-0000.partial",
        "train",
        "test",
        "train/spike",
        "test/gt",
        "train/kitti",
        "train/mot",
        "spikecv",
        "train/.coco-images.partial",
        "train/.coco-annotations.partial",
        "train/.coco.json.partial",
        "train/spike/.scene-0000.dat.partial",
        "test/spike/.scene-0001.dat.partial",
        "train/spike/scene-0000.dat",
        "config.yaml",
        "croissant.json",
        "DATASHEET.md",
    ];
    let streams = ["out.dat", "out.json", "c.images", "c.dat", "c.clean.dat", "gain.npy", "out", "plan.json"];
    let is = |name: &str| fs::symlink_metadata(work.join(name)).is_ok();
    let made: &[&str] = match random.below(2) {
        0 if is("plan.json") => &planned,
        _ if is("plan.json") || is("manifest.jsonl") => &listed,
        _ => &streams,
    };
    let all = paths(work);
    if all.is_empty() || random.below(3) > 0 { work.join(random.of(made)) } else { random.of(&all).clone() }
}

/// A link in the place of a file or folder.
fn link(random: &mut Random, work: &Path, around: &Path) -> String {
    let path = any(random, work);
    let Some(parent) = path.parent() else { return "nothing".to_owned() };
    if fs::create_dir_all(parent).is_err() {
        return "nothing".to_owned();
    }
    let own = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let target = match random.below(12) {
        0..=2 => around.join("secret.txt"),
        3..=4 => around.join("home/alice"),
        5 => around.join("empty"),
        6 => PathBuf::from(own),
        7 => around.join("empty/new"),
        8 => PathBuf::from(*random.of(&[".", "..", "../.."])),
        9 => PathBuf::from("/dev/zero"),
        10 => random.of(&paths(work)).clone(),
        // What was there, moved out of the folder: a link as version control of data makes it.
        _ => {
            let moved = around.join("moved");
            if fs::rename(&path, &moved).is_err() {
                return "nothing".to_owned();
            }
            moved
        }
    };
    remove(&path);
    symlink(&target, &path).unwrap();
    format!("{} -> {}", shown(work, &path), target.display())
}

/// A file of another kind.
fn kind(random: &mut Random, work: &Path) -> String {
    let path = any(random, work);
    if path.parent().is_none_or(|parent| fs::create_dir_all(parent).is_err()) {
        return "nothing".to_owned();
    }
    remove(&path);
    let what = match random.below(4) {
        0 => {
            fs::create_dir(&path).unwrap();
            "folder"
        }
        1 => {
            drop(std::os::unix::net::UnixListener::bind(&path));
            "socket"
        }
        2 => {
            fs::write(&path, "").unwrap();
            "file"
        }
        _ => {
            use rustix::fs::{CWD, FileType, Mode, mknodat};
            mknodat(CWD, &path, FileType::Fifo, Mode::RUSR | Mode::WUSR, 0).unwrap();
            "pipe"
        }
    };
    format!("{} is a {what}", shown(work, &path))
}

/// A file that is gone, cut, or of immense length without blocks.
fn cut(random: &mut Random, work: &Path) -> String {
    let all = files(work, &[]);
    if all.is_empty() {
        return "nothing".to_owned();
    }
    let path = random.of(&all).clone();
    if random.below(4) == 0 {
        remove(&path);
        return format!("{} is gone", shown(work, &path));
    }
    let file = File::options().write(true).open(&path).unwrap();
    let len = file.metadata().unwrap().len();
    let text = matches!(path.extension().and_then(|e| e.to_str()), Some("json" | "jsonl" | "toml" | "yaml"));
    let new = match random.below(4) {
        0 => 0,
        1 if text => 1 << 40,
        _ => len * random.below(100) as u64 / 100,
    };
    file.set_len(new).unwrap();
    format!("{} has {new} bytes", shown(work, &path))
}

/// Other bytes in a file.
fn bytes(random: &mut Random, work: &Path) -> String {
    let all = files(work, &[]);
    if all.is_empty() {
        return "nothing".to_owned();
    }
    let path = random.of(&all).clone();
    let Ok(mut bytes) = fs::read(&path) else { return "nothing".to_owned() };
    if bytes.is_empty() {
        return "nothing".to_owned();
    }
    for _ in 0..=random.below(8) {
        let at = random.below(bytes.len());
        bytes[at] = random.next() as u8;
    }
    fs::write(&path, bytes).unwrap();
    format!("{} has other bytes", shown(work, &path))
}

/// Brings digests, lengths and times that files list up to date, as far as the files can be read.
fn sign(work: &Path) {
    for path in files(work, &["json"]).into_iter().filter(|p| p.ends_with("record.json")) {
        let Some(mut record) = json(&path) else { continue };
        for file in record["files"].as_array_mut().into_iter().flatten() {
            let Some(bytes) = file["path"].as_str().and_then(|name| own(&path.with_file_name(name))) else {
                continue;
            };
            file["bytes"] = bytes.len().into();
            file["digest"] = Digest::of(&bytes).into();
        }
        fs::write(&path, record.to_string()).unwrap();
    }
    for path in files(work, &["jsonl"]) {
        let Ok(text) = fs::read_to_string(&path) else { continue };
        let lines = text.lines().map(|line| signed(&path, line) + "\n");
        let text: String = lines.collect();
        fs::write(&path, text).unwrap();
    }
    let list = own(&work.join("inputs.jsonl")).unwrap_or_default();
    let path = work.join("plan.json");
    let plan =
        fs::symlink_metadata(&path).is_ok_and(|m| m.is_file() && m.len() < 1 << 24).then(|| json(&path));
    let Some(Some(mut plan)) = plan else { return };
    let mut offset = 0;
    let lines: Vec<&[u8]> = list.split_inclusive(|&b| b == b'\n').collect();
    for (piece, line) in plan["pieces"].as_array_mut().into_iter().flatten().zip(lines) {
        if piece.is_object() && random_free(piece) {
            piece["bytes"] = line.len().into();
            piece["offset"] = offset.into();
            piece["digest"] = Digest::of(line).into();
        }
        offset += line.len();
    }
    fs::write(&path, plan.to_string()).unwrap();
}

/// Whether the numbers of a piece are those of a file, and not what a mutation put there.
fn random_free(piece: &Value) -> bool {
    ["bytes", "offset"].iter().all(|key| piece[key].as_u64().is_some_and(|n| n < 1 << 20))
}

fn json(path: &Path) -> Option<Value> {
    serde_json::from_slice(&own(path)?).ok()
}

/// The bytes of a regular file of a usual size.
fn own(path: &Path) -> Option<Vec<u8>> {
    let found = fs::metadata(path).ok()?;
    if found.is_file() && found.len() < 1 << 24 { fs::read(path).ok() } else { None }
}

/// A line of a manifest or journal with the digest and times of the sequence's files.
fn signed(list: &Path, line: &str) -> String {
    let Ok(mut value) = serde_json::from_str::<Value>(line) else { return line.to_owned() };
    let Some(id) = value["id"].as_str() else { return line.to_owned() };
    let shard = value["shard"].as_str().map_or(String::new(), |shard| format!("shards/{shard}"));
    let folder = list.with_file_name(shard).join("sequences").join(id);
    let Some(bytes) = own(&folder.join("record.json")) else { return line.to_owned() };
    let Ok(record) = serde_json::from_slice::<Value>(&bytes) else { return line.to_owned() };
    value["digest"] = Digest::of(&bytes).into();
    if value["times_ns"].is_array() {
        let names = record["files"].as_array().into_iter().flatten();
        let names = ["record.json"].into_iter().chain(names.filter_map(|f| f["path"].as_str()));
        let time = |name: &str| {
            let found = fs::metadata(folder.join(name)).ok()?;
            Some(Value::from(found.mtime() * 1_000_000_000 + found.mtime_nsec()))
        };
        value["times_ns"] = names.filter_map(time).collect::<Vec<_>>().into();
    }
    value.to_string()
}
