//! Simulates a hidden sensor in a laboratory and diagnoses it.

use std::path::Path;

use serde_json::{Value, json};
use spikelane_diagnose::{DiagnoseOptions, diagnose};

use super::factors::Factors;
use super::hidden_sensor::Sensor;
use super::jobs::{SensorJob, uniform_hash};
use super::{laboratory, score};

/// Side of the sensor in pixels.
const SENSOR_SIDE_PX: usize = 48;

/// Range of the strengths of hidden effects, as multiples of the smallest detectable strength in the first study. The
/// logarithm of the strength has a uniform distribution.
const STRENGTH_RANGE: (f64, f64) = (6.0, 20.0);

/// Returns the smallest detectable strength of each effect in the first study.
pub(crate) fn smallest_strengths() -> Vec<(String, f64)> {
    let lines = spikelane_studies::lines::diagnosis_records();
    let mut all: Vec<(String, f64)> = Vec::new();
    for record in lines.lines().filter_map(|l| serde_json::from_str::<Value>(l).ok()) {
        for h in record["hidden"].as_array().into_iter().flatten() {
            let (Some(name), Some(strength)) = (h["name"].as_str(), h["detectable_strength"].as_f64()) else {
                continue;
            };
            if !all.iter().any(|a| a.0 == name) {
                all.push((name.to_owned(), strength));
            }
        }
    }
    all
}

pub(crate) fn diagnose_job(
    job: &SensorJob,
    attempt: u64,
    smallest: &[(String, f64)],
    keep: Option<&Path>,
) -> Value {
    let seed = job.seed() ^ attempt.wrapping_mul(0x9E37_79B9_7F4A_7C15);
    let factors = Factors::random(seed);
    let mut physics = factors.physics();
    let mut hidden = Vec::new();
    for (i, kind) in job.kinds.iter().enumerate() {
        let u = [1, 2, 3].map(|k| uniform_hash(seed, 10 * i as u64 + k));
        let times =
            STRENGTH_RANGE.0 * (STRENGTH_RANGE.1 / STRENGTH_RANGE.0).powf(uniform_hash(seed, 100 + i as u64));
        let smallest_strength = smallest.iter().find(|s| s.0 == kind.name).map(|s| s.1 * times);
        let strength = smallest_strength.map_or(kind.largest, |s| s.min(kind.largest));
        (kind.set)(&mut physics, strength, u);
        hidden.push(json!({"name": kind.name, "strength": strength}));
    }
    let sensor = Sensor::new(physics, SENSOR_SIDE_PX, SENSOR_SIDE_PX, seed);
    let temporary = tempfile::tempdir().unwrap();
    let folder = keep.map_or_else(|| temporary.path().to_owned(), |keep| keep.join(job.id()));
    let first = laboratory::record_take(&sensor, &factors, 0, &folder.join("0"));
    let second = factors.second_set.then(|| laboratory::record_take(&sensor, &factors, 1, &folder.join("1")));
    let camera = factors.camera_file.then(|| laboratory::camera_file(&first, &factors));
    if let (Some(_), Some(camera)) = (keep, &camera) {
        let saved = spikelane::presets::to_toml(camera).unwrap();
        std::fs::write(folder.join("camera.toml"), saved.text).unwrap();
    }
    let options = DiagnoseOptions { camera: camera.as_ref(), ..DiagnoseOptions::default() };
    let outcome = diagnose(&first, second.as_ref(), options, &mut |_, _| {});
    let report = match &outcome {
        Ok(diagnosis) => serde_json::to_value(diagnosis).unwrap(),
        Err(error) => json!({ "error": error.to_string() }),
    };
    let levels: serde_json::Map<String, Value> =
        factors.levels().into_iter().map(|(name, level)| (name.to_owned(), level.into())).collect();
    // If the protocol cannot reveal an effect, the effect does not count as missed.
    let cannot = |name: &str| report["undetectable"].as_array().into_iter().flatten().any(|n| n == name);
    let shown = job.kinds.iter().filter(|k| job.class != "outside" && !cannot(k.name)).count();
    let hidden = Value::from(hidden);
    let mut score = score::score(&hidden, &report);
    score["showable"] = shown.into();
    json!({"id": job.id(), "class": job.class, "attempt": attempt, "factors": levels, "hidden": hidden, "score": score, "diagnosis": with_needed_keys(report)})
}

/// Returns the entries of a diagnosis that the table needs, and the entries that help to analyze a failure.
fn with_needed_keys(report: Value) -> Value {
    let keys = [
        "verdict",
        "effects",
        "parameter_mismatches",
        "unexplained",
        "discrepancy",
        "faults",
        "seconds",
        "error",
        "undetectable",
    ];
    let needed = report.as_object().into_iter().flatten().filter(|(key, _)| keys.contains(&key.as_str()));
    Value::Object(needed.map(|(key, value)| (key.clone(), value.clone())).collect())
}
