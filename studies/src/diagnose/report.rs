//! The tables of the study.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;

use serde_json::Value;

use super::multiple_effects::MultipleEffects;
use super::outcomes::{DiscrepancyCounts, discrepancy, interval_covers};
use super::sensor_table::sensor_table;
use super::share::Share;
use super::summary::{run_time_text, summary};

struct TableRow {
    sensors: usize,
    exact: usize,
    tied: usize,
    unnamed: usize,
    covered: usize,
    intervals: usize,
    gaps: DiscrepancyCounts,
    named_counts: BTreeMap<String, usize>,
}

const EMPTY_ROW: TableRow = TableRow {
    sensors: 0,
    exact: 0,
    tied: 0,
    unnamed: 0,
    covered: 0,
    intervals: 0,
    gaps: DiscrepancyCounts { explained: 0, within_limit: 0 },
    named_counts: BTreeMap::new(),
};

fn add(row: &mut TableRow, record: &Value) {
    let score = &record["score"];
    let name = record["hidden"][0]["name"].as_str().unwrap_or("clean");
    row.sensors += 1;
    row.exact += usize::from(score["exact"] == 1);
    row.tied += usize::from(score["named_or_ambiguous"] == 1);
    let names: Vec<&str> =
        score["names"].as_array().into_iter().flatten().filter_map(Value::as_str).collect();
    row.unnamed += usize::from(score["verdict"] == "agrees");
    for other_name in names.iter().filter(|n| **n != name) {
        *row.named_counts.entry((*other_name).to_owned()).or_default() += 1;
    }
    row.gaps.add(record);
    if let (Some(covered), true) = (interval_covers(record, name), score["exact"] == 1) {
        row.intervals += 1;
        row.covered += usize::from(covered);
    }
}

/// Replaces the text between the markers of the page, or creates the page.
///
/// The sensors of the large size have their own markers and their own table.
pub(crate) fn write(folder: &Path, path: &Path, large: bool) {
    let records = super::records::current_records(folder);
    let (start, end, tables) = if large {
        ("<!-- large -->\n", "<!-- end of large -->", sensor_table(&records))
    } else {
        ("<!-- tables -->\n", "<!-- end of tables -->", tables(&records))
    };
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
    let alarms = all.iter().filter(|r| r["score"]["verdict"] != "agrees").count();
    let named = all.iter().filter(|r| r["score"]["names"].as_array().is_some_and(|n| !n.is_empty())).count();
    writeln!(
        text,
        "### Clean sensors\n\n{} sensors were diagnosed. {alarms} have an alarm, and {named} have a named effect. The upper end of the 95 % interval \
         (Clopper and Pearson) of the share with an alarm is {:.1} %.\n",
        all.len(),
        100.0 * Share { hits: alarms, total: all.len() }.upper_bound()
    )
    .unwrap();
    let gaps: Vec<[f64; 4]> = all.iter().filter_map(|r| discrepancy(r)).collect();
    let Some([.., floor, sd]) = gaps.first() else { return };
    let mean = gaps.iter().map(|g| g[1]).sum::<f64>() / gaps.len() as f64;
    let square = gaps.iter().map(|g| (g[1] - mean).powi(2)).sum::<f64>() / gaps.len() as f64;
    let above = gaps.iter().filter(|[_, last, floor, sd]| last - floor > 2.0 * sd).count();
    writeln!(
        text,
        "The held-out discrepancy of the clean sensors has the mean {mean:.0} (standard deviation {:.0}). The noise floor of the first sensor is \
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
    let sum = |f: fn(&TableRow) -> usize| rows.values().map(f).sum::<usize>();
    let (n, exact, tied) = (sum(|r| r.sensors), sum(|r| r.exact), sum(|r| r.tied));
    let (covered, intervals) = (sum(|r| r.covered), sum(|r| r.intervals));
    let share = |hits: usize, of: usize| Share { hits, total: of }.percent();
    writeln!(
        text,
        "### Single effects\n\n{n} sensors were diagnosed. Exact name: {exact} ({:.0} %). Exact or ambiguous name: {tied} ({:.0} %). The 95 % interval \
         of the amplitude contains the true value in {covered} of {intervals} cases ({:.0} %). {} sets have the verdict *explained*, of which {} have a \
         held-out discrepancy within the limit.\n",
        share(exact, n),
        share(tied, n),
        share(covered, intervals),
        sum(|r| r.gaps.explained),
        sum(|r| r.gaps.within_limit)
    )
    .unwrap();
    text.push_str("| effect | sensors | exact | exact or ambiguous | agrees | interval contains the true value | other named effects |\n|---|---|---|---|---|---|---|\n");
    for (name, r) in &rows {
        let said: Vec<String> = r.named_counts.iter().map(|(n, k)| format!("{n} {k}")).collect();
        writeln!(
            text,
            "| `{name}` | {} | {} | {} | {} | {}/{} | {} |",
            r.sensors,
            r.exact,
            r.tied,
            r.unnamed,
            r.covered,
            r.intervals,
            said.join(", ")
        )
        .unwrap();
    }
    text.push('\n');
}

fn outside_table(text: &mut String, all: &[&Value]) {
    let mut rows: BTreeMap<&str, [usize; 4]> = BTreeMap::new();
    for r in all {
        let row = rows.entry(r["hidden"][0]["name"].as_str().unwrap_or("?")).or_default();
        let named = r["score"]["names"].as_array().is_some_and(|n| !n.is_empty());
        row[0] += 1;
        row[1] += usize::from(r["score"]["verdict"] == "unknown");
        row[2] += usize::from(named);
        row[3] += usize::from(r["score"]["verdict"] == "agrees");
    }
    text.push_str("### Effects outside the catalog\n\n| effect | sensors | unknown | misnamed | agrees |\n|---|---|---|---|---|\n");
    for (name, r) in rows {
        writeln!(text, "| {name} | {} | {} | {} | {} |", r[0], r[1], r[2], r[3]).unwrap();
    }
    text.push('\n');
}

/// For sensors with several effects, writes the number of effects above their smallest detectable strength, and the
/// number of these effects that were found.
fn multiple_table(text: &mut String, title: &str, all: &[&Value]) {
    if all.is_empty() {
        writeln!(text, "### {title}\n\nNo sensor was diagnosed.\n").unwrap();
        return;
    }
    let counts = MultipleEffects::from_records(all);
    let (hidden, found, wrong) = (counts.hidden_count(), counts.found_count(), counts.wrong_count());
    writeln!(
        text,
        "### {title}\n\n{} sensors were diagnosed, with {hidden} effects above the smallest detectable strength. {found} effects were found, with an exact or \
         ambiguous name ({:.0} %). Of {} named effects, {wrong} are wrong (precision {:.0} %).\n",
        all.len(),
        Share { hits: found, total: hidden }.percent(),
        found + wrong,
        Share { hits: found, total: found + wrong }.percent()
    )
    .unwrap();
    let list = |names: Vec<String>| if names.is_empty() { "none".to_owned() } else { names.join(", ") };
    let missed = counts.rows.iter().filter(|(_, r)| r[1] < r[0]);
    let missed = list(missed.map(|(n, r)| format!("`{n}` {} of {}", r[0] - r[1], r[0])).collect());
    let wrong = list(counts.wrong_names.iter().map(|(n, k)| format!("`{n}` {k}")).collect());
    let gaps = DiscrepancyCounts::from_records(all);
    writeln!(
        text,
        "Missed effects: {missed}. Wrongly named effects: {wrong}. {} sets have the verdict *explained*, of which {} have a held-out discrepancy \
         within the limit.\n",
        gaps.explained, gaps.within_limit
    )
    .unwrap();
}
