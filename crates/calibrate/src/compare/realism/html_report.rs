//! The HTML report of a comparison with the windows of a recording.

use super::recording_statistics::{DARK_QUANTILES, VARIANCE_LAGS, format_variance};
use super::{Auc, RealismComparison, RealismRow};
use spikelane::error::Result;
use spikelane_measure::report::{PageElement, RankedRow, Table, heat_map, page, ranked_bar_plot};

/// Number of features that are listed for each camera.
const MAX_LISTED_FEATURES: usize = 6;

impl Auc {
    fn text(self) -> String {
        format!("{:.3} ({:.2} to {:.2})", self.value, self.low, self.high)
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
                " The most revealing statistic is {}: {:.3e} real, {:.3e} simulated.",
                t.name, t.real_mean, t.simulated_mean
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
    pub fn html_report(&self) -> Result<String> {
        let mut parts = vec![
            PageElement::text(self.verdict()),
            PageElement::text(format!(
                "{} windows of {side}x{side} pixels and {} readouts at {} places of the recording, mean rate {:.4} spikes per readout. {:.1} % of the pixels are excluded, because these pixels are near motion or rarely fire. Every camera receives the light that gives each pixel its measured rate{drifting}. The cameras have no fixed pattern.",
                self.windows,
                self.window.readouts,
                self.places,
                self.mean_rate,
                100.0 * self.excluded_share,
                side = self.window.side,
                drifting = if self.drifting_light { ", with the drift of the neighboring light" } else { "" },
            )),
            PageElement::Table(self.camera_table()),
            PageElement::text(
                "Distinguishability: probability that a real window scores above a simulated one, by a logistic regression trained at other places, with a 95 % interval over places. At 0.5, the windows of the simulated camera cannot be distinguished from real windows. Noise floor: the distinguishability between recordings of one simulated camera.",
            ),
        ];
        let still = heat_map(&self.rates, self.width, "spikes per readout")?;
        parts.push(PageElement::figure(still, "Rates of the compared pixels. Excluded pixels are red."));
        parts.push(PageElement::heading("Whole recordings"));
        parts.push(PageElement::Table(self.recording_table()));
        for row in &self.cameras {
            parts.push(PageElement::heading(&row.name));
            parts.push(PageElement::Table(feature_table(row)));
            parts.push(PageElement::figure(
                ratio_plot(row)?,
                "Statistics of simulated windows, divided by the statistics of real windows.",
            ));
            parts.push(PageElement::Table(subset_table(row)));
        }
        Ok(page("Comparison with a real recording, window by window", &parts))
    }

    /// Returns the table of the statistics of whole recordings.
    fn recording_table(&self) -> Table {
        let mut head = vec!["".to_owned()];
        head.extend(VARIANCE_LAGS.iter().map(|n| format!("D({n}), readouts squared")));
        head.extend(["early intervals, ppm", "late intervals, ppm"].map(str::to_owned));
        if self.recording_statistics.iter().any(|n| n.dark_rate_quantiles.is_some()) {
            head.extend(DARK_QUANTILES.iter().map(|s| format!("dark rate, {} %", 100.0 * s)));
        }
        let mut table = Table::new(&head.iter().map(String::as_str).collect::<Vec<_>>());
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
        let mut table = Table::new(&[
            "camera",
            "distinguishability",
            "noise floor",
            "decided",
            "most revealing statistic",
        ]);
        for row in &self.cameras {
            let feature_text =
                row.features.first().map_or(String::new(), |t| format!("{} ({:.2})", t.name, t.auc));
            let decided = if row.is_conclusive() { "yes" } else { "not with this amount of data" };
            table.push_row([
                row.name.clone(),
                row.auc.text(),
                row.self_auc.text(),
                decided.to_owned(),
                feature_text,
            ]);
        }
        table
    }
}

fn feature_table(row: &RealismRow) -> Table {
    let mut table = Table::new(&[
        "statistic of a window",
        "real",
        "simulated",
        "distinguishability with this statistic alone",
    ]);
    for t in row.features.iter().take(MAX_LISTED_FEATURES) {
        table.push_row([
            t.name.clone(),
            format!("{:.3e}", t.real_mean),
            format!("{:.3e}", t.simulated_mean),
            format!("{:.2}", t.auc),
        ]);
    }
    table
}

fn subset_table(row: &RealismRow) -> Table {
    let mut table = Table::new(&[
        "part of the windows",
        "windows",
        "distinguishability",
        "most revealing statistic of this part",
    ]);
    for part in &row.subsets {
        let auc_text = part.auc.map_or("too few places".to_owned(), Auc::text);
        let feature_text =
            part.best_feature.as_ref().map_or(String::new(), |t| format!("{} ({:.2})", t.name, t.auc));
        table.push_row([part.name.clone(), part.windows.to_string(), auc_text, feature_text]);
    }
    table
}

/// Plots the ratio of the simulated mean to the real mean of each feature. Features with a mean of 0 are skipped.
fn ratio_plot(row: &RealismRow) -> Result<String> {
    let usable = row
        .features
        .iter()
        .filter(|t| t.real_mean > 0.0 && t.simulated_mean > 0.0)
        .take(2 * MAX_LISTED_FEATURES);
    let rows: Vec<RankedRow> = usable
        .map(|t| RankedRow { name: t.name.clone(), values: vec![t.simulated_mean / t.real_mean] })
        .collect();
    ranked_bar_plot("simulated over real", &["simulated over real"], &rows, Some((1.0, "alike")))
}
