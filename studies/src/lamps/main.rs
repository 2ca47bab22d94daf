//! Study of `calibrate` with lamps that flicker and drift. Each sensor has known true parameters and is simulated without
//! the library. The light of each readout is an array that does not come from the model of the fit.
//!
//! `cargo run --release -p spikelane-studies --bin study-lamps -- [--sensors A..B] [--records FILE] [--report FILE]` prints a
//! row for each kind of light. With `--records`, finished sensors are read from the file and new ones are added, so an
//! interrupted study continues, and the table contains all sensors of the file. `--report` writes the table between the
//! markers of a page.

#[path = "../../../crates/calibrate/tests/calibrate_support/mod.rs"]
mod calibrate_support;
mod light;
mod sensor;
#[path = "../diagnose/share.rs"]
#[allow(dead_code, reason = "the study of diagnose uses more of it")]
mod share;
mod table;

use std::collections::BTreeMap;
use std::io::Write as _;
use std::ops::Range;
use std::path::{Path, PathBuf};

use serde_json::{Value, json};
use spikelane_studies::page::write_between_markers;

const PAGE_MARKERS: [&str; 2] = ["<!-- begin: study-lamps -->\n", "<!-- end: study-lamps -->"];

struct Arguments {
    sensors: Range<u64>,
    records: Option<PathBuf>,
    report: Option<PathBuf>,
}

fn arguments() -> Arguments {
    let mut arguments = Arguments { sensors: 0..270, records: None, report: None };
    let mut all = std::env::args().skip(1);
    while let Some(arg) = all.next() {
        let value = all.next().unwrap_or_else(|| panic!("{arg} needs a value"));
        match arg.as_str() {
            "--sensors" => {
                let (from, to) = value.split_once("..").expect("a range such as 0..270");
                arguments.sensors = from.parse().expect("a number")..to.parse().expect("a number");
            }
            "--records" => arguments.records = Some(value.into()),
            "--report" => arguments.report = Some(value.into()),
            _ => panic!("{arg}: give --sensors A..B, --records FILE or --report FILE"),
        }
    }
    arguments
}

fn main() {
    let arguments = arguments();
    let mut known = arguments.records.as_deref().map_or_else(BTreeMap::new, read_records);
    for index in arguments.sensors.clone() {
        if known.contains_key(&index) {
            continue;
        }
        let outcome = sensor::assess(index);
        if let Some(file) = &arguments.records {
            let mut file = std::fs::OpenOptions::new().create(true).append(true).open(file).expect("records");
            writeln!(file, "{}", json!({ "sensor": index, "outcome": outcome })).expect("records");
        }
        known.insert(index, outcome);
    }
    let outcomes: Vec<(u64, Value)> = known.into_iter().collect();
    let text = table::table(&outcomes);
    print!("{text}");
    if let Some(file) = &arguments.report {
        write_between_markers(file, PAGE_MARKERS, &text);
    }
}

fn read_records(path: &Path) -> BTreeMap<u64, Value> {
    let text = std::fs::read_to_string(path).unwrap_or_default();
    let record = |line: &str| -> Option<(u64, Value)> {
        let record: Value = serde_json::from_str(line).ok()?;
        Some((record["sensor"].as_u64()?, record["outcome"].clone()))
    };
    text.lines().filter_map(record).collect()
}
