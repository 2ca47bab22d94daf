//! The summary of the study.

use std::fmt::Write as _;

use serde_json::Value;

use super::multiple_effects::MultipleEffects;
use super::outcomes::interval_covers;
use super::share::Share;

/// A row of the summary: a quantity, its target, and the measured share.
struct SummaryRow {
    quantity: &'static str,
    aim: &'static str,
    share: Share,
}

/// Writes the aims of the study and the results.
pub(crate) fn summary(text: &mut String, records: &[Value]) {
    let class_records = |class: &str| records.iter().filter(|r| r["class"] == class).collect::<Vec<_>>();
    let share = |group: &[&Value], hit: &dyn Fn(&Value) -> bool| Share {
        hits: group.iter().filter(|r| hit(r)).count(),
        total: group.len(),
    };
    let (clean, singles, strangers) =
        (class_records("null"), class_records("single"), class_records("outside"));
    let named = |r: &Value| r["score"]["names"].as_array().is_some_and(|n| !n.is_empty());
    let verdict = |r: &Value, word: &str| r["score"]["verdict"] == word;
    let exact: Vec<&Value> = singles.iter().filter(|r| r["score"]["exact"] == 1).copied().collect();
    let covered = exact.iter().filter_map(|r| interval_covers(r, r["hidden"][0]["name"].as_str()?));
    let covered: Vec<bool> = covered.collect();
    let mut rows = vec![
        SummaryRow {
            quantity: "clean sensors with an alarm or a named effect",
            aim: "at most 1 %",
            share: share(&clean, &|r| !verdict(r, "agrees")),
        },
        SummaryRow {
            quantity: "single effects with an exact or ambiguous name",
            aim: "95 %",
            share: share(&singles, &|r| r["score"]["named_or_ambiguous"] == 1),
        },
        SummaryRow {
            quantity: "single effects with an exact name",
            aim: "85 %",
            share: share(&singles, &|r| r["score"]["exact"] == 1),
        },
    ];
    for (class, found, right) in [
        (
            "double",
            "found effects of sensors with two effects",
            "correctly named effects of sensors with two effects",
        ),
        (
            "triple",
            "found effects of sensors with three effects",
            "correctly named effects of sensors with three effects",
        ),
    ] {
        let counts = MultipleEffects::from_records(&class_records(class));
        let hits = counts.found_count();
        rows.push(SummaryRow {
            quantity: found,
            aim: "85 %",
            share: Share { hits, total: counts.hidden_count() },
        });
        rows.push(SummaryRow {
            quantity: right,
            aim: "95 %",
            share: Share { hits, total: hits + counts.wrong_count() },
        });
    }
    rows.extend([
        SummaryRow {
            quantity: "outside the catalog, verdict unknown",
            aim: "90 %",
            share: share(&strangers, &|r| verdict(r, "unknown")),
        },
        SummaryRow {
            quantity: "outside the catalog, misnamed",
            aim: "none",
            share: share(&strangers, &named),
        },
        SummaryRow {
            quantity: "intervals of single effects that contain the true value",
            aim: "90 to 99 %",
            share: Share { hits: covered.iter().filter(|h| **h).count(), total: covered.len() },
        },
    ]);
    text.push_str(
        "| quantity | target | result, with the 95 % interval of Clopper and Pearson |\n|---|---|---|\n",
    );
    for SummaryRow { quantity: what, aim, share } in rows {
        writeln!(text, "| {what} | {aim} | {share} |").unwrap();
    }
    text.push('\n');
}

/// Writes the number of sensors and the durations of their diagnoses.
pub(crate) fn run_time_text(text: &mut String, records: &[Value]) {
    text.push_str(
        "| class of sensors | diagnosed | seconds: median | mean | maximum | sensors with at most 15 s |\n|---|--:|--:|--:|--:|--:|\n",
    );
    for class in ["null", "single", "double", "triple", "outside"] {
        let in_class = records.iter().filter(|r| r["class"] == class);
        let mut seconds: Vec<f64> = in_class.filter_map(|r| r["diagnosis"]["seconds"].as_f64()).collect();
        seconds.sort_by(f64::total_cmp);
        let Some(max_seconds) = seconds.last() else { continue };
        writeln!(
            text,
            "| {class} | {} | {:.1} | {:.1} | {max_seconds:.1} | {} |",
            seconds.len(),
            seconds[seconds.len() / 2],
            seconds.iter().sum::<f64>() / seconds.len() as f64,
            seconds.partition_point(|s| *s <= 15.0),
        )
        .unwrap();
    }
    text.push_str("\nThe times exclude shared simulations. The target is 15 s per sensor.\n\n");
}
