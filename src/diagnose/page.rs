//! The report: one page.

use super::outcome::{Diagnosis, Verdict};
use crate::error::Result;
use crate::report::{Curve, Part, Table, curves, page as render};

/// The page of a diagnosis.
///
/// # Errors
/// When a plot cannot be made.
pub fn page(diagnosis: &Diagnosis) -> Result<String> {
    let mut parts = vec![Part::text(sentence(diagnosis))];
    parts.extend(named(diagnosis));
    parts.push(Part::heading("The gap, after each step"));
    parts.extend(gap(diagnosis)?);
    parts.push(Part::heading("Where model and recordings disagree"));
    parts.extend(disagreements(diagnosis)?);
    parts.extend(tournament(diagnosis));
    parts.push(Part::heading("What this set could not have seen"));
    let unseen = &diagnosis.not_testable;
    let text = if unseen.is_empty() {
        "Every effect of the catalogue would show.".to_owned()
    } else {
        unseen.join(", ")
    };
    parts.push(Part::text(text));
    parts.push(Part::List { items: diagnosis.notes.clone() });
    render("Diagnosis", &parts)
}

fn sentence(d: &Diagnosis) -> String {
    let effects: Vec<String> = d
        .effects
        .iter()
        .map(|e| {
            let ties = if e.tied_with.is_empty() {
                String::new()
            } else {
                format!(" (or {})", e.tied_with.join(", "))
            };
            format!("{}{}{ties}", if e.resembles { "something like " } else { "" }, e.name)
        })
        .chain(
            d.misfits
                .iter()
                .map(|m| format!("another {} ({:.4} instead of {:.4})", m.parameter, m.fitted, m.model)),
        )
        .collect();
    let names = effects.join(", ");
    match d.verdict {
        Verdict::Agrees => "The recordings agree with the model: nothing is above its limit.".to_owned(),
        Verdict::Explained => {
            format!("The recordings are explained by adding {names}; nothing is left above its limit.")
        }
        Verdict::PartlyExplained => {
            format!("Adding {names} explains a part; something that is not in the catalogue is left.")
        }
        Verdict::Unknown if names.is_empty() => {
            "Something is there that no effect of the catalogue explains.".to_owned()
        }
        Verdict::Unknown => format!(
            "Something is there that no effect of the catalogue explains; it looks a little like {names}."
        ),
    }
}

fn named(d: &Diagnosis) -> Vec<Part> {
    let mut table = Table::new(&["effect", "parameter", "value", "95 % interval", "as likely", "evidence"]);
    for e in &d.effects {
        for (i, p) in e.parameters.iter().enumerate() {
            let (name, ties, evidence) = if i == 0 {
                (e.name, e.tied_with.join(", "), e.evidence.as_str())
            } else {
                ("", String::new(), "")
            };
            table.row([
                name,
                p.name,
                &format!("{:.5}", p.value),
                &format!("{:.5} to {:.5}", p.low, p.high),
                &ties,
                evidence,
            ]);
        }
    }
    for m in &d.misfits {
        let note = format!("the model has {:.5}", m.model);
        let interval = format!("{:.5} to {:.5}", m.low, m.high);
        table.row([
            "misfit",
            &m.parameter,
            &format!("{:.5}", m.fitted),
            &interval,
            &m.tied_with.join(", "),
            &note,
        ]);
    }
    let mut parts = Vec::new();
    if !table.rows.is_empty() {
        parts.push(Part::Table(table));
    }
    if !d.unknown.is_empty() {
        let mut left = Table::new(&["left unexplained", "standard deviations"]);
        d.unknown.iter().for_each(|u| left.row([u.r#where.clone(), format!("{:.1}", u.z)]));
        parts.push(Part::Table(left));
    }
    parts
}

fn gap(d: &Diagnosis) -> Result<Vec<Part>> {
    let points =
        |values: &[f64]| values.iter().enumerate().map(|(i, g)| (i as f64, g.max(1.0).log10())).collect();
    let steps = d.gap.train.len().max(2);
    let floor = vec![d.gap.floor; steps];
    let lines = [
        Curve { name: "fitted recordings", points: points(&d.gap.train) },
        Curve { name: "held-out recordings", points: points(&d.gap.heldout) },
        Curve { name: "the model's own sensors", points: points(&floor) },
    ];
    let mut table = Table::new(&["effects added", "fitted", "held out"]);
    for (i, (a, b)) in d.gap.train.iter().zip(&d.gap.heldout).enumerate() {
        table.row([i.to_string(), format!("{a:.1}"), format!("{b:.1}")]);
    }
    table.row([
        "the model's own sensors".to_owned(),
        format!("{:.1}", d.gap.floor),
        format!("+- {:.1}", d.gap.floor_sd),
    ]);
    Ok(vec![
        Part::figure(
            curves("Gap", "effects added", "log10 of the gap", &lines)?,
            "Squared distance of the statistics to the model, with what calibration fits taken out.",
        ),
        Part::Table(table),
    ])
}

/// Rows of the largest deviations.
const SHOWN: usize = 25;

fn disagreements(d: &Diagnosis) -> Result<Vec<Part>> {
    let mut rows: Vec<_> = d.traces.deviations.iter().collect();
    rows.sort_by(|a, b| b.2.abs().total_cmp(&a.2.abs()));
    let ranked = |after: bool| {
        rows.iter()
            .enumerate()
            .map(|(i, r)| (i as f64, (if after { r.3 } else { r.2 }).abs().min(1e6)))
            .take(60)
            .collect()
    };
    let lines =
        [Curve { name: "before", points: ranked(false) }, Curve { name: "after", points: ranked(true) }];
    let mut table = Table::new(&["statistic", "recording", "before", "after"]);
    for (name, place, before, after) in rows.iter().take(SHOWN) {
        table.row([name.clone(), place.clone(), format!("{before:+.1}"), format!("{after:+.1}")]);
    }
    Ok(vec![
        Part::figure(
            curves("Deviations", "statistics, largest first", "standard deviations", &lines)?,
            "Deviations of single statistics from the model, before and after effects were added.",
        ),
        Part::Table(table),
    ])
}

fn tournament(d: &Diagnosis) -> Vec<Part> {
    let mut parts = Vec::new();
    for (i, round) in d.traces.tournament.iter().enumerate() {
        parts.push(Part::heading(&format!("Tournament {}", i + 1)));
        let mut table = Table::new(&["candidate", "misfit when fitted", "within noise of the best"]);
        for (name, misfit, tied) in round {
            table.row([
                (*name).to_owned(),
                format!("{misfit:.1}"),
                if *tied { "yes" } else { "no" }.to_owned(),
            ]);
        }
        parts.push(Part::Table(table));
    }
    parts
}
