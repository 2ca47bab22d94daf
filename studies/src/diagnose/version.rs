//! Versions of the code that makes a diagnosis. Results of two versions must not be in one table.
//!
//! If a commit changes the diagnosis of a sensor, raise the version number of the changed code. Moves, renames and
//! changes of comments do not require a new number. `studies/tests/diagnose_study.rs` repeats recorded diagnoses and
//! requires the first nine digits to be the same. If this test fails, a diagnosis has changed.
//!
//! Some records remain valid when code changes. If a diagnosis finds no discrepancy, it does not run the code that
//! chooses names. If a diagnosis adds a single name, it does not run the code that examines several names. `search`
//! runs a `tournament` only if a discrepancy remains, and runs `weed` only if there are two or more names.
//!
//! The sensors of a study share a null model. The code in `published`, `own_numbers` and `last_steps` runs only when a
//! diagnosis builds its own null model. Changes of this code therefore do not change the version numbers.

use serde_json::Value;

/// Version of the code that detects a discrepancy, computes the smallest detectable strengths, and makes the sensors.
pub(crate) const ALARM_VERSION: u32 = 2;

/// Version of the code that names an effect after an alarm and estimates its strength.
pub(crate) const NAMING_VERSION: u32 = 2;

/// Version of the code that examines several names again.
pub(crate) const ELIMINATION_VERSION: u32 = 2;

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
