//! The tables of the study.

use std::fmt::Write as _;

use super::assessment::{Assessment, AssessmentOutcome, QUANTITIES, QuantityError};
use super::lab::FAULTS;
use super::share::Share;

type AssessedLaboratory = (&'static str, AssessmentOutcome);

pub(crate) fn all_tables(verdicts: &[AssessedLaboratory]) -> String {
    quantities(verdicts) + &faults(verdicts)
}

fn assessments<'a>(
    verdicts: &'a [AssessedLaboratory],
    fault: Option<&'a str>,
) -> impl Iterator<Item = &'a Assessment> + Clone {
    let of = verdicts.iter().filter(move |v| fault.is_none_or(|f| f == v.0));
    of.filter_map(
        |v| if let AssessmentOutcome::Assessed(assessment) = &v.1 { Some(assessment) } else { None },
    )
}

fn quantity_errors(
    verdicts: &[AssessedLaboratory],
    fault: Option<&str>,
    quantity: usize,
) -> Vec<QuantityError> {
    let all = assessments(verdicts, fault).flat_map(|s| s.quantity_errors.iter().copied());
    all.filter(|c| c.quantity == quantity).collect()
}

fn quantities(verdicts: &[AssessedLaboratory]) -> String {
    let mut text = String::from(
        "The columns are the number of 95 % intervals that contain the true value, with the 95 % interval of this share; the number of \
         laboratories in which the value is assumed; the median of the standard error; and the median ratio of the standard error to the smallest \
         possible error.\n\n\
         | quantity | intervals that contain the true value | assumed | standard error | ratio |\n|---|---|--:|--:|--:|\n",
    );
    for (q, name) in QUANTITIES.iter().enumerate() {
        let of = quantity_errors(verdicts, None, q);
        let held = Share { hits: covered_count(&of), total: of.len() };
        let assumed = assessments(verdicts, None).filter(|s| s.assumed_quantities.contains(&q)).count();
        let width = 100.0 * median(of.iter().map(|c| c.relative));
        let over = median(of.iter().map(|c| c.best_ratio));
        writeln!(text, "| {name} | {held} | {assumed} | {width:.3} % | {over:.2} |").unwrap();
    }
    text
}

fn faults(verdicts: &[AssessedLaboratory]) -> String {
    // Too few laboratories report the number of electrons.
    let quantities = || QUANTITIES.iter().enumerate().filter(|(_, name)| **name != "electrons");
    let mut text = String::from(
        "\nFor each fault, the columns are the number of laboratories without a wrong value, the number of laboratories in which `calibrate` \
         names a lamp or the response, and the number of intervals that contain the true value.\n\n| fault | without a wrong value | named |",
    );
    quantities().for_each(|(_, name)| text += &format!(" {name} |"));
    text += &format!("\n|---|--:|--:|{}\n", "--:|".repeat(quantities().count()));
    for fault in FAULTS {
        let of: Vec<&AssessmentOutcome> = verdicts.iter().filter(|v| v.0 == fault).map(|v| &v.1).collect();
        let is_right = |v: &AssessmentOutcome| {
            !matches!(v, AssessmentOutcome::Refused(_)) && v.wrong_quantities().is_empty()
        };
        let right = of.iter().filter(|v| is_right(v)).count();
        let named = assessments(verdicts, Some(fault)).filter(|s| s.has_named_fault).count();
        write!(text, "| {fault} | {right}/{} | {named} |", of.len()).unwrap();
        for (q, _) in quantities() {
            let outcomes = quantity_errors(verdicts, Some(fault), q);
            text += &if outcomes.is_empty() {
                " |".to_owned()
            } else {
                format!(" {}/{} |", covered_count(&outcomes), outcomes.len())
            };
        }
        text.push('\n');
    }
    text
}

fn covered_count(errors: &[QuantityError]) -> usize {
    errors.iter().filter(|c| c.z.abs() <= 1.96).count()
}

fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut all: Vec<f64> = values.collect();
    all.sort_by(f64::total_cmp);
    all.get(all.len() / 2).copied().unwrap_or(0.0)
}
