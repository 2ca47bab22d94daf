//! Versions of the code that makes a diagnosis. Results of two versions must not be in one table.
//!
//! If a commit changes the diagnosis of a sensor, raise the number of the code that it changes. Moves, names and
//! comments change nothing. `studies/tests/diagnose_study.rs` repeats recorded diagnoses and requires every digit to be
//! the same. If it fails, the diagnosis has changed. `docs/why/diagnosis.md` lists the code that each number covers.
//!
//! A sensor without a finding never reaches the code that chooses names. A sensor with a single added name never
//! reaches the code that examines several names: `search` runs a tournament only if a discrepancy remains, and weeds
//! only if there are two or more names. The records of such sensors therefore stay valid when that code changes.
//!
//! The sensors of a study share a null model. Code that runs only when a diagnosis builds its own model (`published`,
//! `own_numbers`, `last_steps`) therefore has no effect on these numbers.

use serde_json::Value;

/// Version of the code that detects a discrepancy, computes the smallest detectable strengths, and makes the sensors.
pub(crate) const ALARM_VERSION: u32 = 1;

/// Version of the code that names an effect after an alarm and estimates its strength.
pub(crate) const NAMING_VERSION: u32 = 1;

/// Version of the code that examines several names again.
pub(crate) const ELIMINATION_VERSION: u32 = 1;

/// Returns the versions of the code that made the diagnosis `diagnosis`, joined by dots.
pub(crate) fn version_of_diagnosis(diagnosis: &Value) -> String {
    // The discrepancy is listed before any name and after each added name.
    let added = diagnosis["discrepancy"]["fitted_set"].as_array().map_or(usize::MAX, Vec::len);
    match added {
        _ if diagnosis["verdict"] == "agrees" => alarm_version(),
        ..=2 => format!("{ALARM_VERSION}.{NAMING_VERSION}"),
        _ => format!("{ALARM_VERSION}.{NAMING_VERSION}.{ELIMINATION_VERSION}"),
    }
}

/// Returns the version of the code that raises an alarm.
pub(crate) fn alarm_version() -> String {
    ALARM_VERSION.to_string()
}
