//! Tests that a printed default changes nothing if it is passed explicitly.

use std::path::Path;

use crate::program_support::{TestFolder, npy_f32};

/// Command lines without flags whose defaults are tested. All outputs begin with `out`.
const COMMANDS: &[&str] = &[
    "simulate -o out/a --width 32 --height 24 --readouts 20",
    "simulate -o out/a --width 32 --height 24 --readouts 20 --builtin-light objects",
    "simulate light.npy -o out/a --width 32 --height 24 --readouts 20",
    "live light.npy --width 32 --height 24 --readouts 20 --sink pipe --block",
    "scene -o out --width 64 --height 40",
    "dataset -o out --scene-preset tiny --sequences 1 --images-per-scene 3 --width 32 --height 24",
    "record ideal -o out --width 16 --height 8 --readouts 200",
    "convert c.dat out.npy",
    "reconstruct c.dat -o out.npy",
    "inspect c.dat",
    "measure c.dat",
    "evaluate c.dat",
];

/// Flags whose default is a description and not a value.
const DESCRIPTIONS: &[(&str, &str)] = &[
    ("--white", "auto"),
    ("--readouts", "all"),
    ("--crop", "all"),
    ("--sequences", "preset"),
    ("--images-per-scene", "preset"),
    ("--method", "all"),
    ("--vehicles", "random"),
    ("--speed-kmh", "random"),
];

/// Returns the flags of a command with the values that its help prints as defaults.
fn printed_defaults(help: &str) -> Vec<(String, String)> {
    let mut defaults = Vec::new();
    let mut flag = String::new();
    for line in help.lines().map(str::trim) {
        let name = line.split_whitespace().take(2).find(|word| word.starts_with("--"));
        if let Some(name) = name.filter(|_| line.starts_with('-')) {
            flag = name.to_owned();
        }
        let Some((_, rest)) = line.split_once("[default: ") else { continue };
        let value = rest.split(']').next().unwrap_or_default().to_owned();
        // A value of several words is a description.
        if !flag.is_empty() && !value.contains(' ') {
            defaults.push((std::mem::take(&mut flag), value));
        }
    }
    defaults
}

/// Collects the files at `path`. Sidecars are read without the command line, which differs.
fn collect(path: &Path, files: &mut Vec<(String, Vec<u8>)>) {
    if path.is_dir() {
        let mut entries: Vec<_> = path.read_dir().unwrap().map(|e| e.unwrap().path()).collect();
        entries.sort();
        return entries.iter().for_each(|entry| collect(entry, files));
    }
    let Ok(bytes) = std::fs::read(path) else { return };
    let text = String::from_utf8_lossy(&bytes);
    let bytes = match serde_json::from_str::<serde_json::Value>(&text) {
        Ok(mut json) if json.is_object() => {
            json.as_object_mut().unwrap().remove("command");
            json.to_string().into_bytes()
        }
        _ => bytes,
    };
    files.push((path.file_name().unwrap().to_string_lossy().into_owned(), bytes));
}

/// Runs a command. Returns its outputs, or `None` if flags exclude each other.
fn outputs(stream: &[u8], line: &str) -> Option<Vec<(String, Vec<u8>)>> {
    let place = TestFolder::new();
    let ramp: Vec<f32> = (0..3 * 24 * 32).map(|i| (i % 97) as f32 / 97.0).collect();
    place.write("light.npy", npy_f32([3, 24, 32], &ramp));
    place.write("c.dat", stream);
    place.write("c.json", r#"{"width":32,"height":24,"layout":"dat","readouts":200,"file":"c.dat","bytes":19200,"digest":"","spikes":0,"mean_rate":0.0,"version":"0"}"#);
    let done = place.command(line).output().unwrap();
    let stderr = String::from_utf8_lossy(&done.stderr);
    let exclusions = [
        "cannot be used with",
        "required arg",
        "no input to which this flag applies",
        "a stream without a mosaic",
    ];
    if done.status.code() == Some(2) && exclusions.iter().any(|words| stderr.contains(words)) {
        return None;
    }
    assert!(done.status.success(), "{line}: {stderr}");
    let mut files = vec![("standard output".to_owned(), done.stdout)];
    for name in ["out", "out.npy"] {
        collect(&place.path(name), &mut files);
    }
    Some(files)
}

/// Runs `base` with each default that the help prints. Returns the number of defaults.
fn check_defaults(base: &str, stream: &[u8]) -> usize {
    let command = base.split_whitespace().next().unwrap();
    let expected = outputs(stream, base).unwrap();
    assert!(expected.iter().any(|(_, bytes)| !bytes.is_empty()), "{base}: no output");
    let help = TestFolder::new().run_ok(&format!("{command} --help")).stdout;
    let mut tested = 0;
    for (flag, value) in printed_defaults(&help) {
        let is_set = base.split_whitespace().any(|word| word == flag) || flag == "--output";
        if is_set || DESCRIPTIONS.contains(&(&*flag, &*value)) {
            continue;
        }
        let line = format!("{base} {flag} {value}");
        let Some(explicit) = outputs(stream, &line) else { continue };
        tested += 1;
        assert_eq!(expected.len(), explicit.len(), "{line}");
        for (wanted, found) in expected.iter().zip(&explicit) {
            assert!(wanted == found, "{line}: {} differs from the run without the flag", wanted.0);
        }
    }
    tested
}

#[test]
fn a_printed_default_gives_the_result_of_no_flag() {
    let place = TestFolder::new();
    place.run_ok("simulate --builtin-light chart --width 32 --height 24 --readouts 200 -o c");
    let stream = &place.read("c.dat");
    let tested: usize = std::thread::scope(|scope| {
        let check = |base| scope.spawn(move || check_defaults(base, stream));
        let running: Vec<_> = COMMANDS.iter().copied().map(check).collect();
        running.into_iter().map(|thread| thread.join().unwrap()).sum()
    });
    assert!(tested > 50, "only {tested} defaults were found in the help");
}

#[test]
fn a_scene_seed_changes_the_scene_and_keeps_the_lighting() {
    let place = TestFolder::new();
    let light_of = |flags: &str| {
        place.run_ok(&format!("simulate --width 32 --height 24 --readouts 20 -o a --force {flags}"));
        place.json("a.json")["light"]["source"].as_str().unwrap().to_owned()
    };
    assert!(light_of("").starts_with("driving scene 0 (noon)"));
    assert!(light_of("--scene-seed 0").starts_with("driving scene 0 (noon)"));
    assert!(light_of("--scene-seed 5").starts_with("driving scene 5 (noon)"));
    // For random lighting, the seed alone determines the lighting.
    let random = light_of("--scene-seed 5 --lighting random");
    assert_eq!(random, light_of("--scene-seed 5 --lighting random"));
    let all: Vec<String> =
        (0..8).map(|seed| light_of(&format!("--scene-seed {seed} --lighting random"))).collect();
    assert!(all.iter().any(|light| !light.contains("(noon)")), "{all:?}");
}
