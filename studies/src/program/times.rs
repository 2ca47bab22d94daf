//! How long `diagnose` takes of a camera that it has never seen: eight recordings of 96x64 pixels and 6,000 readouts.

use std::path::Path;
use std::time::Instant;

use spikelane::effects::Camera;
use spikelane_calibrate::RecordingSet;
use spikelane_calibrate::diagnose::{DiagnoseOptions, Setup, Verdict, diagnose_and_tell, published};
use spikelane_calibrate::diagnose::{Extent, Part};

use super::hidden_sensor::{Physics, Sensor, Size, kind, write_set};
use super::made;

const SIZE: Size = Size { width: 96, height: 64, readouts: 6000 };

/// Effects with strengths.
type Hidden = &'static [(&'static str, f64)];

/// Sensors with what is hidden in them: seed, effects, whether the published camera is given.
const CASES: [(&str, u64, Hidden, bool); 5] = [
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

fn set(hidden: &[(&str, f64)], seed: u64, take: u64, folder: &Path) -> RecordingSet {
    let mut physics = Physics::default();
    for (name, strength) in hidden {
        (kind(name).set)(&mut physics, *strength, [0.5; 3]);
    }
    write_set(&Sensor::new(physics, SIZE.width, SIZE.height, seed), SIZE, take, folder);
    RecordingSet::open(&folder.join("recordings.toml")).unwrap()
}

/// What one diagnosis took and said.
struct Timed {
    first: f64,
    likely: String,
    seconds: f64,
    verdict: &'static str,
    names: String,
    /// Simulations from the cache, and those that were made.
    cached: [usize; 2],
}

fn timed(sets: [&RecordingSet; 2], camera: Option<&Camera>, cache: Option<&Path>) -> Timed {
    let options = DiagnoseOptions { camera, cache, ..DiagnoseOptions::default() };
    let start = Instant::now();
    let mut look = (f64::NAN, String::new());
    let found = diagnose_and_tell(sets[0], Some(sets[1]), options, &mut |_, _| {}, &mut |first| {
        let said = if first.agrees { "nothing stands out".to_owned() } else { first.likely.join(", ") };
        look = (start.elapsed().as_secs_f64(), said);
    })
    .unwrap();
    let seconds = start.elapsed().as_secs_f64();
    let verdict = match found.verdict {
        Verdict::Agrees => "agrees",
        Verdict::Explained => "explained",
        Verdict::PartlyExplained => "partly explained",
        Verdict::Unknown => "unknown",
    };
    let names: Vec<&str> = found.effects.iter().map(|e| e.name).collect();
    Timed {
        first: look.0,
        likely: look.1,
        seconds,
        verdict,
        names: names.join(", "),
        cached: found.cached.unwrap_or_default(),
    }
}

/// The same without a cache, with one that holds what the sets before left, and again with what it has left there itself.
fn row(sets: [&RecordingSet; 2], camera: Option<&Camera>, cache: &Path) -> String {
    let alone = timed(sets, camera, None);
    let [second, again] = [(); 2].map(|()| timed(sets, camera, Some(cache)));
    for other in [&second, &again] {
        assert_eq!(
            (other.verdict, &other.names, &other.likely),
            (alone.verdict, &alone.names, &alone.likely)
        );
    }
    let Timed { first, likely, seconds, verdict, names, .. } = alone;
    let [beside, once_more] =
        [&second, &again].map(|t| format!("{} of {}", t.cached[1], t.cached.iter().sum::<usize>()));
    format!(
        "{first:.0} | {likely} | {seconds:.0} | {verdict} | {names} | {:.0} | {beside} | {:.1} | {once_more}",
        second.seconds, again.seconds
    )
}

/// Prints the table, a row as soon as it is known; of all cases, or of the first few. All share one cache.
pub(crate) fn print(first: usize) {
    print!("{}", made::by());
    println!(
        "| set | first look, s | says | end, s | verdict | names | beside the sets above, s | simulations made | again, s | simulations made |"
    );
    println!("|---|--:|---|--:|---|---|--:|--:|--:|--:|");
    let cache = tempfile::tempdir().unwrap();
    for (what, seed, hidden, given) in CASES.iter().take(first) {
        let folder = tempfile::tempdir().unwrap();
        let [own, judging] =
            [0, 1].map(|take| set(hidden, *seed, take, &folder.path().join(format!("{take}"))));
        let camera =
            given.then(|| published(&Setup::of(&own, Part::Whole, Extent::Enough).unwrap()).unwrap());
        println!("| {what} | {} |", row([&own, &judging], camera.as_ref(), cache.path()));
    }
    let (files, bytes) = size(cache.path());
    println!("\nThe cache of all: {files} files, {:.1} MB.", bytes as f64 / 1e6);
}

/// Files in a folder and below, and their bytes.
fn size(folder: &Path) -> (usize, u64) {
    let of = |entry: std::io::Result<std::fs::DirEntry>| {
        let (path, known) = entry.map(|e| (e.path(), e.metadata().unwrap())).unwrap();
        if known.is_dir() { size(&path) } else { (1, known.len()) }
    };
    let all = std::fs::read_dir(folder).unwrap().map(of);
    all.fold((0, 0), |(files, bytes), (more, further)| (files + more, bytes + further))
}
