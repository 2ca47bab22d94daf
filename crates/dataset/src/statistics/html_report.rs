//! Formats the statistics as an HTML page.

use std::collections::BTreeMap;

use super::{DatasetStatistics, format_number};
use spikelane::error::Result;
use spikelane::unstable::Count;
use spikelane_measure::report::{Curve, PageElement, Table, bar_plot, page, png_image};

/// Returns the statistics as one HTML file.
///
/// # Errors
/// Errors of drawing the histograms.
pub fn html_report(name: &str, stats: &DatasetStatistics) -> Result<String> {
    let sequences: u64 = stats.splits.values().sum();
    let mut parts = vec![PageElement::text(format!(
        "{}, {}, {} MB; {} set aside. Digest {}.",
        Count(sequences, "sequence"),
        Count(stats.readouts, "readout"),
        format_number(stats.bytes as f64 / 1e6),
        stats.failed_sequences,
        stats.digest
    ))];
    for (heading, head, counts) in [
        ("Splits", ["split", "sequences"], &stats.splits),
        ("Light", ["light", "sequences"], &stats.lighting),
        ("Cameras", ["camera", "sequences"], &stats.cameras),
        ("Visible boxes", ["class", "boxes"], &stats.boxes),
    ] {
        if !counts.is_empty() {
            parts.push(PageElement::heading(heading));
            parts.push(PageElement::Table(count_table(&head, counts)));
        }
    }
    if !stats.reference_images.is_empty() {
        parts.push(PageElement::heading("Pictures"));
        parts.push(PageElement::figure(
            image_figures(stats),
            "Clean light of the middle readout of some sequences.",
        ));
    }
    parts.push(PageElement::heading("Quantities"));
    let mut table = Table::new(&["quantity", "count", "least", "10 %", "median", "90 %", "greatest"]);
    for (name, s) in &stats.quantities {
        let cells = [s.min, s.p10, s.median, s.p90, s.max].map(format_number);
        table.push_row([name.clone(), s.count.to_string()].into_iter().chain(cells));
    }
    parts.push(PageElement::Table(table));
    for (name, points) in &stats.histograms {
        let shares = Curve { name: "share", points: points.clone() };
        let count = stats.quantities.get(name).map_or(0, |s| s.count);
        parts.push(PageElement::figure(
            bar_plot(name, name, &[shares])?,
            format!("Shares of {}.", Count(count, "value")),
        ));
    }
    Ok(page(&format!("Dataset {name}"), &parts))
}

/// Returns the HTML markup of the images.
fn image_figures(stats: &DatasetStatistics) -> String {
    stats.reference_images.iter().map(|(id, png)| png_image(png, id, 200) + " ").collect()
}

/// Returns a table of the first entries of `counts`. The number of rows is limited, because a dataset may have a
/// different camera for every sequence.
fn count_table(head: &[&str], counts: &BTreeMap<String, u64>) -> Table {
    const MAX_LISTED_ROWS: usize = 20;
    let mut table = Table::new(head);
    for (name, count) in counts.iter().take(MAX_LISTED_ROWS) {
        table.push_row([name.clone(), count.to_string()]);
    }
    if let Some(more) = counts.len().checked_sub(MAX_LISTED_ROWS).filter(|&n| n > 0) {
        table.push_row([format!("{more} more"), String::new()]);
    }
    table
}
