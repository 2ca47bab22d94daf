//! The HTML report of a comparison at gray levels.

use super::gray::{CameraDistance, GrayComparison};
use spikelane::error::Result;
use spikelane_measure::report::{Curve, PageElement, Table, bar_plot, marked_line_plot, page};

/// Largest number of bins of a plotted histogram. More bins would show noise instead of the shape.
const MAX_PLOTTED_BINS: usize = 80;

impl GrayComparison {
    /// Returns the report of this comparison as an HTML page, with the response curves and the histograms.
    ///
    /// # Errors
    /// If a plot cannot be drawn.
    pub fn html_report(&self) -> Result<String> {
        let mut parts = Vec::new();
        if let Some(camera) = &self.simulated_camera {
            parts.push(PageElement::text(format!(
                "These recordings are simulated: \"measured\" refers to the camera \u{201c}{camera}\u{201d}, and distances are relative to this camera."
            )));
        }
        if let Some(camera) = &self.recorded_camera {
            parts.push(PageElement::Table(camera.table()));
        }
        parts.push(PageElement::text(
            "The light of each level is a fraction of the light that gives one spike per readout. Response: root mean square difference of the mean rates over the levels, in spikes per readout. Intervals: half the sum of the absolute differences of the shares of all lengths, from 0 (equal) to 1 (disjoint), without a unit.",
        ));
        parts.push(PageElement::Table(self.distance_table()));
        parts.push(PageElement::figure(
            marked_line_plot(
                "Mean rate",
                ("light", "spikes per readout"),
                &self.response_curves(|m, _| m),
                None,
            )?,
            "Mean rate as a function of the light.",
        ));
        parts.push(PageElement::figure(
            marked_line_plot(
                "Response minus the measured response",
                ("light", "spikes per readout"),
                &self.response_curves(|m, measured| m - measured),
                None,
            )?,
            "Differences from the measured camera.",
        ));
        for i in 0..self.histogram_lights.len() {
            parts.push(self.histogram_figure(i)?);
        }
        Ok(page("Comparison with a measured camera", &parts))
    }

    fn all_cameras(&self) -> impl Iterator<Item = &CameraDistance> {
        std::iter::once(&self.measured_camera).chain(&self.models)
    }

    fn response_curves(&self, value: fn(f64, f64) -> f64) -> Vec<Curve<'_>> {
        let points = |c: &CameraDistance| {
            let pairs = c.response.iter().zip(&self.measured_camera.response);
            self.lights.iter().zip(pairs).map(|(l, (m, measured))| (*l, value(*m, *measured))).collect()
        };
        self.all_cameras().map(|c| Curve { name: &c.name, points: points(c) }).collect()
    }

    fn distance_table(&self) -> Table {
        let lights = self.histogram_lights.iter().map(|l| format!("intervals at light {l:.3}"));
        let head: Vec<String> = ["camera".to_owned(), "response, spikes per readout".to_owned()]
            .into_iter()
            .chain(lights)
            .collect();
        let mut table = Table::new(&head.iter().map(String::as_str).collect::<Vec<_>>());
        let mut row = |name: &str, response: f64, histograms: &[f64]| {
            let cells = histograms.iter().map(|d| format!("{d:.4}"));
            table.push_row([name.to_owned(), format!("{response:.6}")].into_iter().chain(cells));
        };
        for c in &self.models {
            row(&c.name, c.response_distance, &c.histogram_distance);
        }
        row(
            "noise floor: halves of the measured set",
            self.noise_floor.response,
            &self.noise_floor.histograms,
        );
        let nearest = self.models.first().map_or("", |m| &m.name);
        let name = format!("noise floor: two cameras of {nearest}");
        row(&name, self.fixed_pattern_floor.response, &self.fixed_pattern_floor.histograms);
        table
    }

    fn histogram_figure(&self, i: usize) -> Result<PageElement> {
        let shares = || self.all_cameras().filter_map(|c| c.histograms.get(i));
        // The x axis ends where, for every camera, at most a thousandth of the intervals is longer.
        let end = shares().map(|s| quantile_length(s, 0.999)).max().unwrap_or(1) + 2;
        let step = end.div_ceil(MAX_PLOTTED_BINS);
        let points = |c: &CameraDistance| -> Vec<(f64, f64)> {
            let shares: Vec<f64> = c.histograms.get(i).into_iter().flatten().take(end).copied().collect();
            let center = |bin: usize| (bin * step) as f64 + (step as f64 - 1.0) / 2.0;
            // Bin 0 contains length 0, and no interval has this length.
            let skip = usize::from(step == 1);
            let bins = shares.chunks(step).enumerate().skip(skip);
            bins.map(|(bin, s)| (center(bin), s.iter().sum())).collect()
        };
        let mut lines: Vec<Curve<'_>> =
            self.all_cameras().map(|c| Curve { name: &c.name, points: points(c) }).collect();
        // A model without spread has a high peak. Scaling the y axis to this peak would flatten all other curves.
        let highest = |c: &Curve<'_>| c.points.iter().map(|p| p.1).fold(0.0, f64::max);
        let limit = 3.0 * highest(&lines[0]);
        let cut: Vec<&str> = lines.iter().filter(|c| highest(c) > limit).map(|c| c.name).collect();
        let cut = if cut.is_empty() {
            String::new()
        } else {
            format!(" Cut at the upper edge: {}.", cut.join(", "))
        };
        lines.iter_mut().flat_map(|c| &mut c.points).for_each(|p| p.1 = p.1.min(limit));
        let title = format!("Intervals at light {:.3}", self.histogram_lights[i]);
        let unit = if step == 1 { "one readout".to_owned() } else { format!("{step} readouts") };
        let caption = format!(
            "Share of the intervals by length, in bins of {unit}; the longest 0.1 % are not shown.{cut}"
        );
        Ok(PageElement::figure(bar_plot(&title, "interval in readouts", &lines)?, caption))
    }
}

/// Returns the shortest length that at least the share `share` of the intervals do not exceed.
fn quantile_length(shares: &[f64], share: f64) -> usize {
    let mut sum = 0.0;
    shares
        .iter()
        .position(|s| {
            sum += s;
            sum >= share
        })
        .unwrap_or(shares.len())
}
