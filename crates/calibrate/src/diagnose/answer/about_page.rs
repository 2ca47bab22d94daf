//! The part of the report's page that says what was judged, from which numbers, and how it was made.

use super::diagnosis::Diagnosis;
use super::words::rounded;
use crate::diagnose::given::about::Provenance;
use crate::diagnose::given::base_model::{BaseParameter, NumberSource};
use spikelane_measure::report::{PageElement, Table};

/// Terms of the tables and plots, each with a line.
const TERMS: [(&str, &str); 17] = [
    (
        "gap",
        "squared distance of all statistics from the model, in its noise, with what calibration fits taken out",
    ),
    ("floor", "the gap that sensors of the final model have themselves"),
    ("standard deviations", "how far a statistic lies from the model, over what such sensors differ by"),
    (
        "fitted, held out",
        "recordings that numbers were fitted to, and others that judge whether a name helps",
    ),
    (
        "spread about the line",
        "how far the pixels' rates lie from each pixel's own line over the light, between the quartiles",
    ),
    ("rate against the pixel's line", "the same in the mean of the pixels"),
    ("rate against the line, by gain", "how that changes from pixels of low to pixels of high gain"),
    (
        "interval variance",
        "how far the time of so many spikes (the lag) strays, less what whole readouts make, in thresholds squared",
    ),
    ("interval covariance", "whether a long interval is followed by a short one"),
    (
        "short intervals",
        "intervals shorter than a regular pixel's lattice of whole readouts has; long ones likewise",
    ),
    (
        "change between halves",
        "by how many spikes pixels differ from the first half of a recording to the second",
    ),
    ("second half over first", "the same of all pixels together"),
    (
        "power of the total",
        "how much the number of spikes in a readout swings, over as many independent spikes",
    ),
    ("line in the total", "the strongest single frequency in that"),
    ("neighbors", "pixels side by side that fire in the same or in the next readout, over chance"),
    (
        "pixels far above",
        "pixels more than five robust deviations off the median of a map; far below likewise",
    ),
    ("halves of a row together", "whether both halves of a row fire more in the same readouts"),
];

/// The sets and the numbers that the search began with.
pub(super) fn judged(about: &Provenance) -> Vec<PageElement> {
    let mut parts = vec![PageElement::heading("What was judged")];
    let mut set = Table::new(&["", ""]);
    let mut row = |name: &str, value: String| set.push_row([name.to_owned(), value]);
    row("set", about.set_file.clone().unwrap_or_else(|| "a set in memory".to_owned()));
    row("pixels", format!("{} x {}", about.width, about.height));
    row("readouts per second", format!("{}", about.readout_hz));
    // Without a number nothing was judged.
    let judged = !about.base_parameters.is_empty();
    if judged {
        row("judged by", about.held_out.clone());
    }
    row("camera", about.camera.clone());
    if judged {
        row("lamps taken as known to", format!("{:.2} %", 100.0 * about.lamp_uncertainty));
    }
    row("seed", about.seed.to_string());
    parts.push(PageElement::Table(set));
    let lamp = |file: &str| about.lamps.iter().find(|l| l.file.ends_with(file));
    let mut files =
        Table::new(&["recording", "light", "calibrated, less stated", "readouts", "from readout"]);
    for r in &about.recordings {
        let found = lamp(&r.file).map_or_else(String::new, |l| format!("{:+.3} %", 100.0 * l.deviation));
        files.push_row([
            r.file.clone(),
            r.light.clone(),
            found,
            r.readouts.to_string(),
            r.first_readout.to_string(),
        ]);
    }
    if !about.recordings.is_empty() {
        parts.push(PageElement::Table(files));
    }
    if !about.base_parameters.is_empty() {
        parts.push(PageElement::heading("The numbers that it began with"));
        parts.push(PageElement::Table(numbers(&about.base_parameters)));
    }
    parts
}

fn numbers(all: &[BaseParameter]) -> Table {
    let mut table = Table::new(&["number", "value", "standard error", "unit", "from"]);
    for n in all {
        let source = match n.source {
            NumberSource::Calibrated => "these recordings",
            NumberSource::Published => "the published model",
            NumberSource::Fitted => "a fit that began at the published model",
            NumberSource::Camera => "the camera file",
        };
        // Both to two digits of the error.
        let error = n.error.map_or_else(String::new, |e| rounded(e, -e, e));
        let value = n.error.map_or_else(|| format!("{:.5}", n.value), |e| rounded(n.value, -e, e));
        table.push_row([n.parameter.clone(), value, error, n.unit.to_owned(), source.to_owned()]);
    }
    table
}

/// A line for each term that the page uses.
pub(super) fn glossary(d: &Diagnosis) -> Table {
    let used = |term: &str| {
        let statistics = d.traces.deviations.iter().map(|s| s.0.as_str());
        let general = ["gap", "floor", "standard deviations", "fitted, held out"];
        general.contains(&term) || statistics.into_iter().any(|s| s.contains(term))
    };
    let mut table = Table::new(&["term", "what it is"]);
    TERMS.iter().filter(|t| used(t.0)).for_each(|t| table.push_row([t.0, t.1]));
    table
}

/// What was typed, and when.
pub(super) fn made(about: &Provenance) -> Vec<PageElement> {
    let command = about.command.iter().map(|c| format!("Made by: {c}"));
    let date = about.date.iter().map(|d| format!("On {d} (universal time)."));
    let lines: Vec<String> = command.chain(date).collect();
    if lines.is_empty() { Vec::new() } else { vec![PageElement::List { items: lines }] }
}
