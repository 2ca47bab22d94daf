//! What to record next, where two names explain a set as well as each other.

use crate::diagnose::null::reference::Reference;
use crate::diagnose::search::round::tied;
use crate::diagnose::search::round::{Entrant, Round};

/// Deviations at which two fitted models count as told apart.
const APART: f64 = 5.0;

/// Longest recording that is worth proposing, as a multiple of the present one.
const LONGEST: f64 = 400.0;

/// Effects that look alike for one reason, and the recording in which they do not.
const FAMILIES: [(&[&str], &str); 8] = [
    (
        &["dead_time", "response_nonlinearity", "partial_reset", "adaptation", "saturation_clamp", "leak"],
        "flats at 1/2, 2/3 and 3/4 of saturation and 2 % to either side (a partial reset makes plateaus there, adaptation \
         makes an interval depend on the one before), and one light level at two temperatures (dead time and reset bend the dark \
         current's response too, a non-linear response does not)",
    ),
    (
        &["crosstalk", "spike_coupling", "smooth_prnu"],
        "a checkerboard of squares one pixel wide, and one of lower contrast: shared light follows the light of the neighbour, coupled \
         spikes come one readout after the neighbour's",
    ),
    (
        &["false_spikes", "telegraph_dark", "hot_pixels", "dark_tail", "dark_shot_noise"],
        "a much longer dark, and one at another temperature: what the dark current does grows with it, false spikes do not, and \
         switching pixels are the same ones again",
    ),
    (
        &["missed_spikes", "dropped_readouts", "repeated_readouts", "row_noise"],
        "a longer flat at 0.1: a lost or repeated readout moves all pixels at once, a missed spike one pixel",
    ),
    (
        &["vignetting", "edge_columns", "smooth_prnu", "row_pattern", "column_pattern"],
        "the same flat with the lamp or the camera turned by a quarter: what belongs to the sensor turns with it",
    ),
    (
        &["slow_threshold_noise", "gain_drift", "telegraph_dark", "flicker"],
        "one flat ten times as long, and again after ten minutes: drift goes on, slow noise returns",
    ),
    (
        &["image_lag", "adaptation", "slow_threshold_noise"],
        "a square wave of a longer half period, up to another level: lag follows the light, adaptation the spikes",
    ),
    (
        &["comparator_noise", "row_noise", "missed_spikes", "slow_threshold_noise", "false_spikes"],
        "a longer flat at 0.03: the noise of a comparison does not add up over intervals, other noise does",
    ),
];

/// A sentence for each tie of a name that was kept.
pub(in crate::diagnose) fn settle(reference: &Reference, rounds: &[Round]) -> Vec<String> {
    let kept = rounds.iter().filter(|r| r.is_kept());
    kept.flat_map(|r| tied(r).into_iter().map(|e| sentence(reference, r, e))).collect()
}

fn sentence(reference: &Reference, round: &Round, other: &Entrant) -> String {
    let scores = reference.metric.scores(&(&other.mean - &round.mean));
    let best = (0..scores.len()).max_by(|a, b| scores[*a].abs().total_cmp(&scores[*b].abs())).unwrap_or(0);
    let (statistic, place) = reference.words(best);
    // Deviations shrink with the root of the length.
    let times = (APART / other.apart.max(1e-3)).powi(2);
    let longer = if times <= 1.0 {
        format!("a second recording of {place}, where their {statistic} differs most")
    } else if times <= LONGEST {
        format!(
            "recordings {:.0} times as long, first of all {place}, where their {statistic} differs most",
            times.ceil()
        )
    } else {
        "no longer recording of these scenes".to_owned()
    };
    let family = FAMILIES.iter().find(|f| f.0.contains(&round.winner) && f.0.contains(&other.name));
    let added = family.map_or(String::new(), |f| format!("; or added scenes: {}", f.1));
    format!("{} or {}: {longer} would tell{added}.", round.winner, other.name)
}
