//! Tests error messages. Libraries name a setting by its key, and the program prints the flag of this setting.

mod docs_support;

use std::collections::BTreeSet;
use std::process::Command;

use docs_support::{files, page};

/// Folders with the sources of the libraries.
const LIBRARIES: &[&str] = &[
    "src",
    "crates/io/src",
    "crates/scene/src",
    "crates/measure/src",
    "crates/calibrate/src",
    "crates/dataset/src",
    "crates/benchmark/src",
    "crates/view/src",
];

/// Lines that may contain a flag or a command of the program, with the reason.
const EXCEPTIONS: &[(&str, &str, &str)] = &[
    ("src/threads/spawn.rs", "docker run --pids-limit", "a flag of another program"),
    (
        "crates/dataset/src/config/mod.rs",
        "It is made by: spikelane dataset --config",
        "the command that recreates a dataset, in a file for people",
    ),
];

/// Returns the lines of a source file without comments and unit tests, with their numbers.
fn code_lines(text: &str) -> impl Iterator<Item = (usize, &str)> {
    let code = text.split("\n#[cfg(test)]\nmod ").next().unwrap_or_default();
    code.lines().enumerate().filter(|(_, line)| !line.trim_start().starts_with("//"))
}

/// Whether a line contains a flag such as `--width`, or a command such as `'spikelane inspect`.
fn names_the_program(line: &str) -> bool {
    let is_flag = |(at, _): (usize, &str)| line[at + 2..].starts_with(|c: char| c.is_ascii_lowercase());
    line.match_indices("--").any(is_flag) || line.contains("'spikelane ")
}

fn sources() -> Vec<(String, String)> {
    let names = LIBRARIES.iter().flat_map(|folder| files(folder));
    let is_source = |name: &String| name.ends_with(".rs") && !name.ends_with("tests.rs");
    names.filter(is_source).map(|name| (name.clone(), page(&name).text)).collect()
}

/// Returns the keys in `Setting("key")` of all libraries.
fn setting_keys() -> BTreeSet<String> {
    let mut keys = BTreeSet::new();
    for (_, text) in sources() {
        for (_, line) in code_lines(&text) {
            for rest in line.split("Setting(\"").skip(1) {
                keys.extend(rest.split('"').next().map(str::to_owned));
            }
        }
    }
    keys
}

fn long_help(path: &str) -> String {
    let args = path.split_whitespace();
    let out = Command::new(env!("CARGO_BIN_EXE_spikelane")).args(args).arg("--help").output().unwrap();
    String::from_utf8(out.stdout).unwrap()
}

#[test]
fn messages_of_libraries_name_no_flag_and_no_command() {
    let mut found = Vec::new();
    for (name, text) in sources() {
        for (i, line) in code_lines(&text).filter(|(_, line)| names_the_program(line)) {
            let is_exception = |(file, part, _): &(&str, &str, &str)| name == *file && line.contains(part);
            if !EXCEPTIONS.iter().any(is_exception) {
                found.push(format!("{name}:{}: {}", i + 1, line.trim()));
            }
        }
    }
    assert!(found.is_empty(), "use a Setting instead:\n{}", found.join("\n"));
}

#[test]
fn every_exception_is_necessary() {
    for (file, part, reason) in EXCEPTIONS {
        let text = page(file).text;
        assert!(code_lines(&text).any(|(_, l)| l.contains(part) && names_the_program(l)), "{file}: {reason}");
    }
}

#[test]
fn flags_and_commands_in_a_line_are_found() {
    for line in ["give --width", "name '--layout npy-bits'", "'spikelane simulate' does it"] {
        assert!(names_the_program(line), "{line}");
    }
    for line in ["a -- b", "<!-- comment -->", "-- Lists", "spikelane 1.0"] {
        assert!(!names_the_program(line), "{line}");
    }
}

#[test]
fn every_setting_is_a_flag_of_the_program() {
    let keys = setting_keys();
    assert!(keys.len() > 10, "{keys:?}");
    let commands =
        ["simulate", "inspect", "convert", "evaluate", "calibrate", "compare", "diagnose", "dataset"];
    let nested = ["dataset plan", "dataset run", "benchmark run"];
    let help: String = commands.iter().chain(&nested).map(|path| long_help(path)).collect();
    for key in keys {
        let flag = format!("--{}", key.replace('_', "-"));
        let is_listed = help.split_whitespace().any(|word| word == flag);
        assert!(is_listed, "`{key}` is spelled {flag}, which no command has");
    }
}
