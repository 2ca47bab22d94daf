//! The report and the other files of a diagnosis.

use std::path::Path;

use crate::search::round::EliminationReason;
use crate::thresholds::{DEVIATION_LIMIT, MAX_SHOWN_DEVIATIONS};
use crate::verdict::about_page::{glossary, recording_tables};
use crate::verdict::diagnosis::{
    DiagnosedLamp, Diagnosis, Discrepancy, LimitTest, ParameterMismatch, Verdict,
};
use crate::verdict::effect_limits::EffectLimit;
use crate::verdict::figures::{plot_sections, rate_figures};
use serde_json::Value;
use spikelane::error::{Error, ErrorKind, Result};
use spikelane::presets;
use spikelane_io::storage::FileGroup;
use spikelane_measure::report::{
    Cell, PageElement, RankedRow, Report, ReportState, RunRecord, Table, ranked_bars, row, with_error,
    with_interval, without_error,
};

/// A statistic: name, recording, deviation before the diagnosis, and deviation after it.
type Deviation = (String, String, f64, f64);

/// Writes `camera.toml` with its maps, `report.html` and `diagnosis.json` into `folder`. Either all files are
/// written or none. Returns the diagnosis as JSON. The report contains the origin `run`.
///
/// # Errors
/// If a file exists and `force` is not set, or if a file cannot be written.
pub fn write_diagnosis(diagnosis: &Diagnosis, folder: &Path, run: &RunRecord, force: bool) -> Result<Value> {
    let value =
        serde_json::to_value(diagnosis).map_err(|e| Error::new(ErrorKind::Config, "diagnosis").found(e))?;
    let saved = presets::to_toml(&diagnosis.camera)?;
    std::fs::create_dir_all(folder).map_err(|e| Error::io(folder.display(), e))?;
    let mut group = FileGroup::new(force);
    let mut put = |name: &str, bytes: &[u8]| group.write(&folder.join(name), bytes);
    saved.maps.iter().try_for_each(|(name, bytes)| put(name, bytes))?;
    put("camera.toml", saved.text.as_bytes())?;
    put("report.html", page(diagnosis)?.html(run).as_bytes())?;
    put("diagnosis.json", format!("{value:#}\n").as_bytes())?;
    group.commit()?;
    Ok(value)
}

/// Returns the report of a diagnosis.
///
/// # Errors
/// If a map cannot be encoded.
pub(super) fn page(diagnosis: &Diagnosis) -> Result<Report> {
    let (state, word) = match diagnosis.verdict {
        _ if diagnosis.discrepancy.held_out_set.is_empty() && diagnosis.verdict != Verdict::Undecided => {
            (ReportState::Problem, "no diagnosis")
        }
        Verdict::Agrees => (ReportState::Good, "agrees"),
        Verdict::Explained => (ReportState::Good, "explained"),
        Verdict::PartlyExplained => (ReportState::Caution, "partly explained"),
        Verdict::Unknown => (ReportState::Problem, "unknown"),
        Verdict::Undecided => (ReportState::Info, "undecided"),
    };
    let mut report = Report::new("Diagnosis", state, word, summary(diagnosis));
    push_key_numbers(&mut report, diagnosis);
    report
        .push_list("Faults of the recordings", diagnosis.faults.iter().map(crate::Fault::sentence).collect());
    report.push_list("Not decided within the time limit", diagnosis.undecided.clone());
    let has_search = !diagnosis.discrepancy.held_out_set.is_empty();
    let added = diagnosis.discrepancy.fitted_set.len() > 1;
    if has_search {
        let heading = if added { "What shows the effect" } else { "Comparison with the model" };
        report.push(PageElement::heading(heading));
        report.extend(effect_figure(diagnosis));
        report.extend(recording_discrepancies(diagnosis));
        report.push(deviations_figure(diagnosis));
        report.extend(discrepancy_figure(diagnosis));
    }
    report.extend(pull_figure(diagnosis));
    if !diagnosis.recommended_recordings.is_empty() {
        report.push(PageElement::heading("What to record next"));
        report.push(PageElement::text("These recordings would distinguish the ambiguous effects."));
        report.push(PageElement::List { items: diagnosis.recommended_recordings.clone() });
    }
    report.push_list("Notes", diagnosis.notes.clone());
    if has_search {
        report.extend(tournament(diagnosis));
        report.extend(rate_figures(&diagnosis.rates, added));
        report.extend(plot_sections(&diagnosis.traces.plots, added)?);
        report.push(PageElement::heading("Effects that this recording set cannot reveal"));
        report.push(PageElement::text(undetectable_text(diagnosis)));
    }
    let [findings, unexplained] = findings(diagnosis);
    let own = [findings, unexplained, limit_tests(diagnosis), lamps(diagnosis), effect_limits(diagnosis)];
    let origin = diagnosis.provenance.iter().flat_map(recording_tables);
    own.into_iter().chain(origin).for_each(|table| report.push_table(table));
    if has_search {
        report.push_table(glossary(diagnosis));
    }
    Ok(report)
}

fn push_key_numbers(report: &mut Report, d: &Diagnosis) {
    for e in d.effects.iter().take(2) {
        for p in e.parameters.iter().take(2) {
            let label = format!("{} {}", e.name, p.name);
            report.push_key(label, with_interval(p.value, p.low, p.high), "95 % interval");
        }
    }
    for m in d.parameter_mismatches.iter().take(2) {
        let label = format!("{} instead of {}", m.parameter, format_value(m.model_value, m.low, m.high));
        report.push_key(label, with_interval(m.fitted_value, m.low, m.high), "95 % interval");
    }
    let set = if d.discrepancy.is_held_out() { "held-out discrepancy" } else { "discrepancy" };
    match d.discrepancy.held_out_set[..] {
        [] => {}
        [only] => report.push_key(set, format!("{only:.0}"), ""),
        [first, .., last] => {
            report.push_key(format!("{set}, before and after"), format!("{first:.0} → {last:.0}"), "");
        }
    }
    if !d.discrepancy.held_out_set.is_empty() {
        report.push_estimate("noise floor", d.discrepancy.noise_floor, d.discrepancy.noise_floor_sd, "");
    }
    if !d.traces.deviations.is_empty() {
        let beyond = d.traces.deviations.iter().filter(|r| r.3.abs() > DEVIATION_LIMIT).count();
        let all = format!("of {}", d.traces.deviations.len());
        report.push_key("statistics beyond five standard deviations", beyond.to_string(), &all);
    }
}

/// Plots one statistic in all recordings, with and without the added effects. It is the statistic whose deviation
/// the effects reduce most. Returns `None` if no effect was added.
fn effect_figure(d: &Diagnosis) -> Option<PageElement> {
    if d.discrepancy.fitted_set.len() < 2 {
        return None;
    }
    let drop = |row: &&Deviation| row.2.abs() - row.3.abs();
    let (name, place, before, after) =
        d.traces.deviations.iter().max_by(|a, b| drop(a).total_cmp(&drop(b)))?;
    let effects = d.effects.iter().map(|e| e.name.to_owned());
    let names: Vec<String> =
        effects.chain(d.parameter_mismatches.iter().map(|m| m.parameter.clone())).collect();
    let title = format!(
        "With {}, \u{201c}{name}\u{201d} in {place} falls from {before:.1} to {after:.1} standard deviations",
        if names.is_empty() { "the fitted parameters".to_owned() } else { names.join(", ") }
    );
    let rows = d.traces.deviations.iter().filter(|r| r.0 == *name).take(MAX_SHOWN_DEVIATIONS);
    let rows: Vec<RankedRow> =
        rows.map(|r| RankedRow { name: r.1.clone(), values: vec![r.2, r.3] }).collect();
    Some(ranked_bars(
        &title,
        "recordings minus model, standard deviations",
        &["without the effect", "with the effect"],
        &rows,
        Some((DEVIATION_LIMIT, "limit")),
        "The statistic that the added effect changes most, in all recordings. The limit is exceeded by some statistic of one in 1,000 sensors that follow the model.",
    ))
}

/// Plots the mean squared deviation of the statistics of each recording, before and after effects were added.
fn recording_discrepancies(d: &Diagnosis) -> Option<PageElement> {
    let added = d.discrepancy.fitted_set.len() > 1;
    let mut places: Vec<&str> = d.traces.deviations.iter().map(|r| r.1.as_str()).collect();
    places.sort_unstable();
    places.dedup();
    let mean_square = |place: &str, value: fn(&Deviation) -> f64| {
        let squares = d.traces.deviations.iter().filter(|r| r.1 == place).map(|r| value(r).powi(2));
        let (sum, count) = squares.fold((0.0, 0.0), |(sum, n), square| (sum + square, n + 1.0));
        sum / f64::max(count, 1.0)
    };
    let values: &[fn(&Deviation) -> f64] = if added { &[|r| r.2, |r| r.3] } else { &[|r| r.2] };
    let row = |place: &&str| RankedRow {
        name: (*place).to_owned(),
        values: values.iter().map(|value| mean_square(place, *value)).collect(),
    };
    let mut rows: Vec<RankedRow> = places.iter().map(row).collect();
    rows.sort_by(|a, b| b.values[0].total_cmp(&a.values[0]));
    rows.truncate(MAX_SHOWN_DEVIATIONS);
    let worst = rows.first()?.name.clone();
    let series: &[&str] = if added { &["before", "after"] } else { &["recordings and model"] };
    Some(ranked_bars(
        &format!("Discrepancy of each recording: {worst} deviates most"),
        "mean squared deviation of its statistics, standard deviations squared",
        series,
        &rows,
        Some((1.0, "noise floor")),
        "At the noise floor, a recording deviates from the model as much as simulated sensors of the model. Fitted parameters reduce the deviations below this floor.",
    ))
}

/// Plots the deviation of each lamp from its stated light, divided by its uncertainty.
fn pull_figure(d: &Diagnosis) -> Option<PageElement> {
    let largest = d.lamps.iter().map(|l| l.pull.abs()).fold(f64::NAN, f64::max);
    if !largest.is_finite() {
        return None;
    }
    let name = |l: &DiagnosedLamp| {
        l.source.as_ref().map_or_else(|| format!("{}, light {}", l.file, l.light), |s| format!("source {s}"))
    };
    let rows: Vec<RankedRow> =
        d.lamps.iter().map(|l| RankedRow { name: name(l), values: vec![l.pull] }).collect();
    Some(ranked_bars(
        &format!("Light of the recordings: the largest pull is {largest:.1}"),
        "found minus stated light, divided by the uncertainty of the light",
        &["pull"],
        &rows,
        Some((2.0, "two standard deviations")),
        "One in twenty lamps exceeds two standard deviations.",
    ))
}

/// Returns a table of the values that determine the verdict, each with its limit.
fn limit_tests(d: &Diagnosis) -> Table {
    let header = ["test", "fitted recordings", "held-out recordings", "limit", "result"];
    let percent = d.tests.first().map_or(0.0, |t| 100.0 * t.exceedance_probability);
    let note = format!(
        "Of the sensors that follow the model, {percent} % exceed a limit. The total deviation is the squared distance of all statistics from the model. The other two values are in standard deviations. The held-out recordings are tested after an effect was added."
    );
    let number =
        |x: f64| Cell::number(x, if x.abs() < 100.0 { format!("{x:.1}") } else { format!("{x:.0}") });
    let row = |t: &LimitTest| {
        let held_out = t.held_out_set.map_or_else(|| Cell::from("not tested"), number);
        let result = if t.passes() { "passes" } else { "exceeds the limit" };
        row![t.quantity, number(t.fitted_set), held_out, number(t.limit), result]
    };
    Table::new("Values behind the verdict", &header).open().with_note(note).with_rows(d.tests.iter().map(row))
}

/// Returns a text about the effects that the set cannot show.
pub(crate) fn undetectable_text(d: &Diagnosis) -> String {
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

fn findings(d: &Diagnosis) -> [Table; 2] {
    let header = ["effect", "parameter", "value (95 % interval)", "ambiguous with", "evidence"];
    let mut findings = Table::new("Effects and mismatches", &header).open();
    for e in &d.effects {
        for (i, p) in e.parameters.iter().enumerate() {
            let (ties, evidence) =
                if i == 0 { (e.ambiguous_with.join(", "), e.evidence.as_str()) } else { (String::new(), "") };
            findings.push_row(row![e.name, p.name, Cell::interval(p.value, p.low, p.high), ties, evidence]);
        }
    }
    let mismatch = |m: &ParameterMismatch| {
        let kind = if m.is_tentative { "tentative mismatch" } else { "mismatch" };
        let note = format!("the model has {}", format_value(m.model_value, m.low, m.high));
        let value = Cell::interval(m.fitted_value, m.low, m.high);
        row![kind, &m.parameter, value, m.ambiguous_with.join(", "), note]
    };
    let unexplained = Table::new("Unexplained statistics", &["statistic", "deviation, standard deviations"])
        .open()
        .with_rows(d.unexplained.iter().map(|u| row![&u.r#where, Cell::number(u.z, format!("{:+.1}", u.z))]));
    [findings.with_rows(d.parameter_mismatches.iter().map(mismatch)), unexplained]
}

/// Returns a table with one row for each lamp.
fn lamps(d: &Diagnosis) -> Table {
    let impacts = d.lamps.first().map_or(&[][..], |first| &first.impacts);
    let moved: Vec<String> = impacts.iter().map(|i| format!("moves {} by", i.parameter)).collect();
    let mut titles = vec!["recording", "light", "uncertainty, %", "found minus stated light, %", "pull"];
    titles.extend(moved.iter().map(String::as_str));
    const TEXT: &str = "The light of each recording is a parameter of every fit. The pull is the deviation of the found light from the stated light, divided by the uncertainty of the light. If the levels contradict a stated uncertainty, the table has the larger uncertainty that the diagnosis used. The last columns show how a named parameter changes if the light of one recording increases by its error.";
    let row = |lamp: &DiagnosedLamp| {
        let name = match &lamp.source {
            Some(source) => format!("source {source} ({})", lamp.file),
            None => lamp.file.clone(),
        };
        let deviation = Cell::estimate(100.0 * lamp.deviation, 100.0 * lamp.error, "");
        let pull = Cell::number(lamp.pull, format!("{:+.1}", lamp.pull));
        let impacts = lamp.impacts.iter().map(|i| Cell::number(i.change, format!("{:+.1e}", i.change)));
        row![name, &lamp.light, 100.0 * lamp.uncertainty, deviation, pull]
            .into_iter()
            .chain(impacts)
            .collect::<Vec<Cell>>()
    };
    Table::new("Light of the recordings", &titles).with_note(TEXT).with_rows(d.lamps.iter().map(row))
}

/// Returns a table with the upper limit of each effect that was not added.
fn effect_limits(d: &Diagnosis) -> Table {
    const TEXT: &str = "With 95 % confidence, the strength of an effect is below its limit, if the model lacks no other effect. A strength is the difference of the parameter from its value in the model. An effect with several shapes, such as time constants, has the largest limit of the tried shapes.";
    let header = ["effect", "parameter", "limit", "median over shapes"];
    let row = |l: &EffectLimit| {
        let [limit, median] = [l.limit, l.median_limit].map(|limit| match limit {
            Some(limit) => Cell::from(limit),
            None => Cell::from(format!("none below {}", without_error(l.largest_tried))),
        });
        row![l.name, l.parameter, limit, median]
    };
    Table::new("Upper limits of other effects", &header).with_note(TEXT).with_rows(d.limits.iter().map(row))
}

/// Plots the discrepancy after each step. Returns `None` if no effect was added, because the key numbers already
/// contain the only value.
fn discrepancy_figure(d: &Diagnosis) -> Option<PageElement> {
    const MEASURE: &str = "The discrepancy is the squared distance of the statistics from the model, without the directions that calibration fits.";
    let Discrepancy {
        fitted_set: fitted,
        held_out_set: judged,
        noise_floor: floor,
        noise_floor_sd: floor_sd,
    } = &d.discrepancy;
    let [first, .., last] = judged[..] else { return None };
    let held_out = d.discrepancy.is_held_out();
    let (sets, recordings): (&[&str], _) = if held_out {
        (&["fitted recordings", "held-out recordings"], "of the held-out recordings")
    } else {
        (&["recordings"], "of these recordings")
    };
    let row = |(name, (a, b)): (&String, (&f64, &f64))| RankedRow {
        name: name.clone(),
        values: if held_out { vec![*a, *b] } else { vec![*a] },
    };
    let rows: Vec<RankedRow> =
        d.traces.discrepancy_labels.iter().zip(fitted.iter().zip(judged)).map(row).collect();
    Some(ranked_bars(
        &format!("The discrepancy {recordings} falls from {first:.0} to {last:.0}"),
        "squared distance, standard deviations squared",
        sets,
        &rows,
        Some((*floor, "noise floor")),
        format!(
            "{MEASURE} The noise floor, which is the discrepancy of simulated sensors of the final model, is {}.",
            with_error(*floor, *floor_sd)
        ),
    ))
}

fn deviations_figure(d: &Diagnosis) -> PageElement {
    let mut rows: Vec<_> = d.traces.deviations.iter().collect();
    rows.sort_by(|a, b| b.2.abs().max(b.3.abs()).total_cmp(&a.2.abs().max(a.3.abs())));
    // If no effect was added, the deviations before and after are equal.
    let added = d.discrepancy.fitted_set.len() > 1;
    let row = |(name, place, before, after): &Deviation| RankedRow {
        name: format!("{place}: {name}"),
        values: if added { vec![*before, *after] } else { vec![*before] },
    };
    let shown: Vec<RankedRow> = rows.iter().take(MAX_SHOWN_DEVIATIONS).map(|r| row(r)).collect();
    let exceeding =
        |value: fn(&Deviation) -> f64| rows.iter().filter(|r| value(r).abs() > DEVIATION_LIMIT).count();
    let (before, after, all) = (exceeding(|r| r.2), exceeding(|r| r.3), rows.len());
    let (series, end): (&[&str], _) = if added {
        (&["before", "after"], format!(" before, {after} after"))
    } else {
        (&["recordings minus model"], String::new())
    };
    let title = format!("{before} of {all} statistics are beyond five standard deviations{end}");
    ranked_bars(
        &title,
        "standard deviations",
        series,
        &shown,
        Some((DEVIATION_LIMIT, "limit")),
        "The largest deviations of the fitted recordings from the model.",
    )
}

fn tournament(d: &Diagnosis) -> Vec<PageElement> {
    let mut parts = Vec::new();
    let rounds = d.traces.tournament.iter().zip(&d.traces.step_outcomes);
    // Rounds with a single candidate are omitted. An effect that replaced another one was not compared in a round.
    // Its evidence describes the replacement instead.
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
        let row = |(name, misfit, tied): &(&str, f64, bool)| RankedRow {
            name: format!("{name}{}", if *tied && name != winner { " (ambiguous)" } else { "" }),
            values: vec![*misfit],
        };
        let rows: Vec<RankedRow> = round.iter().map(row).collect();
        parts.push(ranked_bars(
            &format!("Comparison of candidates: {winner}{what}"),
            "remaining discrepancy",
            &["fitted"],
            &rows,
            None,
            caption,
        ));
    }
    parts
}

/// Formats `value` with the precision of two significant digits of half its interval `low` to `high`.
pub(super) fn format_value(value: f64, low: f64, high: f64) -> String {
    with_error(value, (high - low) / 2.0).value_column()
}
