//! `simulate` and the main job, from outside.

use std::io::{Read as _, Write as _};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use crate::program_support::{Place, Ran, npy_f32, y4m};
use spikelane::Backend;

/// Small, and with a last byte that is not full: 63 x 41 pixels.
const SMALL: &str = "--width 63 --height 41 --readouts 300";

#[test]
fn the_main_job_writes_everything_and_runs_again_without_loss() {
    let place = Place::new();
    let ran = place.good("");
    let out = |name: &str| format!("out/{name}");
    for name in ["drive.dat", "drive.clean.dat", "drive.json", "drive.png"] {
        assert!(ran.stderr.contains(name), "{name} in {}", ran.stderr);
        assert!(!place.read(&out(name)).is_empty());
    }
    assert!(ran.stderr.contains("500 readouts of 400x250: 25 ms of camera time"), "{}", ran.stderr);
    // Nothing is wrong with it, so nothing alarms.
    assert!(!ran.stderr.contains("note:") && !ran.stderr.contains("warning:"), "{}", ran.stderr);
    assert_eq!(place.read("out/drive.dat").len(), 500 * 12_500);
    let sidecar = place.json("out/drive.json");
    assert_eq!((sidecar["width"].as_u64(), sidecar["readouts"].as_u64()), (Some(400), Some(500)));
    // Again: the same bytes under the same names.
    let before = place.read("out/drive.dat");
    place.good("");
    assert!(before == place.read("out/drive.dat"));
    assert!(!place.path("out/drive-2.dat").exists());
    // A user's file of that name is left alone.
    place.write("out/drive.dat", "mine");
    place.good("");
    assert_eq!(place.read("out/drive.dat"), b"mine");
    assert!(place.read("out/drive-2.dat") == before);
}

#[test]
fn built_in_light_is_a_drive_unless_another_is_named() {
    let place = Place::new();
    let base = "simulate --width 64 --height 40 --readouts 40";
    for (source, words) in [
        ("", "driving scene"),
        ("--source drive --scene-seed 3 --lighting night", "(night)"),
        ("--source chart", "test chart"),
        ("--source objects --scene-seed 3", "random objects"),
    ] {
        let name = words.replace(['(', ')', ' '], "");
        place.good(&format!("{base} {source} -o {name}"));
        let light = place.json(&format!("{name}.json"))["light"]["source"].clone();
        assert!(light.as_str().unwrap().contains(words), "{source}: {light}");
    }
    place.refused(&format!("{base} --source chart --lighting night -o a"), 2, &["--lighting"]);
    place.refused(&format!("{base} --transfer srgb -o a"), 2, &["--transfer"]);
    place.picture("grey.png", 64, 40, 128);
    place.refused(&format!("{base} grey.png --source chart -o a"), 2, &["--source"]);
}

#[test]
fn threads_and_backends_give_the_same_bits() {
    let place = Place::new();
    let base = format!("simulate --source chart {SMALL} --seed 5 --camera-seed 6 --sequence 7 --clean");
    place.good(&format!("{base} -o first --threads 1 --backend reference"));
    let digest = |stem: &str| {
        let sidecar = place.json(&format!("{stem}.json"));
        (sidecar["digest"].clone(), sidecar["clean"]["digest"].clone())
    };
    for threads in 1..=3 {
        for backend in Backend::ALL {
            if !backend.available() {
                println!("skipped {backend}: this CPU lacks it");
                continue;
            }
            let stem = format!("t{threads}-{backend}");
            place.good(&format!("{base} -o {stem} --threads {threads} --backend {backend}"));
            assert_eq!(digest(&stem), digest("first"), "{stem}");
        }
    }
}

/// Of 300 readouts 60 are lost, give or take 7; the moving chart goes on meanwhile, and its clean twin loses nothing.
#[test]
fn a_camera_that_drops_readouts_still_fills_the_file() {
    let place = Place::new();
    let base = format!("simulate {SMALL} --clean");
    place.good(&format!("{base} -o whole"));
    place.good(&format!("{base} --effect dropped_readouts.probability=0.2 -o lossy"));
    let (whole, lossy) = (place.read("whole.dat"), place.read("lossy.dat"));
    assert_eq!(lossy.len(), whole.len());
    assert!(place.read("lossy.clean.dat") == place.read("whole.clean.dat"));
    let bytes = whole.len() / 300;
    let mut rest = whole.chunks(bytes);
    let found = lossy.chunks(bytes).take_while(|&frame| rest.any(|other| other == frame)).count();
    // What is missing at the end was seen in the last light, after the whole stream had ended.
    assert!((200..280).contains(&found), "{found} frames of the whole stream, in their order");
}

#[test]
fn a_clean_twin_of_an_earlier_run_is_pointed_at() {
    let place = Place::new();
    let line = format!("simulate --source chart {SMALL} -o a --force");
    assert!(!place.good(&line).stderr.contains("a.clean.dat"));
    place.good(&format!("{line} --clean"));
    let before = place.read("a.clean.dat");
    let ran = place.good(&line);
    assert!(ran.stderr.contains("a.clean.dat is of an earlier run"), "{}", ran.stderr);
    assert_eq!(place.read("a.clean.dat"), before);
}

#[test]
fn seeds_move_what_is_theirs_and_a_clean_twin_shares_the_start_phase() {
    let place = Place::new();
    // Dead light and no noise but the phase: what is left is the phase itself.
    place.picture("grey.png", 63, 41, 128);
    let base = format!("simulate grey.png --transfer linear {SMALL} --clean");
    place.good(&format!("{base} -o a"));
    place.good(&format!("{base} -o b --camera-seed 1"));
    place.good(&format!("{base} -o c --seed 1"));
    place.good(&format!("{base} -o d --sequence 1"));
    assert!(place.read("a.clean.dat") == place.read("b.clean.dat"), "the pattern moved the clean stream");
    assert!(place.read("a.clean.dat") != place.read("c.clean.dat"), "the shot seed left the phase");
    assert!(place.read("a.clean.dat") != place.read("d.clean.dat"), "the sequence left the phase");
    assert!(place.read("a.dat") != place.read("b.dat"));
    // With every other effect off, the noisy stream is its clean twin.
    let off = "--without prnu --without dark_current --without dark_tail --without hot_pixels \
               --without shot_noise --without dark_shot_noise --without thermal_noise \
               --without capacitor_mismatch";
    place.good(&format!("{base} {off} -o e"));
    assert!(place.read("e.dat") == place.read("a.clean.dat"));
}

#[test]
fn json_is_one_object_a_line_and_people_are_told_on_standard_error() {
    let place = Place::new();
    let ran = place.good(&format!("simulate --source chart {SMALL} -o a --json"));
    let events = ran.events();
    assert_eq!(events.first().unwrap()["event"], "start");
    assert_eq!(events.last().unwrap()["event"], "done");
    assert_eq!(events.last().unwrap()["digest"], place.json("a.json")["digest"]);
    assert!(ran.stderr.contains("a.dat"));
    let failed = place.run(&format!("simulate --source chart {SMALL} -o a --json"));
    assert_eq!(failed.code, 7);
    assert_eq!(failed.events()[0]["exit_code"], 7);
}

#[test]
fn the_sidecar_holds_what_is_needed_to_make_the_stream_again() {
    let place = Place::new();
    place.good(&format!(
        "simulate --source chart {SMALL} -o a --seed 3 --exposure 20000 --effect prnu.sigma=0.03"
    ));
    let sidecar = place.json("a.json");
    assert_eq!(sidecar["seeds"]["shot"], 3);
    assert!((sidecar["light"]["exposure_electrons"].as_f64().unwrap() - 20_000.0).abs() < 1e-6);
    assert_eq!(sidecar["camera"]["effects"]["prnu"]["sigma"], 0.03);
    assert!(sidecar["command"].as_array().unwrap().iter().any(|a| a == "--exposure"));
    place.write("again.toml", sidecar["camera"]["toml"].as_str().unwrap());
    place.good("simulate --source chart --camera again.toml --readouts 300 --seed 3 -o b");
    assert_eq!(place.json("b.json")["digest"], sidecar["digest"]);
}

#[test]
fn a_stream_ends_with_its_source_and_hold_shows_each_frame_as_long_as_asked() {
    let place = Place::new();
    // Frames of no light and of full light: `ideal` fires never, and at every readout.
    place.write("video.y4m", y4m(16, 8, &[0, 255, 0]));
    let ideal = "--camera ideal --without start_phase --width 16 --height 8 --insertion hold --to npy-bytes";
    place.good(&format!("simulate video.y4m {ideal} --readouts-per-frame 5 -o a"));
    let bytes = place.read("a.npy");
    let data = &bytes[bytes.len() - 15 * 128..];
    let spikes: Vec<usize> =
        data.chunks(128).map(|frame| frame.iter().map(|&b| usize::from(b)).sum()).collect();
    let mut expected = vec![0; 15];
    expected[5..10].fill(128);
    assert_eq!(spikes, expected);
    assert_eq!(place.json("a.json")["readouts"], 15);
    let ran = place.good(&format!("simulate video.y4m {ideal} --readouts-per-frame 5 --readouts 99 -o b"));
    assert!(ran.stderr.contains("15 of 99"), "{}", ran.stderr);
    assert!(place.read("b.npy") == bytes);
}

#[test]
fn standard_input_gives_the_bits_of_the_file() {
    let place = Place::new();
    let video = y4m(20, 10, &[10, 60, 110, 160, 210]);
    place.write("video.y4m", &video);
    for (layout, ending) in [("dat", "dat"), ("npy-bits", "npy")] {
        let line = format!("--width 20 --height 10 --insertion linear --readouts-per-frame 33 --to {layout}");
        place.good(&format!("simulate video.y4m {line} -o file-{layout}"));
        let line = format!("simulate - {line} -o pipe-{layout}");
        let mut child = place.command(&line).stdin(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        child.stdin.take().unwrap().write_all(&video).unwrap();
        let ran = Ran::of(&line, child.wait_with_output().unwrap());
        assert_eq!(ran.code, 0, "{}", ran.stderr);
        // The pipe's length was not known before its end; neither file nor digest may show it.
        assert!(
            place.read(&format!("file-{layout}.{ending}")) == place.read(&format!("pipe-{layout}.{ending}"))
        );
        place.good(&format!("verify pipe-{layout}.json"));
    }
}

#[test]
fn light_beyond_the_greatest_is_counted_and_told() {
    let place = Place::new();
    let bright: Vec<f32> = (0..3 * 128).map(|i| if i / 128 == 1 { 5.0 } else { 0.5 }).collect();
    place.write("bright.npy", npy_f32([3, 8, 16], &bright));
    let line = "simulate bright.npy --width 16 --height 8 --readouts-per-frame 10";
    // A quarter of a threshold a readout at full scale: what is cut at two would still have counted.
    let ran = place.good(&format!("{line} --camera ideal --exposure 7463 -o dim"));
    assert!(ran.stderr.contains("1 of 3 frames"), "{}", ran.stderr);
    // Beyond two thresholds a readout every pixel fires at every readout anyway.
    let ran = place.good(&format!("{line} -o a"));
    assert!(!ran.stderr.contains("note:"), "{}", ran.stderr);
    let light = place.json("a.json")["light"].clone();
    assert_eq!((light["greatest_light"].as_f64(), light["frames"].as_u64()), (Some(2.0), Some(3)));
    assert_eq!(light["frames_beyond_greatest_light"], 1);
}

#[test]
fn a_dry_run_tells_and_writes_nothing() {
    let place = Place::new();
    let ran = place.good(&format!("simulate --source chart {SMALL} -o a --clean --dry-run --json"));
    let told = ran.events().pop().unwrap();
    assert_eq!(told["readouts"], 300);
    assert_eq!(told["bytes"], 2 * 300 * (63_u64 * 41).div_ceil(8));
    assert!(told["seconds"].as_f64().unwrap() > 0.0 && told["free_bytes"].as_u64().unwrap() > 0);
    assert!(place.names().is_empty());
}

#[test]
fn a_closed_pipe_stops_nothing_and_panics_nowhere() {
    let place = Place::new();
    for line in ["effects", "preset list", "preset show physical", "man"] {
        let mut child = place.command(line).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        drop(child.stdout.take());
        let ran = Ran::of(line, child.wait_with_output().unwrap());
        assert_eq!(ran.code, 0, "{line}: {}", ran.stderr);
    }
}

#[cfg(unix)]
#[test]
fn ctrl_c_leaves_nothing_even_while_the_input_is_silent() {
    let place = Place::new();
    let line = "simulate - --width 20 --height 10 --readouts-per-frame 50 --clean -o a";
    let mut child = place.command(line).stdin(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    // Kept open: the program waits for more.
    let mut input = child.stdin.take().unwrap();
    input.write_all(&y4m(20, 10, &[100, 100])).unwrap();
    input.flush().unwrap();
    let start = Instant::now();
    while !place.names().iter().any(|n| n.ends_with(".partial")) {
        assert!(start.elapsed() < Duration::from_secs(20), "no stream was begun");
        std::thread::sleep(Duration::from_millis(10));
    }
    let sent = Command::new("sh").args(["-c", &format!("kill -INT {}", child.id())]).status().unwrap();
    assert!(sent.success());
    let status = child.wait().unwrap();
    let mut said = String::new();
    child.stderr.take().unwrap().read_to_string(&mut said).unwrap();
    assert_eq!(status.code(), Some(130), "{said}");
    assert_eq!(place.names(), Vec::<String>::new(), "{said}");
}

#[test]
fn the_first_line_and_the_sidecar_say_how_codes_became_light() {
    let place = Place::new();
    place.picture("g.png", 16, 12, 128);
    let base = "simulate g.png --width 16 --height 12 --readouts 200 --force -o o";
    for (flags, said, transfer, full_scale, rate) in [
        ("--camera spike-zoo", "codes taken as light (linear)", "linear", "255", 0.251),
        ("--camera spike-zoo --transfer srgb", "sRGB curve undone", "srgb", "255", 0.108),
        ("--camera spikingsim", "each frame's brightest pixel", "linear", "peak", 0.99),
        ("--camera ideal", "sRGB curve undone", "srgb", "255", 0.216),
        ("--camera ideal --transfer 2.2", "exponent 2.2 undone", "2.2", "255", 0.220),
    ] {
        let ran = place.good(&format!("{base} {flags}"));
        let first = ran.stderr.lines().next().unwrap();
        assert!(first.contains(said) && first.contains("mean rate"), "{flags}: {first}");
        let light = &place.json("o.json")["light"];
        assert_eq!(light["transfer"], transfer, "{flags}");
        assert_eq!(light["full_scale"], full_scale, "{flags}");
        // A spike a pixel of 200 readouts is 0.005.
        let found = place.json("o.json")["mean_rate"].as_f64().unwrap();
        assert!((found - rate).abs() < 0.005, "{flags}: {found}");
    }
}

#[test]
fn a_motion_that_does_not_move_writes_the_stream_of_the_still_picture() {
    let place = Place::new();
    let picture = image::RgbImage::from_fn(37, 23, |x, y| image::Rgb([(6 * x) as u8, (11 * y) as u8, 90]));
    picture.save(place.path("p.png")).unwrap();
    for size in ["--width 16 --height 12", "--width 37 --height 23", "--width 9 --height 40"] {
        let base = format!("simulate p.png {size} --readouts 300 --camera physical --force");
        place.good(&format!("{base} -o still"));
        place.good(&format!("{base} --motion pan=0,0 -o moved"));
        assert_eq!(place.read("still.dat"), place.read("moved.dat"), "{size}");
    }
}
