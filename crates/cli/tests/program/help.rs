//! The short help of every command.

use crate::program_support::TestFolder;

const COLUMNS: usize = 80;
const MAX_LINES: usize = 45;
const MAX_OPTION_LINES: usize = 2;

fn short_help(path: &str) -> String {
    let folder = TestFolder::new();
    let out = folder.command(&format!("{path} -h")).env("COLUMNS", COLUMNS.to_string()).output().unwrap();
    assert!(out.status.success(), "spikelane {path} -h");
    String::from_utf8(out.stdout).unwrap()
}

/// Returns the subcommands that a help text lists.
fn subcommands(help: &str) -> Vec<String> {
    let Some((_, list)) = help.split_once("Commands:\n") else { return Vec::new() };
    let rows = list.lines().take_while(|line| !line.is_empty()).filter(|line| !line.starts_with("   "));
    rows.filter_map(|line| line.split_whitespace().next()).map(str::to_owned).collect()
}

/// Returns every command with its short help, the program itself included.
fn helps() -> Vec<(String, String)> {
    let mut found = vec![(String::new(), short_help(""))];
    let mut at = 0;
    while let Some((path, help)) = found.get(at).cloned() {
        for name in subcommands(&help).iter().filter(|name| *name != "help") {
            let path = format!("{path} {name}").trim().to_owned();
            let help = short_help(&path);
            found.push((path, help));
        }
        at += 1;
    }
    assert!(found.len() > 20, "{} commands", found.len());
    found
}

/// Returns the number of lines of the text of each option, by its flags.
fn option_lines(help: &str) -> Vec<(String, usize)> {
    let mut options: Vec<(String, usize)> = Vec::new();
    for line in help.lines() {
        let text = line.trim_start();
        match options.last_mut() {
            _ if text.starts_with('-') && line.starts_with("  ") => {
                let (flags, text) = text.split_once("  ").unwrap_or((text, ""));
                options.push((flags.to_owned(), usize::from(!text.trim().is_empty())));
            }
            Some((_, lines)) if line.starts_with("      ") => *lines += 1,
            _ => {}
        }
    }
    options
}

#[test]
fn short_help_fits_a_screen() {
    for (path, help) in helps() {
        let lines = help.lines().count();
        assert!(lines <= MAX_LINES, "spikelane {path} -h: {lines} lines");
        for line in help.lines() {
            assert!(line.chars().count() <= COLUMNS, "spikelane {path} -h: {line}");
        }
    }
}

#[test]
fn an_option_has_at_most_two_lines_in_short_help() {
    for (path, help) in helps() {
        for (flags, lines) in option_lines(&help) {
            assert!(lines <= MAX_OPTION_LINES, "spikelane {path} -h: {flags}: {lines} lines");
        }
    }
}

#[test]
fn both_layouts_of_options_are_counted() {
    let beside =
        "Options:\n  -o, --output <DIR>  Folder for\n                      all\n      --snee          Also\n";
    let below =
        "Options:\n  -o, --output <DIR>\n          Folder for\n          all\n      --snee\n          Also\n";
    for help in [beside, below] {
        let expected = [("-o, --output <DIR>".to_owned(), 2), ("--snee".to_owned(), 1)];
        assert_eq!(option_lines(help), expected);
    }
}
