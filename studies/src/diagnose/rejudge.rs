//! Repeats recorded diagnoses. A diagnosis is unchanged if all words and the first nine digits of all numbers are the same.

use serde_json::Value;
use spikelane_diagnose::NullModel;

use super::hidden_sensor::{CATALOG_KINDS, OUTSIDE_KINDS, SMALL_SIZE};
use super::jobs::SensorJob;
use super::phases::PhaseTimer;
use super::{diagnose_sensor, records, version};

/// Diagnoses the sensor of a record again and returns the new record.
pub(crate) fn repeat(recorded: &Value, reference: &NullModel) -> Value {
    diagnose_sensor::diagnose_hidden(
        &job_from_record(recorded),
        &strengths_from_record(recorded),
        reference,
        SMALL_SIZE,
        &mut PhaseTimer::new(false),
    )
}

/// Returns the differences between the record of a sensor and its new diagnosis. The list is empty if all words and
/// the first nine digits of all numbers are the same.
pub(crate) fn differences(recorded: &Value, reference: &NullModel) -> Vec<String> {
    let now = repeat(recorded, reference);
    let mut differences = Vec::new();
    let was = records::without_omitted_keys(recorded.clone());
    let now = records::without_omitted_keys(now);
    if was["version"] != version::version_of_diagnosis(&was["diagnosis"]).as_str() {
        differences.push(format!("version: {} is not that of this code", was["version"]));
    }
    for part in ["diagnosis", "hidden", "steps"] {
        compare_values(part, &was[part], &now[part], &mut differences);
    }
    differences
}

/// Returns the record of the sensor `id` from lines of records.
pub(crate) fn find_record(lines: &str, id: &str) -> Option<Value> {
    lines.lines().filter_map(|l| serde_json::from_str::<Value>(l).ok()).find(|r| r["id"] == id)
}

/// Repeats the diagnoses of the sensors in `list` and prints the differences from the records. Returns whether there
/// are no differences.
pub(crate) fn rejudge(list: &str, lines: &str, reference: &NullModel) -> bool {
    let (mut same, mut all) = (0, 0);
    for id in list.lines() {
        all += 1;
        let differing = match find_record(lines, id) {
            Some(recorded) => differences(&recorded, reference),
            None => vec!["no such record".to_owned()],
        };
        same += usize::from(differing.is_empty());
        println!("{id}: {}", if differing.is_empty() { "the same".to_owned() } else { differing.join("; ") });
    }
    println!("{same} of {all} recorded sensors have the recorded diagnosis to nine digits");
    same == all && all > 0
}

fn job_from_record(recorded: &Value) -> SensorJob {
    let class = ["null", "single", "outside", "double", "triple"];
    let class = class.into_iter().find(|c| recorded["class"] == *c).expect("a class of the study");
    let kind = |h: &Value| {
        let mut all = CATALOG_KINDS.iter().chain(OUTSIDE_KINDS.iter());
        all.find(|k| h["name"] == k.name).expect("an effect of the hidden sensor")
    };
    let kinds = recorded["hidden"].as_array().into_iter().flatten().map(kind).collect();
    let index = recorded["id"].as_str().and_then(|id| id.rsplit('-').next()?.parse().ok());
    SensorJob { class, kinds, index: index.expect("a number at the end of the id") }
}

fn strengths_from_record(recorded: &Value) -> Vec<(f64, Option<f64>)> {
    let strengths =
        |h: &Value| (h["strength"].as_f64().expect("a strength"), h["detectable_strength"].as_f64());
    recorded["hidden"].as_array().into_iter().flatten().map(strengths).collect()
}

/// Sums in another order differ in the last digits.
fn is_equal_number(was: &Value, now: &Value) -> bool {
    let numbers = was.as_f64().zip(now.as_f64());
    numbers.is_some_and(|(was, now)| (was - now).abs() <= 1e-9 * was.abs().max(now.abs()))
}

fn compare_values(place: &str, was: &Value, now: &Value, differences: &mut Vec<String>) {
    match (was, now) {
        (Value::Object(a), Value::Object(b)) => {
            let keys: std::collections::BTreeSet<&String> = a.keys().chain(b.keys()).collect();
            keys.into_iter().filter(|k| *k != "seconds").for_each(|k| {
                compare_values(&format!("{place}.{k}"), &was[k.as_str()], &now[k.as_str()], differences);
            });
        }
        (Value::Array(a), Value::Array(b)) if a.len() == b.len() => {
            a.iter().zip(b).enumerate().for_each(|(i, (x, y))| {
                compare_values(&format!("{place}[{i}]"), x, y, differences);
            });
        }
        _ if was == now || is_equal_number(was, now) => {}
        _ => differences.push(format!("{place}: recorded {was}, now {now}")),
    }
}
