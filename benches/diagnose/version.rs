//! Which code judged a sensor: results of two versions must not share a table.
//!
//! A sensor in which nothing was found never came to the code that chooses names, and what was said of it holds when that
//! changes: `search` asks for a tournament only where something is left.

use std::sync::LazyLock;

use serde_json::Value;

/// What decides on whether anything is wrong, what fits it, and what makes the sensors.
const SOURCES: [&str; 36] = [
    include_str!("../../src/diagnose/bits.rs"),
    include_str!("../../src/diagnose/candidates.rs"),
    include_str!("../../src/diagnose/derivatives.rs"),
    include_str!("../../src/diagnose/edges.rs"),
    include_str!("../../src/diagnose/events.rs"),
    include_str!("../../src/diagnose/extent.rs"),
    include_str!("../../src/diagnose/fit.rs"),
    include_str!("../../src/diagnose/interval.rs"),
    include_str!("../../src/diagnose/likelihood.rs"),
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
    include_str!("../../src/diagnose/run.rs"),
    include_str!("../../src/diagnose/scan.rs"),
    include_str!("../../src/diagnose/search.rs"),
    include_str!("../../src/diagnose/setup.rs"),
    include_str!("../../src/diagnose/slope.rs"),
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

/// What chooses between names, once something is wrong.
const NAMING: [&str; 3] = [
    include_str!("../../src/diagnose/drawn.rs"),
    include_str!("../../src/diagnose/tournament.rs"),
    include_str!("../../src/diagnose/weed.rs"),
];

/// What judged a sensor of which `verdict` was said.
pub fn of(verdict: &Value) -> &'static str {
    if verdict == "agrees" { of_the_alarm() } else { digest() }
}

/// FNV-1a of all sources, in hexadecimal digits.
fn digest() -> &'static str {
    static DIGEST: LazyLock<String> = LazyLock::new(|| hashed(SOURCES.iter().chain(&NAMING)));
    &DIGEST
}

/// The same of those that choose no names.
pub fn of_the_alarm() -> &'static str {
    static DIGEST: LazyLock<String> = LazyLock::new(|| hashed(SOURCES.iter()));
    &DIGEST
}

fn hashed<'a>(sources: impl Iterator<Item = &'a &'static str>) -> String {
    let bytes = sources.flat_map(|s| s.bytes());
    let hash =
        bytes.fold(0xcbf2_9ce4_8422_2325_u64, |h, b| (h ^ u64::from(b)).wrapping_mul(0x0000_0100_0000_01B3));
    format!("{hash:016x}")
}
