//! Study of `calibrate` in random laboratories. Each laboratory has known true parameters and is simulated without the
//! library.
//!
//! `cargo run --release -p spikelane-studies --bin study-labs -- [--labs N] [--program FILE] [--report FILE]` prints a
//! row for each kind of fault. It writes the tables between the markers of the report. For every eleventh laboratory the
//! study runs the program on files, so the program must be built first.

#[path = "../../../crates/calibrate/tests/calibrate_support/assessment.rs"]
mod assessment;
#[path = "../../../crates/calibrate/tests/calibrate_support/mod.rs"]
mod calibrate_support;
#[path = "../../../crates/calibrate/tests/calibrate_support/error_bounds.rs"]
mod error_bounds;
#[path = "../../../crates/calibrate/tests/calibrate_support/lab.rs"]
mod lab;
#[path = "../diagnose/share.rs"]
#[allow(dead_code, reason = "the study of diagnose uses more of it")]
mod share;
mod tables;

use std::path::{Path, PathBuf};

use assessment::{AssessmentOutcome, QUANTITIES, assess, assess_program};
use lab::Laboratory;
use rayon::prelude::*;
use spikelane_studies::page::write_between_markers;

const PAGE_MARKERS: [&str; 2] = ["<!-- begin: study-labs -->\n", "<!-- end: study-labs -->"];

/// One of 11 laboratories is tested with files. The number of faults is not a multiple of 11, so every fault is also
/// tested with files.
const FILE_LAB_INTERVAL: u64 = 11;

struct Arguments {
    labs: std::ops::Range<u64>,
    program: PathBuf,
    report: Option<PathBuf>,
}

fn arguments() -> Arguments {
    // The program is expected in the folder above the folder of this executable.
    let sibling_program = std::env::current_exe().ok().map(|program| program.with_file_name("spikelane"));
    let mut arguments =
        Arguments { labs: 0..300, program: sibling_program.unwrap_or_default(), report: None };
    let mut all = std::env::args().skip(1);
    while let Some(arg) = all.next() {
        let value = all.next().unwrap_or_else(|| panic!("{arg} needs a value"));
        match arg.as_str() {
            "--labs" => arguments.labs = 0..value.parse().expect("a number of laboratories"),
            "--lab" => {
                let one: u64 = value.parse().expect("the number of a laboratory");
                arguments.labs = one..one + 1;
            }
            "--program" => arguments.program = value.into(),
            "--report" => arguments.report = Some(value.into()),
            _ => panic!("{arg}: give --labs N, --lab N, --program FILE or --report FILE"),
        }
    }
    assert!(
        arguments.program.is_file(),
        "{}: no such program; build the program (cargo build --release), or set --program FILE",
        arguments.program.display()
    );
    arguments
}

fn main() {
    let arguments = arguments();
    let verdicts: Vec<(&str, AssessmentOutcome)> =
        arguments.labs.into_par_iter().map(|index| assess_laboratory(index, &arguments.program)).collect();
    let tables = tables::all_tables(&verdicts);
    print!("{tables}");
    if let Some(file) = &arguments.report {
        write_between_markers(file, PAGE_MARKERS, &tables);
    }
}

fn assess_laboratory(index: u64, program: &Path) -> (&'static str, AssessmentOutcome) {
    let lab = Laboratory::new(index);
    let verdict = if index % FILE_LAB_INTERVAL == 5 {
        let folder = std::env::temp_dir().join(format!("study-labs-{}-{index}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let verdict = assess_program(&lab, program, &folder);
        std::fs::remove_dir_all(&folder).unwrap();
        verdict
    } else {
        assess(&lab)
    };
    if let AssessmentOutcome::Refused(why) = &verdict {
        println!("laboratory {index}, {}: rejected, {why}", lab.fault);
    }
    for c in verdict.wrong_quantities() {
        let (name, error) = (QUANTITIES[c.quantity], 100.0 * c.relative);
        println!(
            "laboratory {index}, {}: {name} deviates by {:+.1} standard errors, standard error {error:.3} %",
            lab.fault, c.z
        );
    }
    (lab.fault, verdict)
}
