//! Runs a part of the study of `calibrate` in random laboratories. `calibrate` must reject a recording set, or every
//! estimate must be right.

#[path = "../../crates/calibrate/tests/calibrate_support/assessment.rs"]
#[allow(dead_code, reason = "the study makes tables of it")]
mod assessment;
#[path = "../../crates/calibrate/tests/calibrate_support/mod.rs"]
mod calibrate_support;
#[path = "../../crates/calibrate/tests/calibrate_support/error_bounds.rs"]
mod error_bounds;
#[path = "../../crates/calibrate/tests/calibrate_support/lab.rs"]
#[allow(dead_code, reason = "the study makes tables of it")]
mod lab;

use std::path::Path;

use crate::assessment::{AssessmentOutcome, assess, assess_program};
use crate::lab::Laboratory;
use rayon::prelude::*;

/// Tests one or two laboratories for each kind of fault. Three laboratories are tested with files and the command line.
///
/// A value counts as wrong if its error exceeds five standard errors. Each run has about 300 values. If the errors are
/// normally distributed, 99.98 % of all runs have no wrong value.
#[test]
fn calibration_of_random_laboratories_is_right_or_refused() {
    (0..20_u64).into_par_iter().for_each(|index| {
        let lab = Laboratory::new(index);
        let verdict = if index % 7 == 5 {
            let folder = tempfile::TempDir::new().unwrap();
            assess_program(&lab, Path::new(env!("CARGO_BIN_EXE_study-program-under-test")), folder.path())
        } else {
            assess(&lab)
        };
        let wrong: Vec<_> = verdict
            .wrong_quantities()
            .iter()
            .map(|c| (crate::assessment::QUANTITIES[c.quantity], c.z))
            .collect();
        assert!(wrong.is_empty(), "laboratory {index}, {}: {wrong:?}", lab.fault);
        if let AssessmentOutcome::Refused(why) = verdict {
            panic!("laboratory {index}, {}: {why}", lab.fault);
        }
    });
}

/// Compares two calibrations of one laboratory: from spikes that are counted in memory, and from files. The results
/// must be equal.
#[test]
fn files_and_counts_of_a_laboratory_say_the_same() {
    let lab = Laboratory::new(13);
    let folder = tempfile::TempDir::new().unwrap();
    let through_files =
        assess_program(&lab, Path::new(env!("CARGO_BIN_EXE_study-program-under-test")), folder.path());
    let (AssessmentOutcome::Assessed(counted), AssessmentOutcome::Assessed(read)) =
        (assess(&lab), through_files)
    else {
        panic!("refused");
    };
    assert!(counted.has_named_fault && read.has_named_fault, "a drift of 1 % was not told");
    // Only the rates must be equal. The results from memory and from files measure the intervals over different spans.
    for (a, b) in counted.quantity_errors.iter().zip(&read.quantity_errors).filter(|(a, _)| a.quantity < 2) {
        assert!((a.z - b.z).abs() < 0.1, "{} {} {}", crate::assessment::QUANTITIES[a.quantity], a.z, b.z);
    }
}
