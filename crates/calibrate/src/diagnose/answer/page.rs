//! The report and the other files of a diagnosis.

use std::path::Path;

use super::about_page::{command_section, glossary, recording_sections};
use super::diagnosis::{Diagnosis, Discrepancy, Verdict};
use super::figures::{plot_sections, rate_figures};
use crate::diagnose::search::round::EliminationReason;
use serde_json::Value;
use spikelane::error::{Error, ErrorKind, Result};
use spikelane::presets;
use spikelane_io::storage::FileGroup;
use spikelane_measure::report::{PageElement, RankedRow, Table, page as render, ranked_bar_plot};

/// Number of statistics in the plot of the largest deviations.
const MAX_SHOWN_DEVIATIONS: usize = 24;

/// Number of standard deviations that some statistic of a sensor without missing effects exceeds with a probability of
/// 0.001.
const DEVIATION_LIMIT: f64 = 5.0;

/// Writes `camera.toml` with its maps, `report.html` and `diagnosis.json` into `folder`, and returns the diagnosis as
/// JSON. Either all files are written or none.
///
/// # Errors
/// If a file exists and `force` is not set, or if a file cannot be written.
pub fn write_diagnosis(diagnosis: &Diagnosis, folder: &Path, force: bool) -> Result<Value> {
    let value =
        serde_json::to_value(diagnosis).map_err(|e| Error::new(ErrorKind::Config, "diagnosis").found(e))?;
    let saved = presets::to_toml(&diagnosis.camera)?;
    std::fs::create_dir_all(folder).map_err(|e| Error::io(folder.display(), e))?;
    let mut group = FileGroup::new(force);
    let mut put = |name: &str, bytes: &[u8]| group.write(&folder.join(name), bytes);
    saved.maps.iter().try_for_each(|(name, bytes)| put(name, bytes))?;
    put("camera.toml", saved.text.as_bytes())?;
    put("report.html", page(diagnosis)?.as_bytes())?;
    put("diagnosis.json", format!("{value:#}\n").as_bytes())?;
    group.commit()?;
    Ok(value)
}

/// Returns the report as an HTML page.
///
/// # Errors
/// If a plot cannot be drawn.
pub(super) fn page(diagnosis: &Diagnosis) -> Result<String> {
    let mut parts = vec![PageElement::text(summary(diagnosis))];
    parts.extend(limit_tests(diagnosis));
    if !diagnosis.undecided.is_empty() {
        parts.push(PageElement::heading("Not decided within the time limit"));
        parts.push(PageElement::List { items: diagnosis.undecided.clone() });
    }
    parts.extend(faults(diagnosis));
    parts.extend(findings(diagnosis));
    if !diagnosis.recommended_recordings.is_empty() {
        parts.push(PageElement::heading("Recordings that would distinguish ambiguous effects"));
        parts.push(PageElement::List { items: diagnosis.recommended_recordings.clone() });
    }
    parts.extend(lamps(diagnosis));
    parts.extend(diagnosis.provenance.iter().flat_map(recording_sections));
    if !diagnosis.notes.is_empty() {
        parts.push(PageElement::heading("Notes"));
        parts.push(PageElement::List { items: diagnosis.notes.clone() });
    }
    // Only a search gives data to plot.
    if !diagnosis.discrepancy.held_out_set.is_empty() {
        parts.extend(rate_figures(&diagnosis.rates, diagnosis.discrepancy.fitted_set.len() > 1)?);
        parts.push(PageElement::heading("Deviations of the recordings from the model"));
        parts.extend(deviations_section(diagnosis)?);
        parts.push(PageElement::heading("Discrepancy after each step"));
        parts.extend(discrepancy_section(diagnosis)?);
        parts.extend(tournament(diagnosis)?);
        parts.extend(plot_sections(&diagnosis.traces.plots, diagnosis.discrepancy.fitted_set.len() > 1)?);
        parts.extend(effect_limits(diagnosis));
        parts.push(PageElement::heading("Effects that this recording set cannot reveal"));
        parts.push(PageElement::text(undetectable_text(diagnosis)));
        parts.push(PageElement::heading("Terms"));
        parts.push(PageElement::Table(glossary(diagnosis)));
    }
    parts.extend(diagnosis.provenance.iter().flat_map(command_section));
    Ok(render("Diagnosis", &parts))
}

/// Returns the values behind the verdict, each with its limit.
fn limit_tests(d: &Diagnosis) -> Vec<PageElement> {
    if d.tests.is_empty() {
        return Vec::new();
    }
    let mut table = Table::new(&["test", "fitted recordings", "held-out recordings", "limit", ""]);
    let number = |x: f64| if x.abs() < 100.0 { format!("{x:.1}") } else { format!("{x:.0}") };
    for test in &d.tests {
        table.push_row([
            test.quantity.to_owned(),
            number(test.fitted_set),
            test.held_out_set.map_or_else(|| "not tested".to_owned(), number),
            number(test.limit),
            if test.passes() { "passes" } else { "exceeds the limit" }.to_owned(),
        ]);
    }
    let percent = 100.0 * d.tests[0].exceedance_probability;
    let text = format!(
        "Of the sensors that follow the model, {percent} % exceed a limit. The total deviation is the squared distance of all statistics from the model. The other two values are in standard deviations. The held-out recordings are tested after an effect was added."
    );
    vec![PageElement::Table(table), PageElement::text(text)]
}

/// Returns the faults, which precede all results.
fn faults(d: &Diagnosis) -> Vec<PageElement> {
    if d.faults.is_empty() {
        return Vec::new();
    }
    let items = d.faults.iter().map(crate::diagnose::Fault::sentence).collect();
    vec![PageElement::heading("Faults of the recordings"), PageElement::List { items }]
}

/// Describes the effects that the set cannot show.
pub(in crate::diagnose) fn undetectable_text(d: &Diagnosis) -> String {
    if d.undetectable.is_empty() {
        "Each effect of the catalog is detectable at the maximum of its range. The detectability analysis estimates the smallest detectable strength for this recording set.".to_owned()
    } else {
        format!(
            "{}. These recordings do not reveal these effects at any strength.",
            d.undetectable.join(", ")
        )
    }
}

fn summary(d: &Diagnosis) -> String {
    let effects: Vec<String> = d
        .effects
        .iter()
        .map(|e| {
            let ties = if e.ambiguous_with.is_empty() {
                String::new()
            } else {
                format!(" (or {})", e.ambiguous_with.join(", "))
            };
            format!("{}{}{ties}", if e.is_tentative { "an effect that resembles " } else { "" }, e.name)
        })
        .chain(d.parameter_mismatches.iter().map(|m| {
            let [fitted, model] = [m.fitted_value, m.model_value].map(|x| format_value(x, m.low, m.high));
            let similar = if m.is_tentative { "an effect that resembles " } else { "" };
            format!("{similar}a different value of {} ({fitted} instead of {model})", m.parameter)
        }))
        .collect();
    let names = effects.join(", ");
    match d.verdict {
        _ if d.discrepancy.held_out_set.is_empty() => {
            "Too many recordings have faults: a diagnosis of the camera is not possible.".to_owned()
        }
        Verdict::Agrees if d.faults.iter().any(|f| f.is_excluded) => {
            "The recordings without faults agree with the model: no statistic exceeds its limit.".to_owned()
        }
        Verdict::Agrees => "The recordings agree with the model: no statistic exceeds its limit.".to_owned(),
        Verdict::Explained => {
            format!("The model with {names} explains the recordings: no statistic exceeds its limit.")
        }
        Verdict::PartlyExplained => {
            let left = if d.unexplained.is_empty() {
                "the recordings do not show whether the model is complete"
            } else {
                "some statistics still exceed their limits"
            };
            format!("The model with {names} explains a part of the deviations; {left}.")
        }
        Verdict::Undecided => {
            "The time limit was reached before the recordings could be compared with the model.".to_owned()
        }
        Verdict::Unknown if names.is_empty() => {
            "The recordings deviate from the model, and no effect of the catalog explains the deviation."
                .to_owned()
        }
        Verdict::Unknown => format!(
            "The recordings deviate from the model, and no effect of the catalog clearly explains the deviation. The most similar effects are {}.",
            names.replace("an effect that resembles ", "")
        ),
    }
}

fn findings(d: &Diagnosis) -> Vec<PageElement> {
    let mut table =
        Table::new(&["effect", "parameter", "value", "95 % interval", "ambiguous with", "evidence"]);
    for e in &d.effects {
        for (i, p) in e.parameters.iter().enumerate() {
            let (name, ties, evidence) = if i == 0 {
                (e.name, e.ambiguous_with.join(", "), e.evidence.as_str())
            } else {
                ("", String::new(), "")
            };
            table.push_row([
                name,
                p.name,
                &format_value(p.value, p.low, p.high),
                &format_interval(p.low, p.high),
                &ties,
                evidence,
            ]);
        }
    }
    for m in &d.parameter_mismatches {
        let note = format!("the model has {}", format_value(m.model_value, m.low, m.high));
        table.push_row([
            if m.is_tentative { "tentative mismatch" } else { "mismatch" },
            &m.parameter,
            &format_value(m.fitted_value, m.low, m.high),
            &format_interval(m.low, m.high),
            &m.ambiguous_with.join(", "),
            &note,
        ]);
    }
    let mut parts = Vec::new();
    if !table.rows.is_empty() {
        parts.push(PageElement::Table(table));
    }
    if !d.unexplained.is_empty() {
        let mut statistics = Table::new(&["unexplained statistic", "standard deviations"]);
        d.unexplained.iter().for_each(|u| statistics.push_row([u.r#where.clone(), format!("{:.1}", u.z)]));
        parts.push(PageElement::Table(statistics));
    }
    parts
}

/// Returns a table with one row for each lamp.
fn lamps(d: &Diagnosis) -> Vec<PageElement> {
    let Some(first) = d.lamps.first() else { return Vec::new() };
    let moved: Vec<String> = first.impacts.iter().map(|i| format!("moves {} by", i.parameter)).collect();
    let mut titles = vec!["recording", "light", "uncertainty", "found minus stated light", "error", "pull"];
    titles.extend(moved.iter().map(String::as_str));
    let mut table = Table::new(&titles);
    for lamp in &d.lamps {
        let percent = |x: f64| format!("{:.2} %", 100.0 * x);
        let mut row = vec![
            lamp.source.as_ref().map_or_else(|| lamp.file.clone(), |s| format!("source {s} ({})", lamp.file)),
            lamp.light.clone(),
            percent(lamp.uncertainty),
            format!("{:+.2} %", 100.0 * lamp.deviation),
            percent(lamp.error),
            format!("{:+.1}", lamp.pull),
        ];
        row.extend(lamp.impacts.iter().map(|i| format!("{:+.1e}", i.change)));
        table.push_row(row);
    }
    const TEXT: &str = "The light of each recording is a parameter of every fit. The pull is the deviation of the found light from the stated light, divided by the uncertainty of the light. If the levels contradict a stated uncertainty, the table has the larger uncertainty that the diagnosis used. The last columns show how a named parameter changes if the light of one recording increases by its error.";
    vec![PageElement::heading("Light of the recordings"), PageElement::text(TEXT), PageElement::Table(table)]
}

/// Returns a table with the upper limit of each effect that was not added.
fn effect_limits(d: &Diagnosis) -> Vec<PageElement> {
    if d.limits.is_empty() {
        return Vec::new();
    }
    let mut table = Table::new(&["effect", "parameter", "limit", "median over shapes"]);
    for l in &d.limits {
        let largest = l.largest_tried;
        let number = |limit: Option<f64>| {
            limit.map_or_else(|| format!("none below {largest:.2}"), |limit| format!("{limit:.2e}"))
        };
        table.push_row([l.name.to_owned(), l.parameter.to_owned(), number(l.limit), number(l.median_limit)]);
    }
    const TEXT: &str = "With 95 % confidence, the strength of an effect is below its limit, if the model lacks no other effect. A strength is the difference of the parameter from its value in the model. An effect with several shapes, such as time constants, has the largest limit of the tried shapes.";
    vec![
        PageElement::heading("Upper limits of other effects"),
        PageElement::text(TEXT),
        PageElement::Table(table),
    ]
}

fn discrepancy_section(d: &Diagnosis) -> Result<Vec<PageElement>> {
    const MEASURE: &str =
        "the squared distance of the statistics from the model, without the directions that calibration fits";
    let Discrepancy {
        fitted_set: fitted_values,
        held_out_set: held_out_values,
        noise_floor: floor,
        noise_floor_sd: floor_sd,
    } = &d.discrepancy;
    let held_out = d.discrepancy.is_held_out();
    // A single bar would show no more than its number.
    if let ([fitted], [held_out_value]) = (fitted_values.as_slice(), held_out_values.as_slice()) {
        let values = if held_out {
            format!(
                "{fitted:.0} for the fitted recordings and {held_out_value:.0} for the held-out recordings"
            )
        } else {
            format!("{fitted:.0}")
        };
        return Ok(vec![PageElement::text(format!(
            "No effect was added. The discrepancy, {MEASURE}, is {values}. The noise floor, which is the discrepancy of simulated sensors of the model, is {floor:.0} with a standard deviation of {floor_sd:.0}."
        ))]);
    }
    let (sets, recordings): (&[&str], _) = if held_out {
        (&["fitted recordings", "held-out recordings"], "of the held-out recordings")
    } else {
        (&["recordings"], "of these recordings")
    };
    let row = |(name, (a, b)): (&String, (&f64, &f64))| {
        let values = if held_out { vec![*a, *b] } else { vec![*a] };
        let texts: Vec<String> = values.iter().map(|v| format!("{v:.0}")).collect();
        RankedRow { name: format!("{name}: {}", texts.join(", ")), values }
    };
    let rows: Vec<RankedRow> =
        d.traces.discrepancy_labels.iter().zip(fitted_values.iter().zip(held_out_values)).map(row).collect();
    let [first, last] =
        [held_out_values.first(), held_out_values.last()].map(|v| v.copied().unwrap_or_default());
    Ok(vec![PageElement::figure(
        ranked_bar_plot(
            "squared distance, in standard deviations squared",
            sets,
            &rows,
            Some((*floor, "noise floor")),
        )?,
        format!(
            "The discrepancy is {MEASURE}. The discrepancy {recordings} falls from {first:.0} to {last:.0}. The noise floor, which is the \
             discrepancy of simulated sensors of the final model, is {floor:.0} with a standard deviation of {floor_sd:.0}."
        ),
    )])
}

fn deviations_section(d: &Diagnosis) -> Result<Vec<PageElement>> {
    let mut rows: Vec<_> = d.traces.deviations.iter().collect();
    rows.sort_by(|a, b| b.2.abs().max(b.3.abs()).total_cmp(&a.2.abs().max(a.3.abs())));
    // If no effect was added, the deviations before and after are equal.
    let added = d.discrepancy.fitted_set.len() > 1;
    let row = |(name, place, before, after): &(String, String, f64, f64)| RankedRow {
        name: format!("{place}: {name}"),
        values: if added { vec![*before, *after] } else { vec![*before] },
    };
    let shown: Vec<RankedRow> = rows.iter().take(MAX_SHOWN_DEVIATIONS).map(|r| row(r)).collect();
    let exceeding =
        |after: bool| rows.iter().filter(|r| (if after { r.3 } else { r.2 }).abs() > DEVIATION_LIMIT).count();
    let series: &[&str] = if added { &["before", "after"] } else { &["recordings minus model"] };
    let caption = if added {
        format!(
            "The largest deviations of the fitted recordings from the model, before and after effects were added: {} of {} \
             statistics are beyond five standard deviations before, {} after.",
            exceeding(false),
            rows.len(),
            exceeding(true)
        )
    } else {
        format!(
            "The largest deviations of the fitted recordings from the model: {} of {} statistics are beyond five standard deviations.",
            exceeding(false),
            rows.len()
        )
    };
    Ok(vec![PageElement::figure(
        ranked_bar_plot("standard deviations", series, &shown, Some((DEVIATION_LIMIT, "5")))?,
        caption,
    )])
}

fn tournament(d: &Diagnosis) -> Result<Vec<PageElement>> {
    let mut parts = Vec::new();
    let rounds = d.traces.tournament.iter().zip(&d.traces.step_outcomes);
    // Only rounds with several candidates are shown. An effect that replaced another one was not part of a comparison,
    // and its evidence describes the replacement.
    for (round, (winner, fate)) in rounds.filter(|(round, _)| round.len() > 1) {
        let (what, caption) = match fate {
            EliminationReason::Retained => (
                "",
                "Discrepancy that remains after a fit of each candidate. Candidates within the noise of the winner are ambiguous.",
            ),
            EliminationReason::RejectedByHoldout if d.discrepancy.is_held_out() => {
                (", rejected", "The winner did not reduce the held-out discrepancy and was rejected.")
            }
            EliminationReason::RejectedByHoldout => {
                (", rejected", "The winner did not reduce the discrepancy sufficiently and was rejected.")
            }
            EliminationReason::Eliminated => (
                ", removed later",
                "The winner was added first. After other effects were added, the recordings were equally likely without this effect.",
            ),
        };
        parts.push(PageElement::heading(&format!("Comparison of candidates: {winner}{what}")));
        let row = |(name, misfit, tied): &(&str, f64, bool)| RankedRow {
            name: format!("{name}: {misfit:.0}{}", if *tied && name != winner { " (ambiguous)" } else { "" }),
            values: vec![*misfit],
        };
        let rows: Vec<RankedRow> = round.iter().map(row).collect();
        parts.push(PageElement::figure(
            ranked_bar_plot("remaining discrepancy", &["fitted"], &rows, None)?,
            caption,
        ));
    }
    Ok(parts)
}

/// Formats `value` with a precision of two significant digits of half its interval.
pub(super) fn format_value(value: f64, low: f64, high: f64) -> String {
    let half = (high - low) / 2.0;
    let decimals = if half > 0.0 { (1.0 - half.log10().floor()).clamp(0.0, 7.0) as usize } else { 5 };
    format!("{value:.decimals$}")
}

pub(super) fn format_interval(low: f64, high: f64) -> String {
    format!("{} to {}", format_value(low, low, high), format_value(high, low, high))
}

#[cfg(test)]
mod tests {
    use super::{format_interval, format_value};

    #[test]
    fn values_have_the_precision_of_their_intervals() {
        assert_eq!(format_value(0.00744, 0.003_42, 0.011_46), "0.0074");
        assert_eq!(format_interval(0.003_42, 0.011_46), "0.0034 to 0.0115");
        assert_eq!(format_interval(6.574_67, 9.950_68), "6.6 to 10.0");
        assert_eq!(format_value(2480.0, 2100.0, 2900.0), "2480");
        assert_eq!(format_value(0.5, 0.5, 0.5), "0.50000", "known exactly");
    }
}
