//! Tests `check` with scripts in the place of Python. Each script copies prepared results into the output folder of the
//! driver. The Python tests run the published code of the simulators.

use std::os::unix::fs::PermissionsExt as _;

use crate::program_support::{TestFolder, npy_f32};
use spikelane::spikes::set_bit;

const WIDTH: usize = 40;
const HEIGHT: usize = 30;
const PIXELS: usize = WIDTH * HEIGHT;
const READOUTS: usize = 60;

fn code(p: usize) -> u8 {
    (p * 7 % 256) as u8
}

/// Charges without ties: no sum of `gray / 510` and a charge is exactly one threshold.
fn start_charge(p: usize) -> f64 {
    (p as f64 * 0.618_033_988_749_894_9 + 0.1).fract()
}

/// Writes `photo.png`, and the results of Spike-Zoo's converter for a still image: `start.f64`, `spikes.dat` and
/// `result.json`. `threshold` is 2 in the published code.
fn write_results(place: &TestFolder, threshold: f64) {
    let image = image::GrayImage::from_raw(40, 30, (0..PIXELS).map(code).collect()).unwrap();
    image.save(place.path("photo.png")).unwrap();
    let start: Vec<u8> = (0..PIXELS).flat_map(|p| start_charge(p).to_le_bytes()).collect();
    place.write("start.f64", start);
    let mut integral: Vec<f64> = (0..PIXELS).map(|p| threshold * start_charge(p)).collect();
    let mut bytes = vec![0; READOUTS * PIXELS / 8];
    for frame in bytes.chunks_exact_mut(PIXELS / 8) {
        for (p, integral) in integral.iter_mut().enumerate() {
            *integral += f64::from(f32::from(code(p)) / 255.0);
            if *integral >= threshold {
                *integral -= threshold;
                set_bit(frame, p);
            }
        }
    }
    place.write("spikes.dat", bytes);
    place.write(
        "result.json",
        r#"{"source": "spike_utils.py", "sha256": "0123456789abcdef", "numpy": "2.0"}"#,
    );
}

/// Writes a script that runs `commands` in the place of Python. The fifth argument is the output folder.
fn write_python(place: &TestFolder, commands: &str) {
    let here = place.path("");
    let here = here.display();
    let path = place
        .write("python.sh", format!("#!/bin/sh\nset -e\n{}\n", commands.replace("HERE", &here.to_string())));
    std::fs::set_permissions(path, std::fs::Permissions::from_mode(0o755)).unwrap();
}

const COPY: &str = "cp HERE/start.f64 HERE/spikes.dat HERE/result.json \"$5\"";
const LINE: &str = "check spikezoo photo.png --code . --python ./python.sh --readouts 60";

#[test]
fn spikes_of_the_published_rule_are_equal() {
    let place = TestFolder::new();
    write_results(&place, 2.0);
    write_python(&place, COPY);
    let event = place.run_ok(&format!("{LINE} --json")).events().pop().unwrap();
    assert_eq!((&event["agrees"], &event["differing_bits"]), (&true.into(), &0.into()), "{event}");
    assert_eq!(event["bits"], PIXELS * READOUTS);
    let text = place.run_ok(LINE).stdout;
    assert!(text.contains("equal bits: 72000 of 72000") && text.contains("verdict: equal"), "{text}");
}

#[test]
fn a_threshold_that_differs_by_a_thousandth_is_a_difference() {
    let place = TestFolder::new();
    write_results(&place, 2.002);
    write_python(&place, COPY);
    let ran = place.run(LINE);
    assert_eq!(ran.code, 9, "{}", ran.stderr);
    assert!(ran.stdout.contains("verdict: different"), "{}", ran.stdout);
}

/// The driver receives one PNG per frame. The frames of an array are gray images with the codes of the array.
#[test]
fn the_driver_receives_the_images_of_the_input() {
    let place = TestFolder::new();
    write_results(&place, 2.0);
    let light: Vec<f32> = (0..24 * PIXELS).map(|i| f32::from(code(i % PIXELS)) / 255.0).collect();
    place.write("clip.npy", npy_f32([24, HEIGHT, WIDTH], &light));
    write_python(
        &place,
        "cp \"$4\"/* HERE; head -c 3600 HERE/spikes.dat > \"$5\"/spikes.dat; cp HERE/start.f64 HERE/result.json \"$5\"",
    );
    let line = LINE.replace("photo.png", "clip.npy");
    let event = place.run_ok(&format!("{line} --json")).events().pop().unwrap();
    assert_eq!((&event["readouts"], &event["agrees"]), (&24.into(), &true.into()), "{event}");
    let last = image::open(place.path("0023.png")).unwrap().to_luma8();
    assert_eq!(last.into_raw(), (0..PIXELS).map(code).collect::<Vec<u8>>());
    assert!(!place.path("0024.png").exists());
}

#[test]
fn faults_of_python_and_of_its_results_are_errors() {
    let place = TestFolder::new();
    write_results(&place, 2.0);
    for (commands, words) in [
        ("echo 'no module named numpy' >&2; exit 1", ["no module named numpy", "--python"]),
        ("true", ["spikes.dat", "no such file"]),
        ("head -c 8992 HERE/spikes.dat > \"$5\"/spikes.dat", ["8992 bytes", "9000 bytes"]),
        (
            "cp HERE/spikes.dat \"$5\"; head -c 9592 HERE/start.f64 > \"$5\"/start.f64",
            ["9592 bytes", "9600 bytes"],
        ),
    ] {
        write_python(&place, commands);
        let before = place.file_names();
        let ran = place.run(LINE);
        assert!([5, 8].contains(&ran.code), "{commands}: {} {}", ran.code, ran.stderr);
        for word in words {
            assert!(ran.stderr.contains(word), "{commands}: no '{word}' in {}", ran.stderr);
        }
        assert_eq!(place.file_names(), before);
    }
    place.run_refused(&LINE.replace("./python.sh", "./missing"), 8, &["no such program"]);
}

#[test]
fn inputs_that_a_converter_cannot_read_are_refused() {
    let place = TestFolder::new();
    write_results(&place, 2.0);
    write_python(&place, COPY);
    std::fs::create_dir(place.path("folder")).unwrap();
    let with = |input: &str, more: &str| format!("{} {more}", LINE.replace("photo.png", input));
    place.run_refused(&with("folder", ""), 4, &["no image"]);
    std::fs::copy(place.path("photo.png"), place.path("folder/1.png")).unwrap();
    place.run_refused(&with("folder", ""), 4, &["at least 20 images"]);
    place.run_refused(&with("folder", "").replace("spikezoo", "spikecv-image"), 2, &["one image"]);
    place.run_refused(&with("photo.png", "--crop 41x30"), 4, &["40x30"]);
    place.run_refused(&with("photo.png", "--crop 40"), 2, &["WIDTHxHEIGHT"]);
    image::DynamicImage::new_luma16(40, 30).save(place.path("deep.png")).unwrap();
    place.run_refused(&with("deep.png", ""), 4, &["16 bits"]);
}
