//! Tests that a diagnosis with cached simulations returns the same digits as one without, for any partial cache.

#[allow(unreachable_pub, reason = "shared by several test binaries")]
mod hidden_sensor;

use std::path::{Path, PathBuf};

use hidden_sensor::{Physics, Sensor, Size, kind, write_set};
use spikelane_calibrate::RecordingSet;
use spikelane_diagnose::{DiagnoseOptions, detectability, diagnose};

const SIZE: Size = Size { width: 16, height: 16, readouts: 1024 };

/// Records two sets of a sensor with an effect that is strong enough to be detected. The diagnosis then fits effects.
fn sets(folder: &Path) -> [RecordingSet; 2] {
    let mut physics = Physics::default();
    (kind("row_noise").set)(&mut physics, 0.02, [0.5; 3]);
    [0, 1].map(|take| {
        let path = folder.join(format!("{take}"));
        write_set(&Sensor::new(physics.clone(), SIZE.width, SIZE.height, 5), SIZE, take, &path);
        RecordingSet::open(&path.join("recordings.toml")).unwrap()
    })
}

/// Returns two values. The first is the diagnosis without its duration, and the camera, as text. The second is the number
/// of simulations from the cache and the number of new simulations.
fn diagnosis_text(sets: &[RecordingSet; 2], cache: Option<&Path>) -> (String, Option<[usize; 2]>) {
    let options = DiagnoseOptions { cache, ..DiagnoseOptions::default() };
    let mut diagnosis = diagnose(&sets[0], Some(&sets[1]), options, &mut |_, _| {}).unwrap();
    assert!(!diagnosis.effects.is_empty(), "nothing was fitted");
    diagnosis.seconds = 0.0;
    (format!("{} {:?}", serde_json::to_string(&diagnosis).unwrap(), diagnosis.camera), diagnosis.cache_counts)
}

/// Returns the files of simulated vectors and their bytes, sorted by path. The tag file of the folder is excluded.
fn files(cache: &Path) -> Vec<(PathBuf, Vec<u8>)> {
    let folders = std::fs::read_dir(cache).unwrap().map(|f| f.unwrap().path());
    let files = folders.flat_map(|f| std::fs::read_dir(f).unwrap()).map(|f| f.unwrap().path());
    let vectors = files.filter(|f| f.extension().is_none());
    let mut all: Vec<_> = vectors.map(|f| (f.clone(), std::fs::read(f).unwrap())).collect();
    all.sort();
    all
}

#[test]
fn cached_simulations_do_not_change_a_diagnosis() {
    let folder = tempfile::tempdir().unwrap();
    let (sets, cache) = (sets(folder.path()), folder.path().join("cache"));
    let (uncached, none) = diagnosis_text(&sets, None);
    assert_eq!(none, None);

    let (cold, counts) = diagnosis_text(&sets, Some(&cache));
    assert!(cold == uncached, "nothing was kept: {cold} and not {uncached}");
    let [again, simulated] = counts.unwrap();
    let all = files(&cache);
    assert_eq!(all.len(), simulated, "a file each");

    let (warm, counts) = diagnosis_text(&sets, Some(&cache));
    assert!(warm == uncached, "all was kept: {warm} and not {uncached}");
    assert_eq!(counts, Some([simulated + again, 0]));

    // Damages the cache: some files are missing, cut short or zeroed, as after a stopped run on a faulty disk.
    let damaged = (0..all.len()).filter(|i| i % 16 < 3).count();
    for (i, (file, bytes)) in all.iter().enumerate() {
        match i % 16 {
            0 => std::fs::remove_file(file).unwrap(),
            1 => std::fs::write(file, &bytes[..40]).unwrap(),
            2 => std::fs::write(file, vec![0; bytes.len()]).unwrap(),
            _ => {}
        }
    }
    let (torn, counts) = diagnosis_text(&sets, Some(&cache));
    assert!(torn == uncached, "a part was kept: {torn} and not {uncached}");
    assert_eq!(counts, Some([again + simulated - damaged, damaged]));
    assert!(files(&cache) == all, "what was lost is there again");
}

#[test]
fn repeated_detectability_uses_the_cache() {
    let folder = tempfile::tempdir().unwrap();
    let (sets, cache) = (sets(folder.path()), folder.path().join("cache"));
    let run = || {
        let options = DiagnoseOptions { cache: Some(&cache), ..DiagnoseOptions::default() };
        format!("{:?}", detectability(&sets[0], options, &mut |_, _| {}).unwrap())
    };
    let first = run();
    let times = || -> Vec<_> {
        files(&cache).iter().map(|(f, _)| std::fs::metadata(f).unwrap().modified().unwrap()).collect()
    };
    let modified = times();
    assert!(modified.len() > 100, "{}", modified.len());
    assert_eq!(run(), first);
    assert!(times() == modified, "some were made again");
}
