//! When, where and by which code a table was made.

use std::process::Command;

/// A line above a table.
pub(crate) fn by() -> String {
    format!("Made on {}, {}, commit {}.\n\n", said("date", &["-u", "+%F"]), cpu(), commit())
}

/// The last commit, and whether files differ from it.
fn commit() -> String {
    let commit = said("git", &["rev-parse", "--short", "HEAD"]);
    let changed =
        said("git", &["status", "--porcelain", "--untracked-files=no", "--", "src", "study", "tests"]);
    if changed.is_empty() { commit } else { format!("{commit} with changes") }
}

pub(crate) fn cpu() -> String {
    let text = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model = text.lines().find_map(|l| l.strip_prefix("model name")?.split_once(':'));
    let threads = std::thread::available_parallelism().map_or(1, |n| n.get());
    format!("{} ({threads} threads)", model.map_or("an unknown CPU", |m| m.1.trim()))
}

fn said(program: &str, words: &[&str]) -> String {
    let output = Command::new(program).args(words).output();
    output.map_or_else(|_| "unknown".to_owned(), |o| String::from_utf8_lossy(&o.stdout).trim().to_owned())
}
