//! Benchmark of the calibration. Its table is part of docs/why/calibration.md.
//!
//! The simulated camera has known parameters. For the default estimator and for the estimator of the SCSim paper, the
//! table lists the run time and the errors of `a` and `d`. `a` is the gain of a pixel in thresholds per readout at full
//! light. `d` is the dark rate of a pixel in thresholds per readout.
//!
//! `cargo bench --bench calibrate -- WIDTH HEIGHT READOUTS...` prints the table for one sensor size. Without arguments,
//! the benchmark runs half an hour and writes the table for all sensor sizes into docs/why/calibration.md.

#[path = "../tests/calibrate_support/mod.rs"]
mod calibrate_support;

use calibrate_support::score::{Line, Score, mean_and_sd, observations, score};
use calibrate_support::{PUBLISHED_NOISE, Pixel, pixels};
use spikelane_calibrate::{CalibrateOptions, Calibration, SneeOptions, calibrate, estimate_snee};

/// Width and height in pixels and number of readouts, for each row of the table in docs/why/calibration.md.
const PAGE_ROWS: [(u32, u32, u32); 3] = [(400, 250, 1_000), (400, 250, 10_000), (64, 40, 100_000)];
const BEGIN: &str = "<!-- begin: cargo bench --bench calibrate -->\n";
const END: &str = "<!-- end -->\n";

const HEAD: &str =
    "| pixels | readouts | default: RMSE a / d | over the bound (thresholds known) | coverage of 95 % \
| paper's: RMSE a / d | over the bound | on the box |
|---|---|---|---|---|---|---|---|
";

fn best_errors(s: &Score) -> String {
    format!("{:.4} % / {:.3} %", 100.0 * s.rmse[0], 100.0 * s.rmse[1] / PUBLISHED_NOISE.dark)
}

const POPULATION: &str = "
| pixels | readouts | mean a | spread of a | mean d | spread of d | spread of thresholds | threshold noise | photons at full light |
|---|---|---|---|---|---|---|---|---|
";

/// Returns a row of the population table. Fitted means and spreads are compared with the means and spreads of the
/// simulated pixels. Fitted noise is compared with the noise parameters of the simulation.
fn population_rows(found: &Calibration, truth: &[Pixel], name: &str) -> String {
    let (mean_a, sd_a) = mean_and_sd(truth.iter().map(Pixel::a));
    let (mean_d, sd_d) = mean_and_sd(truth.iter().map(Pixel::d));
    let p = &found.population;
    let off = [(p.mean_a, mean_a), (p.sd_a, sd_a), (p.mean_d, mean_d), (p.sd_d, sd_d)]
        .map(|(e, truth)| format!("{:+.4} %", 100.0 * (e.value / truth - 1.0)));
    let (phi, noise, k) = (p.sigma_phi, found.sigma_t, found.photons_at_full_light);
    let error = if k.error.is_nan() { "assumed".to_owned() } else { format!("\u{b1} {:.0}", k.error) };
    format!(
        "| {name} | {} | {:.3} % \u{b1} {:.3} % for {:.3} % | {:.4} % \u{b1} {:.4} % for {:.4} % | {:.0} {error} for {:.0} |\n",
        off.join(" | "),
        100.0 * phi.value,
        100.0 * phi.error,
        100.0 * PUBLISHED_NOISE.threshold_sd,
        100.0 * noise.value,
        100.0 * noise.error,
        100.0 * PUBLISHED_NOISE.sigma_t,
        k.value,
        PUBLISHED_NOISE.photons,
    )
}

fn rows(width: u32, height: u32, readouts: u32) -> [String; 2] {
    let name = format!("{width}x{height} | {readouts}");
    let truth: Vec<Pixel> = pixels(&PUBLISHED_NOISE, (width * height) as usize, 9);
    let observed = observations(&PUBLISHED_NOISE, &truth, width, readouts);
    let found = calibrate(&observed, &CalibrateOptions::default()).expect("a calibration");
    let lines: Vec<Line> = found.fits.iter().map(|f| [f.a, f.d, f.var_a, f.var_d]).collect();
    let own = score(&PUBLISHED_NOISE, &truth, &lines, readouts);
    let paper = estimate_snee(&observed, &SneeOptions::default()).expect("the paper's estimator");
    let nothing = [f64::NAN; 4];
    let lines: Vec<Line> = paper
        .pixels
        .iter()
        .map(|s| s.map_or(nothing, |s| [s.alpha / s.phi, s.dark / s.phi, f64::NAN, f64::NAN]))
        .collect();
    let theirs = score(&PUBLISHED_NOISE, &truth, &lines, readouts);
    let row = format!(
        "| {name} | {} | {:.2} / {:.2} ({:.2} / {:.2}) | {:.1} % / {:.1} % | {} | {:.0} / {:.0} | {:.1} % |\n",
        best_errors(&own),
        own.ratio[0],
        own.ratio[1],
        own.ratio_known[0],
        own.ratio_known[1],
        100.0 * own.coverage[0],
        100.0 * own.coverage[1],
        best_errors(&theirs),
        theirs.ratio[0],
        theirs.ratio[1],
        100.0 * paper.edge_counts().edge_share(),
    );
    [row, population_rows(&found, &truth, &name)]
}

fn main() {
    let numbers: Vec<u32> = std::env::args().skip(1).filter_map(|a| a.parse().ok()).collect();
    let sizes = match numbers[..] {
        [] => PAGE_ROWS.to_vec(),
        [width, height, ref lengths @ ..] => lengths.iter().map(|n| (width, height, *n)).collect(),
        _ => panic!("WIDTH HEIGHT READOUTS... or nothing"),
    };
    let mut tables = [HEAD.to_owned(), POPULATION.to_owned()];
    for (width, height, readouts) in sizes {
        for (table, row) in tables.iter_mut().zip(rows(width, height, readouts)) {
            eprint!("{row}");
            *table += &row;
        }
    }
    let table = tables.concat();
    print!("{table}");
    if numbers.is_empty() {
        write_into_page(&table);
    }
}

fn write_into_page(table: &str) {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/why/calibration.md");
    let page = std::fs::read_to_string(path).expect("the page");
    let (before, rest) = page.split_once(BEGIN).expect("the mark of the table's begin");
    let (_, after) = rest.split_once(END).expect("the mark of the table's end");
    std::fs::write(path, format!("{before}{BEGIN}{table}{END}{after}")).expect("the page to be written");
}
