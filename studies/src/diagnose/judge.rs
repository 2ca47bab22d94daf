//! A hidden sensor is recorded, and what is said of it kept.

use serde_json::{Value, json};
use spikelane_calibrate::RecordingSet;
use spikelane_calibrate::diagnose::{DiagnoseOptions, Extent, Part, Reference, Setup, diagnose, published};

use super::hidden_sensor::{Physics, Sensor, Size, changes_bits, write_set};
use super::jobs::{Job, uniform};
use super::phases::Phases;
use super::{score, version};

/// The simulations that all sensors share: they have one protocol and one published model.
pub(crate) fn reference(size: Size, phases: &mut Phases) -> Reference {
    let folder = tempfile::tempdir().unwrap();
    write_set(&Sensor::new(Physics::default(), size.width, size.height, 1), size, 0, folder.path());
    let set = RecordingSet::open(&folder.path().join("recordings.toml")).unwrap();
    let setup = Setup::of(&set, Part::Whole, Extent::Enough).unwrap();
    let camera = published(&setup).unwrap();
    Reference::new(setup, camera, 1, &mut |what, _| phases.enter(what)).unwrap()
}

/// What is said of the sensor of `job` with its effects at `strengths`; beside each the smallest that can be named.
pub(crate) fn record(
    job: &Job,
    strengths: &[(f64, Option<f64>)],
    reference: &Reference,
    size: Size,
    phases: &mut Phases,
) -> Value {
    let seed = job.seed();
    phases.enter("hidden sensor");
    let mut physics = Physics::default();
    let mut hidden = Vec::new();
    for (i, (kind, (strength, smallest))) in job.kinds.iter().zip(strengths).enumerate() {
        let u = [1, 2, 3].map(|k| uniform(seed, 10 * i as u64 + k));
        (kind.set)(&mut physics, *strength, u);
        let mut alone = Physics::default();
        (kind.set)(&mut alone, *strength, u);
        let changes = changes_bits(&alone, size, seed);
        hidden.push(
            json!({ "name": kind.name, "strength": strength, "nameable": smallest, "changes_bits": changes }),
        );
    }
    let sensor = Sensor::new(physics, size.width, size.height, seed);
    let folder = tempfile::tempdir().unwrap();
    let sets = [0, 1].map(|take| {
        let path = folder.path().join(format!("take{take}"));
        write_set(&sensor, size, take, &path);
        RecordingSet::open(&path.join("recordings.toml")).unwrap()
    });
    let options = DiagnoseOptions { reference: Some(reference), seed: 1, ..DiagnoseOptions::default() };
    let found = diagnose(&sets[0], Some(&sets[1]), options, &mut |what, _| phases.enter(what));
    phases.enter("");
    let said = match &found {
        Ok(diagnosis) => serde_json::to_value(diagnosis).unwrap(),
        Err(error) => json!({ "error": error.to_string() }),
    };
    let hidden = Value::from(hidden);
    let steps = found.as_ref().map_or_else(|_| Vec::new(), |d| d.traces.steps.clone());
    json!({
        "version": version::of(&said),
        "id": job.id(),
        "class": job.class,
        "score": score::of(&hidden, &said),
        "hidden": hidden,
        "steps": steps,
        "said": said,
    })
}
