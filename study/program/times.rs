//! How long `diagnose` takes of a camera that it has never seen: eight recordings of 96x64 pixels and 6,000 readouts.

use std::path::Path;
use std::time::Instant;

use spikelane::calibrate::RecordingSet;
use spikelane::diagnose::{DiagnoseOptions, Setup, Verdict, diagnose_and_tell, published};
use spikelane::diagnose::{Extent, Part};

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

/// Prints the table, a row as soon as it is known; of all cases, or of the first few.
pub(crate) fn print(first: usize) {
    print!("{}", made::by());
    println!("| set | first look, s | says | end, s | verdict | names |\n|---|--:|---|--:|---|---|");
    for (what, seed, hidden, given) in CASES.iter().take(first) {
        let folder = tempfile::tempdir().unwrap();
        let [own, judging] =
            [0, 1].map(|take| set(hidden, *seed, take, &folder.path().join(format!("{take}"))));
        let camera =
            given.then(|| published(&Setup::of(&own, Part::Whole, Extent::Enough).unwrap()).unwrap());
        let options = DiagnoseOptions { camera: camera.as_ref(), ..DiagnoseOptions::default() };
        let start = Instant::now();
        let mut look = (f64::NAN, String::new());
        let found = diagnose_and_tell(&own, Some(&judging), options, &mut |_, _| {}, &mut |first| {
            let said = if first.agrees { "nothing stands out".to_owned() } else { first.likely.join(", ") };
            look = (start.elapsed().as_secs_f64(), said);
        })
        .unwrap();
        let seconds = start.elapsed().as_secs_f64();
        let names: Vec<&str> = found.effects.iter().map(|e| e.name).collect();
        let verdict = match found.verdict {
            Verdict::Agrees => "agrees",
            Verdict::Explained => "explained",
            Verdict::PartlyExplained => "partly explained",
            Verdict::Unknown => "unknown",
        };
        println!("| {what} | {:.0} | {} | {seconds:.0} | {verdict} | {} |", look.0, look.1, names.join(", "));
    }
}
