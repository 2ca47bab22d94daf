//! Tests that `docs/reference/commands.md` matches the output of `--help`.

mod docs_support;

use std::fmt::Write as _;
use std::process::Command;

use docs_support::{page, pages, split_at_markers, write_between_markers};

const PAGE: &str = "docs/reference/commands.md";
const BEGIN: &str = "<!-- generated: begin -->\n";
const END: &str = "<!-- generated: end -->\n";

/// Flags that every command has.
const GLOBAL_FLAGS: &[&str] = &["--json", "--verbose", "--record-paths", "--help", "--version"];

/// The parsed `--help` text of a command.
struct Help {
    about: String,
    usage: String,
    entries: Vec<Entry>,
}

/// The entry of a flag or an argument in a help text.
#[derive(Clone)]
struct Entry {
    /// The heading above the entry, such as `Options` or `Camera`.
    heading: String,
    /// What the user types, such as `-o, --output <DIR>`.
    form: String,
    text: String,
}

/// The comparison ignores the heading of an entry, so that an option of several commands is printed once.
impl PartialEq for Entry {
    fn eq(&self, other: &Self) -> bool {
        (&self.form, &self.text) == (&other.form, &other.text)
    }
}

impl Entry {
    /// Returns the long flag, or `None` for an argument.
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

/// Returns the commands that a help text lists, in the order of the text.
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
    let mut heading = "";
    for line in text.split_once("Usage: ").unwrap().1.lines().skip(1) {
        if line.ends_with(':') && !line.starts_with(' ') {
            inside = line != "Commands:";
            heading = line.trim_end_matches(':');
        } else if inside && starts_entry(line) {
            let line = line.trim();
            let (form, text) = line.split_once("  ").unwrap_or((line, ""));
            let heading = heading.to_owned();
            entries.push(Entry { heading, form: form.to_owned(), text: text.trim().to_owned() });
        } else if inside && let Some(entry) = entries.last_mut() {
            match line.trim() {
                // The end of a paragraph.
                "" if !entry.text.is_empty() && !entry.text.ends_with('.') => entry.text.push('.'),
                "" => {}
                line if entry.text.is_empty() => entry.text += line,
                line => write!(entry.text, " {line}").unwrap(),
            }
        }
    }
    for entry in &mut entries {
        // The first sentence lists the values already.
        let text = entry.text.split(" Possible values:").next().unwrap_or_default();
        entry.text = text.trim_end_matches('.').to_owned();
        // If a default follows the only sentence of an entry, the period before the default is removed.
        if entry.text.matches(". ").count() == 1 {
            entry.text = entry.text.replace(". [", " [");
        }
    }
    Help { about, usage, entries }
}

/// Whether a line begins an entry. Other lines continue the text of an entry.
fn starts_entry(line: &str) -> bool {
    let indent = line.len() - line.trim_start().len();
    let line = line.trim_start();
    (2..=6).contains(&indent) && (line.starts_with('-') || indent == 2 && line.starts_with(['<', '[']))
}

fn escaped(text: &str) -> String {
    text.replace('<', "\\<")
}

/// Options that several commands have with the same meaning, in the order of the commands.
struct Shared {
    entries: Vec<Entry>,
}

/// The command whose options another command extends.
const EXTENDED: (&str, &str) = ("dataset plan", "dataset");

impl Shared {
    fn new(all: &[(String, Help)]) -> Self {
        let mut counts: Vec<(&Entry, usize)> = Vec::new();
        for (_, help) in all.iter().filter(|(path, _)| path != EXTENDED.0) {
            for entry in own_entries(help).filter(|e| e.flag().is_some()) {
                match counts.iter_mut().find(|(other, _)| *other == entry) {
                    Some((_, count)) => *count += 1,
                    None => counts.push((entry, 1)),
                }
            }
        }
        let entries = counts.into_iter().filter(|(_, n)| *n > 1).map(|(entry, _)| entry.clone()).collect();
        Self { entries }
    }

    /// Returns the headings that group shared options.
    fn headings(&self) -> Vec<&str> {
        let mut headings: Vec<&str> = Vec::new();
        for entry in &self.entries {
            if !headings.contains(&entry.heading.as_str()) {
                headings.push(&entry.heading);
            }
        }
        headings
    }

    fn group(&self, heading: &str) -> impl Iterator<Item = &Entry> {
        self.entries.iter().filter(move |e| e.heading == heading)
    }

    fn tables(&self) -> String {
        let mut text = String::from("\n## Shared options\n");
        for heading in self.headings() {
            let title = match heading {
                "Options" => "Other",
                "Seeds" => "Seed",
                heading => heading,
            };
            write!(text, "\n### {title} options\n\n").unwrap();
            text += &list(self.group(heading));
        }
        text
    }

    /// Returns a sentence about the shared options in `entries`. The sentence names a group of options if `entries`
    /// contains the whole group. Otherwise it lists the flags.
    fn sentence(&self, entries: &[&Entry]) -> String {
        let mut parts: Vec<String> = Vec::new();
        for heading in self.headings() {
            let group: Vec<&Entry> = self.group(heading).collect();
            let found: Vec<&Entry> = group.iter().copied().filter(|e| entries.contains(e)).collect();
            if found.len() == group.len() && found.len() > 2 && heading != "Options" {
                parts.push(format!("[{}](#{}-options)", heading.to_lowercase(), heading.to_lowercase()));
            } else {
                parts.extend(found.iter().map(|e| format!("`{}`", e.flag().unwrap_or_default())));
            }
        }
        if parts.is_empty() { String::new() } else { format!("\nShared options: {}.\n", parts.join(", ")) }
    }
}

/// Returns the entries of a command without the options of all commands.
fn own_entries(help: &Help) -> impl Iterator<Item = &Entry> {
    help.entries.iter().filter(|e| e.flag().is_none_or(|flag| !GLOBAL_FLAGS.contains(&flag)))
}

fn list<'a>(entries: impl IntoIterator<Item = &'a Entry>) -> String {
    let mut text = String::new();
    for entry in entries {
        writeln!(text, "* `{}`: {}.", entry.form, escaped(&entry.text)).unwrap();
    }
    text
}

fn section(path: &str, help: &Help, all: &[(String, Help)], shared: &Shared) -> String {
    let mut text = format!("\n## {path}\n\n{}.\n\n`{}`\n", help.about.trim_end_matches('.'), help.usage);
    let mut entries: Vec<&Entry> = own_entries(help).collect();
    if path == EXTENDED.0 {
        let (name, base) = all.iter().find(|(path, _)| path == EXTENDED.1).unwrap();
        let without: Vec<&str> =
            own_entries(base).filter(|e| !entries.contains(e)).filter_map(Entry::flag).collect();
        let list = without.iter().map(|flag| format!("`{flag}`")).collect::<Vec<_>>().join(", ");
        write!(text, "\nIt has the options of [`{name}`](#{name}) except {list}.\n").unwrap();
        entries.retain(|e| !own_entries(base).any(|other| other == *e));
    }
    let own: Vec<&Entry> = entries.iter().copied().filter(|e| !shared.entries.contains(e)).collect();
    if !own.is_empty() {
        text.push('\n');
        text += &list(own);
    }
    text + &shared.sentence(&entries)
}

/// Returns the subcommands of a command.
fn subcommands(name: &str) -> Vec<String> {
    commands(&help(name)).iter().map(|sub| format!("{name} {sub}")).collect()
}

/// Returns all commands with their help, in the order of the page.
fn all_help() -> Vec<(String, Help)> {
    let top = help("");
    let mut paths: Vec<String> = Vec::new();
    for name in commands(&top) {
        match name.as_str() {
            "preset" => paths.extend(subcommands("preset")),
            "dataset" => {
                paths.push(name);
                paths.extend(subcommands("dataset"));
            }
            _ => paths.push(name),
        }
    }
    paths.into_iter().map(|p| (p.clone(), parse(&help(&p)))).collect()
}

fn generated_page() -> String {
    let all = all_help();
    let mut text = String::from("\n");
    let links: Vec<String> =
        all.iter().map(|(path, _)| format!("[`{path}`](#{})", path.replace(' ', "-"))).collect();
    writeln!(text, "{}", links.join(",\n")).unwrap();
    let shared = Shared::new(&all);
    text += &shared.tables();
    all.iter().for_each(|(path, help)| text += &section(path, help, &all, &shared));
    text
}

#[test]
fn the_page_of_commands_is_current() {
    let page = page(PAGE);
    let [_, committed, _] = split_at_markers(&page, BEGIN, END);
    assert!(committed == generated_page(), "run: cargo test --test docs_commands -- --ignored");
}

#[test]
fn the_page_of_commands_is_short() {
    const MAX_WORDS: usize = 5275;
    let words = page(PAGE).count_words();
    assert!(words <= MAX_WORDS, "{words} words");
}

/// A default that a page states: `` `--flag` (default V) `` or `` `V` (default) ``.
#[derive(Debug, PartialEq)]
struct StatedDefault {
    /// The flag, or `None` if the page states that a value is the default of an option.
    flag: Option<String>,
    value: String,
}

/// Returns the defaults that a line of a page states. A default belongs to the last flag before it.
fn stated_defaults(line: &str) -> Vec<StatedDefault> {
    let mut found = Vec::new();
    for (at, word) in line.match_indices("default") {
        let (before, after) = (&line[..at], &line[at + word.len()..]);
        let flag = before.rfind("`--").map(|start| {
            let flag = &before[start + 1..];
            flag[..flag.find(['`', ' ', '=']).unwrap_or(flag.len())].to_owned()
        });
        let value = after.trim_start_matches([':', ' ']);
        let value =
            value[..value.find([')', ',', ';', '|', ' ']).unwrap_or(value.len())].trim_matches(['`', '.']);
        let states_a_value = after.starts_with([' ', ':']) && !value.is_empty();
        if states_a_value
            && (value.starts_with(|c: char| c.is_ascii_digit()) || after.trim_start().starts_with('`'))
        {
            found.extend(flag.map(|flag| StatedDefault { flag: Some(flag), value: value.to_owned() }));
        } else if let Some(value) = before.strip_suffix("` (").and_then(|b| b.rsplit('`').next()) {
            // A flag without a value is its own default, such as `--drop (default)`.
            if !value.starts_with("--") {
                found.push(StatedDefault { flag: None, value: value.to_owned() });
            }
        }
    }
    found
}

/// Returns the flag and the value of each `[default: VALUE]` in a help text.
fn help_defaults(all: &[(String, Help)]) -> Vec<(&str, &str)> {
    let entries = all.iter().flat_map(|(_, help)| &help.entries);
    entries
        .filter_map(|e| {
            let value = e.text.split_once("[default: ")?.1.split(']').next()?;
            Some((e.flag()?, value))
        })
        .collect()
}

fn is_default(stated: &StatedDefault, defaults: &[(&str, &str)]) -> bool {
    defaults.iter().any(|(flag, value)| {
        stated.flag.as_deref().is_none_or(|f| f == *flag)
            && value.split([' ', ',']).next() == Some(stated.value.as_str())
    })
}

#[test]
fn every_default_on_a_page_is_that_of_the_program() {
    let mut all = all_help();
    // The page of benchmarks describes these commands.
    all.extend(subcommands("benchmark").into_iter().map(|path| (path.clone(), parse(&help(&path)))));
    let defaults = help_defaults(&all);
    let mut stated = 0;
    let mut wrong = Vec::new();
    for page in pages().iter().filter(|p| p.name != PAGE) {
        for (number, line) in page.text.lines().enumerate() {
            for default in stated_defaults(line) {
                stated += 1;
                if !is_default(&default, &defaults) {
                    wrong.push(format!("{}:{}: {default:?}", page.name, number + 1));
                }
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    assert!(stated >= 5, "only {stated} defaults were found on the pages");
}

#[test]
fn wrong_defaults_on_pages_are_seen() {
    let defaults = [("--burst", "8"), ("--to", "dat")];
    let seen =
        |line: &str| stated_defaults(line).iter().map(|d| is_default(d, &defaults)).collect::<Vec<_>>();
    assert_eq!(seen("`--burst` readouts (default 8) are delivered"), [true]);
    assert_eq!(seen("`--burst` readouts (default 9) are delivered"), [false]);
    assert_eq!(seen("a header (`--to`, default `dat`)."), [true]);
    assert_eq!(seen("| `rows416` (default) | a layout |"), [false]);
    assert_eq!(seen("`--to` is the layout by default, and `Rate::default()` is a rate"), [] as [bool; 0]);
}

#[test]
fn both_forms_of_help_are_understood() {
    let short = "Fit it\n\nUsage: x <A>\n\nArguments:\n  <A>  The set\n\nOptions:\n  -o, --output <DIR>  Folder for\n                      all\n      --snee          Also\n";
    let long = "Do it\n\nUsage: x\n\nOptions:\n  -o, --output <DIR>\n          Folder for\n          all\n\n      --snee\n          Also\n";
    for text in [short, long] {
        let help = parse(text);
        let flags: Vec<_> = help.entries.iter().filter_map(Entry::flag).collect();
        assert_eq!(flags, ["--output", "--snee"]);
        let output = help.entries.iter().find(|e| e.flag() == Some("--output")).unwrap();
        assert_eq!((output.form.as_str(), output.text.as_str()), ("-o, --output <DIR>", "Folder for all"));
    }
}

#[test]
#[ignore = "writes docs/reference/commands.md"]
fn write_the_page_of_commands() {
    write_between_markers(PAGE, BEGIN, END, &generated_page());
}
