//! The HTML report of a comparison at gray levels.

use super::gray::{CameraDistance, GrayComparison};
use super::smallest;
use spikelane::error::Result;
use spikelane_measure::report::{
    Cell, PageElement, Plot, RankedRow, Report, ReportState, RunRecord, Table, ranked_bars, without_error,
};

/// Largest number of bins of a plotted histogram. More bins would show noise instead of the shape.
const MAX_PLOTTED_BINS: usize = 80;

/// Largest number of bins of histograms that are drawn as grouped bars. More bins are drawn as lines.
const MAX_GROUPED_BINS: usize = 16;

/// If the distance of the nearest model is at most this multiple of the noise floor, the recordings do not distinguish the
/// model from the camera.
const MAX_FLOORS: f64 = 2.0;

impl GrayComparison {
    /// Returns a sentence about the model whose response is nearest to the measured camera.
    #[must_use]
    pub fn verdict(&self) -> String {
        let Some(nearest) = self.models.first() else { return "No model was compared.".to_owned() };
        let ratio = nearest.response_distance / self.noise_floor.response.max(f64::MIN_POSITIVE);
        let floor = if ratio <= MAX_FLOORS {
            "which is within the noise of the recordings".to_owned()
        } else {
            format!(
                "{} times the noise floor of the recordings",
                without_error((10.0 * ratio).round() / 10.0)
            )
        };
        format!(
            "{} has the nearest response: it differs by {} spikes per readout, {floor}.",
            nearest.name,
            without_error(nearest.response_distance)
        )
    }

    /// Returns the report of this comparison as an HTML page, with the response curves and the histograms.
    ///
    /// # Errors
    /// If a plot cannot be drawn.
    pub fn html_report(&self, run: &RunRecord) -> Result<String> {
        let nearest = self.models.first();
        let is_alike = nearest.is_some_and(|m| m.response_distance <= MAX_FLOORS * self.noise_floor.response);
        let (state, word) =
            if is_alike { (ReportState::Good, "alike") } else { (ReportState::Caution, "different") };
        let mut report = Report::new("Comparison with a measured camera", state, word, self.verdict());
        if let Some(nearest) = nearest {
            report.push_key("nearest response", nearest.name.clone(), "");
            report.push_value("its response distance", nearest.response_distance, "spikes per readout");
        }
        report.push_value("noise floor", self.noise_floor.response, "spikes per readout");
        report.push_value(
            "two cameras of one model",
            self.fixed_pattern_floor.response,
            "spikes per readout",
        );
        report.push_key("light levels", self.lights.len().to_string(), "");
        if let Some(camera) = &self.simulated_camera {
            report.push(PageElement::text(format!(
                "These recordings are simulated: \"measured\" refers to the camera \u{201c}{camera}\u{201d}, and distances are relative to this camera."
            )));
        }
        let rows: Vec<RankedRow> = self
            .models
            .iter()
            .map(|m| RankedRow { name: m.name.clone(), values: vec![1e3 * m.response_distance] })
            .collect();
        report.push(ranked_bars(
            "Distance of each response from the measured response",
            "root mean square difference, thousandths of a spike per readout",
            &["response"],
            &rows,
            Some((1e3 * self.noise_floor.response, "noise floor")),
            "The noise floor is the distance between the halves of the measured set.",
        ));
        report.push(self.response_figure(
            "Mean rate of the camera and of the models",
            "spikes per readout",
            |m, _| m,
        ));
        report.push(self.response_figure(
            "Response minus the measured response",
            "spikes per readout",
            |m, measured| m - measured,
        ));
        report.extend((0..self.histogram_lights.len()).map(|i| self.histogram_figure(i)));
        report.push_table(self.distance_table());
        report.push_table(self.rate_table("Mean rates", |c, i| c.response.get(i).copied()));
        for (channel, name) in self.channels.iter().enumerate() {
            let rate = |c: &CameraDistance, i: usize| c.channel_response.get(channel)?.get(i).copied();
            report.push_table(self.rate_table(&format!("Mean rates of the channel {name}"), rate));
        }
        self.recorded_camera.iter().for_each(|camera| report.push_table(camera.table()));
        Ok(report.html(run))
    }

    fn all_cameras(&self) -> impl Iterator<Item = &CameraDistance> {
        std::iter::once(&self.measured_camera).chain(&self.models)
    }

    fn response_figure(&self, title: &str, unit: &str, value: fn(f64, f64) -> f64) -> PageElement {
        let points = |c: &CameraDistance| {
            let pairs = c.response.iter().zip(&self.measured_camera.response);
            self.lights.iter().zip(pairs).map(|(l, (m, measured))| (*l, value(*m, *measured))).collect()
        };
        let plot = Plot::new(title, "light, relative to one spike per readout", unit);
        let plot = self.all_cameras().fold(plot, |plot, c| plot.line(c.name.clone(), points(c)));
        plot.figure("The light of each level is a fraction of the light that gives one spike per readout.")
    }

    /// Returns the rates of all cameras at each light level. `rate` returns the rate of a camera at a level.
    fn rate_table(&self, title: &str, rate: impl Fn(&CameraDistance, usize) -> Option<f64>) -> Table {
        let header: Vec<&str> =
            std::iter::once("light").chain(self.all_cameras().map(|c| c.name.as_str())).collect();
        let mut table = Table::new(format!("{title}, spikes per readout"), &header);
        for (i, light) in self.lights.iter().enumerate() {
            let rates = self.all_cameras().filter_map(|c| rate(c, i)).map(|r| Cell::value(r, ""));
            table.push_row(std::iter::once(Cell::value(*light, "")).chain(rates));
        }
        table
    }

    fn distance_table(&self) -> Table {
        let lights = self.histogram_lights.iter().map(|l| format!("intervals at light {l:.3}"));
        let head: Vec<String> = ["camera".to_owned(), "response, spikes per readout".to_owned()]
            .into_iter()
            .chain(lights)
            .collect();
        let mut table = Table::new("Distances", &head.iter().map(String::as_str).collect::<Vec<_>>()).open().with_note(
            "Response: root mean square difference of the mean rates over the levels. Intervals: half the sum of the absolute differences of the shares of all lengths, from 0 (equal) to 1 (disjoint).",
        );
        let best =
            |i: usize| smallest(self.models.iter().filter_map(|m| m.histogram_distance.get(i).copied()));
        let best_response = smallest(self.models.iter().map(|m| m.response_distance));
        let mut row = |name: &str, response: f64, histograms: &[f64], is_model: bool| {
            let cells = histograms
                .iter()
                .enumerate()
                .map(|(i, d)| Cell::value(*d, "").best(is_model && *d == best(i)));
            let response = Cell::value(response, "").best(is_model && response == best_response);
            table.push_row([Cell::from(name), response].into_iter().chain(cells));
        };
        for c in &self.models {
            row(&c.name, c.response_distance, &c.histogram_distance, true);
        }
        row(
            "noise floor: halves of the measured set",
            self.noise_floor.response,
            &self.noise_floor.histograms,
            false,
        );
        let nearest = self.models.first().map_or("", |m| &m.name);
        let name = format!("noise floor: two cameras of {nearest}");
        row(&name, self.fixed_pattern_floor.response, &self.fixed_pattern_floor.histograms, false);
        table
    }

    fn histogram_figure(&self, i: usize) -> PageElement {
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
        // A model without spread has a high peak. Scaling the y axis to this peak would flatten all other curves.
        let highest = |c: &CameraDistance| points(c).iter().map(|p| p.1).fold(0.0, f64::max);
        let limit = 3.0 * highest(&self.measured_camera);
        let cut: Vec<&str> =
            self.models.iter().filter(|c| highest(c) > limit).map(|c| c.name.as_str()).collect();
        let cut = if cut.is_empty() {
            String::new()
        } else {
            format!(" Cut at the upper edge: {}.", cut.join(", "))
        };
        let nearest = self
            .models
            .iter()
            .min_by(|a, b| {
                let at = |c: &CameraDistance| c.histogram_distance.get(i).copied().unwrap_or(f64::INFINITY);
                at(a).total_cmp(&at(b))
            })
            .map_or("no model", |m| &m.name);
        let title = format!("{nearest} has the nearest intervals at light {:.3}", self.histogram_lights[i]);
        let unit = if step == 1 { "one readout".to_owned() } else { format!("{step} readouts") };
        let caption = format!(
            "Share of the intervals by length, in bins of {unit}; the longest 0.1 % are not shown.{cut}"
        );
        let plot = Plot::new(title, "interval, readouts", "share of the intervals").max_y(limit);
        let has_few_bins = self.all_cameras().all(|c| points(c).len() <= MAX_GROUPED_BINS);
        let plot = self.all_cameras().fold(plot, |plot, c| match has_few_bins {
            true => plot.bars(c.name.clone(), points(c)),
            false => plot.line(c.name.clone(), points(c)),
        });
        plot.figure(caption)
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
