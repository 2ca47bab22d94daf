//! Tests the scores of the blind study.

#[path = "../src/diagnose/score.rs"]
mod score;
#[path = "../src/diagnose/share.rs"]
mod share;

use serde_json::{Value, json};
use share::Share;

fn score_names(hidden: &[&str], named: &[(&str, &[&str])]) -> Value {
    let hidden: Vec<Value> = hidden.iter().map(|name| json!({ "name": name })).collect();
    let effects: Vec<Value> = named
        .iter()
        .map(|(name, ties)| json!({ "name": name, "ambiguous_with": ties, "is_tentative": false }))
        .collect();
    let diagnosis = json!({ "verdict": "explained", "effects": effects, "parameter_mismatches": [] });
    score::score(&Value::from(hidden), &diagnosis)
}

#[test]
fn a_name_with_its_ties_stands_for_one_effect() {
    let score = score_names(&["crosstalk", "spike_coupling"], &[("spike_coupling", &["crosstalk"])]);
    assert_eq!(score["found"], json!(["spike_coupling"]));
    let score = score_names(&["leak", "adaptation"], &[("dead_time", &["adaptation", "leak"])]);
    assert_eq!(score["named_or_ambiguous"], 1);
}

#[test]
fn a_name_without_a_hidden_effect_is_wrong() {
    let score = score_names(&["leak"], &[("leak", &[]), ("dead_time", &["leak"]), ("flicker", &[])]);
    assert_eq!(score["exact"], 1);
    assert_eq!(score["found"], json!(["leak"]));
    assert_eq!(score["wrong"], json!(["dead_time", "flicker"]));
}

#[test]
fn the_name_with_fewer_ties_takes_its_effect_first() {
    let score = score_names(&["leak", "flicker"], &[("a", &["leak", "flicker"]), ("b", &["leak"])]);
    assert_eq!(score["named_or_ambiguous"], 2);
    assert_eq!(score["wrong"], json!([]));
}

#[test]
fn tentative_names_do_not_count_and_mismatches_do() {
    let diagnosis = json!({
        "verdict": "partly-explained",
        "effects": [{ "name": "leak", "ambiguous_with": [], "is_tentative": true }],
        "parameter_mismatches": [{ "parameter": "thermal_noise.sigma", "ambiguous_with": [] }],
    });
    let score = score::score(&json!([{ "name": "leak" }]), &diagnosis);
    assert_eq!(score["names"], json!(["thermal_noise"]));
    assert_eq!(score["found"], json!([]));
    assert_eq!(score::score(&json!([]), &json!({ "error": "no" })), json!({ "error": true }));
}

#[test]
fn an_interval_of_a_share_is_that_of_clopper_and_pearson() {
    // Each expected bound is the share at which a binomial sum in exact fractions is 2.5 %. For 0 of 300 the interval
    // is 0 to 1.222 %. For 79 of 84 it is 86.65 to 98.04 %.
    let none = Share { hits: 0, total: 300 };
    assert!((none.upper_bound() - 0.012_221).abs() < 1e-6, "{}", none.upper_bound());
    assert_eq!(none.to_string(), "0 of 300, 0 % (0 to 1)");
    assert_eq!(Share { hits: 79, total: 84 }.to_string(), "79 of 84, 94 % (87 to 98)");
    // For many sensors n, the power (1 - p)^n of a share p underflows. The expected bounds of 96.61 and 99.33 % were
    // computed with logarithms of the gamma function.
    assert_eq!(Share { hits: 415, total: 422 }.to_string(), "415 of 422, 98 % (97 to 99)");
    assert_eq!(Share { hits: 5, total: 5 }.to_string(), "5 of 5, 100 % (48 to 100)");
    assert_eq!(Share { hits: 0, total: 0 }.to_string(), "no case");
}
