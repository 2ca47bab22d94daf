//! The HTML report of a comparison with one static recording.

use super::scene::SceneComparison;
use super::scene_statistics::{SceneStatistics, VARIANCE_LAGS};
use spikelane::error::Result;
use spikelane_measure::report::{Curve, PageElement, Table, heat_map, line_plot, page};

impl SceneComparison {
    /// Returns the report of this comparison as an HTML page.
    ///
    /// # Errors
    /// If a plot cannot be drawn.
    pub fn html_report(&self) -> Result<String> {
        let parts = [
            PageElement::text(format!(
                "{} static pixels in uniform areas, mean rate {:.4} spikes per readout. Every model receives the light that gives each pixel its measured rate. The models have no fixed pattern.",
                self.pixels, self.mean_rate
            )),
            PageElement::Table(self.statistics_table()),
            PageElement::text(
                "D(n) is the variance of the time between a spike and the n-th later spike of the same pixel, in readouts squared. Outliers are intervals whose length is neither of the two whole numbers around the mean interval of the pixel.",
            ),
            PageElement::heading("Distances"),
            PageElement::Table(self.distance_table()),
            PageElement::text(format!(
                "Models are ranked by the sum of |ln(model / measured)| over D(1), D(8) and the outliers; the standard errors of the recording contribute {:.3}. The sum over D(16), D(24) and D(32) does not affect the rank. This sum includes slow noise, which the models lack, and a model with too much fast noise can have the same sum.",
                self.noise_floor_distance
            )),
            PageElement::text(self.verdict()),
            PageElement::heading("Row bands"),
            PageElement::Table(self.row_band_table()),
            PageElement::text(
                "Share of outliers, with the distance in brackets, in row bands with one eighth of the compared pixels each. The error of a difference between two models is the delete-one jackknife error over the bands. This error includes correlations within rows. The errors of the single statistics above do not include such correlations.",
            ),
            self.lag_variance_figure()?,
            PageElement::figure(
                heat_map(&self.rate_map, self.width, "static areas")?,
                "Rates of the compared pixels. Excluded pixels, which are not uniform or not static, are red.",
            ),
        ];
        Ok(page("Comparison with a static recording", &parts))
    }

    fn statistics_table(&self) -> Table {
        let lags = VARIANCE_LAGS.map(|n| format!("D({n}), readouts\u{b2}"));
        let head: Vec<&str> = ["camera"]
            .into_iter()
            .chain(lags.iter().map(String::as_str))
            .chain(["outliers, share"])
            .collect();
        let mut table = Table::new(&head);
        for row in std::iter::once(&self.recording).chain(&self.models) {
            let lags = row.lag_variance.iter().map(|e| format!("{:.4} \u{b1} {:.4}", e.value, e.error));
            let outliers = format!("{:.2e} \u{b1} {:.1e}", row.outlier_share.value, row.outlier_share.error);
            table.push_row(std::iter::once(row.name.clone()).chain(lags).chain([outliers]));
        }
        table
    }

    fn distance_table(&self) -> Table {
        let mut table =
            Table::new(&["|ln(model / measured)| of", "D(1)", "D(8)", "outliers", "sum", "beyond lag 8"]);
        for row in &self.models {
            let cells = row
                .distance_terms
                .iter()
                .chain([&row.distance, &row.long_lag_distance])
                .map(|x| format!("{x:.3}"));
            table.push_row(std::iter::once(row.name.clone()).chain(cells));
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
                "{} (distance larger by {:.2} \u{b1} {:.2}, nearest in {} row bands)",
                m.name,
                m.excess_distance,
                m.excess_distance_error,
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
        let mut table = Table::new(&head);
        for (i, area) in self.row_bands.iter().enumerate() {
            let [first, last] = area.rows;
            let measured_row = [
                format!("{first} to {last}"),
                area.pixels.to_string(),
                format!("{:.2e}", area.outlier_share),
            ];
            let cells = self
                .models
                .iter()
                .map(|m| format!("{:.2e} ({:.2})", m.row_band_outlier_shares[i], m.row_band_distances[i]));
            table.push_row(measured_row.into_iter().chain(cells));
        }
        table
    }

    /// Plots `D(n)` as a function of `n` for the recording and for models whose `D(n)` stays below twice the recording's
    /// maximum. The caption names the omitted models.
    fn lag_variance_figure(&self) -> Result<PageElement> {
        let limit = 2.0 * self.recording.lag_variance.iter().map(|e| e.value).fold(0.0, f64::max);
        let fits = |row: &&SceneStatistics| row.lag_variance.iter().all(|e| e.value < limit);
        let points = |row: &SceneStatistics| {
            VARIANCE_LAGS.iter().zip(&row.lag_variance).map(|(n, e)| (f64::from(*n), e.value)).collect()
        };
        let rows = std::iter::once(&self.recording).chain(&self.models).filter(fits);
        let lines: Vec<Curve<'_>> = rows.map(|row| Curve { name: &row.name, points: points(row) }).collect();
        let beyond: Vec<&str> = self.models.iter().filter(|m| !fits(m)).map(|m| m.name.as_str()).collect();
        let plot = line_plot("Variance of spike times", "intervals n", "D(n), readouts squared", &lines)?;
        let caption = match beyond[..] {
            [] => "D(n) of all models.".to_owned(),
            _ => format!("D(n); beyond the plot: {}.", beyond.join(", ")),
        };
        Ok(PageElement::figure(plot, caption))
    }
}
