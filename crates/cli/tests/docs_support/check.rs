//! Checks commands without running them. The command, its cargo target and its flags must exist.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::process::Command;
use std::sync::{Mutex, OnceLock};

use super::{files, root};

/// Flags of cargo that pages may use.
const CARGO_FLAGS: &[&str] = &[
    "--release",
    "-p",
    "--example",
    "--test",
    "--bench",
    "--bin",
    "--lib",
    "--no-default-features",
    "--features",
    "--path",
    "--workspace",
    "--all-targets",
    "--no-deps",
    "--doc",
    "--profile",
    "--prefix",
    "--no-dedupe",
    "-e",
];

/// Flags of the test harness that pages may use.
const TEST_FLAGS: &[&str] = &["--ignored", "--nocapture", "--exact", "--include-ignored", "--test-threads"];

/// Unix programs that a page may use without listing them as a requirement.
const SYSTEM_PROGRAMS: &[&str] =
    &["cat", "cd", "cp", "echo", "export", "head", "ls", "mkdir", "mv", "rm", "sed", "printf"];

/// Returns one line for each error in the commands of a block.
pub(crate) fn command_errors(text: &str) -> Vec<String> {
    let commands = commands(text);
    // `own` contains the functions that the block defines as `name() {`.
    let functions: Vec<&str> = commands.iter().filter_map(|words| words[0].strip_suffix("()")).collect();
    let known = |name: &str| functions.contains(&name.trim_end_matches("()")) || matches!(name, "{" | "}");
    commands.iter().filter(|words| !known(&words[0])).filter_map(|words| check_command(words).err()).collect()
}

/// Returns the words of each command. Continued lines are joined. Comments, assignments and redirections are removed.
fn commands(text: &str) -> Vec<Vec<String>> {
    let text = text.replace("\\\n", " ");
    let mut all: Vec<Vec<String>> = text.lines().flat_map(parse_line).collect();
    for words in &mut all {
        let assigned = words.iter().take_while(|word| is_assignment(word)).count();
        words.drain(..assigned);
        let end = words.iter().position(|word| word.starts_with('>')).unwrap_or(words.len());
        words.truncate(end);
    }
    all.retain(|words| !words.is_empty());
    all
}

fn is_assignment(word: &str) -> bool {
    word.split_once('=').is_some_and(|(name, _)| name.chars().all(|c| c.is_ascii_uppercase() || c == '_'))
}

/// Splits a line into commands at `|`, `;` and `&`. Removes quotes.
fn parse_line(line: &str) -> Vec<Vec<String>> {
    let mut all = vec![Vec::new()];
    let (mut word, mut begun, mut quote) = (String::new(), false, None);
    for c in line.chars().chain([' ']) {
        match (quote, c) {
            (Some(q), c) if c == q => quote = None,
            (None, '\'' | '"') => (quote, begun) = (Some(c), true),
            (None, '#') if !begun => break,
            (None, ' ' | '|' | ';' | '&') => {
                if std::mem::take(&mut begun) {
                    all.last_mut().unwrap().push(std::mem::take(&mut word));
                }
                if c != ' ' {
                    all.push(Vec::new());
                }
            }
            _ => {
                word.push(c);
                begun = true;
            }
        }
    }
    all
}

fn check_command(words: &[String]) -> Result<(), String> {
    let line = words.join(" ");
    let fail = |what: &str| Err(format!("{line}: {what}"));
    match words[0].as_str() {
        "spikelane" => check_program(&words[1..]).map_err(|e| format!("{line}: {e}")),
        "cargo" => check_cargo(&words[1..]).map_err(|e| format!("{line}: {e}")),
        "pip" | "python" | "python3" => match words.iter().skip(1).find(|w| w.ends_with(".py")) {
            Some(script) if !root().join(script).is_file() => fail("no such script"),
            _ => Ok(()),
        },
        name if name.contains('/') && !root().join(name).is_file() => fail("no such script"),
        name if name.contains('/') || SYSTEM_PROGRAMS.contains(&name) || is_installed(name) => Ok(()),
        // Pages may use these external programs, even if they are not installed here.
        "ffmpeg" | "jq" | "parallel" | "sbatch" => Ok(()),
        _ => fail("an unknown command"),
    }
}

/// Returns the folders of all packages in the workspace, relative to the repository root.
fn packages() -> Vec<String> {
    let mut all: Vec<String> =
        [".", "bindings/c", "bindings/python", "studies", "tests/outside_effect"].map(str::to_owned).into();
    let crates = fs::read_dir(root().join("crates")).unwrap();
    all.extend(crates.map(|entry| format!("crates/{}", entry.unwrap().file_name().to_string_lossy())));
    all
}

/// Whether the shell finds a program with this name.
pub(crate) fn is_installed(name: &str) -> bool {
    let output = Command::new("sh").args(["-c", "command -v \"$0\"", name]).output();
    output.is_ok_and(|out| out.status.success())
}

fn flags(words: &[String]) -> impl Iterator<Item = &str> {
    words.iter().filter(|w| w.starts_with('-') && w.len() > 1).map(|w| w.split('=').next().unwrap())
}

fn check_program(words: &[String]) -> Result<(), String> {
    let path: Vec<&str> = match words.first().map(String::as_str) {
        None => vec![],
        Some(first) if first.starts_with('-') => vec![],
        Some("preset") if words.len() > 1 => vec!["preset", words[1].as_str()],
        Some(name @ ("dataset" | "benchmark"))
            if words.get(1).is_some_and(|w| !w.starts_with(['-', '[', '<'])) =>
        {
            vec![name, words[1].as_str()]
        }
        Some(first) => vec![first],
    };
    let help = help_text(&path)?;
    let known = |flag: &str| {
        let ends = |rest: &str| !rest.starts_with(|c: char| c.is_alphanumeric() || c == '-');
        help.match_indices(flag).any(|(at, _)| ends(&help[at + flag.len()..]))
    };
    match flags(words).find(|flag| !known(flag)) {
        Some(flag) => Err(format!("`spikelane {} --help` has no {flag}", path.join(" "))),
        None => Ok(()),
    }
}

/// Whether a command of the program, of cargo, of a study or of a script has this flag.
pub(crate) fn is_flag(flag: &str) -> bool {
    static KNOWN: OnceLock<BTreeSet<String>> = OnceLock::new();
    let known = KNOWN.get_or_init(|| {
        let mut found =
            BTreeSet::from_iter([CARGO_FLAGS, TEST_FLAGS].concat().into_iter().map(str::to_owned));
        add_program_flags(&[], &mut found);
        let sources = files("studies/src").into_iter().chain(files("bindings/python"));
        for source in sources.filter(|name| name.ends_with(".rs") || name.ends_with(".py")) {
            let text = fs::read_to_string(root().join(source)).unwrap();
            found.extend(text.split('"').filter(|word| word.starts_with("--")).map(str::to_owned));
        }
        found
    });
    known.contains(flag)
}

/// Adds the flags in the help of a command and of its subcommands.
fn add_program_flags(path: &[&str], found: &mut BTreeSet<String>) {
    let help = help_text(path).unwrap();
    let word = |c: char| c.is_ascii_alphanumeric() || c == '-';
    found.extend(help.split(|c| !word(c)).filter(|w| w.starts_with("--")).map(str::to_owned));
    let Some((_, list)) = help.split_once("Commands:\n") else { return };
    for row in list.lines().take_while(|line| !line.is_empty()).filter(|line| !line.starts_with("   ")) {
        let name = row.split_whitespace().next().unwrap();
        if name != "help" {
            add_program_flags(&[path, &[name]].concat(), found);
        }
    }
}

/// Returns the `--help` text of a command. Texts are cached.
fn help_text(path: &[&str]) -> Result<String, String> {
    static KNOWN: Mutex<BTreeMap<String, String>> = Mutex::new(BTreeMap::new());
    let key = path.join(" ");
    if let Some(text) = KNOWN.lock().unwrap().get(&key) {
        return Ok(text.clone());
    }
    let out = Command::new(env!("CARGO_BIN_EXE_spikelane")).args(path).arg("--help").output().unwrap();
    if !out.status.success() {
        return Err(format!("there is no command '{key}'"));
    }
    let text = String::from_utf8(out.stdout).unwrap();
    KNOWN.lock().unwrap().insert(key, text.clone());
    Ok(text)
}

fn check_cargo(words: &[String]) -> Result<(), String> {
    let end = words.iter().position(|w| w == "--").unwrap_or(words.len());
    let (current, rest) = (&words[..end], &words[(end + 1).min(words.len())..]);
    let flag_value = |flag: &str| {
        current.iter().position(|w| w == flag).and_then(|at| current.get(at + 1)).map(String::as_str)
    };
    if let Some(flag) = flags(current).find(|flag| !CARGO_FLAGS.contains(flag)) {
        return Err(format!("an unknown flag {flag} of cargo"));
    }
    for (flag, folder) in
        [("--test", "tests"), ("--bench", "benches"), ("--example", "examples"), ("--bin", "src/bin")]
    {
        let Some(name) = flag_value(flag) else { continue };
        let here = |package: &String| {
            let manifest = fs::read_to_string(root().join(package).join("Cargo.toml")).unwrap();
            let at = |path: String| root().join(package).join(folder).join(path).is_file();
            at(format!("{name}.rs"))
                || at(format!("{name}/main.rs"))
                || manifest.contains(&format!("name = \"{name}\""))
        };
        if !packages().iter().any(here) {
            return Err(format!("no {flag} of the name {name}"));
        }
    }
    let study_of = flag_value("--bin").filter(|name| name.starts_with("study-")).or(flag_value("--example"));
    match (current.first().map(String::as_str), study_of, flag_value("--test")) {
        (Some("run"), None, _) => check_program(rest),
        (Some("run"), Some(name), _) => check_study(name, rest),
        (Some("test"), _, name) => check_test_filter(name, rest),
        (Some("bench" | "build" | "install" | "doc" | "check" | "clippy" | "fmt" | "tree"), _, _) => Ok(()),
        _ => Err("an unknown command of cargo".into()),
    }
}

/// Checks that the source code of a study contains the flags in `words`.
fn check_study(name: &str, words: &[String]) -> Result<(), String> {
    let folder = format!("studies/src/{}", name.strip_prefix("study-").unwrap_or(name));
    let sources = files(&folder).into_iter().chain([format!("examples/{name}.rs")]);
    let text: String = sources.filter_map(|file| fs::read_to_string(root().join(file)).ok()).collect();
    match flags(words).find(|flag| !text.contains(&format!("\"{flag}\""))) {
        Some(flag) => Err(format!("{folder} knows no {flag}")),
        None => Ok(()),
    }
}

/// Checks that each test filter is the beginning of the name of a test.
fn check_test_filter(file: Option<&str>, words: &[String]) -> Result<(), String> {
    if let Some(flag) = flags(words).find(|flag| !TEST_FLAGS.contains(flag)) {
        return Err(format!("tests know no {flag}"));
    }
    let Some(file) = file else { return Ok(()) };
    // A test binary is either one file or a folder of modules.
    let sources: Vec<String> = packages()
        .iter()
        .flat_map(|package| {
            let one = format!("{package}/tests/{file}.rs");
            if root().join(&one).exists() { vec![one] } else { files(&format!("{package}/tests/{file}")) }
        })
        .collect();
    if sources.is_empty() {
        return Err(format!("there are no tests {file}"));
    }
    let read = |source: &String| fs::read_to_string(root().join(source)).unwrap_or_default();
    let text: String = sources.iter().map(|source| source.clone() + &read(source)).collect();
    let known = |name: &str| name.split("::").all(|part| text.contains(part));
    match words.iter().find(|w| !w.starts_with('-') && !known(w)) {
        Some(name) => Err(format!("tests/{file} has no {name}")),
        None => Ok(()),
    }
}
