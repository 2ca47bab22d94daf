//! The HTML report of a calibration.

use crate::formulas::fit::PixelFit;
use crate::population::mean_and_sd;
use crate::result::{Additivity, Calibration, Lamp};
use crate::snee::{SneeMaps, SneePixel};
use spikelane::error::Result;
use spikelane::unstable::Count;
use spikelane_measure::report::{
    Curve, PageElement, ShadedBand, Table, bar_plot, heat_map, marked_line_plot, page as render, today,
};
use spikelane_measure::{Estimate, finite_values};

impl Calibration {
    /// Returns the report as an HTML page.
    ///
    /// # Errors
    /// If a plot cannot be drawn.
    pub fn html_report(&self) -> Result<String> {
        page(self)
    }
}

fn page(c: &Calibration) -> Result<String> {
    let width = c.sensor.geometry.width();
    let map = |value: fn(&PixelFit) -> f64| c.fits.iter().map(value).collect::<Vec<f64>>();
    let (a, d) = (map(|f| f.a), map(|f| f.d));
    let mut parts = vec![
        PageElement::text(set_summary(c)),
        PageElement::text(c.verdict()),
        PageElement::List { items: c.cautions() },
        PageElement::heading("Light levels"),
        linearity_figure(c)?,
        residual_figure(c)?,
        PageElement::Table(lamp_table(c)),
    ];
    parts.extend(c.additivity.as_ref().map(|a| PageElement::Table(additivity_table(a))));
    parts.extend([
        PageElement::heading("Population"),
        PageElement::Table(population_table(c)),
        PageElement::heading("Identified and unidentified values"),
        PageElement::List { items: c.notes.clone() },
        PageElement::heading("Defects"),
        PageElement::text(defect_summary(c)),
        PageElement::heading("Maps"),
        PageElement::figure(
            heat_map(&a, width, "map of a")?,
            "Gain a, 1st to 99th percentile; unknown pixels are red.",
        ),
        PageElement::figure(
            heat_map(&d, width, "map of d")?,
            "Dark rate d, 1st to 99th percentile; unknown pixels are red.",
        ),
        histogram_figure("Gain a", "thresholds per readout at full light", &a)?,
        histogram_figure("Dark rate d", "thresholds per readout", &d)?,
    ]);
    if let Some(camera) = &c.recorded_camera {
        parts.insert(1, PageElement::Table(camera.table()));
    }
    if let Some(paper) = &c.snee {
        parts.extend(snee_comparison(c, paper)?);
    }
    Ok(render("Calibration", &parts))
}

/// Returns a sentence with the number of recordings, their size in pixels and their length.
fn set_summary(c: &Calibration) -> String {
    let readouts: u64 = c.lamps.iter().map(|l| u64::from(l.readouts)).sum();
    format!(
        "{} of {}x{} pixels at {} readouts per second, {} in total, {:.2} s. Created on {}.",
        Count(c.lamps.len(), "recording"),
        c.sensor.geometry.width(),
        c.sensor.geometry.height(),
        c.sensor.readout_hz,
        Count(readouts, "readout"),
        readouts as f64 / c.sensor.readout_hz,
        today()
    )
}

/// Plots the mean rates, and the mean of the fitted lines, as functions of the stated light.
fn linearity_figure(c: &Calibration) -> Result<PageElement> {
    let p = &c.population;
    let unsaturated = || c.lamps.iter().filter(|l| !l.is_saturated);
    let end = unsaturated().map(|l| l.stated_light).fold(0.0, f64::max);
    let line = [0.0, end].map(|light| (light, p.mean_a.value * light + p.mean_d.value));
    let plot = marked_line_plot(
        "Linearity",
        ("stated light, relative to saturation", "spikes per readout"),
        &[
            Curve { name: "mean of the fitted lines", points: line.to_vec() },
            Curve {
                name: "recorded",
                points: unsaturated().map(|l| (l.stated_light, l.mean_rate)).collect(),
            },
        ],
        None,
    )?;
    Ok(PageElement::figure(plot, "Mean rate of each level below saturation, over the stated light."))
}

/// Plots the deviation of each level from its stated light, with a band of plus and minus two standard errors.
fn residual_figure(c: &Calibration) -> Result<PageElement> {
    let known: Vec<(f64, [f64; 2])> = c
        .lamps
        .iter()
        .filter_map(|l| Some((l.stated_light, l.relative_deviation()?.map(|x| 100.0 * x))))
        .collect();
    let at = |errors: f64| known.iter().map(|(x, [value, error])| (*x, value + errors * error)).collect();
    let band = ShadedBand { name: "two standard errors", low: at(-2.0), high: at(2.0) };
    let plot = marked_line_plot(
        "Estimated light minus stated light",
        ("stated light, relative to saturation", "%"),
        &[Curve { name: "estimated", points: at(0.0) }],
        Some(&band),
    )?;
    let caption = "Residuals from the line of all levels. The errors include the error of the scale that all levels share, so the errors may exceed the scatter of the points.";
    Ok(PageElement::figure(plot, caption))
}

fn population_table(c: &Calibration) -> Table {
    let p = &c.population;
    let mut table = Table::new(&["quantity", "value", "standard error", "relative to the mean"]);
    let (a, d) = (p.mean_a.value, p.mean_d.value);
    let rows = [
        ("mean gain a (thresholds per readout at full light)", p.mean_a, None),
        ("PRNU: spread of a", p.sd_a, Some(a)),
        ("mean dark rate d (thresholds per readout)", p.mean_d, None),
        ("DSNU: spread of d", p.sd_d, Some(d)),
        ("spread of thresholds", p.sigma_phi, Some(1.0)),
        ("threshold noise, relative to the threshold", c.sigma_t, Some(1.0)),
        ("electrons per threshold", c.electrons_per_threshold, None),
        ("photons per readout at light 1 and gain 1", c.photons_at_full_light, None),
    ];
    let shares =
        [("share of the threshold noise that is redrawn at every readout".to_owned(), c.redraw_share)];
    let falloff =
        c.light_field.iter().map(|f| ("falloff of the light at the corners".to_owned(), f.corner_falloff));
    let cells =
        ["even row, even column", "even row, odd column", "odd row, even column", "odd row, odd column"];
    let classes =
        c.class_gains.iter().zip(cells).map(|(g, cell)| (format!("mean gain of the class {cell}"), *g));
    let rows = rows.map(|(name, e, mean)| (name.to_owned(), e, mean)).into_iter();
    let others = shares.into_iter().chain(falloff).chain(classes).filter(|(_, e)| e.value.is_finite());
    let rows = rows.chain(others.map(|(name, e)| (name, e, None)));
    for (name, e, mean) in rows {
        let digits = if e.value >= 100.0 { 0 } else { 6 };
        let error = if e.error.is_finite() { format!("{:.2e}", e.error) } else { "assumed".to_owned() };
        let relative = mean.map_or(String::new(), |m| format!("{:.3} %", 100.0 * e.value / m));
        table.push_row([name, format!("{:.digits$}", e.value), error, relative]);
    }
    table
}

fn lamp_table(c: &Calibration) -> Table {
    let mut table = Table::new(&[
        "recording",
        "readouts",
        "stated light",
        "uncertainty",
        "estimated light",
        "deviation",
        "standard error",
        "pull",
        "spikes per readout",
        "scatter of the pixels around their lines",
        "verdict",
    ]);
    let percent = |x: f64| format!("{:.3} %", 100.0 * x);
    for lamp in &c.lamps {
        let readouts = if lamp.readouts > 0 { lamp.readouts.to_string() } else { "a map".to_owned() };
        let [estimated, deviation, error, pull] = match (lamp.relative_deviation(), lamp.pull()) {
            (Some([value, error]), Some(pull)) => {
                [format!("{:.5}", lamp.found_light()), percent(value), percent(error), format!("{pull:+.2}")]
            }
            _ => Default::default(),
        };
        let (stated, uncertainty) = (format!("{:.5}", lamp.stated_light), percent(lamp.stated_uncertainty));
        let cells = [lamp.file.clone(), readouts, stated, uncertainty, estimated, deviation, error, pull];
        let fitted =
            [format!("{:.5}", lamp.mean_rate), percent(lamp.rate_scatter), lamp_verdict(lamp).to_owned()];
        table.push_row(cells.into_iter().chain(fitted));
    }
    table
}

/// Returns one row for each recording of several sources, and one for the curvature of the response.
fn additivity_table(additivity: &Additivity) -> Table {
    let mut table = Table::new(&["recording", "sources", "response more than the sum", "standard error"]);
    let percent = |x: f64| format!("{:.4} %", 100.0 * x);
    for sum in &additivity.sums {
        let Estimate { value, error, .. } = sum.residual;
        table.push_row([sum.file.clone(), sum.sources.join(" + "), percent(value), percent(error)]);
    }
    let Estimate { value, error, .. } = additivity.curvature;
    let name = "deviation from a line at full light".to_owned();
    table.push_row([name, String::new(), percent(value), percent(error)]);
    table
}

fn lamp_verdict(lamp: &Lamp) -> &'static str {
    match (lamp.stated_light == 0.0, lamp.is_saturated, lamp.is_outlier, lamp.drifts) {
        (_, true, ..) => "saturated: not estimated",
        (_, _, true, _) => "lamp off, uncertainty 30 %",
        (_, _, _, true) => "drifts",
        (true, ..) => "dark, as stated",
        _ => "as stated",
    }
}

fn defect_summary(c: &Calibration) -> String {
    format!(
        "Dead pixels: {}. Hot pixels: {}. Pixels whose levels are not on a line, fitted by least absolute deviations: {}. Median chi-square per degree of freedom: {}.",
        c.dead_pixels.len(),
        c.hot_pixels.len(),
        c.poor_fit_pixels.len(),
        c.reduced_chi2().map_or("unknown".to_owned(), |x| format!("{x:.3}"))
    )
}

fn histogram_figure(title: &str, unit: &str, map: &[f64]) -> Result<PageElement> {
    let plot = bar_plot(title, unit, &[Curve { name: "pixels", points: histogram_bins(map) }])?;
    Ok(PageElement::figure(plot, "Share of the pixels, between the 0.1th and the 99.9th percentile."))
}

/// Compares the estimator of the SCSim paper with the default estimator. Both estimators determine some of the listed
/// quantities. For the other quantities, the values of the paper's estimator depend on the limits that it sets for the
/// threshold.
fn snee_comparison(c: &Calibration, paper: &SneeMaps) -> Result<Vec<PageElement>> {
    let mut table = Table::new(&["quantity", "paper: mean", "spread", "default: mean", "spread"]);
    let p = &c.population;
    let cells = |value: fn(&SneePixel) -> f64| {
        let (mean, sd) = mean_and_sd(&paper.map(value));
        [format!("{mean:.5}"), format!("{sd:.5}")]
    };
    let mut row = |name: &str, value: fn(&SneePixel) -> f64, cell_pair: [String; 2]| {
        table.push_row(std::iter::once(name.to_owned()).chain(cells(value)).chain(cell_pair));
    };
    let spread_cells = |mean: f64, sd: f64| [format!("{mean:.5}"), format!("{sd:.5}")];
    let unknown = || ["not identified".to_owned(), String::new()];
    row("alpha / phi = a, identified", |s| s.alpha / s.phi, spread_cells(p.mean_a.value, p.sd_a.value));
    row("I / phi = d, identified", |s| s.dark / s.phi, spread_cells(p.mean_d.value, p.sd_d.value));
    row("phi, relative to the nominal threshold", |s| s.phi, spread_cells(1.0, p.sigma_phi.value));
    row("C_S, relative to the nominal capacitance", |s| s.c_s, unknown());
    row("V_S, relative to the nominal swing", |s| s.v_s, unknown());
    row("alpha, in nominal thresholds", |s| s.alpha, unknown());
    row("I, in nominal thresholds", |s| s.dark, unknown());
    let edges = paper.edge_counts();
    let (low, high) = (1.0 - paper.box_half_width, 1.0 + paper.box_half_width);
    let where_to = format!(
        "Allowed thresholds: {low:.2} to {high:.2} of the nominal threshold. Pixels at the lower limit: {}; between the limits: {}; at the upper limit: {}; without a solution: {}.",
        edges.at_lower_edge, edges.between_edges, edges.at_upper_edge, edges.unsolved
    );
    Ok(vec![
        PageElement::heading("The paper's estimator (SNEE)"),
        PageElement::text(
            "As a linear program in (phi, alpha, I), the objective, the sum over the levels of |N phi - (alpha mu + I) T|, scales with all three variables. Without limits, all three variables are zero at the optimum. With limits, the threshold of every pixel with nonzero residuals is at the lower limit. The threshold, the absolute values of alpha and I, and the split of phi into C_S and V_S therefore depend on the limits and are not measurements. Only the ratios alpha / phi and I / phi are measurements.",
        ),
        PageElement::text(where_to),
        PageElement::Table(table),
        histogram_figure(
            "Thresholds of the paper's estimator",
            "relative to the nominal threshold",
            &paper.map(|s| s.phi),
        )?,
    ])
}

/// Returns the center and the share of 60 bins. The bins cover the range between the 0.1th and the 99.9th percentile.
fn histogram_bins(map: &[f64]) -> Vec<(f64, f64)> {
    let mut sorted = finite_values(map);
    sorted.sort_by(f64::total_cmp);
    let at = |share: f64| sorted.get((share * sorted.len() as f64) as usize).copied().unwrap_or(0.0);
    // If all values are equal, the range is widened, because the bin width must not be 0.
    let (low, high) = (at(0.001), at(0.999).max(at(0.001) * (1.0 + 1e-3) + 1e-9));
    let step = (high - low) / 60.0;
    let mut bins = [0.0; 60];
    for x in sorted.iter().filter(|x| (low..=high).contains(*x)) {
        bins[(((x - low) / step) as usize).min(59)] += 1.0 / sorted.len() as f64;
    }
    bins.iter().enumerate().map(|(i, n)| (low + (i as f64 + 0.5) * step, *n)).collect()
}
