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
    let shares: Vec<String> = (0..QUANTITIES.len())
        .map(|q| {
            let (hits, total) = coverage(&all, "changing", q);
            format!("{} {}", QUANTITIES[q], Share { hits, total })
        })
        .collect();
    writeln!(text, "\nAll of these, with the 95 % interval of each share: {}.", shares.join("; ")).unwrap();
    let rejected = outcomes.iter().filter(|o| o.1["changing"].is_string()).count();
    writeln!(text, "\nRejected sets: {rejected}.").unwrap();
    text
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
    let of = |o: &&Value| Some(o[light][q][0].as_f64()?.abs() <= 1.96 * o[light][q][1].as_f64()?);
    let all: Vec<bool> = outcomes.iter().filter_map(of).collect();
    (all.iter().filter(|c| **c).count(), all.len())
}
