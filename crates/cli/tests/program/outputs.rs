//! Tests outputs: overwriting files, locking against a second writer, and checking folders before the work begins.

use std::fs;
use std::os::unix::fs::FileTypeExt as _;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use crate::program_support::{CommandResult, TestFolder, exists};

const CHART: &str = "simulate --builtin-light chart --width 32 --height 24 --readouts 20";

/// Creates a folder that contains the stream `c.dat`.
fn with_stream() -> TestFolder {
    let place = TestFolder::new();
    place.run_ok(&format!("{CHART} -o c"));
    place
}

/// Starts a `simulate` process that claims the outputs of the stem `t` and then waits for light.
fn spawn_waiting(place: &TestFolder) -> Child {
    let line = "simulate - --width 20 --height 10 --readouts-per-frame 50 --clean -o t --force";
    let child = place.command(line).stdin(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap();
    let start = Instant::now();
    while !place.file_names().contains(&".t.png.lock".to_owned()) {
        assert!(start.elapsed() < Duration::from_secs(60), "no claim: {:?}", place.file_names());
        std::thread::sleep(Duration::from_millis(5));
    }
    child
}

#[test]
fn force_replaces_files_and_links_and_nothing_else() {
    let place = with_stream();
    let fifo = Command::new("mkfifo").arg(place.path("pipe.dat")).status().unwrap();
    assert!(fifo.success());
    std::os::unix::fs::symlink("/dev/null", place.path("null.dat")).unwrap();
    fs::create_dir(place.path("folder.dat")).unwrap();
    for name in ["pipe.dat", "null.dat", "folder.dat"] {
        place.run_refused(&format!("convert c.dat {name} --force"), 7, &[name, "only plain files"]);
        let stem = name.trim_end_matches(".dat");
        place.run_refused(&format!("{CHART} -o {stem} --force"), 7, &[name]);
    }
    assert!(fs::symlink_metadata(place.path("pipe.dat")).unwrap().file_type().is_fifo());
    place.write("target", "mine");
    std::os::unix::fs::symlink("target", place.path("link.dat")).unwrap();
    place.run_refused("convert c.dat link.dat", 7, &["link.dat"]);
    place.run_ok("convert c.dat link.dat --force");
    assert_eq!((place.read("target"), place.read("link.dat")), (b"mine".to_vec(), place.read("c.dat")));
}

#[test]
fn a_second_writer_of_a_stem_is_told_that_another_process_writes_it() {
    let place = with_stream();
    let mut first = spawn_waiting(&place);
    for line in [
        format!("{CHART} -o t --force"),
        format!("{CHART} -o t"),
        "convert c.dat t.dat --force".to_owned(),
        "reconstruct c.dat -o t.png --force".to_owned(),
    ] {
        place.run_refused(&line, 10, &["t.", "another process"]);
    }
    // Another stem in the same folder can be written at the same time.
    place.run_ok(&format!("{CHART} -o u"));
    drop(first.stdin.take());
    assert_eq!(first.wait().unwrap().code(), Some(4));
    place.run_ok(&format!("{CHART} -o t"));
    assert!(!place.file_names().iter().any(|name| name.starts_with('.')), "{:?}", place.file_names());
}

#[test]
fn the_lock_of_a_killed_writer_blocks_nobody() {
    let place = with_stream();
    let mut first = spawn_waiting(&place);
    first.kill().unwrap();
    first.wait().unwrap();
    let listed = place.run_ok("partials").stdout;
    // The process may have been killed before it wrote its number into the last lock.
    let mut locks = listed.lines().filter(|line| line.contains(".lock:")).peekable();
    assert!(locks.peek().is_some() && locks.all(|line| line.contains("ended")), "{listed}");
    place.run_ok(&format!("{CHART} -o t --clean"));
    place.run_ok("verify t.json");
    assert!(!place.file_names().iter().any(|name| name.starts_with('.')), "{:?}", place.file_names());
}

#[test]
fn what_a_running_process_writes_is_listed_and_never_deleted() {
    let place = TestFolder::new();
    let mut first = spawn_waiting(&place);
    place.write(".u.dat.77-0.spikelane.partial", "half");
    let before = place.file_names();
    let ran = place.run_ok("partials --delete --json");
    let events = ran.events();
    let event_of =
        |name: &str| events.iter().find(|e| e["file"].as_str().is_some_and(|f| f.ends_with(name))).unwrap();
    let (running, left) = (event_of(".t.dat.lock"), event_of(".u.dat.77-0.spikelane.partial"));
    assert_eq!((&running["running"], &running["deleted"]), (&true.into(), &false.into()));
    assert_eq!(running["process"], first.id());
    assert_eq!(
        (&left["running"], &left["deleted"], &left["process"]),
        (&false.into(), &true.into(), &77.into())
    );
    // The running process may replace other hidden files at any time, but its locks stay.
    let names = place.file_names();
    let locks: Vec<&String> = before.iter().filter(|name| name.ends_with(".lock")).collect();
    assert!(!locks.is_empty() && locks.iter().all(|lock| names.contains(lock)), "{before:?} {names:?}");
    assert!(!names.iter().any(|name| name.ends_with(".u.dat.77-0.spikelane.partial")), "{names:?}");
    first.kill().unwrap();
    first.wait().unwrap();
}

/// Commands that write an output. Their inputs do not exist.
const WRITERS: &[&str] = &[
    "simulate missing.png --readouts 5 -o OUT/a",
    "convert missing.dat OUT/a.dat",
    "reconstruct missing.dat -o OUT/a.png",
    "record -o OUT",
    "calibrate missing.toml -o OUT",
    "compare missing.dat -o OUT",
    "diagnose missing.toml -o OUT",
    "measure missing.dat --report OUT/a.html",
    "inspect missing.dat --png OUT/a.png",
    "scene -o OUT",
    "dataset --scene-preset tiny --sequences 1 --images-per-scene 3 -o OUT",
    "dataset stats missing --report OUT/a.html",
    "evaluate missing.dat --report OUT/a.html",
    "dataset preview missing -o OUT/a.mp4",
    "preset show physical -o OUT",
    "man --output OUT",
];

#[test]
fn images_that_a_killed_run_left_half_written_stop_no_later_run() {
    let place = TestFolder::new();
    let line =
        "simulate --builtin-light chart --width 64 --height 48 --readouts 20 --images-every 10 -o out/a";
    place.run_ok(line);
    std::fs::create_dir_all(place.path("out/.a.images.spikelane.partial")).unwrap();
    place.write(
        "out/.a.images.spikelane.partial/.000000.png.4194304-2.spikelane.partial",
        "half of a picture",
    );
    place.run_ok(&format!("{line} --force"));
    assert!(!place.path("out/.a.images.spikelane.partial").exists());
    assert!(place.path("out/a.images/000000.png").exists());
}

#[test]
fn a_folder_that_cannot_be_made_is_named_before_work_begins() {
    let place = TestFolder::new();
    place.write("file", "mine");
    for line in WRITERS {
        // `reconstruct` reads the stream before it checks the output, because it needs the number of pictures.
        if !line.starts_with("reconstruct") {
            place.run_refused(&line.replace("OUT", "file/out"), 5, &["file", "choose another output folder"]);
        }
    }
    assert_eq!(place.read("file"), b"mine");
}

#[test]
fn a_folder_that_was_made_for_nothing_is_removed() {
    let place = TestFolder::new();
    for line in WRITERS.iter().filter(|line| line.contains("missing")) {
        let ran = place.run(&line.replace("OUT", "new/deep"));
        assert!([2, 5].contains(&ran.code), "{line}: {} {}", ran.code, ran.stderr);
        assert_eq!(place.file_names(), Vec::<String>::new(), "{line}");
    }
}

#[test]
fn the_folder_of_a_stem_is_made_with_its_parents() {
    let place = with_stream();
    place.run_ok(&format!("{CHART} -o out/of/light/run"));
    place.run_ok("verify out/of/light/run.dat");
    place.run_ok("convert c.dat other/c.npy");
    place.run_ok("reconstruct c.dat -o pictures/one.png");
    place.run_ok("inspect c.dat --png looks/c.png");
    assert!(exists(&place.path("looks/c.png")));
}

/// Runs a command with a `ulimit` of the shell.
fn run_limited(place: &TestFolder, limit: &str, line: &str) -> CommandResult {
    let script = format!("ulimit {limit}; exec {} {line}", env!("CARGO_BIN_EXE_spikelane"));
    let output = Command::new("bash").args(["-c", &script]).current_dir(place.path("")).output().unwrap();
    CommandResult::from_output(line, output)
}

#[test]
fn a_file_beyond_the_size_limit_is_an_error_and_leaves_nothing() {
    let place = TestFolder::new();
    place.run_ok("simulate --builtin-light chart --width 64 --height 64 --readouts 400 -o c");
    let before = place.file_names();
    // The file size limit is 20 blocks of 1024 bytes. Each stream has 200 kB. If the length of a stream is known, the
    // space is reserved in advance. Otherwise the stream is written step by step.
    for line in [
        "simulate --builtin-light chart --width 64 --height 64 --readouts 400 -o a --clean",
        "convert c.dat new/b.npy",
        "reconstruct c.dat -o all.npy --every 10",
        "record --width 64 --height 64 --readouts 400 -o set",
    ] {
        let ran = run_limited(&place, "-f 20", line);
        assert_eq!(ran.code, 6, "{line}: {}", ran.stderr);
        assert!(ran.stderr.contains("ulimit -f"), "{line}: {}", ran.stderr);
        assert_eq!(place.file_names(), before, "{line}");
    }
}

#[test]
fn a_request_to_stop_ends_commands_that_do_not_look_for_it() {
    let place = TestFolder::new();
    place.run_ok("record --width 16 --height 12 --readouts 2600 -o set");
    let before = place.file_names();
    let line = "calibrate set/recordings.toml -o made";
    let mut child = place.command(line).stderr(Stdio::piped()).spawn().unwrap();
    let start = Instant::now();
    while !exists(&place.path("made/.camera.toml.lock")) {
        assert!(start.elapsed() < Duration::from_secs(60), "no claim");
        std::thread::sleep(Duration::from_millis(1));
    }
    let sent = Command::new("kill").args(["-TERM", &child.id().to_string()]).status().unwrap();
    assert!(sent.success());
    let code = child.wait().unwrap().code();
    // The command can end before the signal arrives.
    assert!(
        code == Some(130) && place.file_names() == before || code == Some(0),
        "{code:?} {:?}",
        place.file_names()
    );
}

#[test]
fn what_is_recorded_names_no_folder_of_the_machine() {
    let place = with_stream();
    place.picture("light.png", 16, 8, 100);
    place.run_ok("record --width 16 --height 12 --readouts 1100 -o set");
    let here = place.path("").canonicalize().unwrap();
    let here = here.to_str().unwrap().trim_end_matches('/').to_owned();
    let lines = |flags: &str| {
        [
            format!(
                "simulate {here}/light.png --width 16 --height 8 --readouts 20 -o {here}/OUT/light {flags}"
            ),
            format!("convert {here}/c.dat {here}/OUT/c.npy {flags}"),
            format!("measure {here}/c.dat --report {here}/OUT/m.html {flags}"),
            format!(
                "compare {here}/set/recordings.toml ideal --max-readouts 50 -o {here}/OUT/compared {flags}"
            ),
            format!("calibrate {here}/set/recordings.toml -o {here}/OUT/calibrated {flags}"),
            format!("preset show physical -o {here}/OUT/camera {flags}"),
            format!("record {flags} --width 16 --height 12 --readouts 20 -o {here}/OUT/set"),
        ]
    };
    for line in lines("") {
        place.run_ok(&line.replace("OUT", "out"));
    }
    let matches = Command::new("grep").args(["-rlF", &here, "out"]).current_dir(&here).output().unwrap();
    assert_eq!(String::from_utf8_lossy(&matches.stdout), "");
    assert_eq!(place.json("out/light.json")["command"][2], "light.png");
    place.run_ok(&lines("--record-paths")[0].replace("OUT", "kept"));
    assert_eq!(place.json("kept/light.json")["command"][2], format!("{here}/light.png"));
}
