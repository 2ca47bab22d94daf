//! Which code judged a sensor: results of two versions must not share a table.

use std::sync::LazyLock;

/// What decides on a diagnosis, and what makes the sensors.
const SOURCES: [&str; 38] = [
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
    include_str!("../../src/diagnose/tournament.rs"),
    include_str!("../../src/diagnose/vector.rs"),
    include_str!("../../src/diagnose/wave.rs"),
    include_str!("../../src/diagnose/weed.rs"),
    include_str!("../../tests/hidden_sensor/kinds.rs"),
    include_str!("../../tests/hidden_sensor/mod.rs"),
    include_str!("../../tests/hidden_sensor/physics.rs"),
    include_str!("../../tests/hidden_sensor/run.rs"),
];

/// FNV-1a of the sources, in hexadecimal digits.
pub fn digest() -> &'static str {
    static DIGEST: LazyLock<String> = LazyLock::new(hashed);
    &DIGEST
}

fn hashed() -> String {
    let bytes = SOURCES.iter().flat_map(|s| s.bytes());
    let hash =
        bytes.fold(0xcbf2_9ce4_8422_2325_u64, |h, b| (h ^ u64::from(b)).wrapping_mul(0x0000_0100_0000_01B3));
    format!("{hash:016x}")
}
