//! Sensors of the blind study, judged again.

#[path = "../src/diagnose/again.rs"]
#[allow(dead_code, reason = "the study judges a list of them")]
mod again;
#[allow(unreachable_pub, reason = "shared by several test binaries")]
#[path = "../../crates/calibrate/tests/hidden_sensor/mod.rs"]
mod hidden_sensor;
#[path = "../src/diagnose/jobs.rs"]
#[allow(dead_code, reason = "the study makes its list with it")]
mod jobs;
#[path = "../src/diagnose/judge.rs"]
mod judge;
#[path = "../src/diagnose/phases.rs"]
mod phases;
#[path = "../src/diagnose/records.rs"]
#[allow(dead_code, reason = "the study reads and writes with it")]
mod records;
#[path = "../src/diagnose/score.rs"]
mod score;
#[path = "../src/diagnose/version.rs"]
mod version;

/// The quickest of each class in which something was named where something is hidden. Forty more are in
/// `studies/data/diagnosis-again.txt`: `docs/why/diagnosis.md` has the command.
const QUICKEST: [&str; 5] = [
    "null--261",
    "single-dead_pixels-018",
    "outside-diagonal_banding-007",
    "double-dead_pixels+dark_tail-124",
    "triple-dead_time+response_nonlinearity+vignetting-009",
];

/// If it fails, what `diagnose` says has changed: either by mistake, or a number of `version.rs` is to be raised.
#[test]
fn recorded_sensors_are_judged_as_they_were_in_every_digit() {
    let lines = spikelane_studies::lines::diagnosis();
    let reference = judge::reference(hidden_sensor::SMALL, &mut phases::Phases::new(false));
    for id in QUICKEST {
        let recorded = again::find(&lines, id).expect("a record of the study");
        let differences = again::differences(&recorded, &reference);
        assert!(differences.is_empty(), "{id}: {differences:#?}");
    }
}
