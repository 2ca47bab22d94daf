//! The page of a comparison over grey levels.

use super::grey::{CameraDistance, GreyComparison};
use spikelane::error::Result;
use spikelane_measure::report::{Curve, Part, Table, bars, marked, page};

/// Most bins of a plotted histogram: more of them show noise and no shape.
const BINS: usize = 80;

impl GreyComparison {
    /// The page of this comparison, with the response curves and the histograms.
    ///
    /// # Errors
    /// When a plot cannot be made.
    pub fn page(&self) -> Result<String> {
        let mut parts = Vec::new();
        if let Some(camera) = &self.simulated {
            parts.push(Part::text(format!(
                "No real camera made these recordings: what is called measured here was simulated with the camera \u{201c}{camera}\u{201d}, and the models' distances say how far they are from that one."
            )));
        }
        parts.push(Part::text(
            "Light is what the set states, in fractions of what gives one spike a readout. Response: root mean square, over the levels, of the difference in mean rate, in spikes a readout. Intervals: half the sum of the absolute differences of the shares of all lengths, from 0 (equal) to 1 (disjoint), without a unit.",
        ));
        parts.push(Part::Table(self.distances()));
        parts.push(Part::figure(
            marked("Mean rate", ("light", "spikes a readout"), &self.lines(|m, _| m), None)?,
            "Response over the light.",
        ));
        parts.push(Part::figure(
            marked(
                "Less the measured response",
                ("light", "spikes a readout"),
                &self.lines(|m, own| m - own),
                None,
            )?,
            "The same as differences from the measured camera.",
        ));
        for i in 0..self.histogram_lights.len() {
            parts.push(self.histogram(i)?);
        }
        Ok(page("Comparison with a measured camera", &parts))
    }

    fn all(&self) -> impl Iterator<Item = &CameraDistance> {
        std::iter::once(&self.measured).chain(&self.models)
    }

    fn lines(&self, of: fn(f64, f64) -> f64) -> Vec<Curve<'_>> {
        let points = |c: &CameraDistance| {
            let pairs = c.response.iter().zip(&self.measured.response);
            self.lights.iter().zip(pairs).map(|(l, (m, own))| (*l, of(*m, *own))).collect()
        };
        self.all().map(|c| Curve { name: &c.name, points: points(c) }).collect()
    }

    fn distances(&self) -> Table {
        let lights = self.histogram_lights.iter().map(|l| format!("intervals at light {l:.3}"));
        let head: Vec<String> = ["camera".to_owned(), "response, spikes a readout".to_owned()]
            .into_iter()
            .chain(lights)
            .collect();
        let mut table = Table::new(&head.iter().map(String::as_str).collect::<Vec<_>>());
        let mut row = |name: &str, response: f64, histograms: &[f64]| {
            let cells = histograms.iter().map(|d| format!("{d:.4}"));
            table.row([name.to_owned(), format!("{response:.6}")].into_iter().chain(cells));
        };
        for c in &self.models {
            row(&c.name, c.response_distance, &c.histogram_distance);
        }
        row("floor: the halves of the measured set", self.floor.response, &self.floor.histograms);
        let nearest = self.models.first().map_or("", |m| &m.name);
        let name = format!("floor: two cameras of {nearest}");
        row(&name, self.pattern_floor.response, &self.pattern_floor.histograms);
        table
    }

    fn histogram(&self, i: usize) -> Result<Part> {
        let shares = || self.all().filter_map(|c| c.histograms.get(i));
        // Up to where a thousandth of all intervals of any camera is left.
        let end = shares().map(|s| length_of(s, 0.999)).max().unwrap_or(1) + 2;
        let step = end.div_ceil(BINS);
        let points = |c: &CameraDistance| -> Vec<(f64, f64)> {
            let shares: Vec<f64> = c.histograms.get(i).into_iter().flatten().take(end).copied().collect();
            let centre = |bin: usize| (bin * step) as f64 + (step as f64 - 1.0) / 2.0;
            // No interval has length 0.
            let skip = usize::from(step == 1);
            let bins = shares.chunks(step).enumerate().skip(skip);
            bins.map(|(bin, s)| (centre(bin), s.iter().sum())).collect()
        };
        let mut lines: Vec<Curve<'_>> =
            self.all().map(|c| Curve { name: &c.name, points: points(c) }).collect();
        // A model without spread would flatten all others.
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
        let caption =
            format!("Share of the intervals by length, bins of {unit}; all but the longest thousandth.{cut}");
        Ok(Part::figure(bars(&title, "interval in readouts", &lines)?, caption))
    }
}

/// The length below which `share` of the intervals lie.
fn length_of(shares: &[f64], share: f64) -> usize {
    let mut sum = 0.0;
    shares
        .iter()
        .position(|s| {
            sum += s;
            sum >= share
        })
        .unwrap_or(shares.len())
}
