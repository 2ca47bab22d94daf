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

/// Texts that a message prints with `{:?}`, because this form escapes a text of a file and puts quotation marks around it,
/// and values that no message prints. Each entry is a part of a line.
const QUOTED: &[(&str, &str, &str)] = &[
    ("src/effects/camera.rs", "{sensor:?} {light:?} {window:?}", "a hash"),
    ("src/effects/camera.rs", "{mosaic:?}", "a hash"),
    ("src/inputs/digest.rs", "the digest {:?} is not", "a text"),
    ("src/inputs/names.rs", "{fault}: {text:?}", "a text"),
    ("src/inputs/names.rs", "{fault}: {:?}\", excerpt(&text)", "a text"),
    ("crates/benchmark/src/score/boxes.rs", "the class {:?}, expected", "a text"),
    ("crates/benchmark/src/score/mod.rs", "the date {:?}", "a text"),
    ("crates/dataset/src/pack_schema.rs", "the seed {text:?}", "a text"),
    ("crates/dataset/src/tar_index.rs", "of type {:?}\", char::from(", "a character"),
    ("crates/dataset/src/manifest.rs", "|l| format!(\"{l:?}\")", "a text"),
    ("crates/diagnose/src/sensors/cache_key.rs", "format!(\"{light:?}\")", "a part of a key"),
    ("crates/view/src/query.rs", "|t| format!(\"{t:?}\")", "a text"),
    ("crates/view/src/labels.rs", "found \"{kind:?}\"", "a text"),
];

/// Whether a line formats a value with `Debug`, such as `{:?}` or `{value:#?}`.
fn prints_debug(line: &str) -> bool {
    line.match_indices("?}").any(|(at, _)| {
        let before =
            line[..at].trim_end_matches(|c: char| c.is_ascii_digit() || matches!(c, '#' | '.' | '<' | '>'));
        before.ends_with(':') && before.rfind('{') > before.rfind('}')
    })
}

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
fn no_message_prints_the_debug_form_of_a_value() {
    let is_exception =
        |name: &str, line: &str| QUOTED.iter().any(|(file, part, _)| name == *file && line.contains(part));
    let more = ["crates/cli/src", "crates/diagnose/src"].into_iter().flat_map(files);
    let more = more.filter(|name| name.ends_with(".rs")).map(|name| (name.clone(), page(&name).text));
    let mut found = Vec::new();
    for (name, text) in sources().into_iter().chain(more) {
        for (i, line) in code_lines(&text) {
            if prints_debug(line) && !line.contains("assert") && !is_exception(&name, line) {
                found.push(format!("{name}:{}: {}", i + 1, line.trim()));
            }
        }
    }
    assert!(found.is_empty(), "implement Display, or print the value:\n{}", found.join("\n"));
    for (file, part, reason) in QUOTED {
        let text = page(file).text;
        assert!(
            code_lines(&text).any(|(_, line)| line.contains(part) && prints_debug(line)),
            "{file}: {part}: {reason}"
        );
    }
}

#[test]
fn the_debug_form_in_a_line_is_found() {
    for line in
        ["format!(\"{:?}\", x)", "found(format_args!(\"a {shape:?} b\"))", "\"{x:#?}\"", "\"{x:.1?}\""]
    {
        assert!(prints_debug(line), "{line}");
    }
    for line in ["Err(e)?}", "\"did you mean {name}?\"", "{ let x = f()?; }", "match x { a => b()? }"] {
        assert!(!prints_debug(line), "{line}");
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
