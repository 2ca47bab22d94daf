//! Compares the calibration of a laboratory with the truth.

use std::path::Path;
use std::process::Command;

use serde_json::Value;
use spikelane_calibrate::{CalibrateOptions, calibrate};

use super::error_bounds;
use super::lab::Laboratory;

/// The compared quantities.
pub(crate) const QUANTITIES: [&str; 7] = [
    "mean gain",
    "spread of gain",
    "mean dark rate",
    "spread of dark rate",
    "threshold noise",
    "electrons",
    "levels",
];

/// A value is wrong if its distance from the truth exceeds this number of its standard errors. For a normal distribution
/// the probability is one in two million.
const WRONG_Z_THRESHOLD: f64 = 5.0;

/// The deviation of one estimate from the true value.
#[derive(Clone, Copy)]
pub(crate) struct QuantityError {
    pub quantity: usize,
    /// Distance from the true value, in standard errors of the estimate.
    pub z: f64,
    /// Error divided by the true value.
    pub relative: f64,
    /// Error divided by the smallest error that any estimate can have.
    pub best_ratio: f64,
}

/// Comparison of one calibration with the truth.
pub(crate) struct Assessment {
    /// One entry for each value that has an error.
    pub quantity_errors: Vec<QuantityError>,
    /// Whether the calibration reports a wrong or drifting lamp, or a nonlinear response.
    pub has_named_fault: bool,
    /// Quantities that the calibration reports as assumed.
    pub assumed_quantities: Vec<usize>,
}

pub(crate) enum AssessmentOutcome {
    Refused(String),
    Assessed(Assessment),
}

impl AssessmentOutcome {
    /// Returns the errors of the estimates that are wrong.
    pub(crate) fn wrong_quantities(&self) -> Vec<QuantityError> {
        match self {
            Self::Refused(_) => Vec::new(),
            Self::Assessed(assessment) => assessment
                .quantity_errors
                .iter()
                .copied()
                .filter(|c| c.z.is_nan() || c.z.abs() > WRONG_Z_THRESHOLD)
                .collect(),
        }
    }
}

/// Calibrates in memory and compares the result with the truth.
pub(crate) fn assess(lab: &Laboratory) -> AssessmentOutcome {
    match calibrate(&lab.observations(), &CalibrateOptions::default()) {
        Ok(calibration) => compare_with_truth(lab, &calibration.to_json()),
        Err(error) => AssessmentOutcome::Refused(error.to_string()),
    }
}

/// Calibrates by running `program calibrate set.toml --json` on files in `folder`. Compares the result with the truth.
pub(crate) fn assess_program(lab: &Laboratory, program: &Path, folder: &Path) -> AssessmentOutcome {
    let set = lab.write(folder);
    let mut command = Command::new(program);
    command.arg("calibrate").arg(set).arg("-o").arg(folder.join("calibrated")).arg("--json");
    let ran = command.output().unwrap_or_else(|e| panic!("{}: {e}", program.display()));
    let output = String::from_utf8(ran.stdout).unwrap();
    let last = output.lines().last().unwrap_or_default();
    let event: Value = serde_json::from_str(last).unwrap_or_else(|e| panic!("{last}: {e}"));
    match event["event"].as_str() {
        Some("done") => compare_with_truth(lab, &event),
        _ => AssessmentOutcome::Refused(event["message"].as_str().unwrap_or(last).to_owned()),
    }
}

fn compare_with_truth(lab: &Laboratory, calibration: &Value) -> AssessmentOutcome {
    let n = &lab.noise;
    // `one` and `two` are the means of `1 / phi` and of `1 / phi^2` for a normal threshold `phi` with mean 1.
    let s = n.threshold_sd * n.threshold_sd;
    let (one, two) = (1.0 + s + 3.0 * s * s, 1.0 + 3.0 * s + 15.0 * s * s);
    let spread = |mean: f64, sd: f64| ((mean * mean + sd * sd) * two - (mean * one).powi(2)).sqrt();
    let p = &calibration["population"];
    let values = [
        (&p["mean_a"], one),
        (&p["sd_a"], spread(1.0, n.gain_sd)),
        (&p["mean_d"], n.dark * one),
        (&p["sd_d"], spread(n.dark, n.dark_sd)),
        (&calibration["sigma_t"], n.sigma_t),
        (&calibration["photons_at_full_light"], n.photons),
    ];
    let best = error_bounds::best_errors(lab);
    let mut assessment =
        Assessment { quantity_errors: Vec::new(), has_named_fault: false, assumed_quantities: Vec::new() };
    for (quantity, (estimate, truth)) in values.into_iter().enumerate() {
        let (value, error) = (estimate["value"].as_f64(), estimate["error"].as_f64());
        assessment.push(quantity, value, error, truth, best[quantity]);
    }
    let levels = calibration["lamps"].as_array().unwrap();
    for (lamp, shot) in levels.iter().zip(&lab.shots).filter(|(_, s)| s.stated > 0.0) {
        assessment.has_named_fault |= lamp["is_outlier"] == true || lamp["drifts"] == true;
        if lamp["is_saturated"] != true {
            let error = lamp["deviation"]["error"].as_f64();
            assessment.push(
                6,
                lamp["found_light"].as_f64(),
                error,
                shot.light,
                error_bounds::best_level_error(lab) * shot.light,
            );
        }
    }
    assessment.has_named_fault |= calibration["is_nonlinear"] == true;
    AssessmentOutcome::Assessed(assessment)
}

impl Assessment {
    fn push(&mut self, quantity: usize, value: Option<f64>, error: Option<f64>, truth: f64, best: f64) {
        let compared = match (value, error) {
            (Some(value), Some(error)) => QuantityError {
                quantity,
                z: (value - truth) / error,
                relative: error / truth,
                best_ratio: error / best,
            },
            (None, _) => QuantityError { quantity, z: f64::NAN, relative: f64::NAN, best_ratio: f64::NAN },
            (Some(_), None) => {
                self.assumed_quantities.push(quantity);
                return;
            }
        };
        self.quantity_errors.push(compared);
    }
}
