//! A part of the study of `calibrate` in random laboratories: what is said there is right, or nothing is said.

#[path = "../../crates/calibrate/tests/calibrate_support/best.rs"]
mod best;
#[path = "../../crates/calibrate/tests/calibrate_support/mod.rs"]
mod calibrate_support;
#[path = "../../crates/calibrate/tests/calibrate_support/judge.rs"]
#[allow(dead_code, reason = "the study makes tables of it")]
mod judge;
#[path = "../../crates/calibrate/tests/calibrate_support/lab.rs"]
#[allow(dead_code, reason = "the study makes tables of it")]
mod lab;

use std::path::Path;

use crate::judge::{Verdict, judge, judge_program};
use crate::lab::Lab;
use rayon::prelude::*;

/// One laboratory or two of each kind, three of them through files and the command line. A wrong value lies five of its errors from the
/// truth: of some 300 values with normal errors chance puts none there in 99.98 % of all suites.
#[test]
fn what_is_said_of_a_random_laboratory_is_right_or_nothing_is_said() {
    (0..20_u64).into_par_iter().for_each(|index| {
        let lab = Lab::new(index);
        let verdict = if index % 7 == 5 {
            let folder = tempfile::TempDir::new().unwrap();
            judge_program(&lab, Path::new(env!("CARGO_BIN_EXE_study-program-under-test")), folder.path())
        } else {
            judge(&lab)
        };
        let wrong: Vec<_> =
            verdict.wrong().iter().map(|c| (crate::judge::QUANTITIES[c.quantity], c.z)).collect();
        assert!(wrong.is_empty(), "laboratory {index}, {}: {wrong:?}", lab.fault);
        if let Verdict::Refused(why) = verdict {
            panic!("laboratory {index}, {}: {why}", lab.fault);
        }
    });
}

/// The same laboratory, counted in memory and read from its files: nothing that is said differs.
#[test]
fn files_and_counts_of_a_laboratory_say_the_same() {
    let lab = Lab::new(13);
    let folder = tempfile::TempDir::new().unwrap();
    let through_files =
        judge_program(&lab, Path::new(env!("CARGO_BIN_EXE_study-program-under-test")), folder.path());
    let (Verdict::Said(counted), Verdict::Said(read)) = (judge(&lab), through_files) else {
        panic!("refused");
    };
    assert!(counted.named && read.named, "a drift of 1 % was not told");
    // Intervals are measured by other spans in the two; rates are the same.
    for (a, b) in counted.compared.iter().zip(&read.compared).filter(|(a, _)| a.quantity < 2) {
        assert!((a.z - b.z).abs() < 0.1, "{} {} {}", crate::judge::QUANTITIES[a.quantity], a.z, b.z);
    }
}
