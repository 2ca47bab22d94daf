//! Tests `-` as standard input and standard output.

use std::io::Write as _;
use std::process::{Output, Stdio};

use crate::program_support::TestFolder;

/// Creates a folder with the stream `c.dat` of 32x24 pixels.
fn with_stream() -> TestFolder {
    let place = TestFolder::new();
    place.run_ok("simulate --builtin-light chart --width 32 --height 24 --readouts 200 -o c");
    place
}

/// Runs a command with `input` at standard input.
fn run_with_input(place: &TestFolder, line: &str, input: Vec<u8>) -> Output {
    let mut command = place.command(line);
    command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().unwrap();
    let mut stdin = child.stdin.take().unwrap();
    let writer = std::thread::spawn(move || {
        // A command that is refused does not read its input.
        let _ = stdin.write_all(&input);
    });
    let output = child.wait_with_output().unwrap();
    writer.join().unwrap();
    output
}

#[test]
fn convert_writes_the_bytes_of_a_file_to_standard_output() {
    let place = with_stream();
    for (flags, name) in
        [("", "a.dat"), ("--to npy-bytes", "a.npy"), ("--readouts 3..9 --crop 4,4,8,8", "b.dat")]
    {
        place.run_ok(&format!("convert c.dat {name} {flags}"));
        let before = place.file_names();
        let output = place.command(&format!("convert c.dat - {flags}")).output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        assert!(output.stdout == place.read(name), "{name}");
        assert_eq!(place.file_names(), before);
    }
    place.run_refused("convert c.dat - --to events", 2, &["events", "a file"]);
    place.run_refused("convert c.dat - --json", 2, &["--json", "standard output"]);
}

#[test]
fn a_stream_is_read_from_standard_input() {
    let place = with_stream();
    let bytes = place.read("c.dat");
    let size = "--width 32 --height 24";
    let inspected = run_with_input(&place, &format!("inspect - {size} --json"), bytes.clone());
    let event: serde_json::Value = serde_json::from_slice(&inspected.stdout).unwrap();
    assert_eq!((&event["readouts"], &event["bytes"]), (&200.into(), &bytes.len().into()));
    let converted = run_with_input(&place, &format!("convert - - --to npy-bytes {size}"), bytes.clone());
    place.run_ok("convert c.dat c.npy");
    assert!(converted.stdout == place.read("c.npy"));
    // The header of an array states the size.
    let npy = place.read("c.npy");
    let back = run_with_input(&place, "convert - -", npy);
    assert!(back.stdout == bytes, "{}", String::from_utf8_lossy(&back.stderr));
    let refused = run_with_input(&place, "inspect -", bytes);
    let text = String::from_utf8_lossy(&refused.stderr);
    assert!(text.contains("--width") && text.contains("standard input"), "{text}");
}

#[test]
fn reconstruct_writes_the_png_of_a_file_to_standard_output() {
    let place = with_stream();
    place.run_ok("reconstruct c.dat -o a.png");
    let before = place.file_names();
    let output = place.command("reconstruct c.dat -o -").output().unwrap();
    assert!(output.stdout == place.read("a.png"));
    assert_eq!(place.file_names(), before);
    place.run_refused("reconstruct c.dat -o - --every 10", 2, &["--every"]);
}

#[test]
fn outputs_of_several_files_refuse_a_dash() {
    let place = with_stream();
    for line in [
        "simulate --readouts 20 --width 32 --height 24 -o -",
        "scene -o -",
        "dataset -o -",
        "record ideal -o -",
        "calibrate missing.toml -o -",
        "inspect c.dat --png -",
        "preset show ideal -o -",
        "calibrate -",
        "verify -",
    ] {
        place.run_refused(line, 2, &["./-"]);
    }
    place.run_ok("simulate --readouts 20 --width 32 --height 24 -o ./-");
    assert!(place.path("-.dat").exists());
}
