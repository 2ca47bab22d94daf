//! What a calibration said of a laboratory, beside the truth.

use std::path::Path;
use std::process::Command;

use serde_json::Value;
use spikelane_calibrate::{CalibrateOptions, calibrate};

use super::best;
use super::lab::Lab;

/// What is compared.
pub(crate) const QUANTITIES: [&str; 7] = [
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
pub(crate) struct Compared {
    pub quantity: usize,
    /// Distance from the truth in the estimate's own errors.
    pub z: f64,
    /// The error over the value.
    pub relative: f64,
    /// The error over the least that any estimate can have.
    pub over_best: f64,
}

/// What was said of a laboratory.
pub(crate) struct Said {
    /// Every value that has an error.
    pub compared: Vec<Compared>,
    /// Whether lamps that are off or drift, or a response that bends, were named.
    pub named: bool,
    /// Quantities that are said to be assumed.
    pub assumed: Vec<usize>,
}

pub(crate) enum Verdict {
    Refused(String),
    Said(Said),
}

impl Verdict {
    /// What was said and is not so.
    pub(crate) fn wrong(&self) -> Vec<Compared> {
        match self {
            Self::Refused(_) => Vec::new(),
            Self::Said(said) => {
                said.compared.iter().copied().filter(|c| c.z.is_nan() || c.z.abs() > WRONG).collect()
            }
        }
    }
}

/// Calibrates in memory, and compares.
pub(crate) fn judge(lab: &Lab) -> Verdict {
    match calibrate(&lab.observed(), &CalibrateOptions::default()) {
        Ok(found) => compare(lab, &found.to_json()),
        Err(error) => Verdict::Refused(error.to_string()),
    }
}

/// The same through files and the command line: `program calibrate set.toml --json`, in `folder`.
pub(crate) fn judge_program(lab: &Lab, program: &Path, folder: &Path) -> Verdict {
    let set = lab.write(folder);
    let mut command = Command::new(program);
    command.arg("calibrate").arg(set).arg("-o").arg(folder.join("calibrated")).arg("--json");
    let ran = command.output().unwrap_or_else(|e| panic!("{}: {e}", program.display()));
    let output = String::from_utf8(ran.stdout).unwrap();
    let last = output.lines().last().unwrap_or_default();
    let event: Value = serde_json::from_str(last).unwrap_or_else(|e| panic!("{last}: {e}"));
    match event["event"].as_str() {
        Some("done") => compare(lab, &event),
        _ => Verdict::Refused(event["message"].as_str().unwrap_or(last).to_owned()),
    }
}

fn compare(lab: &Lab, found: &Value) -> Verdict {
    let n = &lab.noise;
    // Means of 1 / phi and of its square, for a normal phi.
    let s = n.threshold_sd * n.threshold_sd;
    let (one, two) = (1.0 + s + 3.0 * s * s, 1.0 + 3.0 * s + 15.0 * s * s);
    let spread = |mean: f64, sd: f64| ((mean * mean + sd * sd) * two - (mean * one).powi(2)).sqrt();
    let p = &found["population"];
    let values = [
        (&p["mean_a"], one),
        (&p["sd_a"], spread(1.0, n.gain_sd)),
        (&p["mean_d"], n.dark * one),
        (&p["sd_d"], spread(n.dark, n.dark_sd)),
        (&found["sigma_t"], n.sigma_t),
        (&found["electrons_per_spike"], n.photons),
    ];
    let best = best::errors(lab);
    let mut said = Said { compared: Vec::new(), named: false, assumed: Vec::new() };
    for (quantity, (estimate, truth)) in values.into_iter().enumerate() {
        let (value, error) = (estimate["value"].as_f64(), estimate["error"].as_f64());
        said.push(quantity, value, error, truth, best[quantity]);
    }
    let levels = found["levels"].as_array().unwrap();
    for (lamp, shot) in levels.iter().zip(&lab.shots).filter(|(_, s)| s.stated > 0.0) {
        said.named |= lamp["wrong"] == true || lamp["drifts"] == true;
        if lamp["saturated"] != true {
            let error = lamp["deviation"]["error"].as_f64();
            said.push(6, lamp["found"].as_f64(), error, shot.light, best::level(lab) * shot.light);
        }
    }
    said.named |= found["bends"] == true;
    Verdict::Said(said)
}

impl Said {
    fn push(&mut self, quantity: usize, value: Option<f64>, error: Option<f64>, truth: f64, best: f64) {
        let compared = match (value, error) {
            (Some(value), Some(error)) => Compared {
                quantity,
                z: (value - truth) / error,
                relative: error / truth,
                over_best: error / best,
            },
            (None, _) => Compared { quantity, z: f64::NAN, relative: f64::NAN, over_best: f64::NAN },
            (Some(_), None) => {
                self.assumed.push(quantity);
                return;
            }
        };
        self.compared.push(compared);
    }
}
