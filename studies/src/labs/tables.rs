//! The tables of the study.

use std::fmt::Write as _;

use super::judge::{Compared, QUANTITIES, Said, Verdict};
use super::lab::FAULTS;
use super::share::Share;

type Judged = (&'static str, Verdict);

pub(crate) fn all(verdicts: &[Judged]) -> String {
    faults(verdicts) + &quantities(verdicts) + &by_fault(verdicts)
}

fn said<'a>(verdicts: &'a [Judged], fault: Option<&'a str>) -> impl Iterator<Item = &'a Said> + Clone {
    let of = verdicts.iter().filter(move |v| fault.is_none_or(|f| f == v.0));
    of.filter_map(|v| if let Verdict::Said(said) = &v.1 { Some(said) } else { None })
}

fn compared(verdicts: &[Judged], fault: Option<&str>, quantity: usize) -> Vec<Compared> {
    let all = said(verdicts, fault).flat_map(|s| s.compared.iter().copied());
    all.filter(|c| c.quantity == quantity).collect()
}

fn faults(verdicts: &[Judged]) -> String {
    let mut text = String::from(
        "| fault | labs | refused | right | wrong | lamps or response named |\n|---|--:|--:|--:|--:|--:|\n",
    );
    for fault in FAULTS {
        let of: Vec<&Verdict> = verdicts.iter().filter(|v| v.0 == fault).map(|v| &v.1).collect();
        let refused = of.iter().filter(|v| matches!(v, Verdict::Refused(_))).count();
        let wrong = of.iter().filter(|v| !v.wrong().is_empty()).count();
        let named = said(verdicts, Some(fault)).filter(|s| s.named).count();
        let right = of.len() - refused - wrong;
        writeln!(text, "| {fault} | {} | {refused} | {right} | {wrong} | {named} |", of.len()).unwrap();
    }
    text
}

fn quantities(verdicts: &[Judged]) -> String {
    let mut text = String::from(
        "\nShare of the 95 % intervals that hold the truth, with its own 95 % interval; how often no error is given and the value said to be assumed; the \
         standard error, and what it is over the least that counts and lamps allow.\n\n\
         | quantity | intervals | hold the truth | assumed | standard error, median | over the least, median |\n|---|--:|---|--:|--:|--:|\n",
    );
    for (q, name) in QUANTITIES.iter().enumerate() {
        let of = compared(verdicts, None, q);
        let held = Share { hits: held(&of), of: of.len() };
        let assumed = said(verdicts, None).filter(|s| s.assumed.contains(&q)).count();
        let width = 100.0 * median(of.iter().map(|c| c.relative));
        let over = median(of.iter().map(|c| c.over_best));
        writeln!(text, "| {name} | {} | {held} | {assumed} | {width:.3} % | {over:.2} |", of.len()).unwrap();
    }
    text
}

fn by_fault(verdicts: &[Judged]) -> String {
    let mut text = String::from("\nIntervals that hold the truth by kind of fault.\n\n| fault |");
    QUANTITIES.iter().for_each(|q| text += &format!(" {q} |"));
    text += &format!("\n|---|{}\n", "--:|".repeat(QUANTITIES.len()));
    for fault in FAULTS {
        text += &format!("| {fault} |");
        for q in 0..QUANTITIES.len() {
            let of = compared(verdicts, Some(fault), q);
            text +=
                &if of.is_empty() { " |".to_owned() } else { format!(" {} of {} |", held(&of), of.len()) };
        }
        text.push('\n');
    }
    text
}

fn held(of: &[Compared]) -> usize {
    of.iter().filter(|c| c.z.abs() <= 1.96).count()
}

fn median(of: impl Iterator<Item = f64>) -> f64 {
    let mut all: Vec<f64> = of.collect();
    all.sort_by(f64::total_cmp);
    all.get(all.len() / 2).copied().unwrap_or(0.0)
}
