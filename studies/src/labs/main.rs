//! The study of `calibrate` in random laboratories of known truth, simulated without the library.
//!
//! `cargo run --release -p spikelane-studies --bin study-labs -- [--labs N] [--program FILE] [--report FILE]` prints a row for each kind of fault, and writes
//! the tables between the marks of the report. With the program built, every eleventh laboratory goes through its files and command line.

#[path = "../../../crates/calibrate/tests/calibrate_support/best.rs"]
mod best;
#[path = "../../../crates/calibrate/tests/calibrate_support/mod.rs"]
mod calibrate_support;
#[path = "../../../crates/calibrate/tests/calibrate_support/judge.rs"]
mod judge;
#[path = "../../../crates/calibrate/tests/calibrate_support/lab.rs"]
mod lab;
#[path = "../diagnose/share.rs"]
#[allow(dead_code, reason = "the study of diagnose uses more of it")]
mod share;
mod tables;

use std::path::{Path, PathBuf};

use judge::{QUANTITIES, Verdict, judge, judge_program};
use lab::Lab;
use rayon::prelude::*;

const MARKS: [&str; 2] = ["<!-- begin: study-labs -->\n", "<!-- end: study-labs -->"];

/// One laboratory in so many goes through files; no divisor of the number of faults, so each has its turn.
const THROUGH_FILES: u64 = 11;

struct Arguments {
    labs: std::ops::Range<u64>,
    program: PathBuf,
    report: Option<PathBuf>,
}

fn arguments() -> Arguments {
    // Beside `examples`, where cargo puts it.
    let beside = std::env::current_exe().ok().and_then(|e| Some(e.parent()?.parent()?.join("spikelane")));
    let mut found = Arguments { labs: 0..300, program: beside.unwrap_or_default(), report: None };
    let mut all = std::env::args().skip(1);
    while let Some(arg) = all.next() {
        let value = all.next().unwrap_or_else(|| panic!("{arg} needs a value"));
        match arg.as_str() {
            "--labs" => found.labs = 0..value.parse().expect("a number of laboratories"),
            "--lab" => {
                let one: u64 = value.parse().expect("the number of a laboratory");
                found.labs = one..one + 1;
            }
            "--program" => found.program = value.into(),
            "--report" => found.report = Some(value.into()),
            _ => panic!("{arg}: give --labs N, --lab N, --program FILE or --report FILE"),
        }
    }
    assert!(
        found.program.is_file(),
        "{}: no such program; build it (cargo build --release) or give --program FILE",
        found.program.display()
    );
    found
}

fn main() {
    let arguments = arguments();
    let verdicts: Vec<(&str, Verdict)> =
        arguments.labs.into_par_iter().map(|index| verdict(index, &arguments.program)).collect();
    let tables = tables::all(&verdicts);
    print!("{tables}");
    if let Some(file) = &arguments.report {
        write(file, &tables);
    }
}

fn verdict(index: u64, program: &Path) -> (&'static str, Verdict) {
    let lab = Lab::new(index);
    let verdict = if index % THROUGH_FILES == 5 {
        let folder = std::env::temp_dir().join(format!("study-labs-{}-{index}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let verdict = judge_program(&lab, program, &folder);
        std::fs::remove_dir_all(&folder).unwrap();
        verdict
    } else {
        judge(&lab)
    };
    if let Verdict::Refused(why) = &verdict {
        println!("laboratory {index}, {}: refused, {why}", lab.fault);
    }
    for c in verdict.wrong() {
        let (name, error) = (QUANTITIES[c.quantity], 100.0 * c.relative);
        println!("laboratory {index}, {}: {name} {:+.1} errors off, error {error:.3} %", lab.fault, c.z);
    }
    (lab.fault, verdict)
}

fn write(path: &Path, tables: &str) {
    let page = std::fs::read_to_string(path).unwrap();
    let (start, rest) = page.split_once(MARKS[0]).expect("the page's first mark");
    let (_, end) = rest.split_once(MARKS[1]).expect("the page's last mark");
    std::fs::write(path, format!("{start}{}{tables}{}{end}", MARKS[0], MARKS[1])).unwrap();
}
