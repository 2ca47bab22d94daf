//! What the recordings could tell, and what they could not.

use crate::population::Population;
use crate::sets::check::SATURATED;
use crate::sets::observed::Observed;
use spikelane_measure::Estimate;

/// Adds what the recordings could and could not tell.
pub(super) fn identify(
    notes: &mut Vec<String>,
    observed: &Observed,
    population: &Population,
    bias_share: Estimate,
    redrawn_told: bool,
) {
    let mut say = |text: String| notes.push(text);
    say("Identified for every pixel: a and d, its charge per readout at full light and in the dark, in its own thresholds.".to_owned());
    say("Not identified by any static recording: how a and d split into gain, dark current, capacitance and threshold voltage; each threshold of the maps is a draw from its posterior, and the whole spread of thresholds stands as one of voltages.".to_owned());
    let phi = population.sigma_phi;
    if phi.value > 2.0 * phi.error {
        say(format!(
            "The spread of thresholds over the population, {:.2} % +- {:.2} %, follows from the covariance of a and d if gains and dark currents are independent.",
            100.0 * phi.value,
            100.0 * phi.error
        ));
    } else {
        say(format!(
            "The spread of thresholds is not seen: below {:.2} % with 95 % confidence.",
            100.0 * (phi.value + 2.0 * phi.error)
        ));
    }
    let light = observed.levels.iter().filter(|l| l.light > 0.0).count();
    say(format!(
        "The scale of a is that of the light given ({light} lit levels): an error common to all of them cannot be told, and what is stated of single levels is averaged."
    ));
    if observed.levels.iter().filter(|l| l.median_rate() <= SATURATED).count() == 2 {
        say("Two levels below saturation: a line passes through any two. Whether rates follow the light in proportion, whether a given level is wrong, and which pixels do not fit the model cannot be told, and chi-square has no degrees of freedom; a third level would tell.".to_owned());
    }
    if observed.levels.iter().all(|l| l.light > 0.0) {
        say("Without a recording in the dark, d is an extrapolation, and threshold noise was not told from shot noise.".to_owned());
    } else if redrawn_told && bias_share.error.is_finite() {
        say(format!(
            "Of the rate that noise redrawn at every readout would add, {:.3} +- {:.3} was found (1: redrawn at every readout, 0: frozen from reset to reset).",
            bias_share.value, bias_share.error
        ));
    }
    if observed.others.is_empty() {
        say("Static uniform scenes only: image lag, adaptation, crosstalk, supply droop and the clamp on stored charge could not be seen.".to_owned());
    } else {
        say(format!("Not used by this estimator: {}.", observed.others.join(", ")));
    }
}
