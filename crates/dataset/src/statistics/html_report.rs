//! Formats the statistics as an HTML page.

use std::collections::BTreeMap;

use super::{DatasetStatistics, format_number};
use spikelane::unstable::Count;
use spikelane_measure::report::{
    Cell, PageElement, Plot, Report, ReportState, RunRecord, Table, png_image, without_error,
};

/// Returns the statistics as one HTML file. `name` is the name of the dataset, and `run` is the origin of the page.
#[must_use]
pub fn html_report(name: &str, stats: &DatasetStatistics, run: &RunRecord) -> String {
    let sequences: u64 = stats.splits.values().sum();
    let sentence = format!(
        "{} with {} in {} MB; {} failed.",
        Count(sequences, "sequence"),
        Count(stats.readouts, "readout"),
        format_number(stats.bytes as f64 / 1e6),
        stats.failed_sequences
    );
    let (state, word) = match (stats.failed_sequences, sequences) {
        (_, 0) => (ReportState::Problem, "empty"),
        (0, _) => (ReportState::Good, "complete"),
        _ => (ReportState::Caution, "failed sequences"),
    };
    let mut report = Report::new(format!("Dataset {name}"), state, word, sentence);
    report.push_key("sequences", sequences.to_string(), "");
    report.push_key("readouts", stats.readouts.to_string(), "");
    report.push_key("size", format_number(stats.bytes as f64 / 1e6), "MB");
    report.push_key("failed sequences", stats.failed_sequences.to_string(), "");
    if !stats.boxes.is_empty() {
        report.push_key("visible boxes", stats.boxes.values().sum::<u64>().to_string(), "");
    }
    if !stats.reference_images.is_empty() {
        let figure = PageElement::figure(
            "Clean light of some sequences",
            image_figures(stats),
            "The middle readout of each sequence.",
        );
        report.push(figure.wide());
    }
    if !stats.histograms.is_empty() {
        report.push(PageElement::heading("Distributions"));
    }
    for (name, points) in &stats.histograms {
        let s = stats.quantities.get(name);
        let title = s.map_or(name.clone(), |s| {
            format!("{name}: 80 % between {} and {}", without_error(s.p10), without_error(s.p90))
        });
        let plot = Plot::new(title, name.clone(), "share").bars(name.clone(), points.clone());
        report.push(plot.figure(format!("Shares of {}.", Count(s.map_or(0, |s| s.count), "value"))));
    }
    let header = ["quantity", "count", "minimum", "10 %", "median", "90 %", "maximum"];
    let mut table = Table::new("Quantities", &header).open();
    for (name, s) in &stats.quantities {
        let cells = [s.min, s.p10, s.median, s.p90, s.max].map(|x| Cell::number(x, format_number(x)));
        let count = Cell::number(s.count as f64, s.count.to_string());
        table.push_row([Cell::from(name), count].into_iter().chain(cells));
    }
    report.push_table(table);
    for (title, head, counts) in [
        ("Splits", ["split", "sequences"], &stats.splits),
        ("Light", ["light", "sequences"], &stats.lighting),
        ("Cameras", ["camera", "sequences"], &stats.cameras),
        ("Visible boxes", ["class", "boxes"], &stats.boxes),
    ] {
        report.push_table(count_table(title, &head, counts));
    }
    let mut digest = Table::new("Digest of the dataset", &["property", "value"]);
    digest.push_row(["digest", &stats.digest]);
    report.push_table(digest);
    report.html(run)
}

/// Returns the HTML markup of the images.
fn image_figures(stats: &DatasetStatistics) -> String {
    stats.reference_images.iter().map(|(id, png)| png_image(png, id, 200) + " ").collect()
}

/// Returns a table of the first entries of `counts`. The number of rows is limited, because a dataset may have a
/// different camera for every sequence.
fn count_table(title: &str, head: &[&str], counts: &BTreeMap<String, u64>) -> Table {
    const MAX_LISTED_ROWS: usize = 20;
    let mut table = Table::new(title, head);
    for (name, count) in counts.iter().take(MAX_LISTED_ROWS) {
        table.push_row([Cell::from(name), Cell::number(*count as f64, count.to_string())]);
    }
    if let Some(more) = counts.len().checked_sub(MAX_LISTED_ROWS).filter(|&n| n > 0) {
        table.push_row([format!("{more} more"), String::new()]);
    }
    table
}
