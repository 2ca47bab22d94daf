//! Which judgement a record holds: results of two judgements must not share a table.
//!
//! Raise a number in the commit that changes what is said of a sensor by the code it stands for, and only then: a move, a name or
//! a comment changes nothing. `studies/tests/diagnose_study.rs` judges recorded sensors again and wants every digit back; where it
//! fails, the change was a judgement. `docs/why/diagnosis.md` says what each number stands for.
//!
//! A sensor in which nothing was found never came to the code that chooses names, and one in which a single name was added
//! never to the code that looks at several again: `search` asks for a tournament only where something is left, and weeds only
//! where two names or more are. So what was said of them holds when that code changes.
//!
//! The sensors of a study share a reference. What only a diagnosis that builds its own one comes to (`published`, `own_numbers`, `last_steps`)
//! decides nothing here.

use serde_json::Value;

/// What decides on whether anything is wrong, how strong an effect can be named, and what makes the sensors.
pub(crate) const ALARM: u32 = 1;

/// What chooses a name, once something is wrong, and tells how strong it is.
pub(crate) const NAMING: u32 = 1;

/// What looks at several names again.
pub(crate) const SEVERAL: u32 = 1;

/// The numbers of what judged a sensor of which `said` was said, joined by dots.
pub(crate) fn of(said: &Value) -> String {
    // The gap is said before any name and after each that is added.
    let added = said["gap"]["train"].as_array().map_or(usize::MAX, Vec::len);
    match added {
        _ if said["verdict"] == "agrees" => of_the_alarm(),
        ..=2 => format!("{ALARM}.{NAMING}"),
        _ => format!("{ALARM}.{NAMING}.{SEVERAL}"),
    }
}

/// The number of what raises an alarm.
pub(crate) fn of_the_alarm() -> String {
    ALARM.to_string()
}
