//! What a diagnosis says of a laboratory: lamps, scenes, files and starts that are no part of the camera.
//!
//! Sensors are clean ones of the independent simulator; only their recordings are at fault.

#[allow(unreachable_pub, reason = "shared by several test binaries")]
mod hidden_sensor;

use std::path::Path;

use hidden_sensor::{Physics, Scene, Sensor, Size, record, write_set};
use spikelane::{Seeds, presets};
use spikelane_calibrate::diagnose::{DiagnoseOptions, Diagnosis, FaultKind, Verdict, diagnose};
use spikelane_calibrate::{Protocol, RecordingSet};

const SIZE: Size = Size { width: 24, height: 24, readouts: 2048 };

fn sensor(physics: Physics) -> Sensor {
    Sensor::new(physics, SIZE.width, SIZE.height, 5)
}

/// Two takes of a clean sensor; `spoil` writes over a recording of the first one.
fn diagnosed(spoil: impl Fn(&Path)) -> Diagnosis {
    diagnosed_of(Physics::default(), spoil)
}

fn diagnosed_of(physics: Physics, spoil: impl Fn(&Path)) -> Diagnosis {
    let folder = tempfile::tempdir().unwrap();
    let sets = [0, 1].map(|take| {
        let path = folder.path().join(format!("{take}"));
        write_set(&sensor(physics.clone()), SIZE, take, &path);
        if take == 0 {
            spoil(&path);
        }
        RecordingSet::open(&path.join("recordings.toml")).unwrap()
    });
    diagnose(&sets[0], Some(&sets[1]), DiagnoseOptions::default(), &mut |_, _| {}).unwrap()
}

/// One fault of one recording, which was set aside, and nothing said of the camera.
fn only(found: &Diagnosis, kind: FaultKind, file: &str) {
    let said: Vec<_> = found.faults.iter().map(|f| (f.kind, f.recording.as_deref(), f.set_aside)).collect();
    assert_eq!(said, [(kind, Some(file), true)], "{:?}", found.faults);
    assert!(found.effects.is_empty() && found.misfits.is_empty(), "{:?} {:?}", found.effects, found.misfits);
    assert_eq!(found.verdict, Verdict::Agrees, "{:?}", found.unknown);
}

#[test]
fn a_level_that_is_off_by_three_per_cent_is_its_lamps() {
    let found = diagnosed(|folder| {
        let bits = record(&sensor(Physics::default()), Scene::Flat(0.309), SIZE.readouts, 3);
        std::fs::write(folder.join("flat_30.dat"), bits).unwrap();
    });
    only(&found, FaultKind::LightOff, "flat_30.dat");
    assert!(
        found.faults[0].words.contains("+3.") || found.faults[0].words.contains("+2.9"),
        "{:?}",
        found.faults
    );
}

#[test]
fn a_lamp_that_drifts_by_one_per_cent_in_one_recording_is_no_drift_of_the_gain() {
    let found = diagnosed(|folder| {
        let drifting = sensor(Physics { drift: 0.01, ..Physics::default() });
        std::fs::write(folder.join("flat_60.dat"), record(&drifting, Scene::Flat(0.6), SIZE.readouts, 4))
            .unwrap();
    });
    only(&found, FaultKind::LightDrifts, "flat_60.dat");
}

#[test]
fn a_scene_that_moves_is_said_to_move() {
    let found = diagnosed(|folder| {
        let half = |high, low| {
            record(
                &sensor(Physics::default()),
                Scene::Checkerboard { high, low, cell: 6 },
                SIZE.readouts / 2,
                3,
            )
        };
        let bits = [half(0.33, 0.27), half(0.27, 0.33)].concat();
        std::fs::write(folder.join("flat_30.dat"), bits).unwrap();
    });
    only(&found, FaultKind::Moves, "flat_30.dat");
}

#[test]
fn a_recording_of_another_frame_size_is_said_to_be_one() {
    let found = diagnosed(|folder| {
        let larger = Sensor::new(Physics::default(), 2 * SIZE.width, 2 * SIZE.height, 5);
        let bits = record(&larger, Scene::Flat(0.3), SIZE.readouts / 4, 3);
        std::fs::write(folder.join("flat_30.dat"), bits).unwrap();
    });
    only(&found, FaultKind::OtherPattern, "flat_30.dat");
}

#[test]
fn a_lamp_on_the_mains_is_said_to_be_one() {
    let found = diagnosed_of(Physics { flicker: (0.03, 100.0, 0.2), ..Physics::default() }, |_| {});
    let said: Vec<FaultKind> = found.faults.iter().map(|f| f.kind).collect();
    assert_eq!(said, [FaultKind::LightSwings], "{:?}", found.faults);
    assert!(found.faults[0].words.contains("twice the mains' 50 Hz"), "{:?}", found.faults);
    let others: Vec<_> = found.effects.iter().filter(|e| e.name != "flicker").collect();
    assert!(others.is_empty(), "{others:?}");
}

/// The published code's pixels begin with charges of 0 to 1 fC, a fifth of a threshold.
#[test]
fn where_pixels_began_is_no_part_of_the_camera() {
    let mut camera = presets::load("scsim-code").unwrap();
    camera.sensor =
        spikelane::Sensor { geometry: spikelane::Geometry::new(32, 32).unwrap(), ..camera.sensor };
    let folder = tempfile::tempdir().unwrap();
    let sets = [1, 2].map(|take| {
        let seeds = Seeds { camera: 3, shot: take, sequence: 0 };
        let path = folder.path().join(format!("{take}"));
        let set = Protocol::recommended(2400).record(&camera, seeds, &path, false, &mut |_, _| {});
        RecordingSet::open(&set.unwrap()).unwrap()
    });
    for camera in [None, Some(&camera)] {
        let options = DiagnoseOptions { camera, ..DiagnoseOptions::default() };
        let found = diagnose(&sets[0], Some(&sets[1]), options, &mut |_, _| {}).unwrap();
        assert_eq!(
            found.verdict,
            Verdict::Agrees,
            "{:?} {:?} {:?}",
            found.effects,
            found.misfits,
            found.unknown
        );
        assert!(found.notes.iter().any(|n| n.contains("began together")), "{:?}", found.notes);
        let charge = found.camera.effect("start_phase").unwrap().get("charge").unwrap();
        assert_eq!(charge, if camera.is_some() { 1.0 } else { 0.0 });
    }
}

/// Pixels whose resets lose charge lock to the readouts, and those that began together stay so. Four levels were said to be `dead_time`, and
/// with pixels that begin anywhere the name was a likeness beside power of the totals at 22 deviations.
#[test]
fn pixels_that_began_together_and_lock_to_the_readouts_are_told_on_four_levels() {
    let mut camera = presets::load("scsim-code").unwrap();
    camera.sensor =
        spikelane::Sensor { geometry: spikelane::Geometry::new(32, 32).unwrap(), ..camera.sensor };
    let reset = spikelane::effects::find("partial_reset").unwrap().neutral();
    let hidden = camera.with(reset.with("lost_remainder", 0.1).unwrap());
    let folder = tempfile::tempdir().unwrap();
    let sets = [1, 2].map(|take| {
        let seeds = Seeds { camera: 4, shot: take, sequence: 0 };
        let path = folder.path().join(format!("{take}"));
        let set = Protocol::recommended(2400).record(&hidden, seeds, &path, false, &mut |_, _| {});
        let mut set = RecordingSet::open(&set.unwrap()).unwrap();
        let four = ["dark.dat", "flat_1000.dat", "flat_3000.dat", "flat_7400.dat"];
        set.recordings.retain(|r| four.iter().any(|name| r.file.ends_with(name)));
        assert_eq!(set.recordings.len(), 4);
        set
    });
    let found = diagnose(&sets[0], Some(&sets[1]), DiagnoseOptions::default(), &mut |_, _| {}).unwrap();
    let said: Vec<_> = found.effects.iter().map(|e| (e.name, e.resembles)).collect();
    assert_eq!(said, [("partial_reset", false)], "{:?} {:?}", found.effects, found.unknown);
    let strength = &found.effects[0].parameters[0];
    assert!(strength.low < 0.1 && 0.1 < strength.high, "{strength:?}");
}

/// Calibration cannot tell noise and electrons from four levels. The published camera's stood for them, and sensors with a tenth of its
/// electrons were said to show power of the totals and variance of intervals at 24 and 32 deviations.
#[test]
#[ignore = "a minute and a half: numbers that are guessed are moved step by step"]
fn a_camera_with_few_electrons_agrees_on_four_levels_without_its_file() {
    let plain = Physics::default();
    let physics = Physics {
        electrons: 0.1 * plain.electrons,
        dark_mean: 0.1 * plain.dark_mean,
        dark_spread: 0.1 * plain.dark_spread,
        ..plain
    };
    let folder = tempfile::tempdir().unwrap();
    let sets = [0, 1].map(|take| {
        let path = folder.path().join(format!("{take}"));
        write_set(&sensor(physics.clone()), SIZE, take, &path);
        let mut set = RecordingSet::open(&path.join("recordings.toml")).unwrap();
        let four = ["dark.dat", "flat_10.dat", "flat_30.dat", "flat_60.dat"];
        set.recordings.retain(|r| four.iter().any(|name| r.file.ends_with(name)));
        assert_eq!(set.recordings.len(), 4);
        set
    });
    let found = diagnose(&sets[0], Some(&sets[1]), DiagnoseOptions::default(), &mut |_, _| {}).unwrap();
    assert_eq!(found.verdict, Verdict::Agrees, "{:?} {:?}", found.effects, found.unknown);
    let numbers = found.about.unwrap().numbers;
    let quanta = numbers.iter().find(|n| n.parameter == "shot_noise.strength").unwrap();
    assert_eq!(serde_json::json!(quanta.source), "fitted", "{quanta:?}");
    assert!((5.0..20.0).contains(&quanta.value), "{quanta:?}");
}
