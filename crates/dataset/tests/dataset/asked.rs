//! What follows from what a dataset is asked to be: splits, names, cameras.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

use spikelane::{Kind, presets};
use spikelane_dataset::{Cameras, DatasetOptions, Drives, Split, Splits, Work};
use spikelane_scene::Lighting;

use crate::make::{drives, inputs, make, options};

#[test]
fn the_split_of_scenes_is_exact_and_of_inputs_stays() {
    let ids = |n: u32| -> Vec<String> { (0..n).map(|i| format!("scene-{i:04}")).collect() };
    let tests = |share: f64, n: u32, work: Work| {
        let splits = Splits { test: share, ..Splits::default() };
        let options = options(Path::new("nowhere"), work).with_splits(splits);
        options.splits(&ids(n)).into_iter().map(|s| s == Split::Test).collect::<Vec<_>>()
    };
    let count = |share, n| tests(share, n, drives(n)).into_iter().filter(|t| *t).count();
    assert_eq!(
        [count(0.2, 30), count(0.5, 7), count(0.01, 5), count(0.0, 5), count(1.0, 5)],
        [6, 4, 1, 0, 5]
    );
    assert_eq!(count(0.99, 3), 2, "one is left to train with");
    // Inputs that are added later move no other one.
    let few = tests(0.3, 20, inputs(Path::new("clips")));
    assert_eq!(tests(0.3, 50, inputs(Path::new("clips")))[..20], few);
}

#[test]
fn split_by_light_every_light_gives_its_share() {
    let splits = Splits { validation: 0.15, test: 0.25, by_light: true };
    let work = Work::Drives(Drives::rhdd().with_sequences(400));
    let options = options(Path::new("nowhere"), work).with_splits(splits);
    let ids: Vec<String> = (0..400).map(|i| options.scene_id(i)).collect();
    let found = options.splits(&ids);
    let count = |split| found.iter().filter(|s| **s == split).count();
    assert_eq!([count(Split::Test), count(Split::Validation), count(Split::Train)], [100, 60, 240]);
    let mut lights: BTreeMap<&str, [f64; 3]> = BTreeMap::new();
    for (id, split) in ids.iter().zip(&found) {
        let counts = lights.entry(Lighting::drawn(options.seed_of_scene(id)).name()).or_default();
        counts[0] += 1.0;
        counts[1] += f64::from(u8::from(*split == Split::Test));
        counts[2] += f64::from(u8::from(*split == Split::Validation));
    }
    assert_eq!(lights.len(), Lighting::ALL.len());
    for (light, [all, tests, validations]) in lights {
        assert!((tests - 0.25 * all).abs() <= 1.0, "{light}: {tests} of {all}");
        // Of what testing leaves, which is itself off by less than one.
        assert!((validations - 0.15 * all).abs() <= 2.0, "{light}: {validations} of {all}");
    }
    let error = options_of_inputs().with_splits(splits).check().unwrap_err();
    assert_eq!(error.kind(), Kind::Usage);
}

fn options_of_inputs() -> DatasetOptions {
    options(Path::new("nowhere"), inputs(Path::new("clips")))
}

#[test]
fn shares_beyond_one_are_refused() {
    for (validation, test) in [(0.5, 0.6), (-0.1, 0.2), (f64::NAN, 0.0), (0.0, 1.01)] {
        let splits = Splits { validation, test, by_light: false };
        let error = options_of_inputs().with_splits(splits).check().unwrap_err();
        assert_eq!(error.kind(), Kind::Usage, "{validation} {test}");
    }
}

#[test]
fn names_have_as_many_digits_as_the_last_one_and_four_at_least() {
    let named = |sequences, index| {
        options(Path::new("nowhere"), Work::Drives(Drives::rhdd().with_sequences(sequences))).scene_id(index)
    };
    assert_eq!(named(2, 1), "scene-0001");
    assert_eq!(named(10_000, 9_999), "scene-9999");
    assert_eq!(named(10_001, 7), "scene-00007");
    assert_eq!(named(1_000_000, 7), "scene-000007");
}

#[test]
fn cameras_follow_from_names_and_have_one_size() {
    let dir = tempfile::tempdir().unwrap();
    let mut drawn = options(&dir.path().join("drawn"), drives(3));
    drawn.cameras = Cameras::Drawn(presets::Distribution::default());
    make(&drawn).unwrap();
    let camera = |set: &str, id: &str| -> serde_json::Value {
        let path = dir.path().join(set).join("sequences").join(id).join("stream.json");
        serde_json::from_slice(&fs::read(path).unwrap()).unwrap()
    };
    let seen: BTreeSet<String> =
        (0..3).map(|i| camera("drawn", &format!("scene-000{i}"))["camera"].to_string()).collect();
    assert_eq!(seen.len(), 3);
    assert_eq!(camera("drawn", "scene-0001")["seeds"]["camera"], drawn.camera_seed_of("scene-0001"));
    let mut several = options(&dir.path().join("several"), drives(1));
    let other = presets::builtin("ideal").unwrap();
    several.cameras = Cameras::Several(vec![several.camera.clone(), other.clone()]);
    let error = make(&several).unwrap_err();
    assert!(error.kind() == Kind::Config && error.to_string().contains("400x250"), "{error}");
    let mut small = other;
    small.sensor.geometry = several.camera.sensor.geometry;
    several.cameras = Cameras::Several(vec![several.camera.clone(), small]);
    let names: BTreeSet<String> =
        (0..20).map(|i| several.camera_of(&format!("scene-{i:04}")).unwrap().name).collect();
    assert_eq!(names.len(), 2);
}
