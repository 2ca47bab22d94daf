//! What a stranger may change in a folder.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};

use super::SECRET;
use super::signing::{own, sign};
use super::values::{aimed, pack, packs, setting, value};

/// A sequence of numbers that follows from a seed (splitmix64).
pub(super) struct Random(u64);

impl Random {
    pub(super) const fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(0x2545_f491_4f6c_dd1d))
    }

    pub(super) fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// A number below `n`.
    pub(super) fn below(&mut self, n: usize) -> usize {
        (self.next() % n as u64) as usize
    }

    pub(super) fn of<'a, T>(&mut self, all: &'a [T]) -> &'a T {
        &all[self.below(all.len())]
    }
}

/// Changes one to three things in the folder `work` and returns what was changed.
pub(super) fn apply(random: &mut Random, work: &Path, around: &Path) -> Vec<String> {
    let mut changes = Vec::new();
    // More changes make it likelier that the first one read ends the command.
    for _ in 0..*random.of(&[1, 1, 1, 1, 2, 2, 3]) {
        changes.push(match random.below(20) {
            0..=5 => aimed(random, work, around, false),
            6..=7 => aimed(random, work, around, true),
            8..=9 if packs(work).is_empty() => setting(random, work, around),
            8..=9 => pack(random, work, around),
            10..=14 => link(random, work, around),
            15..=16 => kind(random, work),
            17 => value(random, work, around),
            18 => cut(random, work),
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

pub(super) fn files(work: &Path, endings: &[&str]) -> Vec<PathBuf> {
    let mut all = paths(work);
    all.retain(|path| {
        let ending = path.extension().unwrap_or_default().to_string_lossy().into_owned();
        let is_file = fs::symlink_metadata(path).unwrap().is_file();
        is_file && (endings.is_empty() || endings.contains(&&*ending))
    });
    all
}

pub(super) fn shown(work: &Path, path: &Path) -> String {
    path.strip_prefix(work).unwrap_or(path).display().to_string()
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
    // By their names, as labels have hundreds of files. Loaders read the views of a set, not this program.
    let mut named: BTreeMap<_, Vec<PathBuf>> = BTreeMap::new();
    let views = ["train", "test", "spikecv"].map(|view| work.join(view));
    for path in paths(work).into_iter().filter(|path| !views.iter().any(|view| path.starts_with(view))) {
        named.entry(path.file_name().unwrap().to_owned()).or_default().push(path);
    }
    let groups: Vec<_> = named.into_values().collect();
    if groups.is_empty() || random.below(2) == 0 {
        return work.join(random.of(made));
    }
    let group = random.of(&groups);
    random.of(group).clone()
}

/// A link in the place of a file or folder.
fn link(random: &mut Random, work: &Path, around: &Path) -> String {
    let path = any(random, work);
    let Some(parent) = path.parent() else { return "nothing".to_owned() };
    if fs::create_dir_all(parent).is_err() {
        return "nothing".to_owned();
    }
    let own = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let target = match random.below(14) {
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
            mark(&moved);
            moved
        }
    };
    remove(&path);
    symlink(&target, &path).unwrap();
    format!("{} -> {}", shown(work, &path), target.display())
}

/// Puts the secret into a file of pixels or spikes, and leaves its length.
fn mark(path: &Path) {
    let is_text = |bytes: &[u8]| std::str::from_utf8(bytes).is_ok();
    if let Some(mut bytes) = own(path).filter(|bytes| bytes.len() > 2 * SECRET.len() && !is_text(bytes)) {
        let at = bytes.len() - SECRET.len();
        bytes[at..].copy_from_slice(SECRET.as_bytes());
        fs::write(path, bytes).unwrap();
    }
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
