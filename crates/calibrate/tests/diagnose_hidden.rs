//! A small part of the blind study: a clean sensor, a few hidden effects, and one that no catalogue holds.
//!
//! The study's 48x48 pixels and 4,000 readouts are cut to 24x24 and 2,048: effects are hidden at strengths
//! that are plain there.

#[allow(unreachable_pub, reason = "shared by several test binaries")]
mod hidden_sensor;

use std::sync::LazyLock;

use hidden_sensor::{Physics, Sensor, Size, kind, write_set};
use spikelane::Camera;
use spikelane_calibrate::RecordingSet;
use spikelane_calibrate::diagnose::{
    DiagnoseOptions, Diagnosis, Extent, Part, Reference, Setup, Verdict, diagnose, published,
};

const SIZE: Size = Size { width: 24, height: 24, readouts: 2048 };

/// Two takes of a sensor with effects of some strengths.
fn sets(hidden: &[(&str, f64)], seed: u64) -> (tempfile::TempDir, [RecordingSet; 2]) {
    sets_of(SIZE, hidden, seed)
}

fn sets_of(size: Size, hidden: &[(&str, f64)], seed: u64) -> (tempfile::TempDir, [RecordingSet; 2]) {
    let mut physics = Physics::default();
    for (name, strength) in hidden {
        (kind(name).set)(&mut physics, *strength, [0.7, 0.5, 0.5]);
    }
    takes(size, physics, seed)
}

fn takes(size: Size, physics: Physics, seed: u64) -> (tempfile::TempDir, [RecordingSet; 2]) {
    let sensor = Sensor::new(physics, size.width, size.height, seed);
    let folder = tempfile::tempdir().unwrap();
    let sets = [0, 1].map(|take| {
        let path = folder.path().join(format!("{take}"));
        write_set(&sensor, size, take, &path);
        RecordingSet::open(&path.join("recordings.toml")).unwrap()
    });
    (folder, sets)
}

static REFERENCE: LazyLock<Reference> = LazyLock::new(|| {
    let (_folder, sets) = sets(&[], 1);
    let setup = Setup::of(&sets[0], Part::Whole, Extent::Everything).unwrap();
    let camera = published(&setup).unwrap();
    Reference::new(setup, camera, 7, &mut |_, _| {}).unwrap()
});

fn of(hidden: &[(&str, f64)], seed: u64) -> Diagnosis {
    let (_folder, sets) = sets(hidden, seed);
    beside_the_reference(&sets)
}

fn beside_the_reference(sets: &[RecordingSet; 2]) -> Diagnosis {
    let options = DiagnoseOptions {
        reference: Some(&REFERENCE),
        seed: 7,
        extent: Extent::Everything,
        ..DiagnoseOptions::default()
    };
    diagnose(&sets[0], Some(&sets[1]), options, &mut |_, _| {}).unwrap()
}

/// Both takes against a camera file.
fn against(camera: &Camera, sets: &[RecordingSet; 2]) -> Diagnosis {
    let options = DiagnoseOptions {
        camera: Some(camera),
        seed: 7,
        extent: Extent::Everything,
        ..DiagnoseOptions::default()
    };
    diagnose(&sets[0], Some(&sets[1]), options, &mut |_, _| {}).unwrap()
}

/// Comments may name the library, code may not.
#[test]
fn the_hidden_sensor_shares_no_code_with_the_library() {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/hidden_sensor");
    let files: Vec<_> = std::fs::read_dir(folder).unwrap().map(|f| f.unwrap().path()).collect();
    assert!(files.len() >= 4, "{files:?}");
    for file in files {
        let text = std::fs::read_to_string(&file).unwrap();
        let code = text.lines().map(|l| l.split("//").next().unwrap_or_default());
        let named: Vec<&str> = code.filter(|l| l.contains("spikelane") || l.contains("crate::")).collect();
        assert!(named.is_empty(), "{}: {named:?}", file.display());
    }
}

#[test]
fn clean_sensors_raise_no_alarm() {
    // Chance of an alarm: three limits of one in a thousand, for three sensors.
    for seed in 11..14 {
        let found = of(&[], seed);
        assert_eq!(found.verdict, Verdict::Agrees, "sensor {seed}: {found:?}");
    }
}

#[test]
fn a_hidden_effect_is_named_and_the_gap_shrinks() {
    for (name, strength) in [("false_spikes", 1e-3), ("row_noise", 0.02), ("readout_jitter", 0.03)] {
        let found = of(&[(name, strength)], 21);
        let named = found.effects.iter().any(|e| e.name == name || e.tied_with.contains(&name));
        assert!(named, "{name}: {:?} {:?} {:?}", found.verdict, found.effects, found.unknown);
        let held = &found.gap.heldout;
        assert!(
            held[held.len() - 1] - found.gap.floor < 0.3 * (held[0] - found.gap.floor),
            "{name}: {:?}",
            found.gap
        );
    }
}

/// A fit with all rows alike left 4,726 where 410 are the floor, and the name was a likeness.
#[test]
fn jitter_of_a_few_rows_is_named_plainly_and_their_number_told() {
    // 8 of 24 rows have more than half of the width.
    let physics = Physics { undecided: (0.03, 0.0, 7.0), ..Physics::default() };
    let (_folder, sets) = takes(SIZE, physics, 23);
    let found = beside_the_reference(&sets);
    let effect = found.effects.iter().find(|e| e.name == "readout_jitter" && !e.resembles);
    let said = &effect.unwrap_or_else(|| panic!("{found:?}")).parameters;
    let spread = said.iter().find(|p| p.name == "spread").unwrap();
    assert!((5.5..9.0).contains(&spread.value), "{said:?}");
    assert!(spread.low > 4.0 && spread.high < 14.0, "{said:?}");
}

/// Sensors of the study were said to have -0.71 to -0.85, the furthest end of an interval at -0.96.
#[test]
fn a_full_correlation_of_gain_and_dark_current_is_not_cut_short() {
    let found = of(&[("gain_dark_correlation", 1.0)], 61);
    let effect = found.effects.iter().find(|e| e.name == "gain_dark_correlation");
    let said = &effect.unwrap_or_else(|| panic!("{found:?}")).parameters[0];
    assert!(said.low.abs().max(said.high.abs()) > 0.97 && said.value.abs() > 0.85, "{said:?}");
}

#[test]
fn a_camera_file_with_twice_the_spread_of_gain_is_said_to_be_wrong() {
    let (_folder, sets) = sets(&[], 52);
    let setup = Setup::of(&sets[0], Part::Whole, Extent::Everything).unwrap();
    let camera = published(&setup).unwrap();
    let (right, prnu) =
        (camera.effect("prnu").unwrap().get("sigma").unwrap(), camera.effect("prnu").unwrap());
    let wrong = camera.clone().with(prnu.clone().with("sigma", 2.0 * right).unwrap());
    let found = against(&wrong, &sets);
    let said: Vec<&str> = found.misfits.iter().map(|m| m.parameter.as_str()).collect();
    assert_eq!(
        (found.verdict, said.as_slice()),
        (Verdict::Explained, ["prnu.sigma"].as_slice()),
        "{found:?}"
    );
    // 576 pixels tell it to some 8 %.
    assert!((found.misfits[0].fitted / right - 1.0).abs() < 0.25, "{:?}", found.misfits);
}

/// By their probability alone lost readouts made each recording stray so far that nothing beside them was beyond it.
#[test]
fn what_stands_beside_lost_or_repeated_readouts_is_found_and_these_are_counted() {
    for (name, other, strength) in
        [("dropped_readouts", "missed_spikes", 0.004), ("repeated_readouts", "false_spikes", 0.001)]
    {
        let found = of(&[(name, 0.003), (other, strength)], 71);
        let named: Vec<&str> = found.effects.iter().filter(|e| !e.resembles).map(|e| e.name).collect();
        assert!(named.contains(&name) && named.contains(&other), "{:?} {:?}", found.verdict, found.effects);
        let said = found.effects.iter().find(|e| e.name == name).unwrap();
        // Some 100 events: five deviations of their number.
        let p = &said.parameters[0];
        assert!((p.value / 0.003 - 1.0).abs() < 0.5 && p.low < p.value && p.value < p.high, "{p:?}");
        assert!(said.evidence.contains(" found in "), "{}", said.evidence);
    }
}

/// Of the study's sensors with noise that is strong in a part of the pixels, three of ten were said to lose readouts.
#[test]
fn noise_that_is_strong_in_some_pixels_is_no_lost_readout() {
    let found = of(&[("two populations of threshold noise", 4.0)], 81);
    assert!(!matches!(found.verdict, Verdict::Agrees), "{:?}", found.gap);
    let events = found.effects.iter().any(|e| e.name.ends_with("_readouts"));
    assert!(!events, "{:?}", found.effects);
}

/// The base model's numbers took in what the clamp's slope left, and a likeness of a partial reset of 0.56 was said.
#[test]
fn a_clamp_far_from_where_its_slope_is_taken_is_found() {
    let found = of(&[("saturation_clamp", 0.757)], 94);
    let named: Vec<&str> = found.effects.iter().filter(|e| !e.resembles).map(|e| e.name).collect();
    assert_eq!(named, ["saturation_clamp"], "{:?} {:?}", found.verdict, found.effects);
    let said = &found.effects[0].parameters[0];
    assert!((said.value - 1.243).abs() < 0.01, "{said:?}");
}

/// A right camera's numbers take over what they can of an effect that it lacks. Judged all the same, this one was said to have 0.22 of the
/// light's noise and 0.15 of the thresholds' spread that it has.
#[test]
fn a_right_camera_is_not_blamed_for_strong_row_noise() {
    let (_folder, sets) = sets_of(Size { width: 36, height: 36, ..SIZE }, &[("row_noise", 0.02)], 62);
    let setup = Setup::of(&sets[0], Part::Whole, Extent::Everything).unwrap();
    let camera = published(&setup).unwrap();
    let found = against(&camera, &sets);
    assert!(found.effects.iter().any(|e| e.name == "row_noise" && !e.resembles), "{:?}", found.effects);
    assert!(found.misfits.is_empty(), "{:?}", found.misfits);
}

#[test]
fn threads_change_no_number() {
    let of_threads = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let mut found = pool.install(|| of(&[("dead_pixels", 0.02)], 41));
        found.seconds = 0.0;
        format!("{found:?}")
    };
    let alone = of_threads(1);
    assert!(alone.contains("dead_pixels"), "{alone}");
    assert_eq!(alone, of_threads(3));
}

#[test]
fn what_no_catalogue_holds_is_called_unknown() {
    let found = of(&[("two-tap parity", 0.02)], 31);
    assert!(matches!(found.verdict, Verdict::Unknown | Verdict::PartlyExplained), "{:?}", found.verdict);
    assert!(found.effects.iter().all(|e| e.resembles), "{:?}", found.effects);
    assert!(!found.unknown.is_empty());
}

#[test]
fn of_large_recordings_the_first_readouts_are_judged_unless_all_are_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    // 32,000 pixels: 35 million pixel-readouts are 1,093 readouts, and 1,250 are judged at least.
    for name in ["dark.dat", "square.dat"] {
        std::fs::write(folder.path().join(name), vec![0; 200 * 160 / 8 * 5100]).unwrap();
    }
    let set = "width = 200\nheight = 160\nreadout_hz = 20000.0\n[[recording]]\nfile = \"dark.dat\"\nlight = 0.0\n\
        [[recording]]\nfile = \"square.dat\"\nlight = { kind = \"square\", half_period = 400, high = 0.5, low = 0.1 }\n";
    std::fs::write(folder.path().join("recordings.toml"), set).unwrap();
    let set = RecordingSet::open(&folder.path().join("recordings.toml")).unwrap();
    let judged = |part, extent| {
        let setup = Setup::of(&set, part, extent).unwrap();
        let of = |k: usize| (setup.scenes[k].skip, setup.scenes[k].readouts);
        (of(0), of(1), setup.first_readouts)
    };
    // Of a square wave five half periods.
    assert_eq!(judged(Part::Whole, Extent::Enough), ((0, 1250), (0, 2000), Some([1250, 2000])));
    assert_eq!(judged(Part::Whole, Extent::Everything), ((0, 5100), (0, 5100), None));
    // Both parts of a recording that is cut in the middle have as many, a square wave's in whole periods.
    assert_eq!(judged(Part::First, Extent::Enough), ((0, 1250), (0, 1600), Some([2500, 4000])));
    assert_eq!(judged(Part::Second, Extent::Enough), ((1250, 1250), (1600, 1600), Some([2500, 4000])));
}
