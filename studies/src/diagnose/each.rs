//! A study of few sensors: one row each.

use std::fmt::Write as _;

use serde_json::Value;

use super::judged::gap;

/// What was hidden in each sensor, what was said of it, and how long that took.
pub(crate) fn each(records: &[Value]) -> String {
    let mut text = String::from(
        "| hidden | said | verdict | held-out gap before and after (floor) | seconds |\n|---|---|---|--:|--:|\n",
    );
    for record in records {
        let [first, last, floor, _] = gap(record).unwrap_or_default();
        writeln!(
            text,
            "| {} | {} | {} | {first:.0}, {last:.0} ({floor:.0}) | {:.0} |",
            hidden(record),
            said(record),
            record["score"]["verdict"].as_str().unwrap_or("error"),
            record["said"]["seconds"].as_f64().unwrap_or(0.0)
        )
        .unwrap();
    }
    text.push_str(
        "\nStrengths are sizes: effects of either sign are hidden with either. Simulations that all sensors of a protocol share are not in the \
         seconds.\n",
    );
    text
}

/// Names with their strengths, in smallest nameable ones where they have one.
fn hidden(record: &Value) -> String {
    let of = |h: &Value| {
        let (name, strength) = (h["name"].as_str().unwrap_or("?"), h["strength"].as_f64().unwrap_or(0.0));
        match h["nameable"].as_f64() {
            Some(smallest) => format!("`{name}` {} ({:.1} times)", short(strength), strength / smallest),
            None => format!("{name} {}", short(strength)),
        }
    };
    or_nothing(list(&record["hidden"], of))
}

/// Names with their amplitudes and what they are tied with; a likeness says so.
fn said(record: &Value) -> String {
    let effect = |e: &Value| {
        let [value, low, high] =
            ["value", "low", "high"].map(|key| short(e["parameters"][0][key].as_f64().unwrap_or(f64::NAN)));
        let resembles = if e["resembles"] == true { "resembles " } else { "" };
        let tied = list(&e["tied_with"], |t| format!("`{}`", t.as_str().unwrap_or("?")));
        let tied = if tied.is_empty() { tied } else { format!(", tied with {tied}") };
        let name = e["name"].as_str().unwrap_or("?");
        format!("{resembles}`{name}` {value} ({low} to {high}){tied}")
    };
    let misfit = |m: &Value| format!("misfit of `{}`", m["parameter"].as_str().unwrap_or("?"));
    let all = [list(&record["said"]["effects"], effect), list(&record["said"]["misfits"], misfit)];
    or_nothing(all.into_iter().filter(|s| !s.is_empty()).collect::<Vec<_>>().join("; "))
}

fn or_nothing(words: String) -> String {
    if words.is_empty() { "nothing".to_owned() } else { words }
}

/// Four digits, as they are read best.
fn short(x: f64) -> String {
    match x.abs() {
        0.0 => "0".to_owned(),
        size if (1e-3..1e4).contains(&size) => {
            format!("{x:.0$}", (3 - size.log10().floor() as i32).max(0) as usize)
        }
        _ => format!("{x:.3e}"),
    }
}

fn list(all: &Value, of: impl Fn(&Value) -> String) -> String {
    all.as_array().into_iter().flatten().map(of).collect::<Vec<_>>().join("; ")
}
