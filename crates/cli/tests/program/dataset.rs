//! The commands `dataset`, `scene` and `evaluate`, from outside.

use crate::program_support::{Place, Ran, exists, npy_f32};

const TINY: &str = "dataset --kind tiny --sequences 1 --images 6 --label-every 3 --width 64 --height 40";

#[test]
fn a_scene_becomes_pictures_of_light_and_labels() {
    let place = Place::new();
    place.good("scene -o preview --width 64 --height 40 --frames 2");
    for kind in ["light", "depth", "flow", "semantic", "instance", "boxes"] {
        let picture = image::open(place.path(&format!("preview/0001.{kind}.png"))).unwrap();
        assert_eq!((picture.width(), picture.height()), (64, 40), "{kind}");
    }
    assert!(place.path("preview/0001.boxes.json").is_file());
    place.refused("scene -o preview --width 64 --height 40", 7, &["0000.light.png"]);
}

#[test]
fn a_dry_run_writes_nothing_and_answers_json() {
    let place = Place::new();
    let ran = place.good("dataset -o set --dry-run --json");
    assert!(!exists(&place.path("set")));
    let told = &ran.events()[0];
    // RHDD: 30 scenes of 500 images, one readout each.
    assert_eq!((told["sequences"].as_u64(), told["readouts"].as_u64()), (Some(30), Some(15_000)));
    let ran = place.good("dataset -o set --kind tiny --dry-run --json");
    assert_eq!(ran.events()[0]["sequences"], 2);
}

#[test]
fn a_dataset_is_made_evaluated_and_gone_on_with() {
    let place = Place::new();
    let ran = place.good(&format!("{TINY} -o set --json"));
    assert_eq!(ran.events().last().unwrap()["made"], 1);
    place.refused(&format!("{TINY} -o set"), 7, &["set", "--resume"]);
    let ran = place.good(&format!("{TINY} -o set --resume"));
    assert!(ran.stdout.contains("0 made, 1 verified"), "{}", ran.stdout);
    let told = place.good("evaluate set --window 5 --json").events();
    assert_eq!(told.len(), 2);
    assert_eq!((&told[0]["stream"], &told[1]["stream"]), (&"noisy".into(), &"clean".into()));
    let marks = &told[0]["pictures"][0]["marks"];
    assert!(marks["psnr_db"].as_f64().unwrap() > 3.0 && marks["ssim"].as_f64().unwrap() < 1.0, "{marks}");
    assert!(place.good("evaluate set").stdout.contains("tfp 129"));
}

/// The estimate of the noise of TFP falls with its window as counting does, and PSNR rises.
#[test]
fn evaluate_sees_noise_fall_with_the_window() {
    let place = Place::new();
    place.picture("grey.png", 96, 64, 150);
    place.good("simulate grey.png --width 96 --height 64 --readouts 400 -o a");
    let told = place.good("evaluate a.dat --clear grey.png --window 17 --window 257 --json").events();
    let mark = |i: usize, key: &str| told[0]["pictures"][i]["marks"][key].as_f64().unwrap();
    assert!(mark(0, "patch_noise") > 2.0 * mark(1, "patch_noise"));
    assert!(mark(1, "psnr_db") > mark(0, "psnr_db") && mark(1, "snr_db") > mark(0, "snr_db"));
    // Without a truth there is none to compare with.
    let told = place.good("evaluate a.dat --json").events();
    assert!(told[0]["pictures"][0]["marks"]["psnr_db"].is_null());
    place.picture("small.png", 20, 20, 150);
    place.refused("evaluate a.dat --clear small.png", 4, &["small.png", "96x64"]);
}

#[test]
fn impossible_scenes_are_refused() {
    let place = Place::new();
    place.refused("scene -o a --width 0", 2, &["0"]);
    place.refused("scene -o a --rate 0", 2, &["rate"]);
    place.refused("dataset -o a --kind tiny --speed-kmh 5000", 2, &["km/h"]);
    place.refused("dataset -o a --kind tiny --test-share 1.5", 2, &["share"]);
    place.refused("dataset -o a --kind tiny --camera nobody", 3, &["nobody"]);
    // No vehicle at all is a scene like any other.
    place.good(&format!("{TINY} --vehicles 0 -o empty"));
    assert_eq!(place.json("empty/sequences/scene-0000/record.json")["about"]["vehicles"], 0);
}

/// A limit on the size of files stands in for the full disk: both refuse what is written beyond some byte.
#[test]
#[cfg(unix)]
fn a_dataset_that_finds_no_room_says_where_and_can_be_gone_on_with() {
    let place = Place::new();
    let line = format!("{TINY} -o set");
    let script = format!("trap '' XFSZ; ulimit -f 16; exec {} {line}", env!("CARGO_BIN_EXE_spikelane"));
    let mut shell = std::process::Command::new("sh");
    let ran = Ran::of(&line, shell.args(["-c", &script]).current_dir(place.path("")).output().unwrap());
    assert_eq!(ran.code, 6, "{}", ran.stderr);
    assert!(ran.stderr.contains("scene-0000") && ran.stderr.contains("os error"), "{}", ran.stderr);
    let left = std::fs::read_dir(place.path("set/sequences")).unwrap().count();
    assert_eq!(left, 0, "something half-written is left");
    assert!(place.good(&format!("{line} --resume")).stdout.contains("1 made, 0 verified"));
    assert!(place.good(&format!("{line} --resume")).stdout.contains("0 made, 1 verified"));
}

/// Two frames of one light each, 8 readouts apart: readout 6 is three quarters of the way.
#[test]
fn simulate_keeps_clear_light_that_verify_checks() {
    let place = Place::new();
    let values: Vec<f32> = [0.1, 0.5].iter().flat_map(|&v| [v; 16 * 8]).collect();
    place.write("in.npy", npy_f32([2, 8, 16], &values));
    let line = "simulate in.npy --width 16 --height 8 --readouts-per-frame 8 --insertion linear -o run";
    place.good(&format!("{line} --images-every 6 --images-as u16"));
    let light = image::open(place.path("run.images/000006.png")).unwrap().into_luma16();
    // Half a code is rounding; floats hold 0.4 to 3e-8.
    assert!((f32::from(light[(3, 3)].0[0]) - 0.4 * 65535.0).abs() <= 0.51);
    let images = &place.json("run.json")["images"];
    assert_eq!((&images["transfer"], &images["stored_as"]), (&"linear".into(), &"u16".into()));
    let readouts: Vec<_> =
        images["files"].as_array().unwrap().iter().map(|f| f["readout"].as_u64()).collect();
    assert_eq!(readouts, [Some(0), Some(6), Some(12)]);
    place.good("verify run.json");
    place.write("run.images/000012.png", "cut");
    place.refused("verify run.json", 9, &["000012.png"]);
}

#[test]
fn images_of_an_earlier_run_are_replaced_only_by_force_and_only_images() {
    let place = Place::new();
    let line = "simulate --source chart --width 32 --height 16 --readouts 20 -o run --images-every";
    place.good(&format!("{line} 10"));
    place.refused(&format!("{line} 5"), 7, &["--force"]);
    place.good(&format!("{line} 19 --images-as f32 --force"));
    let mut left: Vec<_> =
        std::fs::read_dir(place.path("run.images")).unwrap().map(|e| e.unwrap().file_name()).collect();
    left.sort();
    assert_eq!(left, ["000000.npy", "000019.npy"]);
    place.write("run.images/notes.txt", "mine");
    place.refused(&format!("{line} 10 --force"), 7, &["notes.txt"]);
    assert_eq!(place.read("run.images/notes.txt"), b"mine");
}
