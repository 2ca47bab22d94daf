//! Tests inputs that are not regular files, that change, or that declare more data than they contain.

use std::os::unix::fs::symlink;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use crate::program_support::{CommandResult, TestFolder, npy_f32, y4m};

/// Time limit of a command, which normally takes less time. A command beyond the limit counts as waiting forever.
const TIMEOUT: Duration = Duration::from_secs(60);

/// Runs a command that must end without further input. After `TIMEOUT`, the function kills the command and panics.
fn run(place: &TestFolder, line: &str) -> CommandResult {
    let mut child =
        place.command(line).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("the program");
    let start = Instant::now();
    while child.try_wait().unwrap().is_none() {
        if start.elapsed() > TIMEOUT {
            child.kill().unwrap();
            panic!("{line}: waits without end");
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    CommandResult::from_output(line, child.wait_with_output().unwrap())
}

/// Every kind of input: a file name, and a command that reads this file.
const INPUT_COMMANDS: [(&str, &str); 17] = [
    ("a.png", "simulate a.png --readouts 5 -o o"),
    ("a.jpg", "simulate a.jpg --readouts 5 -o o"),
    ("a.exr", "simulate a.exr --readouts 5 -o o"),
    ("a.mp4", "simulate a.mp4 -o o"),
    ("a.y4m", "simulate a.y4m -o o"),
    ("a.npy", "simulate a.npy -o o"),
    ("a.npz", "simulate a.npz -o o"),
    ("folder/1.png", "simulate folder -o o --width 8 --height 8"),
    ("timed/timestamps.txt", "simulate timed -o o --width 8 --height 8"),
    ("camera.toml", "simulate --builtin-light chart --readouts 5 --camera camera.toml -o o"),
    ("shown.toml", "preset show shown.toml"),
    ("recordings.toml", "calibrate recordings.toml -o o"),
    ("maps.npz", "calibrate maps.npz -o o"),
    ("s.dat", "inspect s.dat --width 8 --height 2"),
    ("s.npy", "inspect s.npy"),
    ("s.npz", "inspect s.npz --width 8 --height 2"),
    ("v.dat", "convert v.dat o.npy --width 8 --height 2"),
];

fn place() -> TestFolder {
    let place = TestFolder::new();
    for folder in ["folder", "timed"] {
        std::fs::create_dir(place.path(folder)).unwrap();
        place.picture(&format!("{folder}/0.png"), 8, 8, 100);
    }
    place.picture("timed/1.png", 8, 8, 200);
    place
}

#[test]
fn a_pipe_is_refused_at_once_at_every_entry() {
    let place = place();
    for (name, line) in INPUT_COMMANDS {
        assert!(Command::new("mkfifo").arg(place.path(name)).status().unwrap().success());
        let ran = run(&place, line);
        assert_eq!(ran.code, 4, "{line}: {}", ran.stderr);
        assert!(ran.stderr.contains("a pipe or device"), "{line}: {}", ran.stderr);
    }
}

#[test]
fn a_device_without_end_is_refused_at_every_entry() {
    let place = place();
    for (name, line) in INPUT_COMMANDS {
        symlink("/dev/zero", place.path(name)).unwrap();
        let mut ran = run(&place, line);
        if name.contains('/') {
            // The link leaves a folder that the user named.
            assert!(
                ran.code == 4 && ran.stderr.contains("points outside the folder"),
                "{line}: {}",
                ran.stderr
            );
            ran = run(&place, &format!("{line} --follow-links"));
        }
        assert_eq!(ran.code, 4, "{line}: {}", ran.stderr);
        assert!(ran.stderr.contains("a pipe or device"), "{line}: {}", ran.stderr);
    }
}

#[test]
fn a_folder_is_refused_where_a_file_is_meant() {
    let place = place();
    // If a folder has the extension of an image or a video, it is read as a folder of images. Folders inside it are
    // skipped.
    for (name, line) in INPUT_COMMANDS.into_iter().filter(|(name, _)| !name.starts_with("folder/")) {
        std::fs::create_dir(place.path(name)).unwrap();
        let ran = run(&place, line);
        // `calibrate` suggests the command that lists the recordings of a folder.
        let code = if line.starts_with("calibrate") { 2 } else { 4 };
        assert_eq!(ran.code, code, "{line}: {}", ran.stderr);
    }
}

/// Editors on Windows write JSON with a byte order mark, or in UTF-16.
#[test]
fn json_with_a_byte_order_mark_and_in_utf_16_is_read() {
    let place = TestFolder::new();
    place
        .run_ok("simulate --builtin-light chart --width 32 --height 24 --readouts 20 --images-every 10 -o c");
    let scenes =
        "--scene-preset tiny --sequences 1 --images-per-scene 3 --label-every 2 --width 32 --height 24";
    place.run_ok(&format!("dataset {scenes} -o set"));
    place.run_ok(&format!("dataset plan {scenes} --sequences-per-shard 1 -o p"));
    let commands =
        [("c.json", "verify c.json"), ("c.json", "inspect c.dat"), ("p/plan.json", "dataset status p")];
    let utf8 = |text: &str| format!("\u{feff}{text}").into_bytes();
    let utf16 =
        |text: &str| format!("\u{feff}{text}").encode_utf16().flat_map(u16::to_le_bytes).collect::<Vec<u8>>();
    for (file, line) in commands {
        let text = std::fs::read_to_string(place.path(file)).unwrap();
        for bytes in [utf8(&text), utf16(&text)] {
            place.write(file, bytes);
            place.run_ok(line);
        }
        place.write(file, text);
    }
    let manifest = std::fs::read_to_string(place.path("set/manifest.jsonl")).unwrap();
    place.write("set/manifest.jsonl", utf8(&manifest));
    place.run_ok("dataset stats set");
}

/// Returns a command that runs on one thread and with at most `megabytes` of address space.
fn limited_command(place: &TestFolder, megabytes: u32, line: &str) -> Command {
    let shell = format!("ulimit -v {}; exec {} {line}", megabytes << 10, env!("CARGO_BIN_EXE_spikelane"));
    let mut command = Command::new("sh");
    command.args(["-c", &shell]).current_dir(place.path(".")).env("RAYON_NUM_THREADS", "1");
    command.stdin(Stdio::null());
    command
}

fn run_within(place: &TestFolder, megabytes: u32, line: &str) -> CommandResult {
    CommandResult::from_output(line, limited_command(place, megabytes, line).output().unwrap())
}

#[cfg(target_os = "linux")]
#[test]
fn memory_that_is_missing_for_an_input_is_an_error_with_a_code() {
    let place = TestFolder::new();
    // The bitmap has 12000 x 12000 pixels. The pixel data are a hole in a sparse file.
    let mut header = b"BM".to_vec();
    for word in [54 + 432_000_000_u32, 0, 54, 40, 12_000, 12_000, 24 << 16 | 1, 0, 0, 0, 0, 0, 0] {
        header.extend(word.to_le_bytes());
    }
    let long = |name: &str, head: &[u8], len: u64| {
        let path = place.write(name, head);
        std::fs::File::options().write(true).open(path).unwrap().set_len(len).unwrap();
    };
    long("a.bmp", &header, 54 + 432_000_000);
    long("a.y4m", b"YUV4MPEG2 W16000 H8000 F25:1 Ip A1:1 C444\nFRAME\n", 48 + 384_000_000);
    let array = npy_f32([1, 10_000, 10_000], &[]);
    long("a.npy", &array, array.len() as u64 + 400_000_000);
    for name in ["a.bmp", "a.y4m", "a.npy"] {
        let line = format!("simulate {name} --readouts 2 -o o --width 8 --height 8");
        let ran = run_within(&place, 300, &line);
        assert_eq!(ran.code, 11, "{line}: {}", ran.stderr);
        assert!(ran.stderr.contains(name), "{line}: {}", ran.stderr);
    }
}

/// For each memory limit, a command must succeed or exit with the code for missing memory. With the lowest limit it fails.
#[cfg(target_os = "linux")]
#[test]
fn tables_of_each_pixel_end_with_a_code_where_memory_is_missing() {
    let place = TestFolder::new();
    // The sensor has 1024 x 1024 pixels. The tables of the commands need between 30 MB and 1 GB.
    place.write("a.dat", vec![0x55; 17 * 1024 * 128]);
    place.run_ok("record --width 192 --height 192 --readouts 300 -o set");
    // The limit includes the address space of the program itself, which is large in a debug build.
    let loaded =
        |megabytes: &u32| limited_command(&place, *megabytes, "--version").output().unwrap().status.success();
    let program = (16..1024).step_by(16).find(loaded).unwrap();
    let read = "a.dat --width 1024 --height 1024 --layout dat";
    for line in [
        "simulate --builtin-light chart --width 1024 --height 1024 --readouts 4 -o o --force".to_owned(),
        format!("measure {read}"),
        format!("inspect {read} --png i.png --force"),
        format!("evaluate {read}"),
        format!("reconstruct {read} -o r.png --force"),
        "calibrate set/recordings.toml -o made --force".to_owned(),
        "record --width 1024 --height 1024 --readouts 8 -o other --force".to_owned(),
    ] {
        // With 1 MB, a small allocation fails, and the standard library aborts. The abort must give the code too.
        for megabytes in [1, 8, 64, 256] {
            let ran = run_within(&place, program + megabytes, &line);
            let codes: &[i32] = if megabytes < 64 { &[11] } else { &[0, 11] };
            assert!(
                codes.contains(&ran.code),
                "{line}: {program} + {megabytes} MB: {} {}",
                ran.code,
                ran.stderr
            );
        }
    }
}

/// The arguments, the signal handler and the stack need memory before an error can be reported. The range of limits is
/// smaller than the memory that the program requires at its start, so the system can load the program with all of them.
#[cfg(target_os = "linux")]
#[test]
fn a_program_without_memory_to_start_ends_with_a_code() {
    let code = |kibibytes: u32| {
        let shell = format!("ulimit -v {kibibytes}; exec {} --version", env!("CARGO_BIN_EXE_spikelane"));
        Command::new("sh").args(["-c", &shell]).output().unwrap().status.code()
    };
    let (mut without, mut with) = (1 << 14, 1 << 20);
    while with - without > 64 {
        let middle = u32::midpoint(without, with);
        if code(middle) == Some(0) { with = middle } else { without = middle }
    }
    for kibibytes in (without - 3500..=without).step_by(28) {
        assert_eq!(code(kibibytes), Some(11), "{kibibytes} KiB");
    }
}

/// The construction of a scene panics if an allocation fails, and the printing of a backtrace needs memory too. A command
/// that waits for a lock forever ends with 124.
#[cfg(target_os = "linux")]
#[test]
fn scenes_end_with_a_code_where_memory_is_missing() {
    let place = TestFolder::new();
    place.write("tiny.toml", crate::benchmark::short_suite(1));
    let loaded =
        |megabytes: &u32| limited_command(&place, *megabytes, "--version").output().unwrap().status.success();
    let program = (16..1024).step_by(4).find(loaded).unwrap();
    for line in [
        "scene --width 64 --height 48 --frames 1 -o scene --force",
        "dataset --scene-preset tiny --sequences 1 --images-per-scene 3 --width 64 --height 48 -o set --resume",
        "benchmark generate tiny.toml -o data --resume",
    ] {
        for (megabytes, backtrace) in
            [(0, "1"), (8, "0"), (16, "1"), (20, "1"), (24, "0"), (28, "1"), (32, "1")]
        {
            let shell = format!(
                "ulimit -v {}; exec timeout 20 {} {line}",
                (program + megabytes) << 10,
                env!("CARGO_BIN_EXE_spikelane")
            );
            let mut command = Command::new("sh");
            command.args(["-c", &shell]).current_dir(place.path(".")).env("RUST_BACKTRACE", backtrace);
            let code = command.output().unwrap().status.code();
            // The tables of a scene need more than 8 MB.
            let codes: &[i32] = if megabytes < 16 { &[11] } else { &[0, 11] };
            assert!(
                code.is_some_and(|code| codes.contains(&code)),
                "{line}: {program} + {megabytes} MB: {code:?}"
            );
        }
    }
}

#[test]
fn archives_and_headers_that_claim_more_than_a_sensor_has_are_refused() {
    let place = TestFolder::new();
    let file = std::fs::File::create(place.path("bomb.npz")).unwrap();
    let mut zip = zip::ZipWriter::new(file);
    for name in ["D_light", "Nd"] {
        zip.start_file(format!("{name}.npy"), zip::write::SimpleFileOptions::default()).unwrap();
        std::io::Write::write_all(&mut zip, &npy_f32([1, 16_384, 16_383], &[])).unwrap();
    }
    zip.finish().unwrap();
    place.run_refused("calibrate bomb.npz -o o", 4, &["at most 16777216 values"]);
    let head = |w: u32, h: u32| format!("YUV4MPEG2 W{w} H{h} F25:1 Ip A1:1 C444\n");
    place.write("bomb.y4m", head(16_000, 16_000));
    place.run_refused("simulate bomb.y4m -o o", 4, &["frames of more than 536870912 bytes"]);
    place.write("bomb.npy", npy_f32([3, 16_000, 16_000], &[]));
    place.run_refused("simulate bomb.npy -o o", 4, &["frames of at most 536870912 bytes"]);
    place.write("good.y4m", y4m(8, 8, &[9]));
    place.run_ok("simulate good.y4m -o good --width 8 --height 8 --readouts 4");
}

#[test]
fn a_playlist_under_the_name_of_a_video_reads_no_other_file() {
    let place = TestFolder::new();
    place.write("other.y4m", y4m(64, 48, &[9; 30]));
    let text = format!("#EXTM3U\n#EXT-X-MEDIA-SEQUENCE:0\n#EXTINF:10.0,\n{}\n#EXT-X-ENDLIST\n", "other.y4m");
    for name in ["clip.mp4", "-clip.mp4", "clip:1.mp4"] {
        place.write(name, &text);
        let ran = run(&place, &format!("simulate -o o --width 32 --height 24 -- {name}"));
        // The exit code is 8 if ffmpeg is not installed.
        assert!([4, 8].contains(&ran.code), "{name}: {}", ran.stderr);
        assert!(!place.path("o.dat").exists());
    }
}

#[test]
fn a_ring_that_is_emptied_ends_the_camera_with_a_code_and_removes_the_name() {
    let place = TestFolder::new();
    let ring = place.path("ring");
    let line = format!(
        "live --builtin-light chart --width 32 --height 24 --readout-hz 2000 --sink shm:{}",
        ring.display()
    );
    let child = place.command(&line).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let start = Instant::now();
    while !std::fs::metadata(&ring).is_ok_and(|metadata| metadata.len() > 0) {
        assert!(start.elapsed() < TIMEOUT, "no ring");
        std::thread::sleep(Duration::from_millis(5));
    }
    std::fs::File::create(&ring).unwrap();
    let ran = CommandResult::from_output(&line, child.wait_with_output().unwrap());
    assert_eq!(ran.code, 5, "{}", ran.stderr);
    assert!(ran.stderr.contains("shortened"), "{}", ran.stderr);
    assert!(!ring.exists());
}

#[test]
fn a_request_to_stop_ends_the_wait_for_standard_input() {
    let place = TestFolder::new();
    let head = "YUV4MPEG2 W8 H8 F25:1 Ip A1:1 Cmono\n";
    // The input stops before the first byte, or after the header and before the first frame.
    for sent in ["", head] {
        let line = "simulate - -o o --width 8 --height 8";
        let mut child = place.command(line).stdin(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        let mut pipe = child.stdin.take().unwrap();
        std::io::Write::write_all(&mut pipe, sent.as_bytes()).unwrap();
        // The signal is sent repeatedly, because the first one can arrive before the program has installed its handler.
        let start = Instant::now();
        while child.try_wait().unwrap().is_none() {
            assert!(start.elapsed() < TIMEOUT, "waits without end");
            std::thread::sleep(Duration::from_millis(300));
            Command::new("kill").arg(child.id().to_string()).status().unwrap();
        }
        let status = child.wait().unwrap();
        let by_default = std::os::unix::process::ExitStatusExt::signal(&status) == Some(15);
        assert!(status.code() == Some(130) || by_default, "{status}");
        assert!(place.file_names().is_empty());
        drop(pipe);
    }
}

#[test]
fn damage_is_an_error_or_a_warning_that_names_the_image() {
    let place = TestFolder::new();
    let image = image::GrayImage::from_fn(16, 16, |x, y| image::Luma([(x * y) as u8]));
    std::fs::create_dir(place.path("clip")).unwrap();
    for name in ["clip/1.jpg", "clip/2.jpg"] {
        image.save(place.path(name)).unwrap();
    }
    let whole = place.read("clip/2.jpg");
    place.write("clip/2.jpg", &whole[..whole.len() - 20]);
    let line = "simulate clip -o o --size-from-input --camera ideal --readouts-per-frame 2";
    place.run_refused(line, 4, &["2.jpg", "end marker", "--accept-damage"]);
    let ran = place.run_ok(&format!("{line} --accept-damage"));
    assert!(ran.stderr.contains("warning: clip: 2.jpg: damaged"), "{}", ran.stderr);
}
