//! The table of a study with few sensors: one row per sensor.

use std::fmt::Write as _;

use serde_json::Value;

use super::outcomes::discrepancy;

/// Returns the table of the hidden effects, the diagnosis, and its duration for each sensor.
pub(crate) fn sensor_table(records: &[Value]) -> String {
    let mut text = String::from(
        "| hidden effects | named effects | verdict | held-out discrepancy before and after (noise floor) | seconds |\n|---|---|---|--:|--:|\n",
    );
    for record in records {
        let [first, last, floor, _] = discrepancy(record).unwrap_or_default();
        writeln!(
            text,
            "| {} | {} | {} | {first:.0}, {last:.0} ({floor:.0}) | {:.0} |",
            hidden_text(record),
            diagnosis_text(record),
            record["score"]["verdict"].as_str().unwrap_or("error"),
            record["diagnosis"]["seconds"].as_f64().unwrap_or(0.0)
        )
        .unwrap();
    }
    text.push_str(
        "\nStrengths are absolute values: effects that can have both signs are hidden with either sign. The times exclude shared \
         simulations.\n",
    );
    text
}

/// Returns the names and strengths of the hidden effects. If the smallest detectable strength of an effect is known,
/// the strength is also given as a multiple of it.
fn hidden_text(record: &Value) -> String {
    let of = |h: &Value| {
        let (name, strength) = (h["name"].as_str().unwrap_or("?"), h["strength"].as_f64().unwrap_or(0.0));
        match h["detectable_strength"].as_f64() {
            Some(smallest) => {
                format!("`{name}` {} ({:.1} times)", four_digits(strength), strength / smallest)
            }
            None => format!("{name} {}", four_digits(strength)),
        }
    };
    or_nothing(joined(&record["hidden"], of))
}

/// Returns names with their amplitudes and ambiguous names. Tentative names are marked.
fn diagnosis_text(record: &Value) -> String {
    let effect = |e: &Value| {
        let [value, low, high] = ["value", "low", "high"]
            .map(|key| four_digits(e["parameters"][0][key].as_f64().unwrap_or(f64::NAN)));
        let resembles = if e["is_tentative"] == true { "resembles " } else { "" };
        let tied = joined(&e["ambiguous_with"], |t| format!("`{}`", t.as_str().unwrap_or("?")));
        let tied = if tied.is_empty() { tied } else { format!(", ambiguous with {tied}") };
        let name = e["name"].as_str().unwrap_or("?");
        format!("{resembles}`{name}` {value} ({low} to {high}){tied}")
    };
    let misfit = |m: &Value| format!("mismatch of `{}`", m["parameter"].as_str().unwrap_or("?"));
    let all = [
        joined(&record["diagnosis"]["effects"], effect),
        joined(&record["diagnosis"]["parameter_mismatches"], misfit),
    ];
    or_nothing(all.into_iter().filter(|s| !s.is_empty()).collect::<Vec<_>>().join("; "))
}

fn or_nothing(words: String) -> String {
    if words.is_empty() { "none".to_owned() } else { words }
}

/// Returns a number with four significant digits.
fn four_digits(x: f64) -> String {
    match x.abs() {
        0.0 => "0".to_owned(),
        size if (1e-3..1e4).contains(&size) => {
            format!("{x:.0$}", (3 - size.log10().floor() as i32).max(0) as usize)
        }
        _ => format!("{x:.3e}"),
    }
}

fn joined(all: &Value, of: impl Fn(&Value) -> String) -> String {
    all.as_array().into_iter().flatten().map(of).collect::<Vec<_>>().join("; ")
}
