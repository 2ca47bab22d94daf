//! Tests the order in which files are written, synced and renamed. This order determines which files exist after a
//! power failure.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Mutex;

use super::{MergeOptions, ShardOptions, ShardPlan, generate_shard, merge};
use crate::{Content, DatasetOptions, SceneContent};
use spikelane::spikes::Geometry;
use spikelane_io::storage::sync::record::{self, Step};

/// Locked during a recording, because only one recording at a time is possible.
static RECORDING_LOCK: Mutex<()> = Mutex::new(());

const RUN_OPTIONS: ShardOptions =
    ShardOptions { threads: 1, verify_digests: false, retry_failed: false, take_lock: true };

fn options(output: &Path) -> DatasetOptions {
    let mut camera = spikelane::presets::builtin("physical").unwrap();
    camera.sensor.geometry = Geometry::new(32, 24).unwrap();
    let work = SceneContent { sequences: 2, images_per_scene: 3, label_every: 2, ..SceneContent::rhdd() };
    DatasetOptions::new(output.to_owned(), Content::Scenes(work), camera).with_seed(1).with_scene_seed(2)
}

/// Returns a temporary folder. If the system has a file system in memory, the folder is in this file system.
///
/// The tests check only the order of steps. On a disk, the sync operations of the tests would take most of a minute.
fn folder() -> tempfile::TempDir {
    tempfile::tempdir_in("/dev/shm").or_else(|_| tempfile::tempdir()).unwrap()
}

/// Generates one shard. Returns the recorded steps, the files at the end, and the digest of the dataset.
fn recorded_steps(folder: &Path, pack: bool) -> (Vec<Step>, BTreeMap<PathBuf, Vec<u8>>, String) {
    let (plan, _) = ShardPlan::create(&options(folder), 2, pack).unwrap();
    let turn = RECORDING_LOCK.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
    record::begin(folder);
    generate_shard(&plan, 0, &RUN_OPTIONS, &mut |_| Ok(())).unwrap();
    let steps = record::end();
    drop(turn);
    let merged = merge(
        &plan,
        &MergeOptions { verify_digests: true, create_links: false, take_lock: false },
        &mut |_, _| Ok(()),
    )
    .unwrap();
    (steps, files_below(&folder.join("shards")), merged.digest)
}

fn files_below(root: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
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

/// Removes the files that contain times or lock holders, because these files differ between runs.
fn without_run_facts(all: BTreeMap<PathBuf, Vec<u8>>) -> BTreeMap<PathBuf, Vec<u8>> {
    all.into_iter().filter(|(path, _)| !path.ends_with("lock") && !path.ends_with("manifest.jsonl")).collect()
}

#[test]
fn each_file_is_synced_before_its_rename_and_its_folder_after_it() {
    for pack in [false, true] {
        let dir = folder();
        let (steps, left, _) = recorded_steps(dir.path(), pack);
        let mut synced: BTreeSet<PathBuf> = BTreeSet::new();
        let mut unsynced: BTreeSet<PathBuf> = BTreeSet::new();
        let mut named: BTreeSet<PathBuf> = BTreeSet::new();
        for step in &steps {
            match step {
                Step::SyncFile(path, _) => drop(synced.insert(path.clone())),
                Step::SyncFolder(path) => {
                    synced.insert(path.clone());
                    unsynced.remove(path);
                }
                Step::Rename(from, to) => {
                    assert!(synced.contains(from), "{} was not synced before its rename", from.display());
                    // The previous rename must be synced before the next rename, because the next rename may depend on
                    // it.
                    let within = |w: &PathBuf| w.starts_with(from);
                    assert!(
                        unsynced.iter().all(within),
                        "{unsynced:?} were not synced before {}",
                        to.display()
                    );
                    let moved: Vec<_> = synced.iter().filter(|p| p.starts_with(from)).cloned().collect();
                    for path in moved {
                        synced.remove(&path);
                        let at = to.join(path.strip_prefix(from).unwrap());
                        named.insert(at.clone());
                        synced.insert(at);
                    }
                    unsynced.insert(to.parent().unwrap().to_owned());
                }
                Step::Remove(_) => {}
            }
        }
        assert!(unsynced.is_empty(), "{unsynced:?} were not synced at the end");
        // This loop detects files that were written without a recorded step.
        let root = dir.path().join("shards");
        for path in left.keys().filter(|p| !p.ends_with("lock")) {
            let path = root.join(path);
            assert!(named.contains(&path), "{} came to the disk by no synced rename", path.display());
        }
        assert!(steps.len() > 20, "{} steps", steps.len());
    }
}

/// Returns the files on disk if the power fails after step `cut`.
///
/// After the power failure, each file has the content of its last sync. If `eager` is true, all renames have taken
/// effect. Otherwise a rename has taken effect only if its folder was synced after the rename.
fn after_failure(steps: &[Step], cut: usize, eager: bool) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut disk: BTreeMap<PathBuf, Vec<u8>> = BTreeMap::new();
    for (i, step) in steps[..=cut].iter().enumerate() {
        let lasting =
            |folder: &Path| steps[i..=cut].iter().any(|s| matches!(s, Step::SyncFolder(f) if f == folder));
        match step {
            Step::SyncFile(path, bytes) => drop(disk.insert(path.clone(), bytes.clone())),
            Step::SyncFolder(_) => {}
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
fn power_failure_at_any_rename_loses_no_finished_file() {
    std::thread::scope(|scope| {
        for pack in [false, true] {
            scope.spawn(move || check_power_failures(pack));
        }
    });
}

fn check_power_failures(pack: bool) {
    let dir = folder();
    let first = dir.path().join("first");
    let (steps, left, digest) = recorded_steps(&first, pack);
    let expected = without_run_facts(left);
    let cuts: Vec<usize> =
        (0..steps.len()).filter(|&i| matches!(steps[i], Step::Rename(..) | Step::Remove(_))).collect();
    assert!(cuts.len() >= 6, "{} cuts", cuts.len());
    for (cut, eager) in cuts.iter().flat_map(|&cut| [(cut, true), (cut, false)]) {
        let place = dir.path().join(format!("{cut}-{eager}"));
        let (plan, _) = ShardPlan::create(&options(&place), 2, pack).unwrap();
        for (path, bytes) in after_failure(&steps, cut, eager) {
            let at = place.join(path.strip_prefix(&first).unwrap());
            fs::create_dir_all(at.parent().unwrap()).unwrap();
            fs::write(at, bytes).unwrap();
        }
        generate_shard(&plan, 0, &RUN_OPTIONS, &mut |_| Ok(())).unwrap();
        let merged = merge(
            &plan,
            &MergeOptions { verify_digests: true, create_links: false, take_lock: false },
            &mut |_, _| Ok(()),
        )
        .unwrap();
        assert_eq!(merged.digest, digest, "cut at {cut}, eager {eager}");
        assert!(
            without_run_facts(files_below(&place.join("shards"))) == expected,
            "cut at {cut}, eager {eager}"
        );
        fs::remove_dir_all(place).unwrap();
    }
}
