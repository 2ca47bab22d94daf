//! The tables of the study.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;

use serde_json::Value;

use super::multiple_effects::MultipleEffects;
use super::outcomes::{discrepancy, interval_covers};
use super::summary::{run_time_text, summary};

/// Smallest share of intervals that contain the true value for which the table omits an effect, the target of the study.
const MIN_COVERAGE: f64 = 0.9;

struct TableRow {
    sensors: usize,
    exact: usize,
    tied: usize,
    covered: usize,
    intervals: usize,
    named_counts: BTreeMap<String, usize>,
}

const EMPTY_ROW: TableRow =
    TableRow { sensors: 0, exact: 0, tied: 0, covered: 0, intervals: 0, named_counts: BTreeMap::new() };

fn add(row: &mut TableRow, record: &Value) {
    let score = &record["score"];
    let name = record["hidden"][0]["name"].as_str().unwrap_or("clean");
    row.sensors += 1;
    row.exact += usize::from(score["exact"] == 1);
    row.tied += usize::from(score["named_or_ambiguous"] == 1);
    let names: Vec<&str> =
        score["names"].as_array().into_iter().flatten().filter_map(Value::as_str).collect();
    for other_name in names.iter().filter(|n| **n != name) {
        *row.named_counts.entry((*other_name).to_owned()).or_default() += 1;
    }
    if let (Some(covered), true) = (interval_covers(record, name), score["exact"] == 1) {
        row.intervals += 1;
        row.covered += usize::from(covered);
    }
}

/// Replaces the text between the markers of the page, or creates the page.
pub(crate) fn write(folder: &Path, path: &Path) {
    let records = super::records::current_records(folder);
    let (start, end, tables) = ("<!-- tables -->\n", "<!-- end of tables -->", tables(&records));
    let page = std::fs::read_to_string(path).unwrap_or_else(|_| format!("# Diagnosis\n\n{start}{end}\n"));
    let (before, rest) = page.split_once(start).expect("the page has marks for its tables");
    let (_, after) = rest.split_once(end).expect("the tables have an end");
    std::fs::write(path, format!("{before}{start}{tables}{end}{after}")).unwrap();
}

fn tables(records: &[Value]) -> String {
    let class_records = |class: &str| records.iter().filter(|r| r["class"] == class).collect::<Vec<_>>();
    let mut text = String::new();
    summary(&mut text, records);
    run_time_text(&mut text, records);
    clean_table(&mut text, &class_records("null"));
    single_table(&mut text, &class_records("single"));
    outside_table(&mut text, &class_records("outside"));
    multiple_table(&mut text, "Two effects at once", &class_records("double"));
    multiple_table(&mut text, "Three effects at once", &class_records("triple"));
    text
}

fn clean_table(text: &mut String, all: &[&Value]) {
    let gaps: Vec<[f64; 4]> = all.iter().filter_map(|r| discrepancy(r)).collect();
    let Some([.., floor, sd]) = gaps.first() else { return };
    let mean = gaps.iter().map(|g| g[1]).sum::<f64>() / gaps.len() as f64;
    let square = gaps.iter().map(|g| (g[1] - mean).powi(2)).sum::<f64>() / gaps.len() as f64;
    let above = gaps.iter().filter(|[_, last, floor, sd]| last - floor > 2.0 * sd).count();
    writeln!(
        text,
        "### Clean sensors\n\nThe held-out discrepancy of the clean sensors has the mean {mean:.0} (standard deviation {:.0}). The noise floor of the first sensor is \
         {floor:.0} ({sd:.0}). {above} sensors lie more than two standard deviations above the noise floor.\n",
        square.sqrt()
    )
    .unwrap();
}

fn single_table(text: &mut String, all: &[&Value]) {
    let mut rows: BTreeMap<&str, TableRow> = BTreeMap::new();
    for record in all {
        add(rows.entry(record["hidden"][0]["name"].as_str().unwrap_or("?")).or_insert(EMPTY_ROW), record);
    }
    let is_listed = |r: &TableRow| {
        r.exact < r.sensors
            || !r.named_counts.is_empty()
            || (r.covered as f64) < MIN_COVERAGE * r.intervals as f64
    };
    let others = rows.values().filter(|r| !is_listed(r)).count();
    writeln!(
        text,
        "### Single effects\n\nThe table lists effects with a missing exact name, another named effect, or less than {:.0} % of the intervals around the true \
         value. The other {others} effects have none of these.\n",
        100.0 * MIN_COVERAGE
    )
    .unwrap();
    text.push_str("| effect | exact | exact or ambiguous | interval contains the true value | other named effects |\n|---|--:|--:|--:|---|\n");
    for (name, r) in rows.iter().filter(|(_, r)| is_listed(r)) {
        let named: Vec<String> = r.named_counts.iter().map(|(n, k)| format!("`{n}` {k}")).collect();
        writeln!(
            text,
            "| `{name}` | {}/{} | {} | {}/{} | {} |",
            r.exact,
            r.sensors,
            r.tied,
            r.covered,
            r.intervals,
            named.join(", ")
        )
        .unwrap();
    }
    text.push('\n');
}

fn outside_table(text: &mut String, all: &[&Value]) {
    let mut rows: BTreeMap<&str, [usize; 2]> = BTreeMap::new();
    for r in all {
        let row = rows.entry(r["hidden"][0]["name"].as_str().unwrap_or("?")).or_default();
        row[0] += 1;
        row[1] += usize::from(r["score"]["verdict"] == "unknown");
    }
    text.push_str("### Effects outside the catalog\n\n| effect | unknown |\n|---|--:|\n");
    for (name, [sensors, unknown]) in rows {
        writeln!(text, "| {name} | {unknown}/{sensors} |").unwrap();
    }
    text.push('\n');
}

/// For sensors with several effects, writes the effects above their smallest detectable strength that were missed more
/// than once, and the wrong names.
fn multiple_table(text: &mut String, title: &str, all: &[&Value]) {
    if all.is_empty() {
        writeln!(text, "### {title}\n\nNo sensor was diagnosed.\n").unwrap();
        return;
    }
    let counts = MultipleEffects::from_records(all);
    let list = |names: Vec<String>| if names.is_empty() { "none".to_owned() } else { names.join(", ") };
    let missed = counts.rows.iter().filter(|(_, r)| r[1] + 1 < r[0]);
    let missed = list(missed.map(|(n, r)| format!("`{n}` {} of {}", r[0] - r[1], r[0])).collect());
    let wrong = list(counts.wrong_names.iter().map(|(n, k)| format!("`{n}` {k}")).collect());
    writeln!(
        text,
        "### {title}\n\nEffects that were missed more than once: {missed}. Wrongly named effects: {wrong}.\n"
    )
    .unwrap();
}
