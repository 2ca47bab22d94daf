//! The table of the results of the diagnoses.

use std::collections::BTreeMap;

use serde_json::Value;

use super::share::Share;

/// Factors of the laboratory that the table contains. The records also contain the other factors.
const SHOWN_FACTORS: [&str; 2] = ["lamps off by", "protocol"];

/// Returns a table row with a share, its target, and whether the share reaches the target.
fn row(what: &str, aim: &str, share: Share, at_least: Option<f64>, at_most: Option<f64>) -> String {
    let (low, high) = (share.lower_bound(), share.upper_bound());
    let status = match (at_least, at_most) {
        _ if share.total == 0 => "no case",
        (Some(aim), _) if low >= aim => "reached",
        (Some(aim), _) if high < aim => "missed",
        (_, Some(aim)) if high <= aim => "reached",
        (_, Some(aim)) if low > aim => "missed",
        _ => "undecided",
    };
    format!("| {what} | {aim} | {share} | {status} |\n")
}

fn share_of<'a>(all: impl Iterator<Item = &'a Value>, hit: impl Fn(&Value) -> bool) -> Share {
    let (mut hits, mut total) = (0, 0);
    all.for_each(|r| {
        total += 1;
        hits += usize::from(hit(r));
    });
    Share { hits, total }
}

fn name_count(r: &Value, key: &str) -> usize {
    r["score"][key].as_array().map_or(0, Vec::len)
}

fn has_wrong_name(r: &Value) -> bool {
    name_count(r, "wrong") > 0
}

/// Smallest number of sensors with a wrong name that the table lists.
const MIN_SENSORS: usize = 3;

/// Returns the table of frequent wrong names, and for each the number of sensors with this name.
fn wrong_name_table(records: &[Value]) -> String {
    let mut counts: BTreeMap<&str, [usize; 2]> = BTreeMap::new();
    for r in records {
        let mut names: Vec<&str> =
            r["score"]["wrong"].as_array().into_iter().flatten().filter_map(Value::as_str).collect();
        names.sort_unstable();
        names.dedup();
        for name in names {
            counts.entry(name).or_default()[usize::from(r["class"] != "null")] += 1;
        }
    }
    let is_listed = |(_, [clean, other]): &(&str, [usize; 2])| clean + other >= MIN_SENSORS;
    let mut rows: Vec<_> = counts.into_iter().filter(is_listed).collect();
    rows.sort_by_key(|(name, [clean, other])| (std::cmp::Reverse(clean + other), *name));
    let mut text = format!(
        "\nWrong names of at least {MIN_SENSORS} sensors:\n\n| wrong name | clean sensors | sensors with an effect |\n|---|--:|--:|\n"
    );
    for (name, [clean, other]) in rows {
        text += &format!("| `{name}` | {clean} | {other} |\n");
    }
    text
}

pub(crate) fn table(records: &[Value]) -> String {
    let class = |class: &str| records.iter().filter(|r| r["class"] == class).count();
    let mut head = format!(
        "{} sensors were diagnosed: {} clean, {} with one effect, {} with two effects, {} with an effect outside the catalog.\n\n",
        records.len(),
        class("null"),
        class("single"),
        class("double"),
        class("outside")
    );
    let in_class = |class: &'static str| records.iter().filter(move |r| r["class"] == class);
    head += "| quantity | target | result, with the 95 % interval of Clopper and Pearson | status |\n|---|---|---|---|\n";
    let mut text = head;
    let alarm = |r: &Value| r["diagnosis"]["verdict"] != "agrees";
    text += &row(
        "clean sensors with a wrongly named effect",
        "at most 0.5 %",
        share_of(in_class("null"), has_wrong_name),
        None,
        Some(0.005),
    );
    text += &row(
        "clean sensors with an alarm",
        "at most 2 %",
        share_of(in_class("null"), alarm),
        None,
        Some(0.02),
    );
    let hidden = ["single", "double"].map(|class| {
        let (mut named_count, mut all) = (0, 0);
        in_class(class).for_each(|r| {
            all += r["score"]["showable"].as_u64().unwrap_or(0) as usize;
            named_count += name_count(r, "found");
        });
        Share { hits: named_count.min(all), total: all }
    });
    text += &row("single effects with an exact or ambiguous name", "90 %", hidden[0], Some(0.9), None);
    text += &row(
        "effects of sensors with two effects, with an exact or ambiguous name",
        "90 %",
        hidden[1],
        Some(0.9),
        None,
    );
    let effects = || records.iter().filter(|r| r["class"] == "single" || r["class"] == "double");
    text += &row(
        "sensors with an effect and a wrongly named effect",
        "at most 3 %",
        share_of(effects(), has_wrong_name),
        None,
        Some(0.03),
    );
    text += &row(
        "outside the catalog, misnamed",
        "at most 1 of 24",
        share_of(in_class("outside"), has_wrong_name),
        None,
        Some(1.0 / 24.0),
    );
    let is_slow = |r: &Value| r["diagnosis"]["seconds"].as_f64().is_some_and(|seconds| seconds > 120.0);
    text += &row("diagnoses of more than 120 s", "none", share_of(records.iter(), is_slow), None, Some(0.01));
    text += "\nClean sensors with an alarm, by factor:\n\n| factor | level | sensors with an alarm |\n|---|---|---|\n";
    let mut cells: BTreeMap<(String, String), Vec<&Value>> = BTreeMap::new();
    for r in in_class("null") {
        for (factor, level) in
            r["factors"].as_object().into_iter().flatten().filter(|f| SHOWN_FACTORS.contains(&f.0.as_str()))
        {
            let level = level.as_str().unwrap_or_default().to_owned();
            cells.entry((factor.clone(), level)).or_default().push(r);
        }
    }
    for ((factor, level), group) in &cells {
        text += &format!("| {factor} | {level} | {} |\n", share_of(group.iter().copied(), alarm));
    }
    text += &wrong_name_table(records);
    text
}
