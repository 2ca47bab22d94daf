//! Differences between two score files.

use serde_json::Value;
use spikelane::error::excerpt;

/// Returns one line for each value that differs, in the order of the keys.
pub(super) fn difference_lines(listed: &Value, computed: &Value) -> Vec<String> {
    let mut lines = Vec::new();
    add_differences("", listed, computed, &mut lines);
    lines
}

fn add_differences(subject: &str, listed: &Value, computed: &Value, lines: &mut Vec<String>) {
    let inside = |part: &str| {
        let part = excerpt(part);
        if subject.is_empty() { part.into_owned() } else { format!("{subject} {part}") }
    };
    match (listed, computed) {
        _ if listed == computed => {}
        (Value::Object(a), Value::Object(b)) => {
            let absent = Value::Null;
            for key in a.keys().chain(b.keys().filter(|key| !a.contains_key(*key))) {
                let [a, b] = [a, b].map(|map| map.get(key).unwrap_or(&absent));
                add_differences(&inside(key), a, b, lines);
            }
        }
        (Value::Array(a), Value::Array(b)) if a.len() == b.len() => {
            for (i, (a, b)) in a.iter().zip(b).enumerate() {
                add_differences(&inside(&element_name(b, i)), a, b, lines);
            }
        }
        (Value::Array(a), Value::Array(b)) => {
            lines.push(format!("number of {subject}: the file lists {}, the run gives {}", a.len(), b.len()));
        }
        _ => lines.push(format!(
            "{subject}: the file lists {}, the run gives {}",
            value_text(listed),
            value_text(computed)
        )),
    }
}

/// Returns the group and the sequence of an element, or its index.
fn element_name(element: &Value, index: usize) -> String {
    match (element["group"].as_str(), element["id"].as_str()) {
        (Some(group), Some(id)) => format!("{group}/{id}"),
        (Some(group), None) => group.to_owned(),
        _ => index.to_string(),
    }
}

fn value_text(value: &Value) -> String {
    match value {
        Value::Null => "nothing".to_owned(),
        Value::String(text) => excerpt(text).into_owned(),
        other => excerpt(&other.to_string()).into_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn a_line_names_the_value_that_differs_and_both_values() {
        let file = |psnr: f64, limit: Option<f64>, names: &[&str]| {
            json!({
                "sequences": [{ "group": "test", "id": "scene-0001", "scores": { "psnr": psnr, "ssim": 0.5 } }],
                "time_limit_s": limit,
                "metrics": names,
            })
        };
        let lines =
            difference_lines(&file(33.9, None, &["psnr/1"]), &file(32.5, Some(2.0), &["psnr/1", "ssim/1"]));
        assert_eq!(
            lines,
            [
                "number of metrics: the file lists 1, the run gives 2",
                "sequences test/scene-0001 scores psnr: the file lists 33.9, the run gives 32.5",
                "time_limit_s: the file lists nothing, the run gives 2.0",
            ]
        );
        assert!(difference_lines(&file(1.0, None, &[]), &file(1.0, None, &[])).is_empty());
        let long = "x".repeat(30_000);
        for line in difference_lines(&json!({ &long: &long }), &json!({ &long: [&long] })) {
            assert!(line.len() < 800, "{} bytes", line.len());
        }
    }
}
