//! The date, the machine and the commit for which a table was computed.

use std::process::Command;

/// Returns the date, the processor and the commit.
#[must_use]
pub fn provenance() -> String {
    format!("{}, {}, commit {}", command_output("date", &["-u", "+%F"]), cpu(), commit())
}

/// Returns the last commit, and a note if files differ from it.
fn commit() -> String {
    let commit = command_output("git", &["rev-parse", "--short", "HEAD"]);
    let changed = command_output(
        "git",
        &["status", "--porcelain", "--untracked-files=no", "--", "src", "crates", "studies", "tests"],
    );
    if changed.is_empty() { commit } else { format!("{commit} with changes") }
}

fn cpu() -> String {
    let text = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model = text.lines().find_map(|l| l.strip_prefix("model name")?.split_once(':'));
    let threads = std::thread::available_parallelism().map_or(1, |n| n.get());
    format!("{} ({threads} threads)", model.map_or("an unknown CPU", |m| m.1.trim()))
}

fn command_output(program: &str, words: &[&str]) -> String {
    let output = Command::new(program).args(words).output();
    output.map_or_else(|_| "unknown".to_owned(), |o| String::from_utf8_lossy(&o.stdout).trim().to_owned())
}
