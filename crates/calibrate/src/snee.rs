//! SNEE, the estimator of the SCSim paper (arXiv 2405.16790), as it is stated.
//!
//! Per pixel it minimises `sum_k |N_k phi - (alpha mu_k + I) T_k|`. The product
//! `phi = (C + C_S)(V_d + V_S)` is bilinear, so the linear program is solved in
//! `(phi, alpha, I)`, with `phi` held within a box about the nominal threshold, by an interior-point
//! method, and `phi` is split by least `(C_S/sigma_C)^2 + (V_S/sigma_V)^2`.
//!
//! The objective is homogeneous of degree one: shrinking all three unknowns together
//! shrinks it, so `phi` ends on the lower side of the box wherever the residuals are not
//! zero. [`SneeMaps::edges`] counts those pixels; what the paper reports as the spread of
//! `C_S` and `V_S` is then the box.

use crate::sets::observed::Observed;
#[cfg(feature = "snee")]
use clarabel::algebra::CscMatrix;
#[cfg(feature = "snee")]
use clarabel::solver::{DefaultSettings, DefaultSolver, IPSolver, SolverStatus, SupportedConeT};
use spikelane::error::{Error, Kind, Result};
use spikelane::unstable::threads;

/// What the paper's estimator is told.
#[derive(Clone, Copy, Debug)]
pub struct SneeOptions {
    /// How far `phi` may lie from 1, its nominal value.
    pub box_width: f64,
    /// Relative spread of the capacitance, for the split.
    pub sigma_c: f64,
    /// Relative spread of the threshold voltage, for the split.
    pub sigma_v: f64,
    /// Whether light levels are known; otherwise the conversion rate comes from the dynamic
    /// range: the brightest light given is taken to fire the mean pixel at its highest mean rate.
    pub levels_known: bool,
}

impl Default for SneeOptions {
    fn default() -> Self {
        Self { box_width: 0.2, sigma_c: 0.0128 / 4.348, sigma_v: 0.0497 / 1.0924, levels_known: true }
    }
}

impl SneeOptions {
    /// Refuses what cannot be run, before anything is counted.
    ///
    /// # Errors
    /// [`Kind::Usage`] when the box is not between 0 and 1, or the build lacks the feature `snee`.
    pub fn check(&self) -> Result<()> {
        Error::require("the paper's estimator", "snee", cfg!(feature = "snee"))?;
        if !(self.box_width > 0.0 && self.box_width < 1.0) {
            return Err(Error::new(Kind::Usage, "box of the threshold")
                .found(self.box_width)
                .expected("between 0 and 1"));
        }
        Ok(())
    }
}

/// The estimator's result for one pixel, all relative to nominal values.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Snee {
    /// Threshold over the nominal one.
    pub phi: f64,
    /// Conversion rate: nominal thresholds per readout at full light.
    pub alpha: f64,
    /// Dark current: nominal thresholds per readout.
    pub dark: f64,
    /// `C_S` over the nominal capacitance.
    pub c_s: f64,
    /// `V_S` over the nominal swing.
    pub v_s: f64,
}

/// The estimator's maps.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct SneeMaps {
    /// Per pixel, row-major; `None` where the solver gave up.
    pub pixels: Vec<Option<Snee>>,
    /// The box of the threshold: its half width about 1.
    pub box_width: f64,
    /// Factor that was applied to the light, 1 when levels are known.
    pub light_scale: f64,
}

/// Where the thresholds of the paper's estimator lie in their box: numbers of pixels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
#[non_exhaustive]
pub struct Edges {
    /// On the lower edge.
    pub lower: usize,
    /// Between the edges.
    pub inside: usize,
    /// On the upper edge.
    pub upper: usize,
    /// Not solved.
    pub failed: usize,
}

impl Edges {
    /// Share of the solved pixels that lie on an edge.
    #[must_use]
    pub fn share(&self) -> f64 {
        let edge = self.lower + self.upper;
        edge as f64 / (edge + self.inside).max(1) as f64
    }
}

/// How near an edge counts as on it: the solver's tolerance is 1e-8 of an objective that is flat along the box.
const ON_EDGE: f64 = 1e-4;

impl SneeMaps {
    /// How many thresholds lie on the edges of the box.
    #[must_use]
    pub fn edges(&self) -> Edges {
        let mut edges = Edges::default();
        for pixel in &self.pixels {
            let place = match pixel.map(|s| s.phi - 1.0) {
                None => &mut edges.failed,
                Some(x) if x < ON_EDGE - self.box_width => &mut edges.lower,
                Some(x) if x > self.box_width - ON_EDGE => &mut edges.upper,
                Some(_) => &mut edges.inside,
            };
            *place += 1;
        }
        edges
    }

    /// One number of every pixel; NaN where the solver gave up.
    #[must_use]
    pub fn map(&self, of: fn(&Snee) -> f64) -> Vec<f64> {
        self.pixels.iter().map(|p| p.as_ref().map_or(f64::NAN, of)).collect()
    }
}

/// Runs the paper's estimator on the levels of `observed` that are streams.
///
/// # Errors
/// When fewer than three levels are there, the box is not between 0 and 1, or the build lacks the feature `snee`.
pub fn snee(observed: &Observed, options: &SneeOptions) -> Result<SneeMaps> {
    options.check()?;
    let levels: Vec<_> = observed.levels.iter().filter(|l| l.readouts > 0).collect();
    if levels.len() < 3 || levels.iter().all(|l| l.light == 0.0) {
        return Err(Error::new(Kind::Input, "levels for the paper's estimator")
            .found(levels.len())
            .expected("three or more streams; the paper has 25, grey 0, 10, ... 240"));
    }
    let count = |l: &crate::sets::observed::Level, p: usize| f64::from(l.spikes[p]) / f64::from(l.readouts);
    let pixels = observed.geometry.pixels();
    let mean =
        |l: &crate::sets::observed::Level| (0..pixels).map(|p| count(l, p)).sum::<f64>() / pixels as f64;
    let light_scale = match (options.levels_known, levels.first(), levels.last()) {
        (false, Some(darkest), Some(brightest)) => {
            (mean(brightest) - mean(darkest)) / (brightest.light - darkest.light)
        }
        _ => 1.0,
    };
    let lights: Vec<f64> = levels.iter().map(|l| l.light * light_scale).collect();
    let of_pixel = |p: usize| {
        let rates: Vec<f64> = levels.iter().map(|l| count(l, p)).collect();
        solve(&rates, &lights, options)
    };
    let pixels: Vec<Option<Snee>> = threads::map(0..pixels, of_pixel);
    Ok(SneeMaps { pixels, box_width: options.box_width, light_scale })
}

/// No pixel is solved without the solver, and [`SneeOptions::check`] has said so.
#[cfg(not(feature = "snee"))]
fn solve(_: &[f64], _: &[f64], _: &SneeOptions) -> Option<Snee> {
    None
}

/// Unknowns `phi, alpha, dark`, then one slack per level: `|residual_k| <= slack_k`.
#[cfg(feature = "snee")]
fn solve(rates: &[f64], lights: &[f64], options: &SneeOptions) -> Option<Snee> {
    let k = rates.len();
    let n = 3 + k;
    let rows = 2 * k + 2;
    let mut triplets: (Vec<usize>, Vec<usize>, Vec<f64>) = Default::default();
    let mut set = |row: usize, column: usize, value: f64| {
        triplets.0.push(row);
        triplets.1.push(column);
        triplets.2.push(value);
    };
    for (i, (rate, light)) in rates.iter().zip(lights).enumerate() {
        for (row, sign) in [(2 * i, 1.0), (2 * i + 1, -1.0)] {
            set(row, 0, sign * rate);
            set(row, 1, -sign * light);
            set(row, 2, -sign);
            set(row, 3 + i, -1.0);
        }
    }
    set(2 * k, 0, 1.0);
    set(2 * k + 1, 0, -1.0);
    let a = CscMatrix::new_from_triplets(rows, n, triplets.0, triplets.1, triplets.2);
    let mut b = vec![0.0; rows];
    b[2 * k] = 1.0 + options.box_width;
    b[2 * k + 1] = options.box_width - 1.0;
    let mut q = vec![0.0; n];
    q[3..].fill(1.0);
    let settings = DefaultSettings { verbose: false, max_iter: 100, ..DefaultSettings::default() };
    let cones = [SupportedConeT::NonnegativeConeT(rows)];
    let mut solver = DefaultSolver::new(&CscMatrix::zeros((n, n)), &q, &a, &b, &cones, settings).ok()?;
    solver.solve();
    if !matches!(solver.solution.status, SolverStatus::Solved | SolverStatus::AlmostSolved) {
        return None;
    }
    let x = &solver.solution.x;
    let (c_s, v_s) = split(x[0], options.sigma_c, options.sigma_v);
    Some(Snee { phi: x[0], alpha: x[1], dark: x[2], c_s, v_s })
}

/// The shortest `(c/sigma_c)^2 + (v/sigma_v)^2` with `(1 + c)(1 + v) = phi`, by Newton's method on
/// the stationary point in `c`: `c (1 + c) sigma_v^2 = v (1 + v) sigma_c^2`.
#[cfg(feature = "snee")]
fn split(phi: f64, sigma_c: f64, sigma_v: f64) -> (f64, f64) {
    let (cc, vv) = (sigma_c * sigma_c, sigma_v * sigma_v);
    let mut c = (phi - 1.0) * cc / (cc + vv);
    for _ in 0..20 {
        let v = phi / (1.0 + c) - 1.0;
        let slope = -(1.0 + v) / (1.0 + c);
        let value = c * (1.0 + c) * vv - v * (1.0 + v) * cc;
        c -= value / ((1.0 + 2.0 * c) * vv - (1.0 + 2.0 * v) * slope * cc);
    }
    (c, phi / (1.0 + c) - 1.0)
}

#[cfg(all(test, feature = "snee"))]
mod tests {
    use super::*;

    #[test]
    fn the_split_multiplies_back_and_the_objective_lands_on_its_box() {
        let (c, v) = split(1.1, 0.003, 0.045);
        assert!(((1.0 + c) * (1.0 + v) - 1.1).abs() < 1e-12 && c.abs() < 0.01 * v);
        let lights: Vec<f64> = (0..25).map(|k| f64::from(10 * k) / 255.0).collect();
        // Rates with the rounding of a count, so that residuals are not zero.
        let rates: Vec<f64> =
            lights.iter().map(|l| ((0.95 * l + 0.0047) * 1000.0).floor() / 1000.0).collect();
        let found = solve(&rates, &lights, &SneeOptions::default()).unwrap();
        assert!((found.phi - 0.8).abs() < 1e-4, "{found:?}");
        assert!((found.alpha / found.phi - 0.95).abs() < 0.01, "{found:?}");
    }
}
