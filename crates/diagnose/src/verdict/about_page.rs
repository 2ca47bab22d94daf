//! Sections of the report: recordings, initial model, terms, and command.

use crate::prepared::base_model::{BaseParameter, NumberSource};
use crate::prepared::provenance::Provenance;
use crate::verdict::diagnosis::Diagnosis;
use spikelane_measure::report::{Cell, Table, row};

/// Terms of the tables and plots of the report, with their definitions.
const TERMS: [(&str, &str); 17] = [
    (
        "discrepancy",
        "squared distance of all statistics from the model, in standard deviations squared, without the directions that calibration fits",
    ),
    ("noise floor", "mean discrepancy of simulated sensors of the final model"),
    (
        "standard deviations",
        "deviation of a statistic from the model, divided by the standard deviation between simulated sensors of the model",
    ),
    (
        "fitted, held out",
        "recordings to which parameters were fitted, and recordings that test whether an effect improves the model",
    ),
    (
        "spread about the line",
        "interquartile range of the differences between the rate of a pixel and its line as a function of the light",
    ),
    (
        "rate against the pixel's line",
        "mean difference between the rate of a pixel and its line as a function of the light",
    ),
    (
        "rate against the line, by gain",
        "change of the difference between rate and line from pixels of low gain to pixels of high gain",
    ),
    (
        "interval variance",
        "variance of the time between a spike and the n-th later spike (n is the lag), minus the part due to whole readouts, in thresholds squared",
    ),
    ("interval covariance", "covariance of successive intervals of a pixel"),
    (
        "short intervals",
        "intervals shorter than the two whole numbers of readouts around the mean; long intervals correspondingly",
    ),
    (
        "change between halves",
        "change of the number of spikes of a pixel from the first half of a recording to the second half",
    ),
    (
        "second half over first",
        "rate of all pixels in the second half of a recording, divided by the rate in the first half",
    ),
    (
        "power of the total",
        "power of the number of spikes per readout, divided by the power of as many independent spikes",
    ),
    ("line in the total", "strongest single frequency in the number of spikes per readout"),
    (
        "neighbors",
        "neighboring pixels that fire at the same readout or at the next readout, compared with chance",
    ),
    (
        "pixels far above",
        "pixels more than five robust standard deviations above the median of a map; far below correspondingly",
    ),
    (
        "halves of a row together",
        "correlation between the spikes of both halves of a row at the same readouts",
    ),
];

/// Returns the tables about the recordings and the initial parameters.
pub(super) fn recording_tables(about: &Provenance) -> Vec<Table> {
    let file = about.set_file.clone().unwrap_or_else(|| "a recording set in memory".to_owned());
    let mut set = vec![("recording set", file)];
    set.extend(about.recorded_camera.iter().flat_map(|camera| camera.rows()));
    set.push(("pixels", format!("{} x {}", about.width, about.height)));
    set.push(("readouts per second", about.readout_hz.to_string()));
    // Without an initial model, nothing was compared, so the held-out recordings are omitted.
    if !about.base_parameters.is_empty() {
        set.push(("held-out recordings", about.held_out.clone()));
    }
    set.push(("initial model", about.camera.clone()));
    set.push(("seed", about.seed.to_string()));
    let files = about.recordings.iter().map(|r| row![&r.file, &r.light, r.readouts, r.first_readout]);
    vec![
        Table::new("Recording set and camera", &["property", "value"])
            .with_rows(set.into_iter().map(|(name, value)| row![name, value])),
        Table::new("Recordings", &["recording", "light", "readouts", "first readout"]).with_rows(files),
        Table::new("Initial camera parameters", &["parameter", "value", "unit", "source"])
            .with_rows(about.base_parameters.iter().map(parameter_row)),
    ]
}

fn parameter_row(p: &BaseParameter) -> [Cell; 4] {
    let source = match p.source {
        NumberSource::Calibrated => "these recordings",
        NumberSource::Published => "the published model",
        NumberSource::Fitted => "a fit that started from the published model",
        NumberSource::Camera => "the camera file",
    };
    let value = p.error.map_or_else(|| Cell::from(p.value), |e| Cell::estimate(p.value, e, ""));
    row![&p.parameter, value, p.unit, source]
}

/// Returns the definitions of the terms that the report uses.
pub(super) fn glossary(d: &Diagnosis) -> Table {
    let used = |term: &str| {
        let statistics = d.traces.deviations.iter().map(|s| s.0.as_str());
        let general = ["discrepancy", "noise floor", "standard deviations", "fitted, held out"];
        general.contains(&term) || statistics.into_iter().any(|s| s.contains(term))
    };
    let terms = TERMS.iter().filter(|t| used(t.0));
    Table::new("Terms", &["term", "meaning"]).with_rows(terms.map(|(term, meaning)| row![*term, *meaning]))
}
