//! Records a hidden sensor and diagnoses it.

use serde_json::{Value, json};
use spikelane_calibrate::RecordingSet;
use spikelane_diagnose::{
    DiagnoseOptions, NullModel, ReadoutSelection, RecordingPart, Setup, diagnose, published_camera,
};

use super::hidden_sensor::{Physics, Sensor, Size, changes_bits, write_set};
use super::jobs::{SensorJob, uniform_hash};
use super::phases::PhaseTimer;
use super::{score, version};

/// Returns the null model. All sensors share its simulations, because they have the same protocol and the same
/// published camera model.
pub(crate) fn shared_null_model(size: Size, phases: &mut PhaseTimer) -> NullModel {
    let folder = tempfile::tempdir().unwrap();
    write_set(&Sensor::new(Physics::default(), size.width, size.height, 1), size, 0, folder.path());
    let set = RecordingSet::open(&folder.path().join("recordings.toml")).unwrap();
    let setup = Setup::new(&set, RecordingPart::Whole, ReadoutSelection::Leading).unwrap();
    let camera = published_camera(&setup).unwrap();
    NullModel::new(setup, camera, 1, &mut |what, _| phases.enter(what)).unwrap()
}

/// Returns the record of the sensor of `job` with its effects at `strengths`.
///
/// Each strength is paired with the smallest detectable one.
pub(crate) fn diagnose_hidden(
    job: &SensorJob,
    strengths: &[(f64, Option<f64>)],
    reference: &NullModel,
    size: Size,
    phases: &mut PhaseTimer,
) -> Value {
    let seed = job.seed();
    phases.enter("hidden sensor");
    let mut physics = Physics::default();
    let mut hidden = Vec::new();
    for (i, (kind, (strength, smallest))) in job.kinds.iter().zip(strengths).enumerate() {
        let u = [1, 2, 3].map(|k| uniform_hash(seed, 10 * i as u64 + k));
        (kind.set)(&mut physics, *strength, u);
        let mut single = Physics::default();
        (kind.set)(&mut single, *strength, u);
        let changes = changes_bits(&single, size, seed);
        hidden.push(
            json!({ "name": kind.name, "strength": strength, "detectable_strength": smallest, "changes_bits": changes }),
        );
    }
    let sensor = Sensor::new(physics, size.width, size.height, seed);
    let folder = tempfile::tempdir().unwrap();
    let sets = [0, 1].map(|take| {
        let path = folder.path().join(format!("take{take}"));
        write_set(&sensor, size, take, &path);
        RecordingSet::open(&path.join("recordings.toml")).unwrap()
    });
    let options = DiagnoseOptions { null_model: Some(reference), seed: 1, ..DiagnoseOptions::default() };
    let outcome = diagnose(&sets[0], Some(&sets[1]), options, &mut |what, _| phases.enter(what));
    phases.enter("");
    let report = match &outcome {
        Ok(diagnosis) => serde_json::to_value(diagnosis).unwrap(),
        Err(error) => json!({ "error": error.to_string() }),
    };
    let hidden = Value::from(hidden);
    let steps = outcome.as_ref().map_or_else(|_| Vec::new(), |d| d.traces.step_outcomes.clone());
    json!({
        "version": version::version_of_diagnosis(&report),
        "id": job.id(),
        "class": job.class,
        "score": score::score(&hidden, &report),
        "hidden": hidden,
        "steps": steps,
        "diagnosis": report,
    })
}
