//! SNEE, the estimator of the SCSim paper (arXiv 2405.16790), implemented as the paper describes it.
//!
//! For each pixel the estimator minimizes `sum_k |N_k phi - (alpha mu_k + I) T_k|` over `phi`, `alpha` and `I`:
//!
//! * `N_k` and `T_k`: number of spikes and number of readouts of level `k`.
//! * `mu_k`: light of level `k`. Light 1 is full light.
//! * `phi = (C + C_S)(V_d + V_S)`: threshold charge, divided by the nominal threshold charge. `C` and `V_d` are the
//!   nominal capacitance and swing. `C_S` and `V_S` are the deviations of the pixel, divided by `C` and `V_d`.
//! * `alpha`: conversion rate in nominal thresholds per readout at full light.
//! * `I`: dark current in nominal thresholds per readout.
//!
//! `phi` is a product of two unknowns. The linear program is therefore solved for `(phi, alpha, I)` by an interior-point
//! method, and `phi` is limited to a box around the nominal threshold. Afterward `phi` is split into `C_S` and `V_S`. The
//! split minimizes `(C_S/sigma_C)^2 + (V_S/sigma_V)^2`. `sigma_C` and `sigma_V` are the relative spreads of capacitance
//! and threshold voltage.
//!
//! The objective is homogeneous of degree one: multiplying all three unknowns by a factor multiplies the objective by the
//! same factor. If the residuals are not zero, the minimum is therefore at the lower edge of the box of `phi`.
//! [`SneeMaps::edge_counts`] counts the pixels at an edge. For these pixels, only the box determines the spread of `C_S`
//! and `V_S` that the paper reports.

use crate::recordings::observations::Observations;
#[cfg(feature = "snee")]
use clarabel::algebra::CscMatrix;
#[cfg(feature = "snee")]
use clarabel::solver::{DefaultSettings, DefaultSolver, IPSolver, SolverStatus, SupportedConeT};
use spikelane::error::{Error, ErrorKind, Result};
use spikelane::unstable::threads;

/// Options of the estimator of the paper.
#[derive(Clone, Copy, Debug)]
pub struct SneeOptions {
    /// Half width of the box, which is the range of allowed thresholds `phi`. The box is centered at the nominal
    /// threshold 1.
    pub box_half_width: f64,
    /// Relative spread of the capacitance. It is used to split `phi`.
    pub sigma_c: f64,
    /// Relative spread of the threshold voltage. It is used to split `phi`.
    pub sigma_v: f64,
    /// Whether the light levels are known.
    ///
    /// If false, the light is scaled to the dynamic range. Between the darkest and the brightest level, one unit of light
    /// then adds one spike per readout to the average pixel.
    pub has_known_levels: bool,
}

impl Default for SneeOptions {
    fn default() -> Self {
        Self {
            box_half_width: 0.2,
            sigma_c: 0.0128 / 4.348,
            sigma_v: 0.0497 / 1.0924,
            has_known_levels: true,
        }
    }
}

impl SneeOptions {
    /// Checks the options. Call this method before the recordings are read.
    ///
    /// # Errors
    /// [`ErrorKind::Usage`] if the half width of the box is not between 0 and 1, or if the library was built without the
    /// feature `snee`.
    pub fn check(&self) -> Result<()> {
        Error::require_feature("the paper's estimator", "snee", cfg!(feature = "snee"))?;
        if !(self.box_half_width > 0.0 && self.box_half_width < 1.0) {
            return Err(Error::new(ErrorKind::Usage, "box of the threshold")
                .found(self.box_half_width)
                .expected("between 0 and 1"));
        }
        Ok(())
    }
}

/// The estimate for one pixel, divided by nominal values.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct SneePixel {
    /// Threshold, divided by the nominal threshold.
    pub phi: f64,
    /// Conversion rate in nominal thresholds per readout at full light.
    pub alpha: f64,
    /// Dark current in nominal thresholds per readout.
    pub dark: f64,
    /// Deviation of the capacitance, divided by the nominal capacitance.
    pub c_s: f64,
    /// Deviation of the threshold voltage, divided by the nominal swing.
    pub v_s: f64,
}

/// The estimates for all pixels.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct SneeMaps {
    /// One estimate per pixel, row-major. `None` if the solver failed for the pixel.
    pub pixels: Vec<Option<SneePixel>>,
    /// Half width of the box of `phi`. The box is centered at 1.
    pub box_half_width: f64,
    /// Factor that multiplies the light. It is 1 if the levels are known.
    pub light_scale: f64,
}

/// Numbers of pixels whose threshold is at an edge of the box of allowed thresholds, inside the box, or without a
/// solution.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
#[non_exhaustive]
pub struct EdgeCounts {
    /// Number of pixels whose threshold is at the lower edge.
    pub at_lower_edge: usize,
    /// Number of pixels whose threshold is between the edges.
    pub between_edges: usize,
    /// Number of pixels whose threshold is at the upper edge.
    pub at_upper_edge: usize,
    /// Number of pixels without a solution.
    pub unsolved: usize,
}

impl EdgeCounts {
    /// Returns the share of the solved pixels whose threshold is at an edge of the box of allowed thresholds.
    #[must_use]
    pub fn edge_share(&self) -> f64 {
        let edge = self.at_lower_edge + self.at_upper_edge;
        edge as f64 / (edge + self.between_edges).max(1) as f64
    }
}

/// A threshold counts as at an edge of the box if its distance from the edge is smaller than this value. The solver's
/// tolerance of 1e-8 limits only the error of the objective, and the objective is nearly constant within the box.
const EDGE_TOLERANCE: f64 = 1e-4;

impl SneeMaps {
    /// Returns the number of thresholds at each edge and inside the box.
    #[must_use]
    pub fn edge_counts(&self) -> EdgeCounts {
        let mut edges = EdgeCounts::default();
        for pixel in &self.pixels {
            let place = match pixel.map(|s| s.phi - 1.0) {
                None => &mut edges.unsolved,
                Some(x) if x < EDGE_TOLERANCE - self.box_half_width => &mut edges.at_lower_edge,
                Some(x) if x > self.box_half_width - EDGE_TOLERANCE => &mut edges.at_upper_edge,
                Some(_) => &mut edges.between_edges,
            };
            *place += 1;
        }
        edges
    }

    /// Returns the map of one quantity. An entry is NaN if the solver failed for the pixel.
    #[must_use]
    pub fn map(&self, quantity: fn(&SneePixel) -> f64) -> Vec<f64> {
        self.pixels.iter().map(|p| p.as_ref().map_or(f64::NAN, quantity)).collect()
    }
}

/// Runs the estimator of the SCSim paper on the levels of `observed` that were measured from streams.
///
/// # Errors
/// * [`ErrorKind::Input`] if there are fewer than three streams or no lit level.
/// * If the options are invalid. See [`SneeOptions::check`].
pub fn estimate_snee(observed: &Observations, options: &SneeOptions) -> Result<SneeMaps> {
    options.check()?;
    let levels: Vec<_> = observed.levels.iter().filter(|l| l.readouts > 0).collect();
    if levels.len() < 3 || levels.iter().all(|l| l.light == 0.0) {
        return Err(Error::new(ErrorKind::Input, "levels for the paper's estimator")
            .found(levels.len())
            .expected("at least three streams; the paper uses 25, gray 0, 10, ... 240"));
    }
    let count = |l: &crate::recordings::observations::LightLevel, p: usize| {
        f64::from(l.spikes[p]) / f64::from(l.readouts)
    };
    let pixels = observed.geometry.pixels();
    let mean = |l: &crate::recordings::observations::LightLevel| {
        (0..pixels).map(|p| count(l, p)).sum::<f64>() / pixels as f64
    };
    let light_scale = match (options.has_known_levels, levels.first(), levels.last()) {
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
    let pixels: Vec<Option<SneePixel>> = threads::map(0..pixels, of_pixel);
    Ok(SneeMaps { pixels, box_half_width: options.box_half_width, light_scale })
}

/// Returns `None`. This build has no solver, and [`SneeOptions::check`] has already returned an error.
#[cfg(not(feature = "snee"))]
fn solve(_: &[f64], _: &[f64], _: &SneeOptions) -> Option<SneePixel> {
    None
}

/// Solves the linear program of one pixel. The unknowns are `phi`, `alpha`, `dark`, and one slack per level with
/// `|residual_k| <= slack_k`.
#[cfg(feature = "snee")]
fn solve(rates: &[f64], lights: &[f64], options: &SneeOptions) -> Option<SneePixel> {
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
    b[2 * k] = 1.0 + options.box_half_width;
    b[2 * k + 1] = options.box_half_width - 1.0;
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
    let (c_s, v_s) = split_threshold(x[0], options.sigma_c, options.sigma_v);
    Some(SneePixel { phi: x[0], alpha: x[1], dark: x[2], c_s, v_s })
}

/// Returns the pair `(c, v)` with `(1 + c)(1 + v) = phi` that minimizes `(c/sigma_c)^2 + (v/sigma_v)^2`.
///
/// Newton's method solves the condition for the minimum, `c (1 + c) sigma_v^2 = v (1 + v) sigma_c^2`, for `c`.
#[cfg(feature = "snee")]
fn split_threshold(phi: f64, sigma_c: f64, sigma_v: f64) -> (f64, f64) {
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
    fn threshold_split_is_consistent_and_estimates_stay_in_their_box() {
        let (c, v) = split_threshold(1.1, 0.003, 0.045);
        assert!(((1.0 + c) * (1.0 + v) - 1.1).abs() < 1e-12 && c.abs() < 0.01 * v);
        let lights: Vec<f64> = (0..25).map(|k| f64::from(10 * k) / 255.0).collect();
        // The rates are rounded in the same way as counts, so the residuals are not zero.
        let rates: Vec<f64> =
            lights.iter().map(|l| ((0.95 * l + 0.0047) * 1000.0).floor() / 1000.0).collect();
        let solution = solve(&rates, &lights, &SneeOptions::default()).unwrap();
        assert!((solution.phi - 0.8).abs() < 1e-4, "{solution:?}");
        assert!((solution.alpha / solution.phi - 0.95).abs() < 0.01, "{solution:?}");
    }
}
