//! The study of the errors that `measure` states.
//!
//! `cargo run --release -p spikelane-studies --bin study-measure -- [--recordings N] [--report FILE]` records N times one sensor, and N sensors once, for
//! each pattern and light, prints how often the intervals hold the truth, and writes the tables between the marks of FILE.

#[path = "../../../crates/measure/tests/coverage_support/mod.rs"]
mod coverage_support;

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;
use std::process::Command;

use coverage_support::{Coverage, HEIGHT, Meaning, PATTERNS, READOUTS, WIDTH, judge, recordings};

const MARKS: [&str; 2] = ["<!-- begin: study-measure -->\n", "<!-- end: study-measure -->"];

const RATES: [f64; 2] = [0.06, 0.2];

fn main() {
    let (mut count, mut report) = (1000_u64, None);
    let mut all = std::env::args().skip(1);
    while let Some(arg) = all.next() {
        let value = all.next().unwrap_or_else(|| panic!("{arg} needs a value"));
        match arg.as_str() {
            "--recordings" => count = value.parse().expect("a number of recordings"),
            "--report" => report = Some(value),
            _ => panic!("{arg}: give --recordings N or --report FILE"),
        }
    }
    let mut text = format!(
        "{count} recordings of {READOUTS} readouts of {WIDTH}x{HEIGHT} pixels for each column; {}.\n",
        circumstances()
    );
    for meaning in [Meaning::Recording, Meaning::Sensor] {
        text += match meaning {
            Meaning::Recording => "\nOne sensor recorded again and again; the truth is that sensor's.\n\n",
            Meaning::Sensor => {
                "\nAs many sensors of a kind, each recorded once; the truth is that of the kind.\n\n"
            }
        };
        text += &table(meaning, count);
    }
    print!("{text}");
    if let Some(file) = report {
        write(Path::new(&file), &text);
    }
}

fn table(meaning: Meaning, count: u64) -> String {
    let mut columns: Vec<BTreeMap<String, Coverage>> = Vec::new();
    let mut keys = Vec::new();
    let mut head = "| statistic |".to_owned();
    for rate in RATES {
        for pattern in PATTERNS {
            let all = recordings(pattern, rate, meaning, count);
            keys = all[0].iter().map(|told| told.key.clone()).collect();
            columns.push(judge(&all, pattern, meaning));
            write!(head, " {pattern}, {rate} |").unwrap();
        }
    }
    let mut text = head + "\n|---|" + &"--:|".repeat(columns.len()) + "\n";
    for key in keys {
        let cells: String = columns.iter().map(|c| format!(" {} |", cell(c[&key]))).collect();
        writeln!(text, "| {key} |{cells}").unwrap();
    }
    text
}

/// Per cent that hold the truth, and the mean stated error over the scatter.
fn cell(found: Coverage) -> String {
    if found.of == 0 {
        return "not told".to_owned();
    }
    let percent = 100.0 * found.held as f64 / found.of as f64;
    let mark = if found.limits > 0 { "<= " } else { "" };
    let ratio = if found.ratio.is_finite() { format!(" ({:.2})", found.ratio) } else { String::new() };
    format!("{mark}{percent:.1}{ratio}")
}

/// Day, processor and commit.
fn circumstances() -> String {
    let said = |program: &str, args: &[&str]| {
        let out = Command::new(program).args(args).output().ok().filter(|o| o.status.success());
        out.map_or("unknown".to_owned(), |o| String::from_utf8_lossy(&o.stdout).trim().to_owned())
    };
    let info = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model = info.lines().find(|l| l.starts_with("model name")).and_then(|l| l.split(": ").nth(1));
    let (day, commit) = (said("date", &["+%Y-%m-%d"]), said("git", &["rev-parse", "--short", "HEAD"]));
    format!("{day}, {}, commit {commit}", model.unwrap_or("processor unknown"))
}

fn write(path: &Path, tables: &str) {
    let page = std::fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    let [begin, end] = MARKS.map(|mark| page.find(mark).unwrap_or_else(|| panic!("no {mark} in the page")));
    let text = [&page[..begin + MARKS[0].len()], tables, &page[end..]].concat();
    std::fs::write(path, text).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
}
