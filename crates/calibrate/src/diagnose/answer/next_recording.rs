//! What to record next, where two names explain a set as well as each other.

use crate::diagnose::null::reference::NullModel;
use crate::diagnose::search::round::tied;
use crate::diagnose::search::round::{Entrant, Round};
use spikelane::effects::{
    Definition, adaptation, column_pattern, comparator_noise, crosstalk, dark_shot_noise, dark_tail,
    dead_time, dropped_readouts, edge_columns, false_spikes, flicker, gain_drift, hot_pixels, image_lag,
    leak, missed_spikes, partial_reset, repeated_readouts, response_nonlinearity, row_noise, row_pattern,
    saturation_clamp, slow_threshold_noise, smooth_prnu, spike_coupling, telegraph_dark, vignetting,
};

/// Deviations at which two fitted models count as told apart.
const APART: f64 = 5.0;

/// Longest recording that is worth proposing, as a multiple of the present one.
const LONGEST: f64 = 400.0;

/// Effects that look alike for one reason, and the recording in which they do not.
const FAMILIES: [(&[&Definition], &str); 8] = [
    (
        &[
            &dead_time::EFFECT,
            &response_nonlinearity::EFFECT,
            &partial_reset::EFFECT,
            &adaptation::EFFECT,
            &saturation_clamp::EFFECT,
            &leak::EFFECT,
        ],
        "flats at 1/2, 2/3 and 3/4 of saturation and 2 % to either side (a partial reset makes plateaus there, adaptation \
         makes an interval depend on the one before), and one light level at two temperatures (dead time and reset bend the dark \
         current's response too, a non-linear response does not)",
    ),
    (
        &[&crosstalk::EFFECT, &spike_coupling::EFFECT, &smooth_prnu::EFFECT],
        "a checkerboard of squares one pixel wide, and one of lower contrast: shared light follows the light of the neighbor, coupled \
         spikes come one readout after the neighbor's",
    ),
    (
        &[
            &false_spikes::EFFECT,
            &telegraph_dark::EFFECT,
            &hot_pixels::EFFECT,
            &dark_tail::EFFECT,
            &dark_shot_noise::EFFECT,
        ],
        "a much longer dark, and one at another temperature: what the dark current does grows with it, false spikes do not, and \
         switching pixels are the same ones again",
    ),
    (
        &[&missed_spikes::EFFECT, &dropped_readouts::EFFECT, &repeated_readouts::EFFECT, &row_noise::EFFECT],
        "a longer flat at 0.1: a lost or repeated readout moves all pixels at once, a missed spike one pixel",
    ),
    (
        &[
            &vignetting::EFFECT,
            &edge_columns::EFFECT,
            &smooth_prnu::EFFECT,
            &row_pattern::EFFECT,
            &column_pattern::EFFECT,
        ],
        "the same flat with the lamp or the camera turned by a quarter: what belongs to the sensor turns with it",
    ),
    (
        &[&slow_threshold_noise::EFFECT, &gain_drift::EFFECT, &telegraph_dark::EFFECT, &flicker::EFFECT],
        "one flat ten times as long, and again after ten minutes: drift goes on, slow noise returns",
    ),
    (
        &[&image_lag::EFFECT, &adaptation::EFFECT, &slow_threshold_noise::EFFECT],
        "a square wave of a longer half period, up to another level: lag follows the light, adaptation the spikes",
    ),
    (
        &[
            &comparator_noise::EFFECT,
            &row_noise::EFFECT,
            &missed_spikes::EFFECT,
            &slow_threshold_noise::EFFECT,
            &false_spikes::EFFECT,
        ],
        "a longer flat at 0.03: the noise of a comparison does not add up over intervals, other noise does",
    ),
];

/// A sentence for each tie of a name that was kept.
pub(in crate::diagnose) fn settle(reference: &NullModel, rounds: &[Round]) -> Vec<String> {
    let kept = rounds.iter().filter(|r| r.is_kept());
    kept.flat_map(|r| tied(r).into_iter().map(|e| sentence(reference, r, e))).collect()
}

fn sentence(reference: &NullModel, round: &Round, other: &Entrant) -> String {
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
    let has = |f: &[&Definition], name: &str| f.iter().any(|d| d.name == name);
    let family = FAMILIES.iter().find(|f| has(f.0, round.winner) && has(f.0, other.name));
    let added = family.map_or(String::new(), |f| format!("; or added scenes: {}", f.1));
    format!("{} or {}: {longer} would tell{added}.", round.winner, other.name)
}
