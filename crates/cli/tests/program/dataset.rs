//! Tests the commands `dataset`, `scene` and `evaluate`.

use crate::program_support::{CommandResult, TestFolder, exists, npy_f32};

const TINY_DATASET: &str =
    "dataset --scene-preset tiny --sequences 1 --images-per-scene 6 --label-every 3 --width 64 --height 40";

#[test]
fn a_scene_becomes_pictures_of_light_and_labels() {
    let place = TestFolder::new();
    place.run_ok("scene -o preview --width 64 --height 40 --frames 2");
    for kind in ["light", "depth", "flow", "semantic", "instance", "boxes"] {
        let picture = image::open(place.path(&format!("preview/0001.{kind}.png"))).unwrap();
        assert_eq!((picture.width(), picture.height()), (64, 40), "{kind}");
    }
    assert!(place.path("preview/0001.boxes.json").is_file());
    place.run_refused("scene -o preview --width 64 --height 40", 7, &["0000.light.png"]);
}

#[test]
fn a_dry_run_writes_nothing_and_answers_json() {
    let place = TestFolder::new();
    let ran = place.run_ok("dataset -o set --dry-run --json");
    assert!(!exists(&place.path("set")));
    let event = &ran.events()[0];
    // The preset rhdd has 30 scenes of 500 images, with one readout per image.
    assert_eq!((event["sequences"].as_u64(), event["readouts"].as_u64()), (Some(30), Some(15_000)));
    let ran = place.run_ok("dataset -o set --scene-preset tiny --dry-run --json");
    assert_eq!(ran.events()[0]["sequences"], 2);
}

#[test]
fn a_dataset_is_made_evaluated_and_gone_on_with() {
    let place = TestFolder::new();
    let ran = place.run_ok(&format!("{TINY_DATASET} -o set --json"));
    assert_eq!(ran.events().last().unwrap()["generated"], 1);
    place.run_refused(&format!("{TINY_DATASET} -o set"), 7, &["set", "--resume"]);
    let ran = place.run_ok(&format!("{TINY_DATASET} -o set --resume"));
    assert!(ran.stdout.contains("0 generated, 1 verified"), "{}", ran.stdout);
    let events = place.run_ok("evaluate set --window 5 --json").events();
    assert_eq!(events.len(), 2);
    assert_eq!((&events[0]["stream"], &events[1]["stream"]), (&"noisy".into(), &"clean".into()));
    let marks = &events[0]["pictures"][0]["scores"];
    assert!(marks["psnr_db"].as_f64().unwrap() > 3.0 && marks["ssim"].as_f64().unwrap() < 1.0, "{marks}");
    assert!(place.run_ok("evaluate set").stdout.contains("tfp 129"));
}

/// With a larger window, the estimated noise of TFP decreases as the noise of a count does, and PSNR increases.
#[test]
fn evaluate_sees_noise_fall_with_the_window() {
    let place = TestFolder::new();
    place.picture("gray.png", 96, 64, 150);
    place.run_ok("simulate gray.png --width 96 --height 64 --readouts 400 -o a");
    let events = place.run_ok("evaluate a.dat --reference gray.png --window 17 --window 257 --json").events();
    let mark = |i: usize, key: &str| events[0]["pictures"][i]["scores"][key].as_f64().unwrap();
    assert!(mark(0, "patch_noise") > 2.0 * mark(1, "patch_noise"));
    assert!(mark(1, "psnr_db") > mark(0, "psnr_db") && mark(1, "snr_db") > mark(0, "snr_db"));
    // Without a reference there is no PSNR.
    let events = place.run_ok("evaluate a.dat --json").events();
    assert!(events[0]["pictures"][0]["scores"]["psnr_db"].is_null());
    place.picture("small.png", 20, 20, 150);
    place.run_refused("evaluate a.dat --reference small.png", 4, &["small.png", "96x64"]);
}

#[test]
fn impossible_scenes_are_refused() {
    let place = TestFolder::new();
    place.run_refused("scene -o a --width 0", 2, &["0"]);
    place.run_refused("scene -o a --fps 0", 2, &["rate"]);
    place.run_refused("dataset -o a --scene-preset tiny --speed-kmh 5000", 2, &["km/h"]);
    place.run_refused("dataset -o a --scene-preset tiny --test-share 1.5", 2, &["share"]);
    place.run_refused("dataset -o a --scene-preset tiny --camera nobody", 3, &["nobody"]);
    // A scene without vehicles is valid.
    place.run_ok(&format!("{TINY_DATASET} --vehicles 0 -o empty"));
    assert_eq!(place.json("empty/sequences/scene-0000/record.json")["facts"]["vehicles"], 0);
}

/// A file size limit simulates a full disk. Both reject writes beyond some byte.
#[test]
#[cfg(unix)]
fn a_dataset_that_finds_no_room_says_where_and_can_be_gone_on_with() {
    let place = TestFolder::new();
    let line = format!("{TINY_DATASET} -o set");
    let script = format!("trap '' XFSZ; ulimit -f 16; exec {} {line}", env!("CARGO_BIN_EXE_spikelane"));
    let mut shell = std::process::Command::new("sh");
    let ran = CommandResult::from_output(
        &line,
        shell.args(["-c", &script]).current_dir(place.path("")).output().unwrap(),
    );
    assert_eq!(ran.code, 6, "{}", ran.stderr);
    assert!(ran.stderr.contains("scene-0000") && ran.stderr.contains("os error"), "{}", ran.stderr);
    let left = std::fs::read_dir(place.path("set/sequences")).unwrap().count();
    assert_eq!(left, 0, "something half-written is left");
    assert!(place.run_ok(&format!("{line} --resume")).stdout.contains("1 generated, 0 verified"));
    assert!(place.run_ok(&format!("{line} --resume")).stdout.contains("0 generated, 1 verified"));
}

/// The light has two uniform frames, 8 readouts apart. The light of readout 6 is therefore a quarter of the first frame
/// plus three quarters of the second.
#[test]
fn simulate_keeps_clear_light_that_verify_checks() {
    let place = TestFolder::new();
    let values: Vec<f32> = [0.1, 0.5].iter().flat_map(|&v| [v; 16 * 8]).collect();
    place.write("in.npy", npy_f32([2, 8, 16], &values));
    let line = "simulate in.npy --width 16 --height 8 --readouts-per-frame 8 --interpolation linear -o run";
    place.run_ok(&format!("{line} --images-every 6 --images-format u16"));
    let light = image::open(place.path("run.images/000006.png")).unwrap().into_luma16();
    // The rounding error is half a code. The error of 0.4 as f32 is 3e-8.
    assert!((f32::from(light[(3, 3)].0[0]) - 0.4 * 65535.0).abs() <= 0.51);
    let images = &place.json("run.json")["images"];
    assert_eq!((&images["transfer"], &images["format"]), (&"linear".into(), &"u16".into()));
    let readouts: Vec<_> =
        images["files"].as_array().unwrap().iter().map(|f| f["readout"].as_u64()).collect();
    assert_eq!(readouts, [Some(0), Some(6), Some(12)]);
    place.run_ok("verify run.json");
    place.write("run.images/000012.png", "cut");
    place.run_refused("verify run.json", 9, &["000012.png"]);
}

#[test]
fn images_of_an_earlier_run_are_replaced_only_by_force_and_only_images() {
    let place = TestFolder::new();
    let line = "simulate --builtin-light chart --width 32 --height 16 --readouts 20 -o run --images-every";
    place.run_ok(&format!("{line} 10"));
    place.run_refused(&format!("{line} 5"), 7, &["--force"]);
    place.run_ok(&format!("{line} 19 --images-format f32 --force"));
    let mut left: Vec<_> =
        std::fs::read_dir(place.path("run.images")).unwrap().map(|e| e.unwrap().file_name()).collect();
    left.sort();
    assert_eq!(left, ["000000.npy", "000019.npy"]);
    place.write("run.images/notes.txt", "mine");
    place.run_refused(&format!("{line} 10 --force"), 7, &["notes.txt"]);
    assert_eq!(place.read("run.images/notes.txt"), b"mine");
}
