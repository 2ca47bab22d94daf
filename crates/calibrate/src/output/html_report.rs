//! The HTML report of a calibration.

use super::emva_1288::sheet_table;
use crate::formulas::fit::PixelFit;
use crate::population::mean_and_sd;
use crate::recordings::recorded_camera::RecordedCamera;
use crate::result::{Additivity, Calibration, ChannelFit, Lamp};
use crate::snee::{SneeMaps, SneePixel};
use spikelane::error::Result;
use spikelane::unstable::Count;
use spikelane_measure::report::{
    Cell, PageElement, Plot, PlotPoint, Report, ReportState, RunRecord, Table, heat_map, row, without_error,
};
use spikelane_measure::{Estimate, finite_values, map_histogram, pattern_spectra};

/// Number of bins of a histogram.
const HISTOGRAM_BINS: usize = 60;

/// Unit of a rate in the plots.
const RATE_UNIT: &str = "spikes per readout";

/// Label of the axis of light.
const LIGHT_AXIS: &str = "stated light, relative to saturation";

impl Calibration {
    /// Returns the report as an HTML page. `run` is the origin of the report.
    ///
    /// # Errors
    /// If a map cannot be encoded.
    pub fn html_report(&self, run: &RunRecord) -> Result<String> {
        Ok(report(self)?.html(run))
    }
}

fn report(c: &Calibration) -> Result<Report> {
    let width = c.sensor.geometry.width();
    let map = |value: fn(&PixelFit) -> f64| c.fits.iter().map(value).collect::<Vec<f64>>();
    let (a, d) = (map(|f| f.a), map(|f| f.d));
    let cautions = c.cautions();
    let (state, word) = if cautions.is_empty() {
        (ReportState::Good, "agrees")
    } else {
        (ReportState::Caution, "usable with care")
    };
    let mut report = Report::new("Calibration", state, word, c.verdict());
    push_key_numbers(&mut report, c);
    report.push(PageElement::List { items: cautions });
    report.push(PageElement::text(set_summary(c)));
    report.push(PageElement::heading("Light levels"));
    report.push(linearity_figure(c));
    report.push(residual_figure(c));
    report.extend(variance_figure(c));
    report.push(PageElement::heading("Pixels"));
    let p = &c.population;
    for (name, unit, values, mean, sd, variance) in [
        ("gain a", "thresholds per readout at light 1", &a, p.mean_a, p.sd_a, map(|f| f.var_a)),
        ("dark rate d", "thresholds per readout", &d, p.mean_d, p.sd_d, map(|f| f.var_d)),
    ] {
        report.push(heat_map(
            &format!("Map of the {name}"),
            values,
            width,
            unit,
            "The colors span the 1st to the 99th percentile. Pixels without an estimate are red.",
        )?);
        report.push(population_figure(name, unit, values, (mean, sd), &finite_values(&variance)));
        report.push(spectrum_figure(name, unit, values, width));
    }
    report.push(PageElement::heading("Identified and unidentified values"));
    report.push(PageElement::List { items: c.notes.clone() });
    report.push(PageElement::text(defect_summary(c)));
    if let Some(paper) = &c.snee {
        report.extend(snee_text(paper));
        report.push(histogram_figure(
            "Thresholds of the paper's estimator (SNEE)",
            "relative to the nominal threshold",
            &paper.map(|s| s.phi),
        ));
    }
    let tables = [population_table(c), channel_table(c), lamp_table(c), sheet_table(c)].into_iter();
    let tables = tables.chain(c.additivity.iter().map(additivity_table));
    let tables = tables.chain(c.snee.iter().map(|paper| snee_table(c, paper)));
    let tables = tables.chain(c.recorded_camera.iter().map(RecordedCamera::table));
    tables.for_each(|table| report.push_table(table));
    Ok(report)
}

fn push_key_numbers(report: &mut Report, c: &Calibration) {
    let p = &c.population;
    let assumed = |e: Estimate, unit: &str| {
        if e.error.is_finite() { unit.to_owned() } else { format!("{unit} (assumed)") }
    };
    for (label, e, unit) in [
        ("mean gain a", p.mean_a, "thresholds per readout at light 1".to_owned()),
        ("PRNU", percent(p.sd_a, p.mean_a.value), "% of the mean gain".to_owned()),
        ("mean dark rate d", p.mean_d, "thresholds per readout".to_owned()),
        ("DSNU", p.sd_d, "thresholds per readout".to_owned()),
        ("threshold noise", percent(c.sigma_t, 1.0), assumed(c.sigma_t, "% of the threshold")),
        ("electrons", c.electrons_per_threshold, assumed(c.electrons_per_threshold, "per threshold")),
    ] {
        report.push_estimate(label, e.value, e.error, &unit);
    }
}

/// Returns a sentence with the number of recordings, their size in pixels and their length.
fn set_summary(c: &Calibration) -> String {
    let readouts: u64 = c.lamps.iter().map(|l| u64::from(l.readouts)).sum();
    format!(
        "{} of {}x{} pixels at {} readouts per second, {} in total, {:.2} s.",
        Count(c.lamps.len(), "recording"),
        c.sensor.geometry.width(),
        c.sensor.geometry.height(),
        c.sensor.readout_hz,
        Count(readouts, "readout"),
        readouts as f64 / c.sensor.readout_hz
    )
}

/// Plots the mean rates, and the mean of the fitted lines, as functions of the stated light.
fn linearity_figure(c: &Calibration) -> PageElement {
    let p = &c.population;
    let unsaturated = || c.lamps.iter().filter(|l| !l.is_saturated);
    let end = unsaturated().map(|l| l.stated_light).fold(0.0, f64::max);
    let line = [0.0, end].map(|light| (light, p.mean_a.value * light + p.mean_d.value));
    let largest = c.lamps.iter().filter_map(Lamp::relative_deviation).map(|d| d[0].abs()).fold(0.0, f64::max);
    let title = match c.is_nonlinear {
        true => "The rate is not linear in the light".to_owned(),
        false => format!("The rate is linear within {} %", without_error(two_digits(100.0 * largest))),
    };
    let recorded = unsaturated().map(|l| PlotPoint::new(l.stated_light, l.mean_rate, 0.0)).collect();
    Plot::new(title, LIGHT_AXIS, RATE_UNIT)
        .points("recorded", recorded)
        .line("mean of the fitted lines", line.to_vec())
        .figure(
            "Mean rate of each level below saturation. The errors of the rates are smaller than the points.",
        )
}

/// Rounds to two significant digits, for limits in titles.
fn two_digits(x: f64) -> f64 {
    format!("{x:.1e}").parse().unwrap_or(x)
}

/// Plots the deviation of each level from its stated light, and the stated uncertainty as a band.
fn residual_figure(c: &Calibration) -> PageElement {
    let mut known: Vec<(&Lamp, [f64; 2])> =
        c.lamps.iter().filter_map(|l| Some((l, l.relative_deviation()?.map(|x| 100.0 * x)))).collect();
    known.sort_by(|x, y| x.0.stated_light.total_cmp(&y.0.stated_light));
    let points =
        known.iter().map(|(l, [value, error])| PlotPoint::new(l.stated_light, *value, *error)).collect();
    let prior = |sign: f64| {
        let of = |(l, _): &(&Lamp, _)| (l.stated_light, sign * 100.0 * l.stated_uncertainty);
        known.iter().map(of).collect::<Vec<_>>()
    };
    let largest = known.iter().filter_map(|(l, _)| l.pull()).map(f64::abs).fold(0.0, f64::max);
    let title = format!("The largest deviation of a level is {largest:.1} times its stated uncertainty");
    Plot::new(title, LIGHT_AXIS, "estimated minus stated light, %")
        .band("stated uncertainty", prior(-1.0), prior(1.0))
        .points("estimated light", points)
        .rule(0.0, "")
        .log_x()
        .figure("Bars are standard errors. They include the error of the scale that all levels share, so they may exceed the scatter of the points.")
}

/// Plots the temporal variance of the rates over the mean rate, as in a photon transfer curve. Returns `None` for fewer than
/// two lit recordings of known length.
fn variance_figure(c: &Calibration) -> Option<PageElement> {
    let pixels = c.fits.iter().filter(|f| f.a.is_finite()).count().max(1) as f64;
    let usable = |l: &&Lamp| {
        l.readouts > 0
            && !l.is_saturated
            && l.mean_rate > 0.0
            && l.rate_scatter.is_finite()
            && l.rate_scatter > 0.0
    };
    let mut points: Vec<PlotPoint> = c
        .lamps
        .iter()
        .filter(usable)
        .map(|l| {
            let variance = (l.rate_scatter * l.mean_rate).powi(2) * f64::from(l.readouts);
            // The relative standard error of a robust standard deviation is 1.17 / sqrt(n), and that of its square is twice
            // as large.
            PlotPoint::new(l.mean_rate, variance, variance * 2.34 / pixels.sqrt())
        })
        .collect();
    points.sort_by(|x, y| x.x.total_cmp(&y.x));
    let (first, last) = (points.first()?.x, points.last()?.x);
    if points.len() < 2 || first >= last {
        return None;
    }
    let ratio = points.iter().map(|p| p.y / p.x).fold(0.0, f64::max);
    let title = match ratio < 1.0 {
        true => format!(
            "The noise is below that of independent spikes: at most {} of their variance",
            without_error(two_digits(ratio))
        ),
        false => format!(
            "The noise reaches {} times the variance of independent spikes",
            without_error(two_digits(ratio))
        ),
    };
    let independent = [first, (first * last).sqrt(), last].map(|x| (x, x)).to_vec();
    let plot = Plot::new(title, "mean rate, spikes per readout", "variance of the rate x readouts")
        .points("recorded", points)
        .line("independent spikes", independent)
        .log_x()
        .log_y();
    Some(plot.figure("Photon transfer curve of a spike camera: the square of the robust spread of the pixels about their lines, multiplied by the number of readouts. The lines are fitted to the same recordings, so few levels reduce the spread."))
}

/// Plots the histogram of a map with the normal distribution of its population. `variances` are the squared errors of the
/// pixels.
fn population_figure(
    name: &str,
    unit: &str,
    map: &[f64],
    (mean, sd): (Estimate, Estimate),
    variances: &[f64],
) -> PageElement {
    let bins = map_histogram(map, HISTOGRAM_BINS);
    let step = bins.get(1).map_or(1.0, |b| b.0 - bins[0].0);
    let noise = variances.iter().sum::<f64>() / variances.len().max(1) as f64;
    let spread = (sd.value.powi(2) + noise).sqrt();
    let density = |x: f64| {
        step / spread / std::f64::consts::TAU.sqrt() * (-0.5 * ((x - mean.value) / spread).powi(2)).exp()
    };
    let curve: Vec<(f64, f64)> = bins.iter().map(|b| (b.0, density(b.0))).collect();
    let plot =
        Plot::new(format!("Distribution of the {name}"), unit, "share of the pixels").bars("pixels", bins);
    let is_finite = spread > 0.0 && curve.iter().all(|p| p.1.is_finite());
    let plot = if is_finite { plot.line("normal population with fit errors", curve) } else { plot };
    plot.figure("Between the 0.1th and the 99.9th percentile. The curve has the mean and the spread of the population.")
}

/// Plots the spectra of a map along rows and columns, as in the spectrograms of EMVA 1288.
fn spectrum_figure(name: &str, unit: &str, map: &[f64], width: usize) -> PageElement {
    let [rows, columns] = pattern_spectra(map, width);
    Plot::new(format!("Spectrum of the {name}"), "frequency, cycles per pixel", unit)
        .line("along rows", rows)
        .line("along columns", columns)
        .log_y()
        .figure("Amplitude: white noise has its standard deviation at every frequency. A peak is a periodic pattern, and a rise at low frequencies is a gradient.")
}

fn population_table(c: &Calibration) -> Table {
    let p = &c.population;
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
    let gains: &[Estimate] = if c.mosaic.is_some() { &[] } else { &c.class_gains[..] };
    let classes = gains.iter().zip(cells).map(|(g, cell)| (format!("mean gain of the class {cell}"), *g));
    let rows = rows.map(|(name, e, mean)| (name.to_owned(), e, mean)).into_iter();
    let others = shares.into_iter().chain(falloff).chain(classes).filter(|(_, e)| e.value.is_finite());
    let rows = rows.chain(others.map(|(name, e)| (name, e, None)));
    let row = |(name, e, mean): (String, Estimate, Option<f64>)| {
        let value = Cell::estimate(e.value, e.error, if e.error.is_finite() { "" } else { "(assumed)" });
        let relative = |m| Cell::estimate(100.0 * e.value / m, 100.0 * e.error / m, "%");
        row![name, value, mean.map_or(Cell::from(""), relative)]
    };
    Table::new("Population of the pixels", &["quantity", "value", "relative to the mean"])
        .open()
        .with_rows(rows.map(row))
}

/// Returns the table of the channels of a mosaic.
fn channel_table(c: &Calibration) -> Table {
    let header = [
        "channel",
        "pixels",
        "relative light",
        "mean gain a",
        "PRNU, %",
        "mean dark rate d",
        "lamp deviation, %",
    ];
    let row = |channel: &ChannelFit| {
        let p = &channel.population;
        let deviation = channel.largest_light_deviation();
        row![
            channel.name.to_string(),
            channel.pixels,
            channel.light,
            p.mean_a,
            percent(p.sd_a, p.mean_a.value),
            p.mean_d,
            deviation.map_or(Cell::from("none"), |e| Cell::from(percent(e, 1.0))),
        ]
    };
    Table::new("Color filters", &header).with_rows(c.channels.iter().map(row)).with_note(
        "Relative light: light of the lamps behind the filter, divided by the light behind the filter that transmits the most. Lamp deviation: largest significant difference between the light of a level in this channel and in all channels.",
    )
}

/// Returns `e` in percent of `whole`.
fn percent(e: Estimate, whole: f64) -> Estimate {
    Estimate { value: 100.0 * e.value / whole, error: 100.0 * e.error / whole, ..e }
}

fn lamp_table(c: &Calibration) -> Table {
    let header = [
        "recording",
        "readouts",
        "stated light",
        "uncertainty, %",
        "estimated light",
        "deviation, %",
        "pull",
        "spikes per readout",
        "scatter about the lines, %",
        "verdict",
    ];
    let row = |lamp: &Lamp| {
        let readouts =
            if lamp.readouts > 0 { Cell::from(lamp.readouts as usize) } else { Cell::from("a map") };
        let [estimated, deviation, pull] = match (lamp.relative_deviation(), lamp.pull()) {
            (Some([value, error]), Some(pull)) => [
                Cell::estimate(lamp.found_light(), lamp.deviation.error, ""),
                Cell::estimate(100.0 * value, 100.0 * error, ""),
                Cell::number(pull, format!("{pull:+.1}")),
            ],
            _ => Default::default(),
        };
        row![
            &lamp.file,
            readouts,
            lamp.stated_light,
            100.0 * lamp.stated_uncertainty,
            estimated,
            deviation,
            pull,
            lamp.mean_rate,
            100.0 * lamp.rate_scatter,
            lamp_verdict(lamp),
        ]
    };
    Table::new("Light levels", &header).with_rows(c.lamps.iter().map(row)).with_note(
        "Uncertainty: standard deviation of the stated light. Pull: deviation divided by this uncertainty. Scatter: spread of the pixels about their fitted lines, relative to the mean rate.",
    )
}

/// Returns one row for each recording of several sources, and one for the curvature of the response.
fn additivity_table(additivity: &Additivity) -> Table {
    let header = ["recording", "sources", "response more than the sum, %"];
    let sums = additivity.sums.iter();
    let sums = sums.map(|sum| row![&sum.file, sum.sources.join(" + "), percent(sum.residual, 1.0)]);
    let curvature = row!["deviation from a line at full light", "", percent(additivity.curvature, 1.0)];
    Table::new("Sums of sources", &header).with_rows(sums.chain([curvature]))
}

fn lamp_verdict(lamp: &Lamp) -> String {
    let removed = if lamp.is_light_change_removed { ", removed" } else { "" };
    let text = match (lamp.stated_light == 0.0, lamp.is_saturated, lamp.is_outlier, lamp.drifts) {
        (_, true, ..) => "saturated: not estimated",
        (_, _, true, _) => "lamp off, uncertainty 30 %",
        (_, _, _, true) => return format!("drifts{removed}"),
        (true, ..) => "dark, as stated",
        _ => "as stated",
    };
    match lamp.flicker {
        Some(f) => format!("flickers at {:.1} Hz by {:.2} %{removed}", f.frequency_hz, 100.0 * f.depth),
        None => text.to_owned(),
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

fn histogram_figure(title: &str, unit: &str, map: &[f64]) -> PageElement {
    Plot::new(title, unit, "share of the pixels")
        .bars("pixels", map_histogram(map, HISTOGRAM_BINS))
        .figure("Between the 0.1th and the 99.9th percentile.")
}

/// Compares the estimator of the SCSim paper with the default estimator. Both estimators determine some of the listed
/// quantities. For the other quantities, the values of the paper's estimator depend on the limits that it sets for the
/// threshold.
fn snee_table(c: &Calibration, paper: &SneeMaps) -> Table {
    let header = ["quantity", "paper: mean", "paper: spread", "default: mean", "default: spread"];
    let p = &c.population;
    let spread_cells = |mean: f64, sd: f64| row![mean, sd];
    let unknown = || row!["not identified", ""];
    type Row<'a> = (&'a str, fn(&SneePixel) -> f64, [Cell; 2]);
    let rows: [Row<'_>; 7] = [
        ("alpha / phi = a, identified", |s| s.alpha / s.phi, spread_cells(p.mean_a.value, p.sd_a.value)),
        ("I / phi = d, identified", |s| s.dark / s.phi, spread_cells(p.mean_d.value, p.sd_d.value)),
        ("phi, relative to the nominal threshold", |s| s.phi, spread_cells(1.0, p.sigma_phi.value)),
        ("C_S, relative to the nominal capacitance", |s| s.c_s, unknown()),
        ("V_S, relative to the nominal swing", |s| s.v_s, unknown()),
        ("alpha, in nominal thresholds", |s| s.alpha, unknown()),
        ("I, in nominal thresholds", |s| s.dark, unknown()),
    ];
    Table::new("The paper's estimator (SNEE)", &header).with_rows(rows.into_iter().map(
        |(name, value, [default_mean, default_sd])| {
            let (mean, sd) = mean_and_sd(&paper.map(value));
            row![name, mean, sd, default_mean, default_sd]
        },
    ))
}

/// Explains which values of the estimator are measurements.
fn snee_text(paper: &SneeMaps) -> Vec<PageElement> {
    let edges = paper.edge_counts();
    let (low, high) = (1.0 - paper.box_half_width, 1.0 + paper.box_half_width);
    let where_to = format!(
        "Allowed thresholds: {low:.2} to {high:.2} of the nominal threshold. Pixels at the lower limit: {}; between the limits: {}; at the upper limit: {}; without a solution: {}.",
        edges.at_lower_edge, edges.between_edges, edges.at_upper_edge, edges.unsolved
    );
    vec![
        PageElement::heading("The paper's estimator (SNEE)"),
        PageElement::text(
            "As a linear program in (phi, alpha, I), the objective, the sum over the levels of |N phi - (alpha mu + I) T|, scales with all three variables. Without limits, all three variables are zero at the optimum. With limits, the threshold of every pixel with nonzero residuals is at the lower limit. The threshold, the absolute values of alpha and I, and the split of phi into C_S and V_S therefore depend on the limits and are not measurements. Only the ratios alpha / phi and I / phi are measurements.",
        ),
        PageElement::text(where_to),
    ]
}
