//! A small version of the blind study, with clean sensors, a few hidden effects, and one effect that is not in the
//! catalog.
//!
//! The study uses 48x48 pixels and 4,000 readouts. These tests use 24x24 pixels and 2,048 readouts. The strengths of the
//! hidden effects are clearly visible at this size.

#[allow(unreachable_pub, reason = "shared by several test binaries")]
mod hidden_sensor;

use std::sync::LazyLock;

use hidden_sensor::{Physics, Sensor, Size, kind, write_set};
use spikelane::Camera;
use spikelane_calibrate::RecordingSet;
use spikelane_diagnose::{
    DiagnoseOptions, Diagnosis, NullModel, ReadoutSelection, RecordingPart, Setup, Verdict, diagnose,
    published_camera,
};

const SIZE: Size = Size { width: 24, height: 24, readouts: 2048 };

/// Records two sets of a small sensor. `hidden` lists the names and strengths of its hidden effects.
fn small_recording_sets(hidden: &[(&str, f64)], seed: u64) -> (tempfile::TempDir, [RecordingSet; 2]) {
    recording_sets(SIZE, hidden, seed)
}

fn recording_sets(size: Size, hidden: &[(&str, f64)], seed: u64) -> (tempfile::TempDir, [RecordingSet; 2]) {
    let mut physics = Physics::default();
    for (name, strength) in hidden {
        (kind(name).set)(&mut physics, *strength, [0.7, 0.5, 0.5]);
    }
    record_takes(size, physics, seed)
}

fn record_takes(size: Size, physics: Physics, seed: u64) -> (tempfile::TempDir, [RecordingSet; 2]) {
    let sensor = Sensor::new(physics, size.width, size.height, seed);
    let folder = tempfile::tempdir().unwrap();
    let sets = [0, 1].map(|take| {
        let path = folder.path().join(format!("{take}"));
        write_set(&sensor, size, take, &path);
        RecordingSet::open(&path.join("recordings.toml")).unwrap()
    });
    (folder, sets)
}

static NULL_MODEL: LazyLock<NullModel> = LazyLock::new(|| {
    let (_folder, sets) = small_recording_sets(&[], 1);
    let setup = Setup::new(&sets[0], RecordingPart::Whole, ReadoutSelection::All).unwrap();
    let camera = published_camera(&setup).unwrap();
    NullModel::new(setup, camera, 7, &mut |_, _| {}).unwrap()
});

fn diagnose_hidden(hidden: &[(&str, f64)], seed: u64) -> Diagnosis {
    let (_folder, sets) = small_recording_sets(hidden, seed);
    diagnose_with_shared_null_model(&sets)
}

fn diagnose_with_shared_null_model(sets: &[RecordingSet; 2]) -> Diagnosis {
    let options = DiagnoseOptions {
        null_model: Some(&NULL_MODEL),
        seed: 7,
        readout_selection: ReadoutSelection::All,
        ..DiagnoseOptions::default()
    };
    diagnose(&sets[0], Some(&sets[1]), options, &mut |_, _| {}).unwrap()
}

/// Diagnoses both sets. The diagnosis starts with the camera file `camera`.
fn diagnose_against_camera(camera: &Camera, sets: &[RecordingSet; 2]) -> Diagnosis {
    let options = DiagnoseOptions {
        camera: Some(camera),
        seed: 7,
        readout_selection: ReadoutSelection::All,
        ..DiagnoseOptions::default()
    };
    diagnose(&sets[0], Some(&sets[1]), options, &mut |_, _| {}).unwrap()
}

/// Comments in these files may mention the library. Code must not use it.
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
    // Each of three sensors raises an alarm with a probability of at most one in a thousand for each of three limits.
    for seed in 11..14 {
        let diagnosis = diagnose_hidden(&[], seed);
        assert_eq!(diagnosis.verdict, Verdict::Agrees, "sensor {seed}: {diagnosis:?}");
    }
}

#[test]
fn a_hidden_effect_is_named_and_the_gap_shrinks() {
    for (name, strength) in [("false_spikes", 1e-3), ("row_noise", 0.02), ("readout_jitter", 0.03)] {
        let diagnosis = diagnose_hidden(&[(name, strength)], 21);
        let named = diagnosis.effects.iter().any(|e| e.name == name || e.ambiguous_with.contains(&name));
        assert!(named, "{name}: {:?} {:?} {:?}", diagnosis.verdict, diagnosis.effects, diagnosis.unexplained);
        let discrepancy = &diagnosis.discrepancy.held_out_set;
        assert!(
            discrepancy[discrepancy.len() - 1] - diagnosis.discrepancy.noise_floor
                < 0.3 * (discrepancy[0] - diagnosis.discrepancy.noise_floor),
            "{name}: {:?}",
            diagnosis.discrepancy
        );
    }
}

/// The stated limit of the strength of an effect.
fn stated_limit(diagnosis: &Diagnosis, name: &str) -> Option<f64> {
    diagnosis.limits.iter().find(|l| l.name == name).and_then(|l| l.limit)
}

/// Sensors with an effect that is a little stronger than the limit of a clean sensor. The smallest limit is that of an estimate of
/// zero, so sensors at this limit itself would be covered whatever they show.
struct LimitTrial {
    name: &'static str,
    strength: f64,
    /// The limits that their own recordings state; infinity if the effect is named, or if no limit is stated.
    limits: Vec<f64>,
}

impl LimitTrial {
    fn new(name: &'static str, seeds: std::ops::Range<u64>) -> Self {
        let clean = diagnose_hidden(&[], 31);
        let strength = 1.3 * stated_limit(&clean, name).unwrap();
        let limit = |seed| {
            let diagnosis = diagnose_hidden(&[(name, strength)], seed);
            stated_limit(&diagnosis, name).unwrap_or(f64::INFINITY)
        };
        let trial = Self { name, strength, limits: seeds.map(limit).collect() };
        eprintln!("{name} {strength:.2e}: {:.2?}", trial.relative());
        trial
    }

    /// The limits divided by the strength.
    fn relative(&self) -> Vec<f64> {
        self.limits.iter().map(|limit| limit / self.strength).collect()
    }

    /// The number of sensors whose limit is not below the strength.
    fn covered(&self) -> usize {
        self.limits.iter().filter(|limit| **limit >= self.strength).count()
    }

    fn median(&self) -> f64 {
        let mut all = self.relative();
        all.sort_by(f64::total_cmp);
        all[all.len() / 2]
    }
}

/// A limit is below the true strength with a probability of 5 %, and those of 4 of 12 sensors with a probability of 0.2 %. The
/// median estimate is the true strength, of at least 2.1 standard deviations. The limit of half of that exceeds the strength
/// by a quarter.
#[test]
#[ignore = "a minute; .ci/full runs it"]
fn long_a_limit_exceeds_the_strength_of_a_hidden_effect() {
    let trials = ["crosstalk", "dead_time"].map(|name| LimitTrial::new(name, 41..47));
    let covered: usize = trials.iter().map(LimitTrial::covered).sum();
    assert!(covered >= 9, "{covered} of 12");
    for trial in &trials {
        assert!(trial.median() > 1.25, "{}: {}", trial.name, trial.median());
    }
}

/// Of 160 sensors, 138 or fewer are covered with a probability of 0.001 % if 95 % are, and with a probability of 66 % if 85 %
/// are.
#[test]
#[ignore = "some minutes: 160 sensors"]
fn long_95_percent_of_limits_exceed_the_strength_of_a_hidden_effect() {
    const NAMES: [&str; 8] = [
        "crosstalk",
        "row_noise",
        "dead_time",
        "response_nonlinearity",
        "comparator_noise",
        "false_spikes",
        "spike_coupling",
        "image_lag",
    ];
    let trials = NAMES.map(|name| LimitTrial::new(name, 41..61));
    let covered: usize = trials.iter().map(LimitTrial::covered).sum();
    eprintln!("{covered} of 160");
    assert!(covered > 138, "{covered} of 160");
    for trial in &trials {
        assert!(trial.covered() >= 15, "{}: {}", trial.name, trial.covered());
    }
}

/// Only some rows have strong jitter. A fit with equal jitter in all rows would leave a discrepancy of
/// 4,726 with a noise floor of 410, and the effect would be tentative.
#[test]
#[ignore = "a minute; .ci/full runs it"]
fn long_readout_jitter_of_some_rows_is_identified() {
    // In 8 of 24 rows the jitter has more than half of its largest width.
    let physics = Physics { jitter: (0.03, 0.0, 7.0), ..Physics::default() };
    let (_folder, sets) = record_takes(SIZE, physics, 23);
    let diagnosis = diagnose_with_shared_null_model(&sets);
    let effect = diagnosis.effects.iter().find(|e| e.name == "readout_jitter" && !e.is_tentative);
    let parameters = &effect.unwrap_or_else(|| panic!("{diagnosis:?}")).parameters;
    let spread = parameters.iter().find(|p| p.name == "spread").unwrap();
    assert!((5.5..9.0).contains(&spread.value), "{parameters:?}");
    assert!(spread.low > 4.0 && spread.high < 14.0, "{parameters:?}");
}

/// The estimate of a full correlation must not be biased toward 0, and the interval must nearly include 1.
#[test]
#[ignore = "a minute; .ci/full runs it"]
fn long_full_gain_dark_correlation_is_recovered() {
    let diagnosis = diagnose_hidden(&[("gain_dark_correlation", 1.0)], 61);
    let effect = diagnosis.effects.iter().find(|e| e.name == "gain_dark_correlation");
    let parameter = &effect.unwrap_or_else(|| panic!("{diagnosis:?}")).parameters[0];
    assert!(
        parameter.low.abs().max(parameter.high.abs()) > 0.97 && parameter.value.abs() > 0.85,
        "{parameter:?}"
    );
}

#[test]
#[ignore = "two minutes: a camera file that is far off"]
fn long_doubled_gain_spread_in_the_camera_file_is_reported() {
    let (_folder, sets) = small_recording_sets(&[], 52);
    let setup = Setup::new(&sets[0], RecordingPart::Whole, ReadoutSelection::All).unwrap();
    let camera = published_camera(&setup).unwrap();
    let (right, prnu) =
        (camera.effect("prnu").unwrap().get("sigma").unwrap(), camera.effect("prnu").unwrap());
    let wrong = camera.clone().with_effect(prnu.clone().with_value("sigma", 2.0 * right).unwrap());
    let diagnosis = diagnose_against_camera(&wrong, &sets);
    let mismatches: Vec<&str> = diagnosis.parameter_mismatches.iter().map(|m| m.parameter.as_str()).collect();
    assert_eq!(
        (diagnosis.verdict, mismatches.as_slice()),
        (Verdict::Explained, ["prnu.sigma"].as_slice()),
        "{diagnosis:?}"
    );
    assert!(!diagnosis.parameter_mismatches[0].is_tentative, "{:?}", diagnosis.parameter_mismatches);
    // With 576 pixels the error of the spread is about 8 %.
    assert!(
        (diagnosis.parameter_mismatches[0].fitted_value / right - 1.0).abs() < 0.25,
        "{:?}",
        diagnosis.parameter_mismatches
    );
}

/// The threshold noise of the camera file is 10 % off, and the sensor has an effect outside the catalog. No number may be stated
/// plainly, because a number explains only a part.
#[test]
#[ignore = "three minutes: two camera files"]
fn long_an_unknown_effect_makes_no_number_of_the_camera_file_plainly_wrong() {
    for (name, strength) in [("two-tap parity", 0.03), ("wake-up transient", 0.2)] {
        let (_folder, sets) = small_recording_sets(&[(name, strength)], 57);
        let setup = Setup::new(&sets[0], RecordingPart::Whole, ReadoutSelection::All).unwrap();
        let camera = published_camera(&setup).unwrap();
        let noise = camera.effect("thermal_noise").unwrap().clone();
        let value = 0.9 * noise.get("sigma").unwrap();
        let camera = camera.with_effect(noise.with_value("sigma", value).unwrap());
        let diagnosis = diagnose_against_camera(&camera, &sets);
        let mismatches = &diagnosis.parameter_mismatches;
        assert!(mismatches.iter().all(|m| m.is_tentative), "{name}: {mismatches:?}");
        assert_eq!(diagnosis.verdict, Verdict::Unknown, "{name}: {:?}", diagnosis.effects);
    }
}

/// Lost readouts must be located. If the model contained only their probability, all simulated recordings would scatter
/// too much to detect any other effect.
#[test]
#[ignore = "two minutes: two sensors with two effects"]
fn long_effects_beside_dropped_or_repeated_readouts_are_found() {
    for (name, other, strength) in
        [("dropped_readouts", "missed_spikes", 0.004), ("repeated_readouts", "false_spikes", 0.001)]
    {
        let diagnosis = diagnose_hidden(&[(name, 0.003), (other, strength)], 71);
        let named: Vec<&str> = diagnosis.effects.iter().filter(|e| !e.is_tentative).map(|e| e.name).collect();
        assert!(
            named.contains(&name) && named.contains(&other),
            "{:?} {:?}",
            diagnosis.verdict,
            diagnosis.effects
        );
        let effect = diagnosis.effects.iter().find(|e| e.name == name).unwrap();
        // There are about 100 events, so their number has a standard deviation of 10 %. The tolerance is five times 10 %.
        let p = &effect.parameters[0];
        assert!((p.value / 0.003 - 1.0).abs() < 0.5 && p.low < p.value && p.value < p.high, "{p:?}");
        assert!(effect.evidence.contains(" found in "), "{}", effect.evidence);
    }
}

/// The test uses strong noise in some of the pixels, because such noise resembles lost readouts.
#[test]
#[ignore = "a minute; .ci/full runs it"]
fn long_strong_noise_in_some_pixels_is_not_reported_as_dropped_readouts() {
    let diagnosis = diagnose_hidden(&[("two populations of threshold noise", 4.0)], 81);
    assert!(!matches!(diagnosis.verdict, Verdict::Agrees), "{:?}", diagnosis.discrepancy);
    let events = diagnosis.effects.iter().any(|e| e.name.ends_with("_readouts"));
    assert!(!events, "{:?}", diagnosis.effects);
}

/// If the clamp were only linearized, the parameters of the base model could absorb the remaining error. A partial reset
/// of 0.56 would then fit equally well.
#[test]
#[ignore = "a minute; .ci/full runs it"]
fn long_saturation_clamp_far_from_its_linearization_is_found() {
    let diagnosis = diagnose_hidden(&[("saturation_clamp", 0.757)], 94);
    let named: Vec<&str> = diagnosis.effects.iter().filter(|e| !e.is_tentative).map(|e| e.name).collect();
    assert_eq!(named, ["saturation_clamp"], "{:?} {:?}", diagnosis.verdict, diagnosis.effects);
    let parameter = &diagnosis.effects[0].parameters[0];
    assert!((parameter.value - 1.243).abs() < 0.01, "{parameter:?}");
}

/// If the camera file lacks an effect, its parameters absorb part of the effect. If the diagnosis judged the parameters
/// anyway, this camera would appear to have 0.22 of its light noise and 0.15 of its threshold spread.
#[test]
#[ignore = "a minute; .ci/full runs it"]
fn long_strong_row_noise_does_not_blame_a_correct_camera_file() {
    let (_folder, sets) = recording_sets(Size { width: 36, height: 36, ..SIZE }, &[("row_noise", 0.02)], 62);
    let setup = Setup::new(&sets[0], RecordingPart::Whole, ReadoutSelection::All).unwrap();
    let camera = published_camera(&setup).unwrap();
    let diagnosis = diagnose_against_camera(&camera, &sets);
    assert!(
        diagnosis.effects.iter().any(|e| e.name == "row_noise" && !e.is_tentative),
        "{:?}",
        diagnosis.effects
    );
    assert!(diagnosis.parameter_mismatches.is_empty(), "{:?}", diagnosis.parameter_mismatches);
}

#[test]
fn threads_change_no_number() {
    let of_threads = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let mut diagnosis = pool.install(|| diagnose_hidden(&[("dead_pixels", 0.02)], 41));
        diagnosis.seconds = 0.0;
        format!("{diagnosis:?}")
    };
    let single_thread = of_threads(1);
    assert!(single_thread.contains("dead_pixels"), "{single_thread}");
    assert_eq!(single_thread, of_threads(3));
}

#[test]
fn an_effect_outside_the_catalog_is_unknown() {
    let diagnosis = diagnose_hidden(&[("two-tap parity", 0.02)], 31);
    assert!(
        matches!(diagnosis.verdict, Verdict::Unknown | Verdict::PartlyExplained),
        "{:?}",
        diagnosis.verdict
    );
    assert!(diagnosis.effects.iter().all(|e| e.is_tentative), "{:?}", diagnosis.effects);
    assert!(!diagnosis.unexplained.is_empty());
}

#[test]
fn large_recordings_are_judged_by_their_leading_readouts_by_default() {
    let folder = tempfile::tempdir().unwrap();
    // 35 million pixel-readouts of 32,000 pixels are 1,093 readouts. The diagnosis uses at least 1,250 readouts.
    for name in ["dark.dat", "square.dat"] {
        std::fs::write(folder.path().join(name), vec![0; 200 * 160 / 8 * 5100]).unwrap();
    }
    let set = "width = 200\nheight = 160\nreadout_hz = 20000.0\n[[recording]]\nfile = \"dark.dat\"\nlight = 0.0\n\
        [[recording]]\nfile = \"square.dat\"\nlight = { kind = \"square\", half_period = 400, high = 0.5, low = 0.1 }\n";
    std::fs::write(folder.path().join("recordings.toml"), set).unwrap();
    let set = RecordingSet::open(&folder.path().join("recordings.toml")).unwrap();
    let judged = |part, extent| {
        let setup = Setup::new(&set, part, extent).unwrap();
        let span_of = |k: usize| (setup.recordings[k].first_readout, setup.recordings[k].readouts);
        (span_of(0), span_of(1), setup.judged_readouts)
    };
    // The minimum for a square wave is five half periods.
    assert_eq!(
        judged(RecordingPart::Whole, ReadoutSelection::Leading),
        ((0, 1250), (0, 2000), Some([1250, 2000]))
    );
    assert_eq!(judged(RecordingPart::Whole, ReadoutSelection::All), ((0, 5100), (0, 5100), None));
    // If a recording is split in the middle, both parts have the same length. The parts of a square wave contain whole
    // periods.
    assert_eq!(
        judged(RecordingPart::FirstHalf, ReadoutSelection::Leading),
        ((0, 1250), (0, 1600), Some([2500, 4000]))
    );
    assert_eq!(
        judged(RecordingPart::SecondHalf, ReadoutSelection::Leading),
        ((1250, 1250), (1600, 1600), Some([2500, 4000]))
    );
}
