//! How the blind study counts what was found.

#[path = "../src/diagnose/score.rs"]
mod score;
#[path = "../src/diagnose/share.rs"]
mod share;

use serde_json::{Value, json};
use share::Share;

fn scored(hidden: &[&str], said: &[(&str, &[&str])]) -> Value {
    let hidden: Vec<Value> = hidden.iter().map(|name| json!({ "name": name })).collect();
    let effects: Vec<Value> = said
        .iter()
        .map(|(name, ties)| json!({ "name": name, "tied_with": ties, "resembles": false }))
        .collect();
    let said = json!({ "verdict": "explained", "effects": effects, "misfits": [] });
    score::of(&Value::from(hidden), &said)
}

#[test]
fn a_name_with_its_ties_stands_for_one_effect() {
    let score = scored(&["crosstalk", "spike_coupling"], &[("spike_coupling", &["crosstalk"])]);
    assert_eq!(score["found"], json!(["spike_coupling"]));
    let score = scored(&["leak", "adaptation"], &[("dead_time", &["adaptation", "leak"])]);
    assert_eq!(score["tied"], 1);
}

#[test]
fn a_name_that_stands_for_nothing_is_wrong() {
    let score = scored(&["leak"], &[("leak", &[]), ("dead_time", &["leak"]), ("flicker", &[])]);
    assert_eq!(score["exact"], 1);
    assert_eq!(score["found"], json!(["leak"]));
    assert_eq!(score["wrong"], json!(["dead_time", "flicker"]));
}

#[test]
fn the_name_with_fewer_ties_takes_its_effect_first() {
    let score = scored(&["leak", "flicker"], &[("a", &["leak", "flicker"]), ("b", &["leak"])]);
    assert_eq!(score["tied"], 2);
    assert_eq!(score["wrong"], json!([]));
}

#[test]
fn a_likeness_is_no_name_and_a_wrong_number_is_one() {
    let said = json!({
        "verdict": "partly-explained",
        "effects": [{ "name": "leak", "tied_with": [], "resembles": true }],
        "misfits": [{ "parameter": "thermal_noise.sigma", "tied_with": [] }],
    });
    let score = score::of(&json!([{ "name": "leak" }]), &said);
    assert_eq!(score["names"], json!(["thermal_noise"]));
    assert_eq!(score["found"], json!([]));
    assert_eq!(score::of(&json!([]), &json!({ "error": "no" })), json!({ "error": true }));
}

#[test]
fn an_interval_of_a_share_is_that_of_clopper_and_pearson() {
    // Ends at which binomial sums in exact fractions give 2.5 %: 0 of 300 to 1.222 %, 79 of 84 from 86.65 to 98.04 %.
    let none = Share { hits: 0, of: 300 };
    assert!((none.upper() - 0.012_221).abs() < 1e-6, "{}", none.upper());
    assert_eq!(none.to_string(), "0 of 300, 0 % (0 to 1)");
    assert_eq!(Share { hits: 79, of: 84 }.to_string(), "79 of 84, 94 % (87 to 98)");
    // Of many sensors (1 - p)^n is below the smallest number: 96.61 to 99.33 % by sums of logarithms of the gamma function.
    assert_eq!(Share { hits: 415, of: 422 }.to_string(), "415 of 422, 98 % (97 to 99)");
    assert_eq!(Share { hits: 5, of: 5 }.to_string(), "5 of 5, 100 % (48 to 100)");
    assert_eq!(Share { hits: 0, of: 0 }.to_string(), "none ran");
}
