//! Recorded sensors judged again: the judgement is the same where every digit comes back.

use serde_json::Value;
use spikelane_calibrate::diagnose::Reference;

use super::hidden_sensor::{INSIDE, OUTSIDE, SMALL};
use super::jobs::Job;
use super::phases::Phases;
use super::{judge, records, version};

/// Where what is said of the sensor of `recorded` now differs from what was said: nothing if every digit came back.
pub(crate) fn differences(recorded: &Value, reference: &Reference) -> Vec<String> {
    let now = judge::record(&job(recorded), &strengths(recorded), reference, SMALL, &mut Phases::new(false));
    let mut differences = Vec::new();
    let was = records::kept(recorded.clone());
    let now = records::kept(now);
    if was["version"] != version::of(&was["said"]).as_str() {
        differences.push(format!("version: {} is not that of this code", was["version"]));
    }
    for part in ["said", "hidden", "steps"] {
        compare(part, &was[part], &now[part], &mut differences);
    }
    differences
}

/// The record of the sensor called `id` among lines of records.
pub(crate) fn find(lines: &str, id: &str) -> Option<Value> {
    lines.lines().filter_map(|l| serde_json::from_str::<Value>(l).ok()).find(|r| r["id"] == id)
}

/// Judges the sensors of a list again and prints what differs; whether nothing did.
pub(crate) fn run(list: &str, lines: &str, reference: &Reference) -> bool {
    let (mut same, mut all) = (0, 0);
    for id in list.lines() {
        all += 1;
        let found = match find(lines, id) {
            Some(recorded) => differences(&recorded, reference),
            None => vec!["no such record".to_owned()],
        };
        same += usize::from(found.is_empty());
        println!("{id}: {}", if found.is_empty() { "the same".to_owned() } else { found.join("; ") });
    }
    println!("{same} of {all} recorded sensors are judged as they were, in every digit");
    same == all && all > 0
}

fn job(recorded: &Value) -> Job {
    let class = ["null", "single", "outside", "double", "triple"];
    let class = class.into_iter().find(|c| recorded["class"] == *c).expect("a class of the study");
    let kind = |h: &Value| {
        let mut all = INSIDE.iter().chain(OUTSIDE.iter());
        all.find(|k| h["name"] == k.name).expect("an effect of the hidden sensor")
    };
    let kinds = recorded["hidden"].as_array().into_iter().flatten().map(kind).collect();
    let index = recorded["id"].as_str().and_then(|id| id.rsplit('-').next()?.parse().ok());
    Job { class, kinds, index: index.expect("a number at the end of the id") }
}

fn strengths(recorded: &Value) -> Vec<(f64, Option<f64>)> {
    let of = |h: &Value| (h["strength"].as_f64().expect("a strength"), h["nameable"].as_f64());
    recorded["hidden"].as_array().into_iter().flatten().map(of).collect()
}

fn compare(place: &str, was: &Value, now: &Value, differences: &mut Vec<String>) {
    match (was, now) {
        (Value::Object(a), Value::Object(b)) => {
            let keys: std::collections::BTreeSet<&String> = a.keys().chain(b.keys()).collect();
            keys.into_iter().filter(|k| *k != "seconds").for_each(|k| {
                compare(&format!("{place}.{k}"), &was[k.as_str()], &now[k.as_str()], differences);
            });
        }
        (Value::Array(a), Value::Array(b)) if a.len() == b.len() => {
            a.iter().zip(b).enumerate().for_each(|(i, (x, y))| {
                compare(&format!("{place}[{i}]"), x, y, differences);
            });
        }
        _ if was == now => {}
        _ => differences.push(format!("{place}: {was} was said, {now} is now")),
    }
}
