//! A sensor of a laboratory, and what the program says of it.

use std::path::Path;

use serde_json::{Value, json};
use spikelane_calibrate::diagnose::{DiagnoseOptions, diagnose};

use super::factors::Factors;
use super::hidden_sensor::Sensor;
use super::jobs::{Job, uniform};
use super::{lab, score};

/// Pixels of a side.
const SIDE: usize = 48;

/// Strengths over the smallest that the first study could name, log-uniform.
const STRENGTHS: (f64, f64) = (6.0, 20.0);

/// The smallest nameable strength of each effect in the first study.
pub(crate) fn smallest() -> Vec<(String, f64)> {
    let lines = spikelane_studies::lines::diagnosis();
    let mut all: Vec<(String, f64)> = Vec::new();
    for record in lines.lines().filter_map(|l| serde_json::from_str::<Value>(l).ok()) {
        for h in record["hidden"].as_array().into_iter().flatten() {
            let (Some(name), Some(strength)) = (h["name"].as_str(), h["nameable"].as_f64()) else { continue };
            if !all.iter().any(|a| a.0 == name) {
                all.push((name.to_owned(), strength));
            }
        }
    }
    all
}

pub(crate) fn judged(job: &Job, attempt: u64, smallest: &[(String, f64)], keep: Option<&Path>) -> Value {
    let seed = job.seed() ^ attempt.wrapping_mul(0x9E37_79B9_7F4A_7C15);
    let factors = Factors::drawn(seed);
    let mut physics = factors.physics();
    let mut hidden = Vec::new();
    for (i, kind) in job.kinds.iter().enumerate() {
        let u = [1, 2, 3].map(|k| uniform(seed, 10 * i as u64 + k));
        let times = STRENGTHS.0 * (STRENGTHS.1 / STRENGTHS.0).powf(uniform(seed, 100 + i as u64));
        let own = smallest.iter().find(|s| s.0 == kind.name).map(|s| s.1 * times);
        let strength = own.map_or(kind.largest, |s| s.min(kind.largest));
        (kind.set)(&mut physics, strength, u);
        hidden.push(json!({"name": kind.name, "strength": strength}));
    }
    let sensor = Sensor::new(physics, SIDE, SIDE, seed);
    let own = tempfile::tempdir().unwrap();
    let folder = keep.map_or_else(|| own.path().to_owned(), |keep| keep.join(job.id()));
    let first = lab::take(&sensor, &factors, 0, &folder.join("0"));
    let second = factors.second_set.then(|| lab::take(&sensor, &factors, 1, &folder.join("1")));
    let camera = factors.camera_file.then(|| lab::camera_file(&first, &factors));
    if let (Some(_), Some(camera)) = (keep, &camera) {
        let saved = spikelane::presets::to_toml(camera).unwrap();
        std::fs::write(folder.join("camera.toml"), saved.text).unwrap();
    }
    let options = DiagnoseOptions { camera: camera.as_ref(), ..DiagnoseOptions::default() };
    let found = diagnose(&first, second.as_ref(), options, &mut |_, _| {});
    let said = match &found {
        Ok(diagnosis) => serde_json::to_value(diagnosis).unwrap(),
        Err(error) => json!({ "error": error.to_string() }),
    };
    let levels: serde_json::Map<String, Value> =
        factors.levels().into_iter().map(|(name, level)| (name.to_owned(), level.into())).collect();
    // What a protocol cannot show is no miss.
    let cannot = |name: &str| said["not_testable"].as_array().into_iter().flatten().any(|n| n == name);
    let shown = job.kinds.iter().filter(|k| job.class != "outside" && !cannot(k.name)).count();
    let hidden = Value::from(hidden);
    let mut score = score::of(&hidden, &said);
    score["shown"] = shown.into();
    json!({"id": job.id(), "class": job.class, "attempt": attempt, "factors": levels, "hidden": hidden, "score": score, "said": kept(said)})
}

/// What a table and a question about a failure need.
fn kept(said: Value) -> Value {
    let keys =
        ["verdict", "effects", "misfits", "unknown", "gap", "faults", "seconds", "error", "not_testable"];
    let own = said.as_object().into_iter().flatten().filter(|(key, _)| keys.contains(&key.as_str()));
    Value::Object(own.map(|(key, value)| (key.clone(), value.clone())).collect())
}
