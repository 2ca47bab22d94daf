//! Tests that the diagnoses of some sensors of the blind study are reproduced.

#[path = "../src/diagnose/diagnose_sensor.rs"]
mod diagnose_sensor;
#[allow(unreachable_pub, reason = "shared by several test binaries")]
#[path = "../../crates/diagnose/tests/hidden_sensor/mod.rs"]
mod hidden_sensor;
#[path = "../src/diagnose/jobs.rs"]
#[allow(dead_code, reason = "the study makes its list with it")]
mod jobs;
#[path = "../src/diagnose/phases.rs"]
mod phases;
#[path = "../src/diagnose/records.rs"]
#[allow(dead_code, reason = "the study reads and writes with it")]
mod records;
#[path = "../src/diagnose/rejudge.rs"]
#[allow(dead_code, reason = "the study judges a list of them")]
mod rejudge;
#[path = "../src/diagnose/score.rs"]
mod score;
#[path = "../src/diagnose/version.rs"]
mod version;

use spikelane_diagnose::NullModel;

/// A clean sensor, and one sensor of each other class. Each other sensor has the quickest diagnosis of those in its
/// class that identified all hidden effects.
///
/// `studies/data/diagnosis-again.txt` lists forty more sensors. `docs/why/diagnosis.md` contains the command to test them.
const QUICKEST_SENSORS: [&str; 5] = [
    "null--261",
    "single-dead_pixels-018",
    "outside-diagonal_banding-007",
    "double-dead_pixels+dark_tail-124",
    "triple-dead_time+response_nonlinearity+vignetting-009",
];

/// The records of these sensors by the current code. The records of the study are of an earlier version.
const RECORDS: &str = "data/diagnosis-again.jsonl";

/// If one of these tests fails, the result of `diagnose` has changed. If the change is intended, increase a number in
/// `version.rs`, and write new records with `WRITE=1 cargo test -p spikelane-studies --test diagnose_study -- --ignored`.
#[test]
fn recorded_diagnoses_of_up_to_one_effect_are_reproduced_to_nine_digits() {
    assert_reproduced(&QUICKEST_SENSORS[..2], &shared_null_model());
}

#[test]
#[ignore = "two minutes; .ci/full runs it"]
fn long_recorded_diagnoses_of_up_to_three_effects_are_reproduced_to_nine_digits() {
    let reference = shared_null_model();
    if std::env::var_os("WRITE").is_some() {
        let lines = spikelane_studies::lines::diagnosis_records();
        let write = |id: &str| {
            let recorded = rejudge::find_record(&lines, id).expect("a record of the study");
            format!("{}\n", records::without_omitted_keys(rejudge::repeat(&recorded, &reference)))
        };
        std::fs::write(RECORDS, QUICKEST_SENSORS.into_iter().map(write).collect::<String>()).unwrap();
    }
    assert_reproduced(&QUICKEST_SENSORS, &reference);
}

fn shared_null_model() -> NullModel {
    diagnose_sensor::shared_null_model(hidden_sensor::SMALL_SIZE, &mut phases::PhaseTimer::new(false))
}

fn assert_reproduced(ids: &[&str], reference: &NullModel) {
    let lines = std::fs::read_to_string(RECORDS).unwrap();
    for id in ids {
        let recorded = rejudge::find_record(&lines, id).expect("a record");
        let differences = rejudge::differences(&recorded, reference);
        assert!(differences.is_empty(), "{id}: {differences:#?}");
    }
}
