//! Applies changes to a folder that an attacker could apply.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};

use super::SECRET;
use super::signing::{read_small_file, sign};
use super::values::{mutate_known_key, mutate_pack, mutate_setting, mutate_value, packs};

/// A generator of pseudorandom numbers (splitmix64).
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

    /// Returns a random number in `0..n`.
    pub(super) fn number_below(&mut self, n: usize) -> usize {
        (self.next() % n as u64) as usize
    }

    pub(super) fn choose<'a, T>(&mut self, all: &'a [T]) -> &'a T {
        &all[self.number_below(all.len())]
    }
}

/// Applies one to three random changes to the folder `work`. Returns descriptions of the changes.
pub(super) fn apply(random: &mut Random, work: &Path, around: &Path) -> Vec<String> {
    let mut changes = Vec::new();
    // One or two changes are most frequent. With more changes, an early error often hides the effect of later changes.
    for _ in 0..*random.choose(&[1, 1, 1, 1, 2, 2, 3]) {
        changes.push(match random.number_below(20) {
            0..=5 => mutate_known_key(random, work, around, false),
            6..=7 => mutate_known_key(random, work, around, true),
            8..=9 if packs(work).is_empty() => mutate_setting(random, work, around),
            8..=9 => mutate_pack(random, work, around),
            10..=14 => link(random, work, around),
            15..=16 => change_file_type(random, work),
            17 => mutate_value(random, work, around),
            18 => cut(random, work),
            _ => bytes(random, work),
        });
    }
    // In most cases the digests are updated too, because an attacker can compute digests.
    if random.number_below(4) > 0 {
        sign(work);
        changes.push("signed".to_owned());
    }
    changes
}

/// Returns the files and folders below `work`, sorted by path. Links are not followed.
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

pub(super) fn relative_name(work: &Path, path: &Path) -> String {
    path.strip_prefix(work).unwrap_or(path).display().to_string()
}

fn remove(path: &Path) {
    match fs::symlink_metadata(path) {
        Ok(metadata) if metadata.is_dir() => fs::remove_dir_all(path).unwrap(),
        Ok(_) => fs::remove_file(path).unwrap(),
        Err(_) => {}
    }
}

/// Returns a path in the folder. It exists, or a command may create it.
fn any_path(random: &mut Random, work: &Path) -> PathBuf {
    let locks = ["shards/000000/lock", "shards/000001/lock", "lock"];
    if random.number_below(4) == 0 && fs::symlink_metadata(work.join("plan.json")).is_ok() {
        return work.join(random.choose(&locks));
    }
    let planned = [
        "shards",
        "shards/000000/sequences",
        "shards/000000/journal.jsonl",
        "shards/000000.tar",
        "shards/000001",
        "shards/000001/sequences",
        "shards/000001/journal.jsonl",
        "shards/000001/sequences/.scene-0001.spikelane.partial",
    ];
    let listed = [
        "manifest.jsonl",
        "sequences",
        "sequences/.scene-0000.spikelane.partial",
        "train",
        "test",
        "train/spike",
        "test/gt",
        "train/kitti",
        "train/mot",
        "spikecv",
        "train/.coco-images.spikelane.partial",
        "train/.coco-annotations.spikelane.partial",
        "train/.coco.json.spikelane.partial",
        "train/spike/.scene-0000.dat.spikelane.partial",
        "test/spike/.scene-0001.dat.spikelane.partial",
        "train/spike/scene-0000.dat",
        "config.yaml",
        "croissant.json",
        "DATASHEET.md",
    ];
    let streams = ["out.dat", "out.json", "c.images", "c.dat", "c.clean.dat", "gain.npy", "out", "plan.json"];
    let is = |name: &str| fs::symlink_metadata(work.join(name)).is_ok();
    let candidates: &[&str] = match random.number_below(2) {
        0 if is("plan.json") => &planned,
        _ if is("plan.json") || is("manifest.jsonl") => &listed,
        _ => &streams,
    };
    // A file name is selected first, and then a file of this name. Otherwise labels, which have hundreds of files, would
    // be selected too often. The exported folders of a dataset are excluded, because only loaders read them.
    let mut named: BTreeMap<_, Vec<PathBuf>> = BTreeMap::new();
    let views = ["train", "test", "spikecv"].map(|view| work.join(view));
    for path in paths(work).into_iter().filter(|path| !views.iter().any(|view| path.starts_with(view))) {
        named.entry(path.file_name().unwrap().to_owned()).or_default().push(path);
    }
    let groups: Vec<_> = named.into_values().collect();
    if groups.is_empty() || random.number_below(2) == 0 {
        return work.join(random.choose(candidates));
    }
    let group = random.choose(&groups);
    random.choose(group).clone()
}

/// Replaces a file or folder with a link.
fn link(random: &mut Random, work: &Path, around: &Path) -> String {
    let path = any_path(random, work);
    let Some(parent) = path.parent() else { return "nothing".to_owned() };
    if fs::create_dir_all(parent).is_err() {
        return "nothing".to_owned();
    }
    let file_name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let target = match random.number_below(14) {
        0..=2 => around.join("secret.txt"),
        3..=4 => around.join("home/alice"),
        5 => around.join("empty"),
        6 => PathBuf::from(file_name),
        7 => around.join("empty/new"),
        8 => PathBuf::from(*random.choose(&[".", "..", "../.."])),
        9 => PathBuf::from("/dev/zero"),
        10 => random.choose(&paths(work)).clone(),
        // The original file or folder is moved out of the untrusted folder, and a link replaces it. Tools for data
        // version control create such links.
        _ => {
            let moved = around.join("moved");
            if fs::rename(&path, &moved).is_err() {
                return "nothing".to_owned();
            }
            plant_secret(&moved);
            moved
        }
    };
    remove(&path);
    symlink(&target, &path).unwrap();
    format!("{} -> {}", relative_name(work, &path), target.display())
}

/// Overwrites the end of a file of pixels or spikes with the secret text. The length of the file does not change.
fn plant_secret(path: &Path) {
    let is_text = |bytes: &[u8]| std::str::from_utf8(bytes).is_ok();
    if let Some(mut bytes) =
        read_small_file(path).filter(|bytes| bytes.len() > 2 * SECRET.len() && !is_text(bytes))
    {
        let at = bytes.len() - SECRET.len();
        bytes[at..].copy_from_slice(SECRET.as_bytes());
        fs::write(path, bytes).unwrap();
    }
}

/// Replaces a file with a file of another type.
fn change_file_type(random: &mut Random, work: &Path) -> String {
    let path = any_path(random, work);
    if path.parent().is_none_or(|parent| fs::create_dir_all(parent).is_err()) {
        return "nothing".to_owned();
    }
    remove(&path);
    let what = match random.number_below(4) {
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
    format!("{} is a {what}", relative_name(work, &path))
}

/// Removes a file, truncates it, or extends it to a very large sparse file.
fn cut(random: &mut Random, work: &Path) -> String {
    let all = files(work, &[]);
    if all.is_empty() {
        return "nothing".to_owned();
    }
    let path = random.choose(&all).clone();
    if random.number_below(4) == 0 {
        remove(&path);
        return format!("{} is gone", relative_name(work, &path));
    }
    let file = File::options().write(true).open(&path).unwrap();
    let len = file.metadata().unwrap().len();
    let text = matches!(path.extension().and_then(|e| e.to_str()), Some("json" | "jsonl" | "toml" | "yaml"));
    let new = match random.number_below(4) {
        0 => 0,
        1 if text => 1 << 40,
        _ => len * random.number_below(100) as u64 / 100,
    };
    file.set_len(new).unwrap();
    format!("{} has {new} bytes", relative_name(work, &path))
}

/// Changes random bytes in a file.
fn bytes(random: &mut Random, work: &Path) -> String {
    let all = files(work, &[]);
    if all.is_empty() {
        return "nothing".to_owned();
    }
    let path = random.choose(&all).clone();
    let Ok(mut bytes) = fs::read(&path) else { return "nothing".to_owned() };
    if bytes.is_empty() {
        return "nothing".to_owned();
    }
    for _ in 0..=random.number_below(8) {
        let at = random.number_below(bytes.len());
        bytes[at] = random.next() as u8;
    }
    fs::write(&path, bytes).unwrap();
    format!("{} has other bytes", relative_name(work, &path))
}
