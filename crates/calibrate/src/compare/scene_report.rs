//! The HTML report of a comparison with one static recording.

use super::scene::{SceneChannel, SceneComparison};
use super::scene_statistics::{SceneStatistics, VARIANCE_LAGS};
use super::smallest;
use spikelane::error::Result;
use spikelane_measure::report::{
    Cell, PageElement, Plot, PlotPoint, RankedRow, Report, ReportState, RunRecord, Table, heat_map,
    ranked_bars, with_error, without_error,
};

impl SceneComparison {
    /// Returns the report of this comparison as an HTML page.
    ///
    /// # Errors
    /// If a plot cannot be drawn.
    pub fn html_report(&self, run: &RunRecord) -> Result<String> {
        let is_decided = self.models.iter().filter(|m| m.is_tied_with_nearest()).count() <= 1;
        let (state, word) =
            if is_decided { (ReportState::Good, "decided") } else { (ReportState::Caution, "not decided") };
        let mut report = Report::new("Comparison with a static recording", state, word, self.verdict());
        if let Some(nearest) = self.models.first() {
            report.push_key("nearest model", nearest.name.clone(), "");
            report.push_value("its distance", nearest.distance, "");
        }
        report.push_value("part due to errors of the recording", self.noise_floor_distance, "");
        if let [_, second, ..] = self.models.as_slice() {
            let label = format!("lead over {}", second.name);
            report.push_estimate(label, second.excess_distance, second.excess_distance_error, "");
        }
        report.push_key("static pixels in uniform areas", self.pixels.to_string(), "");
        report.push_value("mean rate", self.mean_rate, "spikes per readout");
        if !self.channels.is_empty() {
            report.push_key("pixels of each color filter", self.channel_text(), "");
        }
        let rows: Vec<RankedRow> = self
            .models
            .iter()
            .map(|m| RankedRow { name: m.name.clone(), values: vec![m.distance] })
            .collect();
        report.push(ranked_bars(
            "Distance of each model from the recording",
            "sum of |ln(model / measured)| over D(1), D(8) and the outliers",
            &["distance"],
            &rows,
            Some((self.noise_floor_distance, "due to errors of the recording")),
            "Every model receives the light that gives each pixel its measured rate. The models have no fixed pattern.",
        ));
        report.push(self.lag_variance_figure());
        report.push(heat_map(
            "Rates of the compared pixels",
            &self.rate_map,
            self.width,
            "spikes per readout",
            "Excluded pixels, which are not uniform or not static, are red.",
        )?);
        report.push_table(self.statistics_table());
        report.push_table(self.distance_table());
        report.push_table(self.row_band_table());
        Ok(report.html(run))
    }

    /// Returns the number of compared pixels of each color filter, and their mean rates.
    #[must_use]
    pub fn channel_text(&self) -> String {
        let channel = |c: &SceneChannel| match c.pixels {
            0 => format!("{} 0", c.name),
            n => format!("{} {n} (rate {:.4})", c.name, c.mean_rate),
        };
        self.channels.iter().map(channel).collect::<Vec<_>>().join(", ")
    }

    fn statistics_table(&self) -> Table {
        let lags = VARIANCE_LAGS.map(|n| format!("D({n}), readouts\u{b2}"));
        let head: Vec<&str> = ["camera"]
            .into_iter()
            .chain(lags.iter().map(String::as_str))
            .chain(["outliers, share"])
            .collect();
        let mut table = Table::new("Statistics of the recording and of the models", &head).with_note(
            "D(n) is the variance of the time between a spike and the n-th later spike of the same pixel. Outliers are intervals whose length is neither of the two whole numbers around the mean interval of the pixel.",
        );
        for row in std::iter::once(&self.recording).chain(&self.models) {
            let cells = row.lag_variance.iter().chain([&row.outlier_share]);
            let cells = cells.map(|e| Cell::estimate(e.value, e.error, ""));
            table.push_row(std::iter::once(Cell::from(&row.name)).chain(cells));
        }
        table
    }

    fn distance_table(&self) -> Table {
        let header = ["|ln(model / measured)| of", "D(1)", "D(8)", "outliers", "sum", "beyond lag 8"];
        let mut table = Table::new("Distances", &header).open().with_note(
            "Models are ranked by the sum over D(1), D(8) and the outliers. The sum over D(16), D(24) and D(32) does not affect the rank. This sum includes slow noise, which the models lack, and a model with too much fast noise can have the same sum.",
        );
        let best = |value: &dyn Fn(&SceneStatistics) -> f64| smallest(self.models.iter().map(value));
        let sum = best(&|m| m.distance);
        let terms: Vec<f64> = (0..3).map(|i| best(&|m| m.distance_terms[i])).collect();
        for row in &self.models {
            let own =
                row.distance_terms.iter().enumerate().map(|(i, x)| Cell::value(*x, "").best(*x == terms[i]));
            let sums = [
                Cell::value(row.distance, "").best(row.distance == sum),
                Cell::value(row.long_lag_distance, ""),
            ];
            table.push_row(std::iter::once(Cell::from(&row.name)).chain(own).chain(sums));
        }
        table
    }

    /// Returns a sentence about the nearest model and the models that the recording cannot distinguish from it.
    #[must_use]
    pub fn verdict(&self) -> String {
        let Some((nearest, others)) = self.models.split_first() else { return String::new() };
        let nearest_count = |name: &str| self.row_bands.iter().filter(|a| a.nearest_model == name).count();
        let lead = |m: &SceneStatistics| {
            format!(
                "{} (distance larger by {}, nearest in {} row bands)",
                m.name,
                with_error(m.excess_distance, m.excess_distance_error),
                nearest_count(&m.name)
            )
        };
        let near: Vec<String> = others.iter().filter(|m| m.is_tied_with_nearest()).map(lead).collect();
        let (name, bands, all) = (&nearest.name, nearest_count(&nearest.name), self.row_bands.len());
        let tells = match near[..] {
            [] => format!("the recording distinguishes {name} from all other models"),
            _ => format!("the recording does not distinguish {name} from {}", near.join(", ")),
        };
        format!(
            "{name} has the smallest overall distance, and the smallest distance in {bands} of {all} row bands; {tells}."
        )
    }

    fn row_band_table(&self) -> Table {
        let names = self.models.iter().map(|m| m.name.as_str());
        let head: Vec<&str> = ["rows", "pixels", "measured"].into_iter().chain(names).collect();
        let mut table = Table::new("Outliers in row bands", &head).with_note(
            "Share of outliers, with the distance in brackets, in row bands with one eighth of the compared pixels each. The error of a difference between two models is the delete-one jackknife error over the bands. This error includes correlations within rows. The errors of the single statistics do not include such correlations.",
        );
        for (i, area) in self.row_bands.iter().enumerate() {
            let [first, last] = area.rows;
            let measured_row =
                [format!("{first} to {last}"), area.pixels.to_string(), without_error(area.outlier_share)];
            let cells = self.models.iter().map(|m| {
                format!("{} ({:.2})", without_error(m.row_band_outlier_shares[i]), m.row_band_distances[i])
            });
            table.push_row(measured_row.into_iter().chain(cells));
        }
        table
    }

    /// Plots `D(n)` as a function of `n` for the recording and for models whose `D(n)` stays below twice the recording's
    /// maximum. The caption names the omitted models.
    fn lag_variance_figure(&self) -> PageElement {
        let limit = 2.0 * self.recording.lag_variance.iter().map(|e| e.value).fold(0.0, f64::max);
        let fits = |row: &&SceneStatistics| row.lag_variance.iter().all(|e| e.value < limit);
        let lags = || VARIANCE_LAGS.iter().map(|n| f64::from(*n));
        let points =
            |row: &SceneStatistics| lags().zip(&row.lag_variance).map(|(n, e)| (n, e.value)).collect();
        let beyond: Vec<&str> = self.models.iter().filter(|m| !fits(m)).map(|m| m.name.as_str()).collect();
        let measured =
            lags().zip(&self.recording.lag_variance).map(|(n, e)| PlotPoint::new(n, e.value, e.error));
        let plot = Plot::new("Variance of spike times", "intervals n", "D(n), readouts²")
            .points(self.recording.name.clone(), measured.collect());
        let plot =
            self.models.iter().filter(fits).fold(plot, |plot, row| plot.line(row.name.clone(), points(row)));
        plot.figure(match beyond[..] {
            [] => "D(n) of the recording and of all models.".to_owned(),
            _ => format!("D(n) of the recording and of the models. Beyond the plot: {}.", beyond.join(", ")),
        })
    }
}
