//! `report.html` of a calibration.

use crate::calibrate::formulas::fit::PixelFit;
use crate::calibrate::population::mean_and_sd;
use crate::calibrate::result::Calibration;
use crate::calibrate::snee::{Snee, SneeMaps};
use crate::error::Result;
use crate::measure::finite;
use crate::report::{Curve, Part, Table, bars, heat_map, page as render};

/// The page of a calibration.
///
/// # Errors
/// When a plot cannot be made.
pub fn page(c: &Calibration) -> Result<String> {
    let width = c.sensor.geometry.width();
    let map = |of: fn(&PixelFit) -> f64| c.fits.iter().map(of).collect::<Vec<f64>>();
    let (a, d) = (map(|f| f.a), map(|f| f.d));
    let mut parts = vec![
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
        Part::heading("Light levels"),
        Part::Table(levels(c)),
    ];
    if let Some(paper) = &c.paper {
        parts.extend(beside(c, paper)?);
    }
    render("Calibration", &parts)
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
    let mut table =
        Table::new(&["recording", "light stated", "found", "difference", "standard error", "verdict"]);
    for lamp in &c.levels {
        let relative = |x: f64| format!("{:.3} %", 100.0 * x / lamp.stated);
        let cells = match (lamp.stated == 0.0, lamp.saturated) {
            (true, _) => ["0".to_owned(), String::new(), String::new(), "dark, by what is stated".to_owned()],
            (_, true) => [String::new(), String::new(), String::new(), "saturated: not told".to_owned()],
            _ => [
                format!("{:.5}", lamp.found()),
                relative(lamp.deviation.value),
                relative(lamp.deviation.error),
                if lamp.wrong { "off, and left out of the scale" } else { "as stated" }.to_owned(),
            ],
        };
        table.row([lamp.file.clone(), format!("{:.5}", lamp.stated)].into_iter().chain(cells));
    }
    table
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
