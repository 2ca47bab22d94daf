//! The page of a comparison with one static recording.

use super::row::{LAGS, SceneRow};
use super::scene::SceneComparison;
use spikelane::error::Result;
use spikelane_measure::report::{Curve, Part, Table, curves, heat_map, page};

impl SceneComparison {
    /// The page of this comparison.
    ///
    /// # Errors
    /// When a plot cannot be made.
    pub fn page(&self) -> Result<String> {
        let parts = [
            Part::text(format!(
                "{} pixels in even, static areas, mean rate {:.4} spikes per readout. Every model got the light that gives each pixel its measured rate, and none of its own fixed pattern.",
                self.pixels, self.mean_rate
            )),
            Part::Table(self.values()),
            Part::text(
                "D(n) is the variance of the time between a spike and the n-th one after it, in readouts squared; outliers are intervals other than the two whole numbers about a pixel's mean.",
            ),
            Part::heading("Distances"),
            Part::Table(self.distances()),
            Part::text(format!(
                "Ranked by the sum of |ln(model / measured)| over D(1), D(8) and the outliers; the recording's own standard errors make {:.3} of it. The same over D(16), D(24) and D(32) is not ranked by: slow noise shows there, which none of these models has, and a model may come near by fast noise that is too large.",
                self.floor
            )),
            Part::text(self.verdict()),
            Part::heading("Bands of rows"),
            Part::Table(self.bands()),
            Part::text(
                "Share of outliers, and distance in brackets, in bands of rows with an eighth of the compared pixels each. The error of a lead is the delete-one jackknife over them: it holds what rows share, which the errors of the single statistics above do not.",
            ),
            self.figure()?,
            Part::figure(
                heat_map(&self.map, self.width, "static areas")?,
                "Rate of the pixels that were compared; red: left out, not even or not static.",
            ),
        ];
        Ok(page("Comparison with a static recording", &parts))
    }

    fn values(&self) -> Table {
        let lags = LAGS.map(|n| format!("D({n}), readouts\u{b2}"));
        let head: Vec<&str> = ["camera"]
            .into_iter()
            .chain(lags.iter().map(String::as_str))
            .chain(["outliers, share"])
            .collect();
        let mut table = Table::new(&head);
        for row in std::iter::once(&self.measured).chain(&self.models) {
            let lags = row.lag_variance.iter().map(|e| format!("{:.4} \u{b1} {:.4}", e.value, e.error));
            let outliers = format!("{:.2e} \u{b1} {:.1e}", row.outliers.value, row.outliers.error);
            table.row(std::iter::once(row.name.clone()).chain(lags).chain([outliers]));
        }
        table
    }

    fn distances(&self) -> Table {
        let mut table = Table::new(&[
            "camera, |ln(model / measured)| of",
            "D(1)",
            "D(8)",
            "outliers",
            "sum",
            "beyond lag 8",
        ]);
        for row in &self.models {
            let cells =
                row.terms.iter().chain([&row.distance, &row.slow_distance]).map(|x| format!("{x:.3}"));
            table.row(std::iter::once(row.name.clone()).chain(cells));
        }
        table
    }

    /// A sentence on which models the recording tells from the nearest one.
    #[must_use]
    pub fn verdict(&self) -> String {
        let Some((nearest, others)) = self.models.split_first() else { return String::new() };
        let of = |name: &str| self.areas.iter().filter(|a| a.nearest == name).count();
        let lead = |m: &SceneRow| {
            format!(
                "{} (behind by {:.2} \u{b1} {:.2}, nearest in {})",
                m.name,
                m.behind,
                m.behind_error,
                of(&m.name)
            )
        };
        let near: Vec<String> = others.iter().filter(|m| m.is_as_near()).map(lead).collect();
        let (name, bands, all) = (&nearest.name, of(&nearest.name), self.areas.len());
        let tells = match near[..] {
            [] => "the recording tells it from all others".to_owned(),
            _ => format!("the recording does not tell it from {}", near.join(", ")),
        };
        format!("{name} is nearest over all, and in {bands} of {all} bands of rows; {tells}.")
    }

    fn bands(&self) -> Table {
        let names = self.models.iter().map(|m| m.name.as_str());
        let head: Vec<&str> = ["rows", "pixels", "measured"].into_iter().chain(names).collect();
        let mut table = Table::new(&head);
        for (i, area) in self.areas.iter().enumerate() {
            let [first, last] = area.rows;
            let own =
                [format!("{first} to {last}"), area.pixels.to_string(), format!("{:.2e}", area.outliers)];
            let cells = self
                .models
                .iter()
                .map(|m| format!("{:.2e} ({:.2})", m.area_outliers[i], m.area_distances[i]));
            table.row(own.into_iter().chain(cells));
        }
        table
    }

    /// D(n) over n, of the models that fit into one picture with the recording.
    fn figure(&self) -> Result<Part> {
        let limit = 2.0 * self.measured.lag_variance.iter().map(|e| e.value).fold(0.0, f64::max);
        let fits = |row: &&SceneRow| row.lag_variance.iter().all(|e| e.value < limit);
        let points = |row: &SceneRow| {
            LAGS.iter().zip(&row.lag_variance).map(|(n, e)| (f64::from(*n), e.value)).collect()
        };
        let rows = std::iter::once(&self.measured).chain(&self.models).filter(fits);
        let lines: Vec<Curve<'_>> = rows.map(|row| Curve { name: &row.name, points: points(row) }).collect();
        let beyond: Vec<&str> = self.models.iter().filter(|m| !fits(m)).map(|m| m.name.as_str()).collect();
        let plot = curves("Variance of spike times", "intervals n", "D(n), readouts squared", &lines)?;
        let caption = match beyond[..] {
            [] => "D(n) of all models.".to_owned(),
            _ => format!("D(n); far above: {}.", beyond.join(", ")),
        };
        Ok(Part::figure(plot, caption))
    }
}
