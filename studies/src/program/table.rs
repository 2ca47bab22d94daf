//! The table of what was judged.

use std::collections::BTreeMap;

use serde_json::Value;

use super::share::Share;

/// A share with its aim.
fn row(what: &str, aim: &str, share: Share, at_least: Option<f64>, at_most: Option<f64>) -> String {
    let (low, high) = (share.lower(), share.upper());
    let said = match (at_least, at_most) {
        _ if share.of == 0 => "none ran",
        (Some(aim), _) if low >= aim => "reached",
        (Some(aim), _) if high < aim => "missed",
        (_, Some(aim)) if high <= aim => "reached",
        (_, Some(aim)) if low > aim => "missed",
        _ => "undecided",
    };
    format!("| {what} | {aim} | {share} | {said} |\n")
}

fn count<'a>(all: impl Iterator<Item = &'a Value>, hit: impl Fn(&Value) -> bool) -> Share {
    let (mut hits, mut of) = (0, 0);
    all.for_each(|r| {
        of += 1;
        hits += usize::from(hit(r));
    });
    Share { hits, of }
}

fn names(r: &Value, key: &str) -> usize {
    r["score"][key].as_array().map_or(0, Vec::len)
}

fn wrong(r: &Value) -> bool {
    names(r, "wrong") > 0
}

/// Names that sets of a protocol could not show, however strong, and in how many of them.
fn cannot_show(records: &[Value]) -> String {
    let mut text = "\nWhat a protocol cannot show, by how many of its sets:\n\n| protocol | sets | names |\n|---|--:|---|\n".to_owned();
    let mut protocols: BTreeMap<&str, Vec<&Value>> = BTreeMap::new();
    for r in records.iter().filter(|r| r["said"]["not_testable"].is_array()) {
        protocols.entry(r["factors"]["protocol"].as_str().unwrap_or_default()).or_default().push(r);
    }
    for (protocol, own) in &protocols {
        let mut names: BTreeMap<&str, usize> = BTreeMap::new();
        for name in own.iter().flat_map(|r| r["said"]["not_testable"].as_array().into_iter().flatten()) {
            *names.entry(name.as_str().unwrap_or_default()).or_default() += 1;
        }
        let names: Vec<String> = names.iter().map(|(name, n)| format!("`{name}` {n}")).collect();
        text += &format!("| {protocol} | {} | {} |\n", own.len(), names.join(", "));
    }
    text
}

pub(crate) fn table(records: &[Value]) -> String {
    let class = |class: &str| records.iter().filter(|r| r["class"] == class).count();
    let mut head = format!(
        "{} sensors were judged: {} clean, {} with one effect, {} with two, {} with what the catalogue does not hold.\n\n",
        records.len(),
        class("null"),
        class("single"),
        class("double"),
        class("outside")
    );
    let of = |class: &'static str| records.iter().filter(move |r| r["class"] == class);
    head += "| what | aim | found, with the 95 % interval of Clopper and Pearson | |\n|---|---|---|---|\n";
    let mut text = head;
    let alarm = |r: &Value| r["said"]["verdict"] != "agrees";
    text += &row(
        "clean sensors with a wrong plain name",
        "none of 300",
        count(of("null"), wrong),
        None,
        Some(0.01),
    );
    text += &row("clean sensors with an alarm", "at most 1 %", count(of("null"), alarm), None, Some(0.01));
    let hidden = ["single", "double"].map(|class| {
        let (mut found, mut all) = (0, 0);
        of(class).for_each(|r| {
            all += r["score"]["shown"].as_u64().unwrap_or(0) as usize;
            found += names(r, "found");
        });
        Share { hits: found.min(all), of: all }
    });
    text += &row("single effects, named or tied", "90 %", hidden[0], Some(0.9), None);
    text += &row("effects of doubles, named or tied", "90 %", hidden[1], Some(0.9), None);
    let effects = || records.iter().filter(|r| r["class"] == "single" || r["class"] == "double");
    text += &row(
        "sensors with an effect and a wrong plain name",
        "at most 2 %",
        count(effects(), wrong),
        None,
        Some(0.02),
    );
    text += &row("from outside, misnamed", "none", count(of("outside"), wrong), None, Some(0.01));
    text += "\nClean sensors by factor, with an alarm:\n\n| factor | level | alarm |\n|---|---|---|\n";
    let mut cells: BTreeMap<(String, String), Vec<&Value>> = BTreeMap::new();
    for r in of("null") {
        for (factor, level) in r["factors"].as_object().into_iter().flatten() {
            let level = level.as_str().unwrap_or_default().to_owned();
            cells.entry((factor.clone(), level)).or_default().push(r);
        }
    }
    for ((factor, level), own) in &cells {
        text += &format!("| {factor} | {level} | {} |\n", count(own.iter().copied(), alarm));
    }
    text += &cannot_show(records);
    text += "\nSensors that did not end as they should:\n\n";
    for r in records {
        let class = r["class"].as_str().unwrap_or_default();
        let missed = r["score"]["shown"].as_u64().unwrap_or(0) as usize > names(r, "found");
        if wrong(r) || (class == "null" && alarm(r)) || missed {
            text += &format!(
                "* {}: {}, said {}; {}\n",
                r["id"].as_str().unwrap_or_default(),
                r["said"]["verdict"].as_str().unwrap_or_default(),
                r["score"]["names"],
                r["factors"]
            );
        }
    }
    text
}
