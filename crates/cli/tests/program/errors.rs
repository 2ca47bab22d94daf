//! Tests invalid input. The exit code must be correct and the message helpful. No output may look complete.

use std::fs;

use crate::program_support::{CommandResult, TestFolder, exists, npy_f32, y4m};

const SMALL_SIZE_FLAGS: &str = "--width 16 --height 8";

/// Creates a folder that contains the valid stream `good.dat` with 20 readouts.
fn with_stream() -> TestFolder {
    let place = TestFolder::new();
    place.run_ok("simulate --builtin-light chart --width 32 --height 24 --readouts 20 -o good");
    place
}

#[test]
fn an_empty_stream_is_refused_and_a_cut_one_read_up_to_the_cut() {
    let place = with_stream();
    place.write("empty.dat", "");
    place.write("cut.dat", &place.read("good.dat")[..1000]);
    for command in ["inspect", "convert", "reconstruct"] {
        let rest = match command {
            "inspect" => "",
            "convert" => "new.dat",
            _ => "-o new.png",
        };
        let size = "--width 32 --height 24";
        place.run_refused(&format!("{command} empty.dat {rest} {size}"), 4, &["empty.dat", "0 bytes"]);
        let ran = place.run_ok(&format!("{command} cut.dat {rest} {size}"));
        assert!(
            ran.stderr.contains("cut.dat: the stream ends inside readout 10; ignored: 40 bytes"),
            "{}",
            ran.stderr
        );
    }
    // The file has complete frames, but fewer frames than the sidecar states.
    place.write("good.dat", &place.read("good.dat")[..96 * 19]);
    assert!(place.run_ok("inspect good.dat").stderr.contains("19 readouts, but the sidecar states 20"));
    place.run_refused("verify good.dat", 9, &["good.dat", "1824 bytes", "1920 bytes"]);
}

#[test]
fn a_changed_bit_is_found() {
    let place = with_stream();
    let mut bytes = place.read("good.dat");
    bytes[777] ^= 4;
    place.write("good.dat", bytes);
    place.run_refused("verify good.dat", 9, &["good.dat", "blake3:"]);
    place.run_refused("verify good.json", 9, &["good.dat"]);
}

#[test]
fn a_backend_that_the_environment_misspells_is_refused() {
    let place = TestFolder::new();
    let line = "simulate --builtin-light chart --width 32 --height 24 --readouts 20 -o good";
    let output = place.command(line).env("SPIKELANE_BACKEND", "avx3").output().unwrap();
    let ran = CommandResult::from_output(line, output);
    assert_eq!(ran.code, 2, "{}", ran.stderr);
    for word in ["SPIKELANE_BACKEND", "avx3", "avx512"] {
        assert!(ran.stderr.contains(word), "{}", ran.stderr);
    }
    assert!(place.file_names().is_empty());
}

#[test]
fn a_geometry_that_does_not_divide_the_file_is_refused() {
    let place = with_stream();
    place.run_refused(
        "inspect good.dat --width 33 --height 24 --layout dat",
        4,
        &["good.dat", "multiple of 99"],
    );
    place.run_refused("inspect good.dat --width 33", 2, &["good.dat", "--height"]);
}

#[test]
fn a_setting_in_an_error_is_named_by_its_flag() {
    let place = with_stream();
    place.write("bare.dat", place.read("good.dat"));
    let ran = place.run("inspect bare.dat --json");
    assert!(ran.stderr.contains("check --width, --height and --layout"), "{}", ran.stderr);
    let message = ran.events().pop().unwrap()["message"].as_str().unwrap().to_owned();
    assert!(ran.stderr.contains(&message), "{message}");
}

#[test]
fn images_of_mixed_size_are_refused() {
    let place = TestFolder::new();
    fs::create_dir(place.path("images")).unwrap();
    place.picture("images/1.png", 16, 8, 10);
    place.picture("images/2.png", 16, 9, 10);
    place.run_refused(
        &format!("simulate images {SMALL_SIZE_FLAGS} --readouts-per-frame 5 -o a"),
        4,
        &["2.png", "16x9", "1.png"],
    );
}

#[test]
fn light_that_is_no_light_is_refused_even_late() {
    let place = TestFolder::new();
    for (name, bad) in [("nan", f32::NAN), ("negative", -0.5), ("infinite", f32::INFINITY)] {
        let mut values = vec![0.5; 4 * 128];
        // Only the last frame is invalid. The program reads it when it has already written a part of the stream.
        values[3 * 128 + 17] = bad;
        place.write(&format!("{name}.npy"), npy_f32([4, 8, 16], &values));
        let line = format!("simulate {name}.npy {SMALL_SIZE_FLAGS} --readouts-per-frame 400 --clean -o a");
        place.run_refused(&line, 4, &[name, "row 1, col 1"]);
    }
}

#[test]
fn an_input_that_is_cut_short_is_refused() {
    let place = TestFolder::new();
    let video = y4m(16, 8, &[1, 2, 3]);
    place.write("cut.y4m", &video[..video.len() - 10]);
    place.run_refused(
        &format!("simulate cut.y4m {SMALL_SIZE_FLAGS} --readouts-per-frame 5 -o a"),
        4,
        &["cut.y4m"],
    );
    let array = npy_f32([4, 8, 16], &vec![0.5; 4 * 128]);
    place.write("cut.npy", &array[..array.len() - 10]);
    place.run_refused(
        &format!("simulate cut.npy {SMALL_SIZE_FLAGS} --readouts-per-frame 5 -o a"),
        4,
        &["cut.npy"],
    );
    place.write("empty.png", "");
    place.run_refused(&format!("simulate empty.png {SMALL_SIZE_FLAGS} --readouts 5 -o a"), 4, &["empty.png"]);
}

#[test]
fn zero_readouts_and_a_still_without_a_duration_are_refused() {
    let place = TestFolder::new();
    place.picture("one.png", 16, 8, 10);
    place.run_refused(
        &format!("simulate one.png {SMALL_SIZE_FLAGS} --readouts 0 -o a"),
        2,
        &["--readouts", "0"],
    );
    place.run_refused(
        &format!("simulate one.png {SMALL_SIZE_FLAGS} --readouts-per-frame 0 -o a"),
        2,
        &["--readouts-per-frame"],
    );
    place.run_refused(&format!("simulate one.png {SMALL_SIZE_FLAGS} -o a"), 2, &["one.png", "--readouts"]);
    place.write("two.npy", npy_f32([2, 8, 16], &[0.5; 256]));
    let ran = place.run_ok(&format!("simulate two.npy {SMALL_SIZE_FLAGS} -o a"));
    assert!(
        ran.stderr.contains("two.npy states no frame rate: each frame lasts 20 readouts"),
        "{}",
        ran.stderr
    );
    assert_eq!(place.read("a.dat").len(), 40 * 16);
}

#[test]
fn presets_that_make_no_sense_are_refused() {
    let place = TestFolder::new();
    for (name, text, word) in [
        ("key", "[effects.prnu]\nsigmma = 0.02", "sigmma"),
        ("effect", "[effects.prnoo]\nsigma = 0.02", "prnoo"),
        ("unit", "[sensor]\nswing = \"1.1 fF\"", "1.1 fF"),
        ("bare", "[sensor]\nswing = 1.1", "swing"),
        // Full scale is 400 thresholds per readout. One threshold then has fewer than 1024 fixed-point steps.
        (
            "wide",
            "[sensor]\nthresholds_at_full_scale = 400\n[effects.shot_noise]\nstrength = 1",
            "fixed point",
        ),
    ] {
        place.write(&format!("{name}.toml"), text);
        let line = format!(
            "simulate --builtin-light chart {SMALL_SIZE_FLAGS} --readouts 5 --width 16 --height 16 --camera {name}.toml -o a"
        );
        let line = line.replace(&format!("{SMALL_SIZE_FLAGS} "), "");
        place.run_refused(&line, 3, &[word]);
    }
    place.run_refused(
        "simulate --builtin-light chart --readouts 5 --camera nothing -o a",
        3,
        &["nothing", "physical"],
    );
    place.run_refused(
        "simulate --builtin-light chart --readouts 5 --effect prnu.sigma=-1 -o a",
        3,
        &["prnu", "sigma"],
    );
    place.run_refused(
        "simulate --builtin-light chart --readouts 5 --effect prnu -o a",
        2,
        &["NAME.KEY=VALUE"],
    );
    place.run_refused(
        "simulate --builtin-light chart --readouts 5 --camera missing.toml -o a",
        5,
        &["missing.toml"],
    );
}

#[test]
fn a_video_without_ffmpeg_says_what_to_install() {
    let place = with_stream();
    place.write("video.mp4", "not looked at");
    let before = place.file_names();
    for (line, word) in [
        (format!("simulate video.mp4 {SMALL_SIZE_FLAGS} -o a"), "video.mp4"),
        ("reconstruct good.dat -o a.mp4".into(), "ffmpeg"),
    ] {
        let ran = CommandResult::from_output(&line, place.command(&line).env("PATH", "").output().unwrap());
        assert_eq!(ran.code, 8, "{line}: {}", ran.stderr);
        assert!(ran.stderr.contains(word) && ran.stderr.contains("install"), "{}", ran.stderr);
        assert_eq!(place.file_names(), before);
    }
}

#[test]
fn nothing_is_overwritten_without_force() {
    let place = TestFolder::new();
    for existing in ["a.dat", "a.clean.dat", "a.json", "a.png"] {
        place.write(existing, "mine");
        place.run_refused(
            "simulate --builtin-light chart --width 16 --height 16 --readouts 9 --clean -o a",
            7,
            &[existing, "--force"],
        );
        assert_eq!(place.read(existing), b"mine");
        fs::remove_file(place.path(existing)).unwrap();
    }
    place.run_ok("simulate --builtin-light chart --width 16 --height 16 --readouts 9 -o a");
    for (line, output) in
        [("convert a.dat", "b.npy"), ("reconstruct a.dat -o", "b.png"), ("reconstruct a.dat -o", "b.npy")]
    {
        place.write(output, "mine");
        place.run_refused(&format!("{line} {output}"), 7, &[output]);
        assert_eq!(place.read(output), b"mine");
        place.run_ok(&format!("{line} {output} --force"));
        assert_ne!(place.read(output), b"mine");
    }
    place.run_ok("simulate --builtin-light chart --width 16 --height 16 --readouts 18 -o a --force");
    place.run_ok("verify a.dat");
    assert_eq!(place.json("a.json")["readouts"], 18);
}

#[test]
fn a_stream_that_cannot_fit_the_disk_is_refused_before_the_start() {
    let place = TestFolder::new();
    place.run_refused("simulate --builtin-light chart --readouts 1000000000000 -o a", 6, &["a.dat", "free"]);
}

/// The test fills the disk while the program writes a stream of unknown length.
#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_leaves_nothing() {
    use std::io::Write as _;
    use std::process::{Command, Stdio};

    let place = TestFolder::new();
    let disk = place.path("disk");
    fs::create_dir(&disk).unwrap();
    let mount = Command::new("mount").args(["-t", "tmpfs", "-o", "size=20m", "none"]).arg(&disk).output();
    if !mount.is_ok_and(|o| o.status.success()) {
        println!("skipped: mounting a small disk needs more rights than this user has");
        return;
    }
    // Each of the three frames becomes 12.5 MB of the stream.
    let line = "simulate - --readouts-per-frame 1000 -o disk/a";
    let mut child = place.command(line).stdin(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    // The program can stop reading before the end of the input, so the write may fail.
    let _ = child.stdin.take().unwrap().write_all(&y4m(400, 250, &[0, 0, 0]));
    let output = child.wait_with_output().unwrap();
    let left = fs::read_dir(&disk).unwrap().count();
    let unmounted = Command::new("umount").arg(&disk).status().unwrap();
    let ran = CommandResult::from_output(line, output);
    assert_eq!((ran.code, left), (6, 0), "{}", ran.stderr);
    assert!(ran.stderr.contains("a.dat") && unmounted.success());
}

#[test]
fn a_missing_input_is_named_and_leaves_no_folder_behind() {
    let place = TestFolder::new();
    place.run_refused("simulate missing.png --readouts 5 -o new/a", 5, &["missing.png"]);
    place.run_refused("inspect missing.dat", 5, &["missing.dat"]);
    assert!(!exists(&place.path("new")));
}

#[test]
fn a_missing_output_folder_is_made_with_its_parents() {
    let place = TestFolder::new();
    place.run_ok("simulate --builtin-light chart --readouts 5 -o new/folder/a");
    assert!(exists(&place.path("new/folder/a.dat")));
}
