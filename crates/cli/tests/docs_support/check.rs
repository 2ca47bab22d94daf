//! Looks at commands without running them: do the command, its target and its flags exist?

use std::collections::BTreeMap;
use std::fs;
use std::process::Command;
use std::sync::Mutex;

use super::{files, root};

/// Flags of cargo itself that pages use.
const CARGO: &[&str] = &[
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

/// Flags of the program that runs cargo's tests.
const TESTS: &[&str] = &["--ignored", "--nocapture", "--exact", "--include-ignored", "--test-threads"];

/// Programs of a Unix system that pages call without more ado.
const SYSTEM: &[&str] =
    &["cat", "cd", "cp", "echo", "export", "head", "ls", "mkdir", "mv", "rm", "sed", "printf"];

/// What is wrong with the commands of a block, a line each.
pub(crate) fn wrong(text: &str) -> Vec<String> {
    let commands = commands(text);
    // Functions of the block itself, `name() {`.
    let own: Vec<&str> = commands.iter().filter_map(|words| words[0].strip_suffix("()")).collect();
    let known = |name: &str| own.contains(&name.trim_end_matches("()")) || matches!(name, "{" | "}");
    commands.iter().filter(|words| !known(&words[0])).filter_map(|words| one(words).err()).collect()
}

/// The words of each command: continued lines joined, comments, assignments and files behind `>` left out.
fn commands(text: &str) -> Vec<Vec<String>> {
    let text = text.replace("\\\n", " ");
    let mut all: Vec<Vec<String>> = text.lines().flat_map(line).collect();
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

/// A line's commands, which `|`, `;` and `&` part; quotes are taken off.
fn line(line: &str) -> Vec<Vec<String>> {
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

fn one(words: &[String]) -> Result<(), String> {
    let line = words.join(" ");
    let fail = |what: &str| Err(format!("{line}: {what}"));
    match words[0].as_str() {
        "spikelane" => program(&words[1..]).map_err(|e| format!("{line}: {e}")),
        "cargo" => cargo(&words[1..]).map_err(|e| format!("{line}: {e}")),
        "pip" | "python" | "python3" => match words.iter().skip(1).find(|w| w.ends_with(".py")) {
            Some(script) if !root().join(script).is_file() => fail("no such script"),
            _ => Ok(()),
        },
        name if name.contains('/') && !root().join(name).is_file() => fail("no such script"),
        name if name.contains('/') || SYSTEM.contains(&name) || found(name) => Ok(()),
        // Programs of other people that pages name, here or not.
        "ffmpeg" | "jq" | "parallel" | "sbatch" => Ok(()),
        _ => fail("an unknown command"),
    }
}

/// The folders of the workspace's packages, from the root.
fn packages() -> Vec<String> {
    let mut all: Vec<String> =
        [".", "bindings/c", "bindings/python", "studies", "tests/outside_effect"].map(str::to_owned).into();
    let crates = fs::read_dir(root().join("crates")).unwrap();
    all.extend(crates.map(|entry| format!("crates/{}", entry.unwrap().file_name().to_string_lossy())));
    all
}

/// Whether the shell finds a program of that name.
pub(crate) fn found(name: &str) -> bool {
    let said = Command::new("sh").args(["-c", "command -v \"$0\"", name]).output();
    said.is_ok_and(|out| out.status.success())
}

fn flags(words: &[String]) -> impl Iterator<Item = &str> {
    words.iter().filter(|w| w.starts_with('-') && w.len() > 1).map(|w| w.split('=').next().unwrap())
}

fn program(words: &[String]) -> Result<(), String> {
    let path: Vec<&str> = match words.first().map(String::as_str) {
        None => vec![],
        Some(first) if first.starts_with('-') => vec![],
        Some("preset") if words.len() > 1 => vec!["preset", words[1].as_str()],
        Some("dataset") if words.get(1).is_some_and(|w| !w.starts_with(['-', '[', '<'])) => {
            vec!["dataset", words[1].as_str()]
        }
        Some(first) => vec![first],
    };
    let help = help(&path)?;
    let known = |flag: &str| {
        let ends = |rest: &str| !rest.starts_with(|c: char| c.is_alphanumeric() || c == '-');
        help.match_indices(flag).any(|(at, _)| ends(&help[at + flag.len()..]))
    };
    match flags(words).find(|flag| !known(flag)) {
        Some(flag) => Err(format!("`spikelane {} --help` has no {flag}", path.join(" "))),
        None => Ok(()),
    }
}

/// What a command's `--help` prints, asked for once.
fn help(path: &[&str]) -> Result<String, String> {
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

fn cargo(words: &[String]) -> Result<(), String> {
    let end = words.iter().position(|w| w == "--").unwrap_or(words.len());
    let (own, rest) = (&words[..end], &words[(end + 1).min(words.len())..]);
    let of =
        |flag: &str| own.iter().position(|w| w == flag).and_then(|at| own.get(at + 1)).map(String::as_str);
    if let Some(flag) = flags(own).find(|flag| !CARGO.contains(flag)) {
        return Err(format!("an unknown flag {flag} of cargo"));
    }
    for (flag, folder) in
        [("--test", "tests"), ("--bench", "benches"), ("--example", "examples"), ("--bin", "src/bin")]
    {
        let Some(name) = of(flag) else { continue };
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
    let study_of = of("--bin").filter(|name| name.starts_with("study-")).or(of("--example"));
    match (own.first().map(String::as_str), study_of, of("--test")) {
        (Some("run"), None, _) => program(rest),
        (Some("run"), Some(name), _) => study(name, rest),
        (Some("test"), _, name) => test(name, rest),
        (Some("bench" | "build" | "install" | "doc" | "check" | "clippy" | "fmt" | "tree"), _, _) => Ok(()),
        _ => Err("an unknown command of cargo".into()),
    }
}

/// The flags of a study are words of its source.
fn study(name: &str, words: &[String]) -> Result<(), String> {
    let folder = format!("studies/src/{}", name.strip_prefix("study-").unwrap_or(name));
    let sources = files(&folder).into_iter().chain([format!("examples/{name}.rs")]);
    let text: String = sources.filter_map(|file| fs::read_to_string(root().join(file)).ok()).collect();
    match flags(words).find(|flag| !text.contains(&format!("\"{flag}\""))) {
        Some(flag) => Err(format!("{folder} knows no {flag}")),
        None => Ok(()),
    }
}

/// Filters of tests are names of tests, or begin one.
fn test(file: Option<&str>, words: &[String]) -> Result<(), String> {
    if let Some(flag) = flags(words).find(|flag| !TESTS.contains(flag)) {
        return Err(format!("tests know no {flag}"));
    }
    let Some(file) = file else { return Ok(()) };
    // A binary of tests is a file, or a folder of modules.
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
