//! Tests the warning about light that is outside the range of the camera.

use crate::benchmark::short_suite;
use crate::program_support::{TestFolder, npy_f32};

/// The start of the warning about saturated pixels.
const SATURATED: &str = "% of the pixel readouts saturated";

/// A camera with a dark current that fires every pixel at every readout.
const DARK_CURRENT: &str = "--effect dark_current.mean=2nA --width 32 --height 16";

/// Writes a picture whose top `bright` of 20 rows have twice the light of white.
fn picture(place: &TestFolder, bright: usize) {
    let values: Vec<f32> = (0..20 * 32).map(|p| if p / 32 < bright { 2.0 } else { 0.3 }).collect();
    place.write("picture.npy", npy_f32([1, 20, 32], &values));
}

#[test]
fn more_than_half_of_saturated_pixels_are_a_warning() {
    let place = TestFolder::new();
    for (bright, share) in [(2, None), (10, None), (13, Some("65 %")), (20, Some("100 %"))] {
        picture(&place, bright);
        let ran = place
            .run_ok("simulate picture.npy --camera ideal --width 32 --height 20 --readouts 300 --force -o a");
        assert_eq!(ran.stderr.contains(SATURATED), share.is_some(), "{bright}: {}", ran.stderr);
        assert!(share.is_none_or(|share| ran.stderr.contains(share)), "{bright}: {}", ran.stderr);
    }
}

#[test]
fn a_stream_without_spikes_is_a_warning() {
    let place = TestFolder::new();
    place.picture("black.png", 32, 20, 0);
    let line = "simulate black.png --camera ideal --width 32 --height 20 --readouts 60 -o a";
    let ran = place.run_ok(line);
    assert!(ran.stderr.contains("a.dat: found no spike in 60 readouts"), "{}", ran.stderr);
}

#[test]
fn every_command_that_simulates_warns() {
    let place = TestFolder::new();
    place.picture("gray.png", 32, 16, 100);
    std::fs::create_dir(place.path("clips")).unwrap();
    place.write("clips/a.npy", npy_f32([2, 16, 32], &[0.3; 2 * 16 * 32]));
    place.write("clips/b.npy", npy_f32([2, 16, 32], &[0.2; 2 * 16 * 32]));
    let suite = short_suite(1).replace("thresholds_at_full_scale = 0.6", "thresholds_at_full_scale = 30.0");
    place.write("bright.toml", suite.replace("images_per_scene = 9", "images_per_scene = 40"));
    for line in [
        format!("simulate gray.png {DARK_CURRENT} --readouts 60 -o a"),
        format!("record {DARK_CURRENT} --readouts 60 -o set"),
        format!("dataset --from clips {DARK_CURRENT} --readouts-per-frame 40 -o data"),
        format!(
            "dataset --scene-preset tiny --sequences 1 --images-per-scene 40 --label-every 0 {DARK_CURRENT} -o scenes"
        ),
        format!(
            "dataset plan --from clips {DARK_CURRENT} --readouts-per-frame 40 --sequences-per-shard 2 -o plan"
        ),
        "dataset run plan --shards all".to_owned(),
        "benchmark generate bright.toml -o suite".to_owned(),
    ] {
        let ran = place.run_ok(&line);
        let simulates = !line.starts_with("dataset plan");
        assert_eq!(ran.stderr.contains(SATURATED), simulates, "{line}: {}", ran.stderr);
    }
}

#[test]
fn live_warns_at_its_end() {
    let place = TestFolder::new();
    place.picture("gray.png", 32, 16, 100);
    let mut command = place.command(&format!("live gray.png {DARK_CURRENT} --readouts 60 --sink pipe"));
    let ran = command.stdout(std::process::Stdio::null()).output().unwrap();
    let text = String::from_utf8(ran.stderr).unwrap();
    assert!(text.contains(SATURATED), "{text}");
}

#[test]
fn one_line_warns_of_all_sequences() {
    let place = TestFolder::new();
    std::fs::create_dir(place.path("clips")).unwrap();
    for name in ["a", "b", "c"] {
        place.write(&format!("clips/{name}.npy"), npy_f32([2, 16, 32], &[0.3; 2 * 16 * 32]));
    }
    let ran = place.run_ok(&format!("dataset --from clips {DARK_CURRENT} --readouts-per-frame 40 -o data"));
    assert_eq!(ran.stderr.matches(SATURATED).count(), 1, "{}", ran.stderr);
    assert!(ran.stderr.contains("3 of 3 generated sequences"), "{}", ran.stderr);
}
