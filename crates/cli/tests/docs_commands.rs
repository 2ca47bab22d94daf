//! `docs/reference/commands.md` is what `--help` says.

mod docs_support;

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::process::Command;

use docs_support::{between, page, put};

const PAGE: &str = "docs/reference/commands.md";
const BEGIN: &str = "<!-- generated: begin -->\n";
const END: &str = "<!-- generated: end -->\n";

/// Flags that every command has.
const EVERYWHERE: &[&str] = &["--json", "--verbose", "--record-paths", "--help", "--version"];

/// What `--help` says of a command.
struct Help {
    about: String,
    usage: String,
    entries: Vec<Entry>,
}

/// A flag or an argument.
struct Entry {
    /// As it is typed, such as `-o, --output <DIR>`.
    form: String,
    text: String,
}

impl Entry {
    /// The long flag, or nothing for an argument.
    fn flag(&self) -> Option<&str> {
        let at = self.form.find("--")?;
        self.form[at..].split([' ', '=', '[']).next()
    }
}

fn help(path: &str) -> String {
    let out = Command::new(env!("CARGO_BIN_EXE_spikelane"))
        .args(path.split_whitespace())
        .arg("--help")
        .env("COLUMNS", "100")
        .output()
        .unwrap();
    assert!(out.status.success(), "spikelane {path} --help");
    String::from_utf8(out.stdout).unwrap()
}

/// The commands of a help text, in its order.
fn commands(text: &str) -> Vec<String> {
    let list = text.split_once("Commands:\n").expect("a list of commands").1;
    let rows = list.lines().take_while(|line| !line.is_empty()).filter(|line| !line.starts_with("   "));
    let names = rows.filter_map(|line| line.split_whitespace().next());
    names.filter(|name| *name != "help").map(str::to_owned).collect()
}

fn parse(text: &str) -> Help {
    let about = text.split("\n\n").next().unwrap().replace('\n', " ");
    let usage = text.lines().find_map(|line| line.strip_prefix("Usage: ")).unwrap().to_owned();
    let mut entries: Vec<Entry> = Vec::new();
    let mut inside = false;
    for line in text.split_once("Usage: ").unwrap().1.lines().skip(1) {
        if line.ends_with(':') && !line.starts_with(' ') {
            inside = line != "Commands:";
        } else if inside && begins(line) {
            let line = line.trim();
            let (form, text) = line.split_once("  ").unwrap_or((line, ""));
            entries.push(Entry { form: form.to_owned(), text: text.trim().to_owned() });
        } else if inside && !line.trim().is_empty() {
            let entry = entries.last_mut().unwrap();
            if !entry.text.is_empty() {
                entry.text.push(' ');
            }
            entry.text += line.trim();
        }
    }
    Help { about, usage, entries }
}

/// Whether a line begins the entry of a flag or an argument, not the text of one.
fn begins(line: &str) -> bool {
    let indent = line.len() - line.trim_start().len();
    let line = line.trim_start();
    (2..=6).contains(&indent) && (line.starts_with('-') || indent == 2 && line.starts_with(['<', '[']))
}

fn escaped(text: &str) -> String {
    text.replace('|', "\\|").replace('<', "\\<")
}

fn section(path: &str, help: &Help) -> String {
    let mut text = format!("\n## {path}\n\n{}.\n\n`{}`\n\n", help.about.trim_end_matches('.'), help.usage);
    let own: Vec<&Entry> =
        help.entries.iter().filter(|e| e.flag().is_none_or(|flag| !EVERYWHERE.contains(&flag))).collect();
    if !own.is_empty() {
        text += "| flag or argument | what it does |\n|---|---|\n";
    }
    for entry in own {
        writeln!(text, "| `{}` | {} |", entry.form.replace('|', "\\|"), escaped(&entry.text)).unwrap();
    }
    text
}

/// The commands below a command.
fn below(name: &str) -> Vec<String> {
    commands(&help(name)).iter().map(|sub| format!("{name} {sub}")).collect()
}

fn generated() -> String {
    let top = help("");
    let mut paths: Vec<String> = Vec::new();
    for name in commands(&top) {
        match name.as_str() {
            "preset" => paths.extend(below("preset")),
            "dataset" => {
                paths.push(name);
                paths.extend(below("dataset"));
            }
            _ => paths.push(name),
        }
    }
    let all: Vec<(String, Help)> = paths.into_iter().map(|p| (p.clone(), parse(&help(&p)))).collect();
    let mut text = String::from("\n| command | what it does |\n|---|---|\n");
    for (path, help) in &all {
        let anchor = path.replace(' ', "-");
        writeln!(text, "| [`{path}`](#{anchor}) | {} |", escaped(help.about.trim_end_matches('.'))).unwrap();
    }
    let mut flags: BTreeMap<String, Vec<&str>> = BTreeMap::new();
    for (path, help) in &all {
        for flag in help.entries.iter().filter_map(Entry::flag).filter(|flag| !EVERYWHERE.contains(flag)) {
            flags.entry(flag.to_owned()).or_default().push(path);
        }
    }
    text += "\n## One word for one thing\n\nEvery flag, and the commands that have it.\n\n| flag | commands |\n|---|---|\n";
    for (flag, paths) in flags {
        writeln!(text, "| `{flag}` | {} |", paths.join(", ")).unwrap();
    }
    all.iter().for_each(|(path, help)| text += &section(path, help));
    text
}

#[test]
fn the_page_of_commands_is_current() {
    let page = page(PAGE);
    let [_, found, _] = between(&page, BEGIN, END);
    assert!(found == generated(), "run: cargo test --test docs_commands -- --ignored");
}

#[test]
fn both_forms_of_help_are_understood() {
    let short = "Fit it\n\nUsage: x <A>\n\nArguments:\n  <A>  The set\n\nOptions:\n  -o, --output <DIR>  Folder for\n                      all\n      --snee          Also\n";
    let long = "Do it\n\nUsage: x\n\nOptions:\n  -o, --output <DIR>\n          Folder for\n          all\n\n      --snee\n          Also\n";
    for text in [short, long] {
        let found = parse(text);
        let flags: Vec<_> = found.entries.iter().filter_map(Entry::flag).collect();
        assert_eq!(flags, ["--output", "--snee"]);
        let output = found.entries.iter().find(|e| e.flag() == Some("--output")).unwrap();
        assert_eq!((output.form.as_str(), output.text.as_str()), ("-o, --output <DIR>", "Folder for all"));
    }
}

#[test]
#[ignore = "writes docs/reference/commands.md"]
fn write_the_page_of_commands() {
    put(PAGE, BEGIN, END, &generated());
}
