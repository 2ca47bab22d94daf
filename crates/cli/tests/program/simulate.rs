//! Tests `simulate`, and the program without arguments.

use std::io::{Read as _, Write as _};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use crate::program_support::{CommandResult, TestFolder, npy_f32, y4m};
use spikelane::Backend;

/// A small simulation. A readout of 63 x 41 pixels is not a whole number of bytes.
const SMALL_RUN_FLAGS: &str = "--width 63 --height 41 --readouts 300";

#[test]
fn the_main_job_writes_everything_and_runs_again_without_loss() {
    let place = TestFolder::new();
    let ran = place.run_ok("");
    let out = |name: &str| format!("out/{name}");
    for name in ["drive.dat", "drive.clean.dat", "drive.json", "drive.png"] {
        assert!(ran.stderr.contains(name), "{name} in {}", ran.stderr);
        assert!(!place.read(&out(name)).is_empty());
    }
    assert!(ran.stderr.contains("500 readouts of 400x250: 25 ms of camera time"), "{}", ran.stderr);
    // A valid run prints no notes and no warnings.
    assert!(!ran.stderr.contains("note:") && !ran.stderr.contains("warning:"), "{}", ran.stderr);
    assert_eq!(place.read("out/drive.dat").len(), 500 * 12_500);
    let sidecar = place.json("out/drive.json");
    assert_eq!((sidecar["width"].as_u64(), sidecar["readouts"].as_u64()), (Some(400), Some(500)));
    // A second run writes the same bytes to the same names.
    let before = place.read("out/drive.dat");
    place.run_ok("");
    assert!(before == place.read("out/drive.dat"));
    assert!(!place.path("out/drive-2.dat").exists());
    // A file of the user that has this name must not be changed.
    place.write("out/drive.dat", "mine");
    place.run_ok("");
    assert_eq!(place.read("out/drive.dat"), b"mine");
    assert!(place.read("out/drive-2.dat") == before);
}

#[test]
fn built_in_light_is_a_drive_unless_another_is_named() {
    let place = TestFolder::new();
    let base = "simulate --width 64 --height 40 --readouts 40";
    for (source, words) in [
        ("", "driving scene"),
        ("--builtin-light drive --scene-seed 3 --lighting night", "(night)"),
        ("--builtin-light chart", "test chart"),
        ("--builtin-light objects --scene-seed 3", "random objects"),
    ] {
        let name = words.replace(['(', ')', ' '], "");
        place.run_ok(&format!("{base} {source} -o {name}"));
        let light = place.json(&format!("{name}.json"))["light"]["source"].clone();
        assert!(light.as_str().unwrap().contains(words), "{source}: {light}");
    }
    place.run_refused(&format!("{base} --builtin-light chart --lighting night -o a"), 2, &["--lighting"]);
    place.run_refused(&format!("{base} --transfer srgb -o a"), 2, &["--transfer"]);
    place.picture("gray.png", 64, 40, 128);
    place.run_refused(&format!("{base} gray.png --builtin-light chart -o a"), 2, &["--builtin-light"]);
}

#[test]
fn threads_and_backends_give_the_same_bits() {
    let place = TestFolder::new();
    let base = format!(
        "simulate --builtin-light chart {SMALL_RUN_FLAGS} --seed 5 --camera-seed 6 --sequence 7 --clean"
    );
    place.run_ok(&format!("{base} -o first --threads 1 --backend reference"));
    let digest = |stem: &str| {
        let sidecar = place.json(&format!("{stem}.json"));
        (sidecar["digest"].clone(), sidecar["clean"]["digest"].clone())
    };
    for threads in 1..=3 {
        for backend in Backend::ALL {
            if !backend.is_available() {
                println!("skipped {backend}: this CPU lacks it");
                continue;
            }
            let stem = format!("t{threads}-{backend}");
            place.run_ok(&format!("{base} -o {stem} --threads {threads} --backend {backend}"));
            assert_eq!(digest(&stem), digest("first"), "{stem}");
        }
    }
}

/// While the chart moves, the lossy stream is expected to lose 60 +- 7 of 300 readouts. The clean stream loses no
/// readouts.
#[test]
fn a_camera_that_drops_readouts_still_fills_the_file() {
    let place = TestFolder::new();
    let base = format!("simulate {SMALL_RUN_FLAGS} --clean");
    place.run_ok(&format!("{base} -o whole"));
    place.run_ok(&format!("{base} --effect dropped_readouts.probability=0.2 -o lossy"));
    let (full, lossy) = (place.read("whole.dat"), place.read("lossy.dat"));
    assert_eq!(lossy.len(), full.len());
    assert!(place.read("lossy.clean.dat") == place.read("whole.clean.dat"));
    let bytes = full.len() / 300;
    let mut rest = full.chunks(bytes);
    let matched = lossy.chunks(bytes).take_while(|&frame| rest.any(|other| other == frame)).count();
    // The lossy stream has as many readouts as the full stream. Its last readouts replace the lost readouts. They
    // record light after the end of the full stream, so they match no readout of the full stream.
    assert!((200..280).contains(&matched), "{matched} frames of the whole stream, in their order");
}

#[test]
fn a_clean_twin_of_an_earlier_run_is_pointed_at() {
    let place = TestFolder::new();
    let line = format!("simulate --builtin-light chart {SMALL_RUN_FLAGS} -o a --force");
    assert!(!place.run_ok(&line).stderr.contains("a.clean.dat"));
    place.run_ok(&format!("{line} --clean"));
    let before = place.read("a.clean.dat");
    let ran = place.run_ok(&line);
    assert!(ran.stderr.contains("a.clean.dat is from an earlier run"), "{}", ran.stderr);
    assert_eq!(place.read("a.clean.dat"), before);
}

#[test]
fn seeds_move_what_is_theirs_and_a_clean_twin_shares_the_start_phase() {
    let place = TestFolder::new();
    // The light is uniform and the clean camera has no effect except the start phase. Therefore two clean streams differ
    // only in the phase.
    place.picture("gray.png", 63, 41, 128);
    let base = format!("simulate gray.png --transfer linear {SMALL_RUN_FLAGS} --clean");
    place.run_ok(&format!("{base} -o a"));
    place.run_ok(&format!("{base} -o b --camera-seed 1"));
    place.run_ok(&format!("{base} -o c --seed 1"));
    place.run_ok(&format!("{base} -o d --sequence 1"));
    assert!(place.read("a.clean.dat") == place.read("b.clean.dat"), "the pattern moved the clean stream");
    assert!(place.read("a.clean.dat") != place.read("c.clean.dat"), "the shot seed left the phase");
    assert!(place.read("a.clean.dat") != place.read("d.clean.dat"), "the sequence left the phase");
    assert!(place.read("a.dat") != place.read("b.dat"));
    // If all other effects are disabled, the noisy stream equals the clean stream.
    let off = "--disable-effect prnu --disable-effect dark_current --disable-effect dark_tail --disable-effect hot_pixels \
               --disable-effect shot_noise --disable-effect dark_shot_noise --disable-effect thermal_noise \
               --disable-effect capacitor_mismatch";
    place.run_ok(&format!("{base} {off} -o e"));
    assert!(place.read("e.dat") == place.read("a.clean.dat"));
}

#[test]
fn json_is_one_object_a_line_and_people_are_told_on_standard_error() {
    let place = TestFolder::new();
    let ran = place.run_ok(&format!("simulate --builtin-light chart {SMALL_RUN_FLAGS} -o a --json"));
    let events = ran.events();
    assert_eq!(events.first().unwrap()["event"], "start");
    assert_eq!(events.last().unwrap()["event"], "done");
    assert_eq!(events.last().unwrap()["digest"], place.json("a.json")["digest"]);
    assert!(ran.stderr.contains("a.dat"));
    let failed = place.run(&format!("simulate --builtin-light chart {SMALL_RUN_FLAGS} -o a --json"));
    assert_eq!(failed.code, 7);
    assert_eq!(failed.events()[0]["exit_code"], 7);
}

#[test]
fn the_sidecar_holds_what_is_needed_to_make_the_stream_again() {
    let place = TestFolder::new();
    place.run_ok(&format!(
        "simulate --builtin-light chart {SMALL_RUN_FLAGS} -o a --seed 3 --exposure 20000 --effect prnu.sigma=0.03"
    ));
    let sidecar = place.json("a.json");
    assert_eq!(sidecar["seeds"]["shot"], 3);
    assert!((sidecar["light"]["exposure_electrons"].as_f64().unwrap() - 20_000.0).abs() < 1e-6);
    assert_eq!(sidecar["camera"]["effects"]["prnu"]["sigma"], 0.03);
    assert!(sidecar["command"].as_array().unwrap().iter().any(|a| a == "--exposure"));
    place.write("again.toml", sidecar["camera"]["toml"].as_str().unwrap());
    place.run_ok("simulate --builtin-light chart --camera again.toml --readouts 300 --seed 3 -o b");
    assert_eq!(place.json("b.json")["digest"], sidecar["digest"]);
}

#[test]
fn a_stream_ends_with_its_source_and_hold_shows_each_frame_as_long_as_asked() {
    let place = TestFolder::new();
    // The frames are dark or full scale. Pixels of `ideal` fire never or at every readout.
    place.write("video.y4m", y4m(16, 8, &[0, 255, 0]));
    let ideal = "--camera ideal --disable-effect start_phase --width 16 --height 8 --interpolation hold --to npy-bytes";
    place.run_ok(&format!("simulate video.y4m {ideal} --readouts-per-frame 5 -o a"));
    let bytes = place.read("a.npy");
    let data = &bytes[bytes.len() - 15 * 128..];
    let spikes: Vec<usize> =
        data.chunks(128).map(|frame| frame.iter().map(|&b| usize::from(b)).sum()).collect();
    let mut expected = vec![0; 15];
    expected[5..10].fill(128);
    assert_eq!(spikes, expected);
    assert_eq!(place.json("a.json")["readouts"], 15);
    let ran = place.run_ok(&format!("simulate video.y4m {ideal} --readouts-per-frame 5 --readouts 99 -o b"));
    assert!(ran.stderr.contains("15 of 99"), "{}", ran.stderr);
    assert!(place.read("b.npy") == bytes);
}

#[test]
fn standard_input_gives_the_bits_of_the_file() {
    let place = TestFolder::new();
    let video = y4m(20, 10, &[10, 60, 110, 160, 210]);
    place.write("video.y4m", &video);
    for (layout, ending) in [("dat", "dat"), ("npy-bits", "npy")] {
        let line =
            format!("--width 20 --height 10 --interpolation linear --readouts-per-frame 33 --to {layout}");
        place.run_ok(&format!("simulate video.y4m {line} -o file-{layout}"));
        let line = format!("simulate - {line} -o pipe-{layout}");
        let mut child = place.command(&line).stdin(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        child.stdin.take().unwrap().write_all(&video).unwrap();
        let ran = CommandResult::from_output(&line, child.wait_with_output().unwrap());
        assert_eq!(ran.code, 0, "{}", ran.stderr);
        // The program learns the length of a pipe only at the end. This must not change the files or digests.
        assert!(
            place.read(&format!("file-{layout}.{ending}")) == place.read(&format!("pipe-{layout}.{ending}"))
        );
        place.run_ok(&format!("verify pipe-{layout}.json"));
    }
}

#[test]
fn light_beyond_the_greatest_is_counted_and_told() {
    let place = TestFolder::new();
    let bright: Vec<f32> = (0..3 * 128).map(|i| if i / 128 == 1 { 5.0 } else { 0.5 }).collect();
    place.write("bright.npy", npy_f32([3, 8, 16], &bright));
    let line = "simulate bright.npy --width 16 --height 8 --readouts-per-frame 10";
    // Full scale is 0.25 thresholds per readout. Clipping light above two full scales would change the stream.
    let ran = place.run_ok(&format!("{line} --camera ideal --exposure 7463 -o dim"));
    assert!(ran.stderr.contains("1 of 3 frames"), "{}", ran.stderr);
    // Two full scales are more than two thresholds per readout, and every pixel fires at every readout. Clipping does not
    // change the stream.
    let ran = place.run_ok(&format!("{line} -o a"));
    assert!(!ran.stderr.contains("note:"), "{}", ran.stderr);
    let light = place.json("a.json")["light"].clone();
    assert_eq!((light["max_light"].as_f64(), light["frames"].as_u64()), (Some(2.0), Some(3)));
    assert_eq!(light["frames_above_max_light"], 1);
}

#[test]
fn a_dry_run_tells_and_writes_nothing() {
    let place = TestFolder::new();
    let ran = place
        .run_ok(&format!("simulate --builtin-light chart {SMALL_RUN_FLAGS} -o a --clean --dry-run --json"));
    let told = ran.events().pop().unwrap();
    assert_eq!(told["readouts"], 300);
    assert_eq!(told["bytes"], 2 * 300 * (63_u64 * 41).div_ceil(8));
    assert!(told["seconds"].as_f64().unwrap() > 0.0 && told["free_bytes"].as_u64().unwrap() > 0);
    assert!(place.file_names().is_empty());
}

#[test]
fn a_closed_pipe_stops_nothing_and_panics_nowhere() {
    let place = TestFolder::new();
    for line in ["effects", "preset list", "preset show physical", "man"] {
        let mut child = place.command(line).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        drop(child.stdout.take());
        let ran = CommandResult::from_output(line, child.wait_with_output().unwrap());
        assert_eq!(ran.code, 0, "{line}: {}", ran.stderr);
    }
}

#[cfg(unix)]
#[test]
fn ctrl_c_leaves_nothing_even_while_the_input_is_silent() {
    let place = TestFolder::new();
    let line = "simulate - --width 20 --height 10 --readouts-per-frame 50 --clean -o a";
    let mut child = place.command(line).stdin(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    // The pipe stays open, so the program waits for more input.
    let mut input = child.stdin.take().unwrap();
    input.write_all(&y4m(20, 10, &[100, 100])).unwrap();
    input.flush().unwrap();
    let start = Instant::now();
    while !place.file_names().iter().any(|n| n.ends_with(".partial")) {
        assert!(start.elapsed() < Duration::from_secs(20), "no stream was begun");
        std::thread::sleep(Duration::from_millis(10));
    }
    let sent = Command::new("sh").args(["-c", &format!("kill -INT {}", child.id())]).status().unwrap();
    assert!(sent.success());
    let status = child.wait().unwrap();
    let mut stderr = String::new();
    child.stderr.take().unwrap().read_to_string(&mut stderr).unwrap();
    assert_eq!(status.code(), Some(130), "{stderr}");
    assert_eq!(place.file_names(), Vec::<String>::new(), "{stderr}");
}

#[test]
fn the_first_line_and_the_sidecar_say_how_codes_became_light() {
    let place = TestFolder::new();
    place.picture("g.png", 16, 12, 128);
    let base = "simulate g.png --width 16 --height 12 --readouts 200 --force -o o";
    for (flags, said, transfer, full_scale, rate) in [
        ("--camera spike-zoo", "linear codes", "linear", "255", 0.251),
        ("--camera spike-zoo --transfer srgb", "sRGB curve inverted", "srgb", "255", 0.108),
        ("--camera spikingsim", "each frame's brightest pixel", "linear", "peak", 0.99),
        ("--camera ideal", "sRGB curve inverted", "srgb", "255", 0.216),
        ("--camera ideal --transfer 2.2", "exponent 2.2 inverted", "2.2", "255", 0.220),
        ("--camera ideal --transfer linear --full-scale 200", "full scale 200", "linear", "200", 0.64),
    ] {
        let ran = place.run_ok(&format!("{base} {flags}"));
        let first = ran.stderr.lines().next().unwrap();
        assert!(first.contains(said) && first.contains("mean rate"), "{flags}: {first}");
        let light = &place.json("o.json")["light"];
        assert_eq!(light["transfer"], transfer, "{flags}");
        assert_eq!(light["full_scale"], full_scale, "{flags}");
        // The count of a pixel in 200 readouts can be wrong by one spike, which is a rate of 0.005.
        let found = place.json("o.json")["mean_rate"].as_f64().unwrap();
        assert!((found - rate).abs() < 0.005, "{flags}: {found}");
    }
}

#[test]
fn full_scale_of_the_light_is_in_the_units_of_the_input() {
    let place = TestFolder::new();
    image::ImageBuffer::<image::Luma<u16>, _>::from_pixel(16, 12, image::Luma([2048_u16]))
        .save(place.path("g.png"))
        .unwrap();
    let base = "simulate g.png --width 16 --height 12 --readouts 20 --camera ideal --force -o o";
    for (flags, full_scale) in [("", "65535"), ("--full-scale 4095", "4095")] {
        let ran = place.run_ok(&format!("{base} {flags}"));
        assert!(ran.stderr.contains(&format!("full scale {full_scale}\n")), "{}", ran.stderr);
        assert_eq!(place.json("o.json")["light"]["full_scale"], full_scale, "{flags}");
    }
    // Earlier versions wrote the 8-bit code of the camera's front end.
    let sidecar = place.read("o.json");
    let sidecar = String::from_utf8(sidecar).unwrap().replace("\"4095\",", "\"255\",");
    place.write("o.json", sidecar);
    place.run_ok("verify o.json");
}

#[test]
fn a_count_of_one_has_a_singular_noun() {
    let place = TestFolder::new();
    place.picture("g.png", 16, 12, 128);
    let ran = place.run_ok("simulate g.png --width 16 --height 12 --readouts 1 -o o");
    assert!(ran.stderr.contains("1 readout of 16x12"), "{}", ran.stderr);
    let inspected = place.run_ok("inspect o.dat").stdout;
    assert!(inspected.contains("1 readout of 16x12"), "{inspected}");
    place.run_refused("inspect o.dat --width 17 --height 12", 4, &["24 bytes (0 whole frames and 24 bytes)"]);
}

#[test]
fn a_motion_that_does_not_move_writes_the_stream_of_the_still_picture() {
    let place = TestFolder::new();
    let picture = image::RgbImage::from_fn(37, 23, |x, y| image::Rgb([(6 * x) as u8, (11 * y) as u8, 90]));
    picture.save(place.path("p.png")).unwrap();
    for size in ["--width 16 --height 12", "--width 37 --height 23", "--width 9 --height 40"] {
        let base = format!("simulate p.png {size} --readouts 300 --camera physical --force");
        place.run_ok(&format!("{base} -o still"));
        place.run_ok(&format!("{base} --motion pan=0,0 -o moved"));
        assert_eq!(place.read("still.dat"), place.read("moved.dat"), "{size}");
    }
}

#[test]
fn the_light_is_described_as_what_it_is() {
    let place = TestFolder::new();
    place.picture("gray.png", 32, 24, 128);
    let base = "simulate --width 32 --height 24 --readouts 20 --force -o a";
    for (flags, words) in [
        ("", "driving scene 0 (noon), white "),
        ("--builtin-light chart", "built-in test chart"),
        ("--builtin-light objects", "random objects of seed 0"),
    ] {
        let ran = place.run_ok(&format!("{base} {flags}"));
        assert!(
            ran.stderr.contains(&format!("light: {words}").replace("light: random", "random")),
            "{}",
            ran.stderr
        );
        assert!(!ran.stderr.contains("codes") && !ran.stderr.contains("luminance"), "{}", ran.stderr);
        let forecast = place.run_ok(&format!("{base} {flags} --dry-run")).stdout;
        assert!(forecast.contains(words) && !forecast.contains("codes"), "{forecast}");
        let light = &place.json("a.json")["light"];
        assert_eq!(light["transfer"], "linear");
        for key in ["luminance", "gray_codes", "full_scale", "resize_mode"] {
            assert!(light.get(key).is_none(), "{flags}: {light}");
        }
    }
    let ran = place.run_ok(&format!("{base} gray.png"));
    assert!(ran.stderr.contains("sRGB curve inverted"), "{}", ran.stderr);
    let light = &place.json("a.json")["light"];
    assert_eq!((&light["resize_mode"], &light["full_scale"]), (&"cover".into(), &"255".into()));
}
