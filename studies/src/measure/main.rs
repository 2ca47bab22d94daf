//! Study of the errors that `measure` reports.
//!
//! `cargo run --release -p spikelane-studies --bin study-measure -- [--recordings N] [--report FILE]` makes recordings
//! for each fixed pattern and each light: N recordings of one sensor, and one recording of each of N sensors. The study
//! prints how often the confidence intervals contain the true value. It writes the tables between the markers of FILE.

#[path = "../../../crates/measure/tests/coverage_support/mod.rs"]
mod coverage_support;

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;

use spikelane_studies::page::write_between_markers;
use spikelane_studies::provenance::provenance;

use coverage_support::{Coverage, HEIGHT, PATTERNS, READOUTS, Repetition, WIDTH, judge, recordings};

const PAGE_MARKERS: [&str; 2] = ["<!-- begin: study-measure -->\n", "<!-- end: study-measure -->"];

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
    let columns = [Repetition::Recording, Repetition::Sensor].map(|meaning| Column::new(meaning, count));
    let text = format!(
        "Range over {} cases of {count} recordings each, of {READOUTS} readouts and {WIDTH}x{HEIGHT} pixels; {}.\n\n{}",
        RATES.len() * PATTERNS.len(),
        provenance(),
        table(&columns)
    );
    print!("{text}");
    if let Some(file) = report {
        write_between_markers(Path::new(&file), PAGE_MARKERS, &text);
    }
}

/// The coverage of every statistic for one repetition.
struct Column {
    keys: Vec<String>,
    /// One map for each rate and pattern.
    cases: Vec<BTreeMap<String, Coverage>>,
}

impl Column {
    fn new(meaning: Repetition, count: u64) -> Self {
        let mut column = Self { keys: Vec::new(), cases: Vec::new() };
        for rate in RATES {
            for pattern in PATTERNS {
                let all = recordings(pattern, rate, meaning, count);
                column.keys = all[0].iter().map(|statistic| statistic.key.clone()).collect();
                column.cases.push(judge(&all, pattern, meaning));
            }
        }
        column
    }

    /// Returns the coverage of the statistic `key`: the lowest and the highest percentage of intervals that contain the
    /// true value, over all cases. Upper limits have a separate percentage range.
    fn cell(&self, key: &str) -> String {
        let range = |limits: bool| {
            let found = self.cases.iter().map(|case| case[key]);
            let found = found.filter(|c| c.intervals > 0 && (c.limits > 0) == limits);
            let percent: Vec<f64> = found.map(|c| 100.0 * c.covering as f64 / c.intervals as f64).collect();
            let low = percent.iter().copied().reduce(f64::min)?;
            let high = percent.iter().copied().fold(low, f64::max);
            let (mark, low, high) =
                (if limits { "limits " } else { "" }, format!("{low:.1}"), format!("{high:.1}"));
            Some(if low == high { mark.to_owned() + &low } else { format!("{mark}{low} to {high}") })
        };
        let ranges: Vec<String> = [false, true].into_iter().filter_map(range).collect();
        if ranges.is_empty() { "not reported".to_owned() } else { ranges.join("; ") }
    }
}

fn table(columns: &[Column; 2]) -> String {
    let mut text = "| statistic | one sensor | many sensors |\n|---|--:|--:|\n".to_owned();
    for key in &columns[0].keys {
        let [one, many] = columns.each_ref().map(|column| column.cell(key));
        writeln!(text, "| `{key}` | {one} | {many} |").unwrap();
    }
    text
}
