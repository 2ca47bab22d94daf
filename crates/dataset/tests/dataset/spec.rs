//! Tests of the properties that the options of a dataset determine. The properties are splits, names and cameras.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

use spikelane::{ErrorKind, presets};
use spikelane_dataset::{Cameras, Content, DatasetOptions, SceneContent, Split, Splits};
use spikelane_scene::Lighting;

use crate::generate::{generate_dataset, inputs, options, scene_content};

#[test]
fn scene_splits_are_exact_and_input_splits_are_stable() {
    let ids = |n: u32| -> Vec<String> { (0..n).map(|i| format!("scene-{i:04}")).collect() };
    let tests = |share: f64, n: u32, work: Content| {
        let splits = Splits { test: share, ..Splits::default() };
        let options = options(Path::new("nowhere"), work).with_splits(splits);
        options.splits(&ids(n)).into_iter().map(|s| s == Split::Test).collect::<Vec<_>>()
    };
    let count = |share, n| tests(share, n, scene_content(n)).into_iter().filter(|t| *t).count();
    assert_eq!(
        [count(0.2, 30), count(0.5, 7), count(0.01, 5), count(0.0, 5), count(1.0, 5)],
        [6, 4, 1, 0, 5]
    );
    assert_eq!(count(0.99, 3), 2, "one is left to train with");
    // If inputs are added later, the splits of the existing inputs must not change.
    let few = tests(0.3, 20, inputs(Path::new("clips")));
    assert_eq!(tests(0.3, 50, inputs(Path::new("clips")))[..20], few);
}

#[test]
fn stratified_splits_have_equal_shares_of_each_lighting() {
    let splits = Splits { validation: 0.15, test: 0.25, stratify_by_lighting: true };
    let work = Content::Scenes(SceneContent::rhdd().with_sequences(400));
    let options = options(Path::new("nowhere"), work).with_splits(splits);
    let ids: Vec<String> = (0..400).map(|i| options.scene_id(i)).collect();
    let assigned = options.splits(&ids);
    let count = |split| assigned.iter().filter(|s| **s == split).count();
    assert_eq!([count(Split::Test), count(Split::Validation), count(Split::Train)], [100, 60, 240]);
    let mut lights: BTreeMap<&str, [f64; 3]> = BTreeMap::new();
    for (id, split) in ids.iter().zip(&assigned) {
        let counts = lights.entry(Lighting::from_seed(options.scene_seed_for(id)).name()).or_default();
        counts[0] += 1.0;
        counts[1] += f64::from(u8::from(*split == Split::Test));
        counts[2] += f64::from(u8::from(*split == Split::Validation));
    }
    assert_eq!(lights.len(), Lighting::ALL.len());
    for (light, [all, tests, validations]) in lights {
        assert!((tests - 0.25 * all).abs() <= 1.0, "{light}: {tests} of {all}");
        // The validation scenes are selected from the scenes that are not for testing. The number of scenes of this
        // preset that are not for testing may differ by one, so the tolerance is two.
        assert!((validations - 0.15 * all).abs() <= 2.0, "{light}: {validations} of {all}");
    }
    let error = input_options().with_splits(splits).check().unwrap_err();
    assert_eq!(error.kind(), ErrorKind::Usage);
}

fn input_options() -> DatasetOptions {
    options(Path::new("nowhere"), inputs(Path::new("clips")))
}

#[test]
fn shares_beyond_one_are_refused() {
    for (validation, test) in [(0.5, 0.6), (-0.1, 0.2), (f64::NAN, 0.0), (0.0, 1.01)] {
        let splits = Splits { validation, test, stratify_by_lighting: false };
        let error = input_options().with_splits(splits).check().unwrap_err();
        assert_eq!(error.kind(), ErrorKind::Usage, "{validation} {test}");
    }
}

#[test]
fn names_have_as_many_digits_as_the_last_one_and_four_at_least() {
    let scene_id = |sequences, index| {
        options(Path::new("nowhere"), Content::Scenes(SceneContent::rhdd().with_sequences(sequences)))
            .scene_id(index)
    };
    assert_eq!(scene_id(2, 1), "scene-0001");
    assert_eq!(scene_id(10_000, 9_999), "scene-9999");
    assert_eq!(scene_id(10_001, 7), "scene-00007");
    assert_eq!(scene_id(1_000_000, 7), "scene-000007");
}

#[test]
fn cameras_follow_from_names_and_have_one_size() {
    let dir = tempfile::tempdir().unwrap();
    let mut drawn = options(&dir.path().join("drawn"), scene_content(3));
    drawn.cameras = Cameras::Distribution(presets::CameraDistribution::default());
    generate_dataset(&drawn).unwrap();
    let camera = |set: &str, id: &str| -> serde_json::Value {
        let path = dir.path().join(set).join("sequences").join(id).join("stream.json");
        serde_json::from_slice(&fs::read(path).unwrap()).unwrap()
    };
    let cameras: BTreeSet<String> =
        (0..3).map(|i| camera("drawn", &format!("scene-000{i}"))["camera"].to_string()).collect();
    assert_eq!(cameras.len(), 3);
    assert_eq!(camera("drawn", "scene-0001")["seeds"]["camera"], drawn.camera_seed_for("scene-0001"));
    let mut several = options(&dir.path().join("several"), scene_content(1));
    let other = presets::builtin("ideal").unwrap();
    several.cameras = Cameras::List(vec![several.camera.clone(), other.clone()]);
    let error = generate_dataset(&several).unwrap_err();
    assert!(error.kind() == ErrorKind::Config && error.to_string().contains("400x250"), "{error}");
    let mut small = other;
    small.sensor.geometry = several.camera.sensor.geometry;
    several.cameras = Cameras::List(vec![several.camera.clone(), small]);
    let names: BTreeSet<String> =
        (0..20).map(|i| several.camera_for(&format!("scene-{i:04}")).unwrap().name).collect();
    assert_eq!(names.len(), 2);
}
