//! Tests files with the keys of earlier development builds. Each file is refused, and the message names the key and the
//! remedy.

use crate::program_support::TestFolder;

const SCENE: &str = "--scene-preset tiny --sequences 1 --images-per-scene 2 --width 32 --height 24";

/// Replaces one key in a text file. The key must exist.
fn rename_key(place: &TestFolder, file: &str, new: &str, old: &str) {
    let text = String::from_utf8(place.read(file)).unwrap();
    assert!(text.contains(new), "{file} has no {new}");
    place.write(file, text.replacen(new, old, 1));
}

#[test]
fn a_sidecar_with_an_earlier_key_is_refused() {
    let place = TestFolder::new();
    place.run_ok("simulate --builtin-light chart --width 32 --height 24 --readouts 20 -o s");
    rename_key(&place, "s.json", "\"interpolation\"", "\"insertion\"");
    place.run_refused("verify s.dat", 3, &["s.json", "interpolation", "simulate the stream again"]);
}

#[test]
fn a_camera_file_with_an_earlier_key_is_refused() {
    let place = TestFolder::new();
    place.write("mine.toml", place.run_ok("preset show physical").stdout);
    rename_key(&place, "mine.toml", "noise_sampling", "redraw");
    place.run_refused(
        "simulate --builtin-light chart --camera mine.toml --readouts 2 -o s",
        3,
        &["mine.toml", "effects.thermal_noise", "redraw", "noise_sampling"],
    );
}

#[test]
fn a_recording_set_with_an_earlier_key_is_refused() {
    let place = TestFolder::new();
    let recording =
        "width = 32\nheight = 24\nsimulated = \"physical\"\n[[recording]]\nfile = \"a.dat\"\nlight = 0.1\n";
    place.write("recordings.toml", recording);
    place.run_refused(
        "calibrate recordings.toml -o out",
        3,
        &["recordings.toml", "`simulated`", "`simulated_camera`"],
    );
}

#[test]
fn a_plan_of_an_earlier_format_is_refused() {
    let place = TestFolder::new();
    place.run_ok(&format!("dataset plan {SCENE} -o d --sequences-per-shard 1"));
    rename_key(&place, "d/plan.json", "\"format_version\"", "\"plan\"");
    for command in ["dataset run d --shards 0", "dataset status d", "dataset merge d"] {
        place.run_refused(
            command,
            3,
            &["plan.json", "version null", "the version of spikelane that wrote the plan"],
        );
    }
}

#[test]
fn a_manifest_of_an_earlier_format_is_refused() {
    let place = TestFolder::new();
    place.run_ok(&format!("dataset {SCENE} -o d"));
    rename_key(&place, "d/manifest.jsonl", "\"format_version\"", "\"dataset\"");
    for command in ["dataset stats d", &format!("dataset {SCENE} -o d --resume")] {
        place.run_refused(
            command,
            3,
            &["manifest.jsonl", "version null", "generate the dataset again in a new folder"],
        );
    }
}

#[test]
fn a_record_with_an_earlier_key_is_refused() {
    let place = TestFolder::new();
    place.run_ok(&format!("dataset {SCENE} -o d"));
    let record = "d/sequences/scene-0000/record.json";
    rename_key(&place, record, "\"facts\"", "\"about\"");
    place.run_refused("dataset stats d", 3, &["record.json", "`facts`", "generate the sequence again"]);
}

#[test]
fn a_dataset_file_of_an_earlier_format_is_refused() {
    let place = TestFolder::new();
    place.write("d.toml", place.run_ok(&format!("dataset {SCENE} -o d --print-config")).stdout);
    rename_key(&place, "d.toml", "format_version", "dataset");
    place.run_refused("dataset --config d.toml -o d", 3, &["d.toml", "dataset", "format_version"]);
}

#[test]
fn a_resumed_dataset_names_the_line_of_a_camera_that_differs() {
    let place = TestFolder::new();
    place.run_ok(&format!("dataset {SCENE} -o d"));
    let message = place.run(&format!("dataset {SCENE} -o d --resume --effect prnu.sigma=0.03"));
    assert_eq!(message.code, 3, "{}", message.stderr);
    assert!(message.stderr.contains("camera = \"sigma = 0.03\""), "{}", message.stderr);
    assert!(message.stderr.len() < 300, "{}", message.stderr);
}
