//! Run times of `diagnose` for an unknown camera. A recording set has eight recordings of 96x64 pixels and 6,000
//! readouts.

use std::path::Path;
use std::time::Instant;

use spikelane::effects::Camera;
use spikelane_calibrate::RecordingSet;
use spikelane_diagnose::{
    DiagnoseOptions, ReadoutSelection, RecordingPart, Setup, Verdict, diagnose_with_preliminary,
    published_camera,
};

use spikelane_studies::provenance::provenance;

use super::hidden_sensor::{Physics, Sensor, Size, kind, write_set};

const SIZE: Size = Size { width: 96, height: 64, readouts: 6000 };

/// Names and strengths of hidden effects.
type HiddenEffects = &'static [(&'static str, f64)];

/// Cases: description of the sensor, seed, hidden effects, and whether the diagnosis starts from the published camera.
const CASES: [(&str, u64, HiddenEffects, bool); 5] = [
    ("clean, calibrated", 1, &[], false),
    ("another clean sensor of the same kind, calibrated", 2, &[], false),
    ("clean, with its camera file", 1, &[], true),
    ("single: row_noise of 0.006", 3, &[("row_noise", 0.006)], false),
    (
        "double: row_noise of 0.006, hot_pixels of 0.008",
        4,
        &[("row_noise", 0.006), ("hot_pixels", 0.008)],
        false,
    ),
];

fn record_set(hidden: &[(&str, f64)], seed: u64, take: u64, folder: &Path) -> RecordingSet {
    let mut physics = Physics::default();
    for (name, strength) in hidden {
        (kind(name).set)(&mut physics, *strength, [0.5; 3]);
    }
    write_set(&Sensor::new(physics, SIZE.width, SIZE.height, seed), SIZE, take, folder);
    RecordingSet::open(&folder.join("recordings.toml")).unwrap()
}

/// Run times and result of one diagnosis.
struct TimedDiagnosis {
    preliminary_seconds: f64,
    likely: String,
    seconds: f64,
    verdict: &'static str,
    names: String,
    /// Number of simulations from the cache, and number of new simulations.
    cache_counts: [usize; 2],
}

fn time_diagnosis(sets: [&RecordingSet; 2], camera: Option<&Camera>, cache: Option<&Path>) -> TimedDiagnosis {
    let options = DiagnoseOptions { camera, cache, ..DiagnoseOptions::default() };
    let start = Instant::now();
    let mut look = (f64::NAN, String::new());
    let diagnosis =
        diagnose_with_preliminary(sets[0], Some(sets[1]), options, &mut |_, _| {}, &mut |first| {
            let summary =
                if first.is_consistent { "none".to_owned() } else { first.likely_effects.join(", ") };
            look = (start.elapsed().as_secs_f64(), summary);
        })
        .unwrap();
    let seconds = start.elapsed().as_secs_f64();
    let verdict = match diagnosis.verdict {
        Verdict::Agrees => "agrees",
        Verdict::Explained => "explained",
        Verdict::PartlyExplained => "partly explained",
        Verdict::Unknown => "unknown",
        Verdict::Undecided => "undecided",
    };
    let names: Vec<&str> = diagnosis.effects.iter().map(|e| e.name).collect();
    TimedDiagnosis {
        preliminary_seconds: look.0,
        likely: look.1,
        seconds,
        verdict,
        names: names.join(", "),
        cache_counts: diagnosis.cache_counts.unwrap_or_default(),
    }
}

/// Returns the table row of a case. The diagnosis runs three times: without a cache, with the cache of the preceding
/// cases, and again after the cache contains the simulations of this case.
fn row(sets: [&RecordingSet; 2], camera: Option<&Camera>, cache: &Path) -> String {
    let uncached = time_diagnosis(sets, camera, None);
    let [second, again] = [(); 2].map(|()| time_diagnosis(sets, camera, Some(cache)));
    for other in [&second, &again] {
        assert_eq!(
            (other.verdict, &other.names, &other.likely),
            (uncached.verdict, &uncached.names, &uncached.likely)
        );
    }
    let TimedDiagnosis { preliminary_seconds: first, likely, seconds, verdict, names, .. } = uncached;
    let [second_simulations, once_more] = [&second, &again]
        .map(|t| format!("{} of {}", t.cache_counts[1], t.cache_counts.iter().sum::<usize>()));
    format!(
        "{first:.0} | {likely} | {seconds:.0} | {verdict} | {names} | {:.0} | {second_simulations} | {:.1} | {once_more}",
        second.seconds, again.seconds
    )
}

/// Prints the table of the first `first` cases. Each row is printed as soon as its case is complete. All cases share one
/// cache.
pub(crate) fn print_table(first: usize) {
    print!("Made on {}.\n\n", provenance());
    println!(
        "| set | preliminary result, s | likely effects | diagnosis, s | verdict | named effects | with the cache of the sets above, s | new simulations | repeated, s | new simulations |"
    );
    println!("|---|--:|---|--:|---|---|--:|--:|--:|--:|");
    let cache = tempfile::tempdir().unwrap();
    for (what, seed, hidden, is_published) in CASES.iter().take(first) {
        let folder = tempfile::tempdir().unwrap();
        let [fitted_set, judging] =
            [0, 1].map(|take| record_set(hidden, *seed, take, &folder.path().join(format!("{take}"))));
        let camera = is_published.then(|| {
            published_camera(
                &Setup::new(&fitted_set, RecordingPart::Whole, ReadoutSelection::Leading).unwrap(),
            )
            .unwrap()
        });
        println!("| {what} | {} |", row([&fitted_set, &judging], camera.as_ref(), cache.path()));
    }
    let (files, bytes) = folder_size(cache.path());
    println!("\nThe cache of all sets has {files} files and {:.1} MB.", bytes as f64 / 1e6);
}

/// Returns the number of files below a folder and the sum of their sizes in bytes.
fn folder_size(folder: &Path) -> (usize, u64) {
    let file_and_bytes = |entry: std::io::Result<std::fs::DirEntry>| {
        let (path, known) = entry.map(|e| (e.path(), e.metadata().unwrap())).unwrap();
        if known.is_dir() { folder_size(&path) } else { (1, known.len()) }
    };
    let all = std::fs::read_dir(folder).unwrap().map(file_and_bytes);
    all.fold((0, 0), |(files, bytes), (more, more_bytes)| (files + more, bytes + more_bytes))
}
