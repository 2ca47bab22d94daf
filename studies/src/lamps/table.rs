//! The table of the study.

use std::fmt::Write as _;

use serde_json::Value;
use spikelane_studies::provenance::provenance;

use crate::light::KINDS;
use crate::sensor::QUANTITIES;
use crate::share::Share;

/// Returns one row for each kind of light, and rows for all kinds without light in the dark recording.
pub(crate) fn table(outcomes: &[(u64, Value)]) -> String {
    let mut text = format!(
        "{} sensors; {}. A cell is the number of 95 % intervals that contain the true value, the number of withheld values, and the median width relative to that with a steady lamp.\n\n| light |",
        outcomes.len(),
        provenance()
    );
    QUANTITIES.iter().for_each(|name| write!(text, " {name} |").unwrap());
    writeln!(text, "\n|---|{}", "---|".repeat(QUANTITIES.len())).unwrap();
    let of_kind = |kind: usize| -> Vec<&Value> {
        outcomes.iter().filter(|o| o.0 as usize % KINDS.len() == kind).map(|o| &o.1).collect()
    };
    // The last kind has light in the dark recording.
    let leak = KINDS.len() - 1;
    for (kind, name) in KINDS.iter().enumerate().take(leak) {
        row(&mut text, name, &of_kind(kind), "changing");
    }
    let all: Vec<&Value> = (0..leak).flat_map(of_kind).collect();
    row(&mut text, "all of these", &all, "changing");
    row(&mut text, "the same sensors, steady light", &all, "steady");
    row(&mut text, KINDS[leak], &of_kind(leak), "changing");
    row(&mut text, "the same light leak, steady light", &of_kind(leak), "steady");
    summary(&mut text, "All of these", &all);
    summary(&mut text, KINDS[leak], &of_kind(leak));
    let rejected = outcomes.iter().filter(|o| o.1["changing"].is_string()).count();
    writeln!(text, "\nRejected sets: {rejected}.").unwrap();
    text
}

/// Writes, for each quantity, the share of the intervals that contain the true value, and the pull: the root mean square of
/// the deviations, each divided by its stated error.
fn summary(text: &mut String, name: &str, outcomes: &[&Value]) {
    let of_quantity = |q: usize| {
        let (hits, total) = coverage(outcomes, "changing", q);
        let squares = outcomes.iter().filter_map(|o| pull(o, "changing", q)).map(|z| z * z).sum::<f64>();
        let pull = (squares / total as f64).sqrt();
        format!("{} {}, pull {pull:.2}", QUANTITIES[q], Share { hits, total })
    };
    let all: Vec<String> = (0..QUANTITIES.len()).map(of_quantity).collect();
    writeln!(text, "\n{name}, with the 95 % interval of each share and the root mean square of the deviations in stated errors (pull): {}.", all.join("; ")).unwrap();
}

/// Returns the deviation divided by the stated error, or `None` if the value is withheld.
fn pull(outcome: &Value, light: &str, q: usize) -> Option<f64> {
    Some(outcome[light][q][0].as_f64()? / outcome[light][q][1].as_f64()?)
}

fn row(text: &mut String, name: &str, outcomes: &[&Value], light: &str) {
    write!(text, "| {name} |").unwrap();
    for q in 0..QUANTITIES.len() {
        let (hits, total) = coverage(outcomes, light, q);
        let mut ratios: Vec<f64> = outcomes
            .iter()
            .filter_map(|o| Some(o[light][q][1].as_f64()? / o["steady"][q][1].as_f64()?))
            .collect();
        ratios.sort_by(f64::total_cmp);
        let width = ratios.get(ratios.len() / 2).map_or("-".to_owned(), |r| format!("{r:.2}"));
        write!(text, " {hits}/{total}, {} withheld, {width} |", outcomes.len() - total).unwrap();
    }
    text.push('\n');
}

/// Returns the number of intervals that contain the true value, and the number of all intervals.
fn coverage(outcomes: &[&Value], light: &str, q: usize) -> (usize, usize) {
    let all: Vec<f64> = outcomes.iter().filter_map(|o| pull(o, light, q)).collect();
    (all.iter().filter(|z| z.abs() <= 1.96).count(), all.len())
}
