//! The overview as a page.

use std::collections::BTreeMap;

use super::{Stats, number};
use spikelane::error::Result;
use spikelane::unstable::inputs::read_bytes;
use spikelane_measure::report::{Curve, Part, Table, bars, page, picture};

/// The most that a picture on the page may hold, in bytes.
const MAX_PICTURE_BYTES: u64 = 64 << 20;

/// The overview as one HTML file.
///
/// # Errors
/// Never, in practice: the template is fixed.
pub fn html(name: &str, stats: &Stats) -> Result<String> {
    let sequences: u64 = stats.splits.values().sum();
    let mut parts = vec![Part::text(format!(
        "{sequences} sequences, {} readouts, {} MB; {} set aside. Digest {}.",
        stats.readouts,
        number(stats.bytes as f64 / 1e6),
        stats.set_aside,
        stats.digest
    ))];
    for (heading, head, counts) in [
        ("Splits", ["split", "sequences"], &stats.splits),
        ("Light", ["light", "sequences"], &stats.lights),
        ("Cameras", ["camera", "sequences"], &stats.cameras),
        ("Boxes that are seen", ["class", "boxes"], &stats.boxes),
    ] {
        if !counts.is_empty() {
            parts.push(Part::heading(heading));
            parts.push(Part::Table(counted(&head, counts)));
        }
    }
    if !stats.pictures.is_empty() {
        parts.push(Part::heading("Pictures"));
        parts
            .push(Part::figure(pictures(stats)?, "The clear light of the middle readout of some sequences."));
    }
    parts.push(Part::heading("Quantities"));
    let mut table = Table::new(&["quantity", "count", "least", "10 %", "median", "90 %", "greatest"]);
    for (name, s) in &stats.quantities {
        let cells = [s.least, s.tenth, s.median, s.ninth, s.greatest].map(number);
        table.row([name.clone(), s.count.to_string()].into_iter().chain(cells));
    }
    parts.push(Part::Table(table));
    for (name, points) in &stats.histograms {
        let shares = Curve { name: "share", points: points.clone() };
        let of = stats.quantities.get(name).map_or(0, |s| s.count);
        parts.push(Part::figure(bars(name, name, &[shares])?, format!("Shares of {of} values.")));
    }
    Ok(page(&format!("Dataset {name}"), &parts))
}

/// The pictures as markup, inside of the page.
fn pictures(stats: &Stats) -> Result<String> {
    let mut markup = String::new();
    for (id, path) in &stats.pictures {
        let bytes = read_bytes(path, "a picture", MAX_PICTURE_BYTES)?;
        markup += &picture(&bytes, id, 200);
        markup.push(' ');
    }
    Ok(markup)
}

/// Counts; of many, such as cameras drawn for every sequence, the first.
fn counted(head: &[&str], counts: &BTreeMap<String, u64>) -> Table {
    const LISTED: usize = 20;
    let mut table = Table::new(head);
    for (name, count) in counts.iter().take(LISTED) {
        table.row([name.clone(), count.to_string()]);
    }
    if let Some(more) = counts.len().checked_sub(LISTED).filter(|&n| n > 0) {
        table.row([format!("{more} more"), String::new()]);
    }
    table
}
