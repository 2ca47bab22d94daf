//! The order of steps on the disk: what a power failure may leave.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Mutex;

use super::{Merging, Plan, Running, merge, run};
use crate::{DatasetOptions, Drives, Work};
use spikelane::spikes::Geometry;
use spikelane_io::storage::steps::record::{self, Step};

/// One recording at a time.
static TURN: Mutex<()> = Mutex::new(());

const HOW: Running = Running { threads: 1, verify: false, retry: false, lock: true };

fn options(output: &Path) -> DatasetOptions {
    let mut camera = spikelane::presets::builtin("physical").unwrap();
    camera.sensor.geometry = Geometry::new(32, 24).unwrap();
    let work = Drives { sequences: 2, images: 3, label_every: 2, ..Drives::rhdd() };
    DatasetOptions::new(output.to_owned(), Work::Drives(work), camera).with_seed(1).with_scene_seed(2)
}

/// A folder in memory where there is such a place: what is asked is the order of steps, and a disk's syncs took most of a minute.
fn folder() -> tempfile::TempDir {
    tempfile::tempdir_in("/dev/shm").or_else(|_| tempfile::tempdir()).unwrap()
}

/// The steps of one shard, and the bytes that it ends with.
fn recorded(folder: &Path, pack: bool) -> (Vec<Step>, BTreeMap<PathBuf, Vec<u8>>, String) {
    let (plan, _) = Plan::make(&options(folder), 2, pack).unwrap();
    let turn = TURN.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
    record::begin(folder);
    run(&plan, 0, &HOW, &mut |_| Ok(())).unwrap();
    let steps = record::end();
    drop(turn);
    let merged =
        merge(&plan, &Merging { quick: false, links: false, lock: false }, &mut |_, _| Ok(())).unwrap();
    (steps, contents(&folder.join("shards")), merged.digest)
}

fn contents(root: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let (mut all, mut folders) = (BTreeMap::new(), vec![root.to_owned()]);
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else {
                all.insert(path.strip_prefix(root).unwrap().to_owned(), fs::read(&path).unwrap());
            }
        }
    }
    all
}

/// Times and who held the lock are of the run, not of the data.
fn data(all: BTreeMap<PathBuf, Vec<u8>>) -> BTreeMap<PathBuf, Vec<u8>> {
    all.into_iter().filter(|(path, _)| !path.ends_with("lock") && !path.ends_with("manifest.jsonl")).collect()
}

#[test]
fn each_file_is_synced_before_its_rename_and_its_folder_after_it() {
    for pack in [false, true] {
        let dir = folder();
        let (steps, left, _) = recorded(dir.path(), pack);
        let mut synced: BTreeSet<PathBuf> = BTreeSet::new();
        let mut waiting: BTreeSet<PathBuf> = BTreeSet::new();
        let mut named: BTreeSet<PathBuf> = BTreeSet::new();
        for step in &steps {
            match step {
                Step::File(path, _) => drop(synced.insert(path.clone())),
                Step::Folder(path) => {
                    synced.insert(path.clone());
                    waiting.remove(path);
                }
                Step::Rename(from, to) => {
                    assert!(synced.contains(from), "{} was not synced before its rename", from.display());
                    // The former rename is on the disk before the next one tells of it.
                    let within = |w: &PathBuf| w.starts_with(from);
                    assert!(
                        waiting.iter().all(within),
                        "{waiting:?} were not synced before {}",
                        to.display()
                    );
                    let moved: Vec<_> = synced.iter().filter(|p| p.starts_with(from)).cloned().collect();
                    for path in moved {
                        synced.remove(&path);
                        let at = to.join(path.strip_prefix(from).unwrap());
                        named.insert(at.clone());
                        synced.insert(at);
                    }
                    waiting.insert(to.parent().unwrap().to_owned());
                }
                Step::Remove(_) => {}
            }
        }
        assert!(waiting.is_empty(), "{waiting:?} were not synced at the end");
        // What was written without a step that is seen here would be found on the disk alone.
        let root = dir.path().join("shards");
        for path in left.keys().filter(|p| !p.ends_with("lock")) {
            let path = root.join(path);
            assert!(named.contains(&path), "{} came to the disk by no synced rename", path.display());
        }
        assert!(steps.len() > 20, "{} steps", steps.len());
    }
}

/// What is on the disk when the power fails after step `cut`: of files what was synced, of renames all that were asked
/// for (`eager`), or those alone whose folder was synced since.
fn after_failure(steps: &[Step], cut: usize, eager: bool) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut disk: BTreeMap<PathBuf, Vec<u8>> = BTreeMap::new();
    for (i, step) in steps[..=cut].iter().enumerate() {
        let lasting =
            |folder: &Path| steps[i..=cut].iter().any(|s| matches!(s, Step::Folder(f) if f == folder));
        match step {
            Step::File(path, bytes) => drop(disk.insert(path.clone(), bytes.clone())),
            Step::Folder(_) => {}
            Step::Rename(from, to) => {
                if !eager && !lasting(to.parent().unwrap()) {
                    continue;
                }
                disk.retain(|path, _| !path.starts_with(to));
                let moved: Vec<_> = disk.keys().filter(|p| p.starts_with(from)).cloned().collect();
                for path in moved {
                    let bytes = disk.remove(&path).unwrap();
                    let rest = path.strip_prefix(from).unwrap();
                    let at = if rest.as_os_str().is_empty() { to.clone() } else { to.join(rest) };
                    disk.insert(at, bytes);
                }
            }
            Step::Remove(path) => {
                if eager || lasting(path.parent().unwrap()) {
                    disk.retain(|p, _| !p.starts_with(path));
                }
            }
        }
    }
    disk
}

#[test]
fn a_power_failure_at_any_rename_loses_nothing_that_looked_finished() {
    std::thread::scope(|scope| {
        for pack in [false, true] {
            scope.spawn(move || nothing_is_lost(pack));
        }
    });
}

fn nothing_is_lost(pack: bool) {
    let dir = folder();
    let first = dir.path().join("first");
    let (steps, left, digest) = recorded(&first, pack);
    let expected = data(left);
    let cuts: Vec<usize> =
        (0..steps.len()).filter(|&i| matches!(steps[i], Step::Rename(..) | Step::Remove(_))).collect();
    assert!(cuts.len() >= 6, "{} cuts", cuts.len());
    for (cut, eager) in cuts.iter().flat_map(|&cut| [(cut, true), (cut, false)]) {
        let place = dir.path().join(format!("{cut}-{eager}"));
        let (plan, _) = Plan::make(&options(&place), 2, pack).unwrap();
        for (path, bytes) in after_failure(&steps, cut, eager) {
            let at = place.join(path.strip_prefix(&first).unwrap());
            fs::create_dir_all(at.parent().unwrap()).unwrap();
            fs::write(at, bytes).unwrap();
        }
        run(&plan, 0, &HOW, &mut |_| Ok(())).unwrap();
        let merged =
            merge(&plan, &Merging { quick: false, links: false, lock: false }, &mut |_, _| Ok(())).unwrap();
        assert_eq!(merged.digest, digest, "cut at {cut}, eager {eager}");
        assert!(data(contents(&place.join("shards"))) == expected, "cut at {cut}, eager {eager}");
        fs::remove_dir_all(place).unwrap();
    }
}
