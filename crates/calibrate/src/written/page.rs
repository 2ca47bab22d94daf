//! `report.html` of a calibration.

use crate::formulas::fit::PixelFit;
use crate::population::mean_and_sd;
use crate::result::{Calibration, Lamp};
use crate::snee::{Snee, SneeMaps};
use spikelane::error::Result;
use spikelane_measure::finite;
use spikelane_measure::report::{Band, Curve, Part, Table, bars, heat_map, marked, page as render, today};

/// The page of a calibration.
///
/// # Errors
/// When a plot cannot be made.
pub fn page(c: &Calibration) -> Result<String> {
    let width = c.sensor.geometry.width();
    let map = |of: fn(&PixelFit) -> f64| c.fits.iter().map(of).collect::<Vec<f64>>();
    let (a, d) = (map(|f| f.a), map(|f| f.d));
    let mut parts = vec![
        Part::text(about(c)),
        Part::text(c.verdict()),
        Part::List { items: c.cautions() },
        Part::heading("Light levels"),
        linearity(c)?,
        residuals(c)?,
        Part::Table(levels(c)),
        Part::heading("Population"),
        Part::Table(population(c)),
        Part::heading("What the recordings could and could not tell"),
        Part::List { items: c.notes.clone() },
        Part::heading("Defects"),
        Part::text(defects(c)),
        Part::heading("Maps"),
        Part::figure(heat_map(&a, width, "map of a")?, "Gain a, 1st to 99th percentile; red: unknown."),
        Part::figure(heat_map(&d, width, "map of d")?, "Dark rate d, likewise."),
        histogram("Gain a", "thresholds per readout at full light", &a)?,
        histogram("Dark rate d", "thresholds per readout", &d)?,
    ];
    if let Some(paper) = &c.paper {
        parts.extend(beside(c, paper)?);
    }
    Ok(render("Calibration", &parts))
}

/// What was recorded.
fn about(c: &Calibration) -> String {
    let readouts: u64 = c.levels.iter().map(|l| u64::from(l.readouts)).sum();
    format!(
        "{} recordings of {}x{} pixels at {} readouts a second, {readouts} readouts in all, {:.2} s. Made on {}.",
        c.levels.len(),
        c.sensor.geometry.width(),
        c.sensor.geometry.height(),
        c.sensor.readout_hz,
        readouts as f64 / c.sensor.readout_hz,
        today()
    )
}

/// Mean rates over the light as it was stated, and the mean of the pixels' lines.
fn linearity(c: &Calibration) -> Result<Part> {
    let p = &c.population;
    let told = || c.levels.iter().filter(|l| !l.saturated);
    let end = told().map(|l| l.stated).fold(0.0, f64::max);
    let line = [0.0, end].map(|light| (light, p.mean_a.value * light + p.mean_d.value));
    let plot = marked(
        "Linearity",
        ("light as stated, of what saturates", "spikes a readout"),
        &[
            Curve { name: "mean of the lines", points: line.to_vec() },
            Curve { name: "recorded", points: told().map(|l| (l.stated, l.rate)).collect() },
        ],
        None,
    )?;
    Ok(Part::figure(
        plot,
        "Mean rate of each level that does not saturate, over the light that the set states.",
    ))
}

/// How far each level lies off what is stated, with two standard errors.
fn residuals(c: &Calibration) -> Result<Part> {
    let known: Vec<(f64, [f64; 2])> =
        c.levels.iter().filter_map(|l| Some((l.stated, l.relative()?.map(|x| 100.0 * x)))).collect();
    let at = |errors: f64| known.iter().map(|(x, [value, error])| (*x, value + errors * error)).collect();
    let band = Band { name: "two errors", low: at(-2.0), high: at(2.0) };
    let plot = marked(
        "Light found, less what is stated",
        ("light as stated, of what saturates", "%"),
        &[Curve { name: "found", points: at(0.0) }],
        Some(&band),
    )?;
    let caption = "Residuals from the line of all levels. The errors hold the scale that all levels share, so that they may be wider than the points scatter.";
    Ok(Part::figure(plot, caption))
}

fn population(c: &Calibration) -> Table {
    let p = &c.population;
    let mut table = Table::new(&["quantity", "value", "standard error", "relative to the mean"]);
    let (a, d) = (p.mean_a.value, p.mean_d.value);
    let rows = [
        ("mean gain a (thresholds per readout at full light)", p.mean_a, None),
        ("PRNU: spread of a", p.sd_a, Some(a)),
        ("mean dark rate d (thresholds per readout)", p.mean_d, None),
        ("DSNU: spread of d", p.sd_d, Some(d)),
        ("spread of thresholds", p.sigma_phi, Some(1.0)),
        ("threshold noise, of the threshold", c.sigma_t, Some(1.0)),
        ("electrons per spike", c.electrons, None),
    ];
    for (name, e, mean) in rows {
        let digits = if e.value >= 100.0 { 0 } else { 6 };
        let error = if e.error.is_finite() { format!("{:.2e}", e.error) } else { "assumed".to_owned() };
        let relative = mean.map_or(String::new(), |m| format!("{:.3} %", 100.0 * e.value / m));
        table.row([name.to_owned(), format!("{:.digits$}", e.value), error, relative]);
    }
    table
}

fn levels(c: &Calibration) -> Table {
    let mut table = Table::new(&[
        "recording",
        "readouts",
        "light stated",
        "found",
        "difference",
        "standard error",
        "spikes a readout",
        "pixels about their lines",
        "verdict",
    ]);
    let percent = |x: f64| format!("{:.3} %", 100.0 * x);
    for lamp in &c.levels {
        let readouts = if lamp.readouts > 0 { lamp.readouts.to_string() } else { "a map".to_owned() };
        let [found, difference, error] = match lamp.relative() {
            Some([value, error]) => [format!("{:.5}", lamp.found()), percent(value), percent(error)],
            None => [String::new(), String::new(), String::new()],
        };
        let stated = format!("{:.5}", lamp.stated);
        let own = [lamp.file.clone(), readouts, stated, found, difference, error];
        let fitted = [format!("{:.5}", lamp.rate), percent(lamp.scatter), judged(lamp).to_owned()];
        table.row(own.into_iter().chain(fitted));
    }
    table
}

fn judged(lamp: &Lamp) -> &'static str {
    match (lamp.stated == 0.0, lamp.saturated, lamp.wrong, lamp.drifts) {
        (_, true, ..) => "saturated: not told",
        (_, _, true, _) => "off, and left out of the scale",
        (_, _, _, true) => "drifts",
        (true, ..) => "dark, by what is stated",
        _ => "as stated",
    }
}

fn defects(c: &Calibration) -> String {
    format!(
        "Dead pixels: {}. Hot pixels: {}. Pixels whose levels do not lie on a line, fitted by least absolute deviations: {}. Median chi-square per degree of freedom: {}.",
        c.dead.len(),
        c.hot.len(),
        c.misfits.len(),
        c.chi2_per_freedom().map_or("unknown".to_owned(), |x| format!("{x:.3}"))
    )
}

fn histogram(title: &str, unit: &str, map: &[f64]) -> Result<Part> {
    let plot = bars(title, unit, &[Curve { name: "pixels", points: bins(map) }])?;
    Ok(Part::figure(plot, "Share of the pixels, between the 0.1th and the 99.9th percentile."))
}

/// The paper's estimator beside the default one: what both know, and what only its box decides.
fn beside(c: &Calibration, paper: &SneeMaps) -> Result<Vec<Part>> {
    let mut table = Table::new(&["quantity", "paper's: mean", "spread", "default: mean", "spread"]);
    let p = &c.population;
    let cells = |of: fn(&Snee) -> f64| {
        let (mean, sd) = mean_and_sd(&paper.map(of));
        [format!("{mean:.5}"), format!("{sd:.5}")]
    };
    let mut row = |name: &str, of: fn(&Snee) -> f64, own: [String; 2]| {
        table.row(std::iter::once(name.to_owned()).chain(cells(of)).chain(own));
    };
    let own = |mean: f64, sd: f64| [format!("{mean:.5}"), format!("{sd:.5}")];
    let unknown = || ["not identified".to_owned(), String::new()];
    row("alpha / phi = a, identified", |s| s.alpha / s.phi, own(p.mean_a.value, p.sd_a.value));
    row("I / phi = d, identified", |s| s.dark / s.phi, own(p.mean_d.value, p.sd_d.value));
    row("phi, of the nominal threshold", |s| s.phi, own(1.0, p.sigma_phi.value));
    row("C_S, of the nominal capacitance", |s| s.c_s, unknown());
    row("V_S, of the nominal swing", |s| s.v_s, unknown());
    row("alpha, nominal thresholds", |s| s.alpha, unknown());
    row("I, nominal thresholds", |s| s.dark, unknown());
    let edges = paper.edges();
    let (low, high) = (1.0 - paper.box_width, 1.0 + paper.box_width);
    let where_to = format!(
        "Thresholds were held between {low:.2} and {high:.2} of nominal. Pixels on the lower edge: {}; inside: {}; on the upper edge: {}; not solved: {}.",
        edges.lower, edges.inside, edges.upper, edges.failed
    );
    Ok(vec![
        Part::heading("The paper's estimator (SNEE)"),
        Part::text(
            "As a linear program in (phi, alpha, I) the objective, the sum over the levels of |N phi - (alpha mu + I) T|, shrinks in proportion when all three shrink together. So without a bound its optimum is zero for all three, and with a box the threshold of a pixel whose residuals are not zero lies on the lower edge: its position, and with it the absolute alpha and I and the split of phi into C_S and V_S, is the box and not a measurement. Only the ratios alpha / phi and I / phi are.",
        ),
        Part::text(where_to),
        Part::Table(table),
        histogram("Thresholds of the paper's estimator", "of the nominal threshold", &paper.map(|s| s.phi))?,
    ])
}

/// 60 bins between the 0.1th and the 99.9th percentile: centre and share.
fn bins(map: &[f64]) -> Vec<(f64, f64)> {
    let mut sorted = finite(map);
    sorted.sort_by(f64::total_cmp);
    let at = |share: f64| sorted.get((share * sorted.len() as f64) as usize).copied().unwrap_or(0.0);
    // A map of one value still has a width.
    let (low, high) = (at(0.001), at(0.999).max(at(0.001) * (1.0 + 1e-3) + 1e-9));
    let step = (high - low) / 60.0;
    let mut bins = [0.0; 60];
    for x in sorted.iter().filter(|x| (low..=high).contains(*x)) {
        bins[(((x - low) / step) as usize).min(59)] += 1.0 / sorted.len() as f64;
    }
    bins.iter().enumerate().map(|(i, n)| (low + (i as f64 + 0.5) * step, *n)).collect()
}
