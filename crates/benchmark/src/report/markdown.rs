//! Writes a comparison as Markdown tables for a page of documentation.

use std::fmt::Write as _;

use spikelane::error::Result;
use spikelane_measure::report::{markdown_code, markdown_text};

use super::{ScoredMethod, check_comparable, curve_points, listed_metrics, primary_score, unique_names};
use crate::Better;
use crate::score::{OVERALL, ScoreInterval};

/// Returns the tables of a comparison: the scores of the scored splits, the primary metric along each curve, and the cost.
///
/// The rows are metrics or values of a curve, and the columns are methods. Each cell contains a score and its 95 %
/// bootstrap interval. `commit` identifies the source code of the program.
///
/// # Errors
/// Those of [`super::report`].
///
/// # Examples
/// ```
/// use spikelane_benchmark::report::markdown;
/// assert!(markdown(&[], "unknown").is_err());
/// ```
pub fn markdown(methods: &[ScoredMethod], commit: &str) -> Result<String> {
    let first = check_comparable(methods, None)?;
    let names = unique_names(methods);
    let metrics = listed_metrics(first)?;
    let primary = metrics[0];
    let environment = &first.environment;
    let processor = environment.processor.as_deref().unwrap_or(&environment.system);
    let mut text = format!(
        "Suite {} {}, {} sequences, digest {}. Scored on {}, {}, spikelane {}, commit {}.\n\n",
        markdown_text(first.suite.as_str()),
        markdown_text(&first.version),
        first.sequences.len(),
        markdown_code(&first.digest),
        markdown_text(&environment.date),
        markdown_text(processor),
        markdown_text(&environment.spikelane),
        markdown_text(commit),
    );
    push_header(&mut text, "metric", &names);
    for metric in &metrics {
        let arrow = match metric.better {
            Better::Larger => "larger is better".to_owned(),
            Better::Smaller => "smaller is better".to_owned(),
            Better::CloserTo(target) => format!("ideal {target}"),
        };
        let unit = if metric.unit.is_empty() { String::new() } else { format!("{}; ", metric.unit) };
        let _ = write!(text, "| `{}` ({unit}{arrow}) |", metric.name);
        for method in methods {
            let summary = method.file.summary(OVERALL).and_then(|s| s.metrics.get(metric.name));
            push_cell(&mut text, summary.map(|summary| summary.pooled));
        }
        text.push('\n');
    }
    for (curve, groups) in &curve_points(first) {
        let _ = writeln!(text, "\n`{}` along the curve {}:\n", primary.name, markdown_code(curve));
        push_header(&mut text, curve, &names);
        for (value, _, group) in groups {
            let _ = write!(text, "| {} |", markdown_text(value));
            for method in methods {
                push_cell(&mut text, primary_score(&method.file, group, primary));
            }
            text.push('\n');
        }
    }
    text.push('\n');
    push_header(&mut text, "cost", &names);
    let mut row = |label: &str, cell: &dyn Fn(&ScoredMethod) -> Option<String>| {
        let cells = methods.iter().map(|m| format!(" {} |", cell(m).unwrap_or_else(|| "-".to_owned())));
        let _ = writeln!(text, "| {label} |{}", cells.collect::<String>());
    };
    row("median time per output, ms", &|m| Some(format!("{:.1}", 1e3 * m.file.cost?.latency_seconds[0])));
    row("outputs with a fault", &|m| Some(m.file.faults().to_string()));
    Ok(text)
}

fn push_header(text: &mut String, first: &str, names: &[String]) {
    let cells: Vec<String> =
        std::iter::once(first).chain(names.iter().map(String::as_str)).map(markdown_text).collect();
    let _ = writeln!(text, "| {} |\n|---|{}", cells.join(" | "), "--:|".repeat(names.len()));
}

fn push_cell(text: &mut String, score: Option<ScoreInterval>) {
    let _ = match score {
        None => write!(text, " - |"),
        Some(ScoreInterval { value, interval: None }) => write!(text, " {} |", rounded(value)),
        Some(ScoreInterval { value, interval: Some([low, high]) }) => {
            write!(text, " {} ({} to {}) |", rounded(value), rounded(low), rounded(high))
        }
    };
}

/// Writes a score with three decimals below 10, and with two decimals from 10 on.
fn rounded(value: f64) -> String {
    if value.abs() < 10.0 { format!("{value:.3}") } else { format!("{value:.2}") }
}
