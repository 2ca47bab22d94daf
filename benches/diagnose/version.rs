//! Which code judged a sensor: results of two versions must not share a table.
//!
//! A sensor in which nothing was found never came to the code that chooses names, and one in which a single name was added
//! never to the code that looks at several again. What was said of them holds when that code changes: `search` asks for a
//! tournament only where something is left, and weeds only where two names or more are.
//!
//! The sensors of a study share a reference. What only a diagnosis that builds its own one comes to (`calibrated`, `rebase`, `ending`)
//! decides nothing here.

use std::sync::LazyLock;

use serde_json::Value;

/// What decides on whether anything is wrong, how strong an effect can be named, and what makes the sensors.
const SOURCES: [&str; 40] = [
    include_str!("../../src/diagnose/alarm.rs"),
    include_str!("../../src/diagnose/bits.rs"),
    include_str!("../../src/diagnose/candidates.rs"),
    include_str!("../../src/diagnose/case.rs"),
    include_str!("../../src/diagnose/contradicted.rs"),
    include_str!("../../src/diagnose/derivatives.rs"),
    include_str!("../../src/diagnose/edges.rs"),
    include_str!("../../src/diagnose/events.rs"),
    include_str!("../../src/diagnose/extent.rs"),
    include_str!("../../src/diagnose/fit.rs"),
    include_str!("../../src/diagnose/intervals.rs"),
    include_str!("../../src/diagnose/limits.rs"),
    include_str!("../../src/diagnose/lines.rs"),
    include_str!("../../src/diagnose/maps.rs"),
    include_str!("../../src/diagnose/metric.rs"),
    include_str!("../../src/diagnose/model.rs"),
    include_str!("../../src/diagnose/nameable.rs"),
    include_str!("../../src/diagnose/outcome.rs"),
    include_str!("../../src/diagnose/own.rs"),
    include_str!("../../src/diagnose/quiet.rs"),
    include_str!("../../src/diagnose/recorded.rs"),
    include_str!("../../src/diagnose/redraw.rs"),
    include_str!("../../src/diagnose/reference.rs"),
    include_str!("../../src/diagnose/refine.rs"),
    include_str!("../../src/diagnose/remembered.rs"),
    include_str!("../../src/diagnose/run.rs"),
    include_str!("../../src/diagnose/scan.rs"),
    include_str!("../../src/diagnose/setup.rs"),
    include_str!("../../src/diagnose/simulated.rs"),
    include_str!("../../src/diagnose/spectra.rs"),
    include_str!("../../src/diagnose/spread.rs"),
    include_str!("../../src/diagnose/still.rs"),
    include_str!("../../src/diagnose/time.rs"),
    include_str!("../../src/diagnose/together.rs"),
    include_str!("../../src/diagnose/vector.rs"),
    include_str!("../../src/diagnose/wave.rs"),
    include_str!("../../tests/hidden_sensor/kinds.rs"),
    include_str!("../../tests/hidden_sensor/mod.rs"),
    include_str!("../../tests/hidden_sensor/physics.rs"),
    include_str!("../../tests/hidden_sensor/run.rs"),
];

/// What chooses a name, once something is wrong, and tells how strong it is.
const NAMING: [&str; 13] = [
    include_str!("../../src/diagnose/crossed.rs"),
    include_str!("../../src/diagnose/drawn.rs"),
    include_str!("../../src/diagnose/interval.rs"),
    include_str!("../../src/diagnose/likelihood.rs"),
    include_str!("../../src/diagnose/located.rs"),
    include_str!("../../src/diagnose/lost.rs"),
    include_str!("../../src/diagnose/missing.rs"),
    include_str!("../../src/diagnose/pinned.rs"),
    include_str!("../../src/diagnose/repeated.rs"),
    include_str!("../../src/diagnose/round.rs"),
    include_str!("../../src/diagnose/search.rs"),
    include_str!("../../src/diagnose/slope.rs"),
    include_str!("../../src/diagnose/tournament.rs"),
];

/// What looks at several names again.
const SEVERAL: [&str; 2] =
    [include_str!("../../src/diagnose/faint.rs"), include_str!("../../src/diagnose/weed.rs")];

/// What judged a sensor of which `said` was said.
pub fn of(said: &Value) -> &'static str {
    // The gap is said before any name and after each that is added.
    let added = said["gap"]["train"].as_array().map_or(usize::MAX, Vec::len);
    match added {
        _ if said["verdict"] == "agrees" => of_the_alarm(),
        ..=2 => of_one_name(),
        _ => of_several(),
    }
}

/// FNV-1a, in hexadecimal digits, of the code that raises an alarm.
pub fn of_the_alarm() -> &'static str {
    static DIGEST: LazyLock<String> = LazyLock::new(|| hashed(&[&SOURCES]));
    &DIGEST
}

fn of_one_name() -> &'static str {
    static DIGEST: LazyLock<String> = LazyLock::new(|| hashed(&[&SOURCES, &NAMING]));
    &DIGEST
}

fn of_several() -> &'static str {
    static DIGEST: LazyLock<String> = LazyLock::new(|| hashed(&[&SOURCES, &NAMING, &SEVERAL]));
    &DIGEST
}

fn hashed(sources: &[&[&str]]) -> String {
    let bytes = sources.concat().into_iter().flat_map(decisive).collect::<Vec<u8>>();
    let hash = bytes
        .into_iter()
        .fold(0xcbf2_9ce4_8422_2325_u64, |h, b| (h ^ u64::from(b)).wrapping_mul(0x0000_0100_0000_01B3));
    format!("{hash:016x}")
}

/// A file without what decides nothing: comments, blanks at lines' ends, who may call a function, and its tests.
fn decisive(source: &str) -> Vec<u8> {
    let code = source.split("#[cfg(test)]\nmod tests").next().unwrap_or(source);
    let lines = code.lines().map(str::trim).filter(|l| !l.is_empty() && !l.starts_with("//"));
    lines.flat_map(|l| l.strip_prefix("pub(super) ").unwrap_or(l).bytes().chain([b'\n'])).collect()
}
