//! Adds notes about the quantities that the recordings identify or do not identify.

use crate::population::Population;
use crate::recordings::observations::Observations;
use spikelane_measure::Estimate;

/// Adds notes about the quantities that the recordings identify or do not identify.
pub(super) fn note_identifiability(
    notes: &mut Vec<String>,
    observed: &Observations,
    population: &Population,
    redraw_share: Estimate,
    is_noise_sampling_identified: bool,
) {
    let mut say = |text: String| notes.push(text);
    say("Identified for every pixel: a and d, the charge per readout at full light and in the dark, relative to the threshold of the pixel.".to_owned());
    say("Not identified by any static recording: how a and d depend on gain, dark current, capacitance and threshold voltage. Each threshold in the maps is drawn from its posterior, and the whole spread of thresholds is attributed to the voltages.".to_owned());
    let phi = population.sigma_phi;
    if phi.value > 2.0 * phi.error {
        say(format!(
            "The spread of thresholds over the pixels, {:.2} % +- {:.2} %, follows from the covariance of a and d if gains and dark currents are independent.",
            100.0 * phi.value,
            100.0 * phi.error
        ));
    } else {
        say(format!(
            "The spread of thresholds is not detectable: the spread is below {:.2} % with 95 % confidence.",
            100.0 * (phi.value + 2.0 * phi.error)
        ));
    }
    let light = observed.levels.iter().filter(|l| l.light > 0.0).count();
    say(format!(
        "The scale of a depends on the stated light ({light} lit levels): an error common to all levels is not detectable, and errors of single levels average out."
    ));
    let classes = observed.pixel_classes();
    if observed.levels.iter().filter(|l| !l.is_saturated(&classes)).count() == 2 {
        say("Two levels below saturation always fit a line. The recordings cannot show whether rates are proportional to the light, whether a level is wrong or which pixels deviate from the model, and chi-square has no degrees of freedom. A third level would answer these questions.".to_owned());
    }
    if observed.levels.iter().all(|l| l.light > 0.0) {
        say("Without a dark recording, d is an extrapolation, and threshold noise is not separated from shot noise.".to_owned());
    } else if is_noise_sampling_identified && redraw_share.error.is_finite() {
        say(format!(
            "The share of the threshold noise that is redrawn at every readout is {:.3} +- {:.3} (1: redrawn at every readout, 0: constant from reset to reset). This share follows from the variance of single intervals in the dark.",
            redraw_share.value, redraw_share.error
        ));
    }
    if observed.other_recordings.is_empty() {
        say("The scenes are static and uniform: image lag, adaptation, crosstalk, supply droop and the limit on stored charge are not detectable.".to_owned());
    } else {
        say(format!("Not used by this estimator: {}.", observed.other_recordings.join(", ")));
    }
}
