//! What a calibration said of a laboratory, beside the truth.

use spikelane::calibrate::{Options, calibrate};
use spikelane::measure::Estimate;

use super::lab::Lab;

/// What is compared.
pub const QUANTITIES: [&str; 7] = [
    "mean gain",
    "spread of gain",
    "mean dark rate",
    "spread of dark rate",
    "threshold noise",
    "electrons",
    "levels",
];

/// A value that lies further from the truth than this many of its own errors is wrong. One in two million of a normal law is.
const WRONG: f64 = 5.0;

/// One estimate and its truth.
#[derive(Clone, Copy)]
pub struct Compared {
    pub quantity: usize,
    /// Distance from the truth in the estimate's own errors.
    pub z: f64,
    /// The error over the value.
    pub relative: f64,
}

pub enum Verdict {
    Refused(String),
    /// Every value that has an error.
    Said(Vec<Compared>),
}

impl Verdict {
    /// What was said and is not so.
    pub fn wrong(&self) -> Vec<Compared> {
        match self {
            Self::Refused(_) => Vec::new(),
            Self::Said(all) => all.iter().copied().filter(|c| c.z.is_nan() || c.z.abs() > WRONG).collect(),
        }
    }
}

/// Calibrates and compares.
pub fn judge(lab: &Lab) -> Verdict {
    let found = match calibrate(&lab.observed, &Options::default()) {
        Ok(found) => found,
        Err(error) => return Verdict::Refused(error.to_string()),
    };
    let n = &lab.noise;
    // Means of 1 / phi and of its square, for a normal phi.
    let s = n.threshold_sd * n.threshold_sd;
    let (one, two) = (1.0 + s + 3.0 * s * s, 1.0 + 3.0 * s + 15.0 * s * s);
    let spread = |mean: f64, sd: f64| ((mean * mean + sd * sd) * two - (mean * one).powi(2)).sqrt();
    let p = &found.population;
    let mut all = Vec::new();
    let mut compare = |quantity: usize, e: Estimate, truth: f64| {
        if e.error.is_finite() {
            all.push(Compared { quantity, z: (e.value - truth) / e.error, relative: e.error / truth });
        } else if !e.value.is_finite() {
            all.push(Compared { quantity, z: f64::NAN, relative: f64::NAN });
        }
    };
    compare(0, p.mean_a, one);
    compare(1, p.sd_a, spread(1.0, n.gain_sd));
    compare(2, p.mean_d, n.dark * one);
    compare(3, p.sd_d, spread(n.dark, n.dark_sd));
    compare(4, found.sigma_t, n.sigma_t);
    compare(5, found.electrons, n.photons);
    for (lamp, [light, stated]) in found.levels.iter().zip(&lab.levels).filter(|(l, _)| l.stated > 0.0) {
        if !lamp.saturated {
            compare(6, Estimate { value: lamp.found(), ..lamp.deviation }, *light);
            debug_assert_eq!(lamp.stated, *stated);
        }
    }
    Verdict::Said(all)
}
