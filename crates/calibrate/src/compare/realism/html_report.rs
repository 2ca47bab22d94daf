//! The HTML report of a comparison with the windows of a recording.

use super::super::smallest;
use super::recording_statistics::{DARK_QUANTILES, VARIANCE_LAGS, format_variance};
use super::{Auc, RealismComparison, RealismRow};
use spikelane::error::Result;
use spikelane_measure::report::{
    Cell, PageElement, RankedRow, Report, ReportState, RunRecord, Table, heat_map, ranked_bars,
    with_interval, without_error,
};

/// Number of features that are listed for each camera.
const MAX_LISTED_FEATURES: usize = 6;

impl Auc {
    fn text(self) -> String {
        with_interval(self.value, self.low, self.high)
    }

    fn cell(self) -> Cell {
        Cell::interval(self.value, self.low, self.high)
    }
}

impl RealismComparison {
    /// Returns a sentence about the camera that is hardest to distinguish from the recording.
    #[must_use]
    pub fn verdict(&self) -> String {
        let Some(best) = self.cameras.first() else { return String::new() };
        let over = best.auc.value - best.self_auc.value;
        let decided = if best.is_conclusive() {
            String::new()
        } else {
            " The data is insufficient for a decision: the 95 % interval extends more than 0.07 to either side."
                .to_owned()
        };
        let feature_text = best.features.first().map_or(String::new(), |t| {
            format!(
                " The most revealing statistic is {}: {} real, {} simulated.",
                t.name,
                without_error(t.real_mean),
                without_error(t.simulated_mean)
            )
        });
        format!(
            "{} is the most realistic camera: its distinguishability is {}. The noise floor, between two recordings of this camera, is {} (difference {over:+.2}).{feature_text}{decided}",
            best.name,
            best.auc.text(),
            best.self_auc.text()
        )
    }

    /// Returns the report of this comparison as an HTML page.
    ///
    /// # Errors
    /// If a plot cannot be drawn.
    pub fn html_report(&self, run: &RunRecord) -> Result<String> {
        let best = self.cameras.first();
        let (state, word) = match best {
            Some(best) if !best.is_conclusive() => (ReportState::Caution, "not decided"),
            Some(best) if best.auc.low <= best.self_auc.high => (ReportState::Good, "realistic"),
            _ => (ReportState::Caution, "distinguishable"),
        };
        let mut report =
            Report::new("Comparison with a real recording, window by window", state, word, self.verdict());
        if let Some(best) = best {
            report.push_key("most realistic camera", best.name.clone(), "");
            report.push_key("its distinguishability", best.auc.text(), "0.5 is alike, 1 is different");
            report.push_key("noise floor", best.self_auc.text(), "");
        }
        report.push_key("windows", self.windows.to_string(), &format!("at {} places", self.places));
        report.push_value("mean rate", self.mean_rate, "spikes per readout");
        report.push_value("excluded pixels", 100.0 * self.excluded_share, "%");
        report.push(PageElement::text(format!(
            "A window has {side}x{side} pixels and {} readouts. The excluded pixels are near motion or rarely fire. Every camera receives the light that gives each pixel its measured rate{drifting}. The cameras have no fixed pattern.",
            self.window.readouts,
            side = self.window.side,
            drifting = if self.drifting_light { ", with the drift of the neighboring light" } else { "" },
        )));
        let rows: Vec<RankedRow> = self
            .cameras
            .iter()
            .map(|c| RankedRow { name: c.name.clone(), values: vec![c.auc.value, c.self_auc.value] })
            .collect();
        report.push(ranked_bars(
            "Distinguishability of each camera from the recording",
            "probability that a real window scores above a simulated one",
            &["real and simulated", "noise floor: simulated and simulated"],
            &rows,
            Some((0.5, "alike")),
            "A logistic regression was trained at other places of the recording.",
        ));
        report.push(heat_map(
            "Rates of the compared pixels",
            &self.rates,
            self.width,
            "spikes per readout",
            "Excluded pixels are red.",
        )?);
        report.extend(self.cameras.iter().map(ratio_plot));
        report.push_table(self.camera_table());
        report.push_table(self.recording_table());
        for row in &self.cameras {
            report.push_table(feature_table(row));
            report.push_table(subset_table(row));
        }
        Ok(report.html(run))
    }

    /// Returns the table of the statistics of whole recordings.
    fn recording_table(&self) -> Table {
        let mut head = vec!["recording".to_owned()];
        head.extend(VARIANCE_LAGS.iter().map(|n| format!("D({n}), readouts squared")));
        head.extend(["early intervals, ppm", "late intervals, ppm"].map(str::to_owned));
        if self.recording_statistics.iter().any(|n| n.dark_rate_quantiles.is_some()) {
            head.extend(DARK_QUANTILES.iter().map(|s| format!("dark rate, {} %", 100.0 * s)));
        }
        let mut table = Table::new("Whole recordings", &head.iter().map(String::as_str).collect::<Vec<_>>());
        for n in &self.recording_statistics {
            let mut cells = vec![n.name.clone()];
            cells.extend(n.lag_variance.iter().map(|d| format_variance(*d)));
            cells.extend(
                [n.early_interval_share, n.late_interval_share].map(|share| format!("{:.0}", 1e6 * share)),
            );
            cells.extend(n.dark_rate_quantiles.iter().flatten().map(|rate| format!("{rate:.4}")));
            table.push_row(cells);
        }
        table
    }

    fn camera_table(&self) -> Table {
        let header = ["camera", "distinguishability", "noise floor", "decided", "most revealing statistic"];
        let mut table = Table::new("Cameras", &header).open().with_note(
            "Distinguishability: probability that a real window scores above a simulated one, with a 95 % interval over places. At 0.5, the windows of the simulated camera cannot be distinguished from real windows. Noise floor: the distinguishability between recordings of one simulated camera.",
        );
        let smallest = smallest(self.cameras.iter().map(|c| c.auc.value));
        for row in &self.cameras {
            let feature_text =
                row.features.first().map_or(String::new(), |t| format!("{} ({:.2})", t.name, t.auc));
            let decided = if row.is_conclusive() { "yes" } else { "not with this amount of data" };
            table.push_row([
                Cell::from(&row.name),
                row.auc.cell().best(row.auc.value == smallest),
                row.self_auc.cell(),
                Cell::from(decided),
                Cell::from(feature_text),
            ]);
        }
        table
    }
}

fn feature_table(row: &RealismRow) -> Table {
    let header =
        ["statistic of a window", "real", "simulated", "distinguishability with this statistic alone"];
    let mut table = Table::new(format!("Statistics that distinguish {}", row.name), &header);
    for t in row.features.iter().take(MAX_LISTED_FEATURES) {
        table.push_row([
            Cell::from(&t.name),
            Cell::value(t.real_mean, ""),
            Cell::value(t.simulated_mean, ""),
            Cell::number(t.auc, format!("{:.2}", t.auc)),
        ]);
    }
    table
}

fn subset_table(row: &RealismRow) -> Table {
    let header =
        ["part of the windows", "windows", "distinguishability", "most revealing statistic of this part"];
    let mut table = Table::new(format!("Parts of the windows, {}", row.name), &header);
    for part in &row.subsets {
        let auc = part.auc.map_or(Cell::from("too few places"), Auc::cell);
        let feature_text =
            part.best_feature.as_ref().map_or(String::new(), |t| format!("{} ({:.2})", t.name, t.auc));
        table.push_row([Cell::from(&part.name), Cell::from(part.windows), auc, Cell::from(feature_text)]);
    }
    table
}

/// Plots the ratio of the simulated mean to the real mean of each feature. Features with a mean of 0 are skipped.
fn ratio_plot(row: &RealismRow) -> PageElement {
    let usable = row
        .features
        .iter()
        .filter(|t| t.real_mean > 0.0 && t.simulated_mean > 0.0)
        .take(2 * MAX_LISTED_FEATURES);
    let rows: Vec<RankedRow> = usable
        .map(|t| RankedRow { name: t.name.clone(), values: vec![t.simulated_mean / t.real_mean] })
        .collect();
    ranked_bars(
        &format!("{}: statistics of simulated windows relative to real windows", row.name),
        "simulated divided by real",
        &["ratio"],
        &rows,
        Some((1.0, "alike")),
        "The statistics are ordered by how well they distinguish the windows.",
    )
}
