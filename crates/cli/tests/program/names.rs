//! Tests files whose names are not UTF-8 or contain control characters.

use std::ffi::{OsStr, OsString};
use std::os::unix::ffi::{OsStrExt as _, OsStringExt as _};
use std::process::Output;

use crate::program_support::TestFolder;

/// Stems with a byte that is not UTF-8, with control characters, and with a colon.
const STEMS: [&[u8]; 3] = [b"a\xffb", b"red\x1b[31m\nline", b"12:30"];

fn name_of(stem: &[u8], ending: &str) -> OsString {
    OsString::from_vec([stem, ending.as_bytes()].concat())
}

/// Runs a command whose arguments `@STEM` are replaced. The output must be safe to print.
fn run(place: &TestFolder, line: &str, stem: &[u8]) -> Output {
    let mut command = place.command("");
    for word in line.split_whitespace() {
        match word.strip_prefix('@') {
            Some(ending) => command.arg(name_of(stem, ending)),
            None => command.arg(OsStr::new(word)),
        };
    }
    let output = command.output().unwrap();
    let stderr = String::from_utf8(output.stderr.clone()).unwrap();
    assert!(output.status.success(), "{line} with {:?}: {stderr}", OsStr::from_bytes(stem));
    let printed = String::from_utf8(output.stdout.clone()).unwrap() + &stderr;
    assert!(!printed.contains('\x1b'), "{line}: {printed:?}");
    if line.contains("--json") {
        for event in String::from_utf8_lossy(&output.stdout).lines() {
            serde_json::from_str::<serde_json::Value>(event)
                .unwrap_or_else(|e| panic!("{line}: {e}: {event}"));
        }
    }
    output
}

#[test]
fn the_sidecar_of_any_name_is_found() {
    for stem in STEMS {
        let place = TestFolder::new();
        let size = "--width 32 --height 24 --readouts 200 --images-every 50 --clean";
        run(&place, &format!("simulate --builtin-light chart {size} -o @ --json"), stem);
        for line in [
            "inspect @.dat --digest --json",
            "inspect @.clean.dat",
            "verify @.dat @.clean.dat --json",
            "verify @.json --json",
            "reconstruct @.dat -o @.r.png --json",
            "evaluate @.dat --reference @.images --window 33",
            "convert @.dat @.npy --json",
            "verify @.npy @.npy.json",
            "measure @.dat --json",
            "simulate @.npy -o @.again --width 32 --height 24 --readouts-per-frame 1 --json",
        ] {
            run(&place, line, stem);
        }
        let inspected = run(&place, "inspect @.dat --digest", stem);
        assert!(String::from_utf8_lossy(&inspected.stdout).contains("equal to the digest in the sidecar"));
    }
}

/// Creates a folder `in` with an image folder whose name is `stem`.
fn with_input(stem: &[u8]) -> TestFolder {
    let place = TestFolder::new();
    let folder = place.path("in").join(name_of(stem, ""));
    std::fs::create_dir_all(&folder).unwrap();
    place.picture("g.png", 32, 24, 100);
    for i in 0..3 {
        std::fs::copy(place.path("g.png"), folder.join(format!("{i}.png"))).unwrap();
    }
    place
}

#[test]
fn inputs_of_a_dataset_have_any_name_that_is_utf_8() {
    let line = "dataset --from in -o out --width 32 --height 24";
    for stem in &STEMS[1..] {
        run(&with_input(stem), &format!("{line} --json"), stem);
    }
    with_input(STEMS[0]).run_refused(line, 4, &["not UTF-8", "rename the input"]);
}
