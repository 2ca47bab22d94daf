//! Recommended recordings, which distinguish ambiguous effects.

use crate::diagnose::null::reference::NullModel;
use crate::diagnose::search::round::{Entrant, Round, tied};
use spikelane::effects::{
    Definition, adaptation, column_pattern, comparator_noise, crosstalk, dark_shot_noise, dark_tail,
    dead_time, dropped_readouts, edge_columns, false_spikes, flicker, gain_drift, hot_pixels, image_lag,
    leak, missed_spikes, partial_reset, repeated_readouts, response_nonlinearity, row_noise, row_pattern,
    saturation_clamp, slow_threshold_noise, smooth_prnu, spike_coupling, telegraph_dark, vignetting,
};

/// Number of standard deviations between two fitted models at which they count as distinguished.
const DISTINCT_SDS: f64 = 5.0;

/// Largest recommended length of a recording, relative to the present one.
const MAX_LENGTH_FACTOR: f64 = 400.0;

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
        "flat fields at 1/2, 2/3 and 3/4 of saturation and 2 % above and below each level (a partial reset causes plateaus there, and adaptation \
         makes an interval depend on the previous interval), and one light level at two temperatures (dead time and reset also change the response \
         to the dark current, a nonlinear response does not)",
    ),
    (
        &[&crosstalk::EFFECT, &spike_coupling::EFFECT, &smooth_prnu::EFFECT],
        "a checkerboard of squares one pixel wide, and a checkerboard of lower contrast: crosstalk follows the light of the neighbor, and coupled \
         spikes follow the spikes of the neighbor by one readout",
    ),
    (
        &[
            &false_spikes::EFFECT,
            &telegraph_dark::EFFECT,
            &hot_pixels::EFFECT,
            &dark_tail::EFFECT,
            &dark_shot_noise::EFFECT,
        ],
        "a much longer dark recording, and a dark recording at another temperature: effects of the dark current grow with the dark current, false \
         spikes do not, and switching pixels are the same pixels in both recordings",
    ),
    (
        &[&missed_spikes::EFFECT, &dropped_readouts::EFFECT, &repeated_readouts::EFFECT, &row_noise::EFFECT],
        "a longer flat field at 0.1: a lost or repeated readout affects all pixels at once, and a missed spike affects one pixel",
    ),
    (
        &[
            &vignetting::EFFECT,
            &edge_columns::EFFECT,
            &smooth_prnu::EFFECT,
            &row_pattern::EFFECT,
            &column_pattern::EFFECT,
        ],
        "the same flat field with the lamp or the camera rotated by 90 degrees: a pattern of the sensor rotates with the sensor",
    ),
    (
        &[&slow_threshold_noise::EFFECT, &gain_drift::EFFECT, &telegraph_dark::EFFECT, &flicker::EFFECT],
        "a flat field ten times as long, and the same flat field after ten minutes: a drift continues, and slow noise returns to its mean",
    ),
    (
        &[&image_lag::EFFECT, &adaptation::EFFECT, &slow_threshold_noise::EFFECT],
        "a square wave with a longer half period and another high level: lag depends on the light, and adaptation depends on the spikes",
    ),
    (
        &[
            &comparator_noise::EFFECT,
            &row_noise::EFFECT,
            &missed_spikes::EFFECT,
            &slow_threshold_noise::EFFECT,
            &false_spikes::EFFECT,
        ],
        "a longer flat field at 0.03: comparator noise does not accumulate over intervals, and other noise accumulates",
    ),
];

/// Returns one sentence for each effect that is ambiguous with a retained effect.
pub(in crate::diagnose) fn recommended_recordings(reference: &NullModel, rounds: &[Round]) -> Vec<String> {
    let kept = rounds.iter().filter(|r| r.is_kept());
    kept.flat_map(|r| tied(r).into_iter().map(|e| sentence(reference, r, e))).collect()
}

fn sentence(reference: &NullModel, round: &Round, other: &Entrant) -> String {
    let scores = reference.metric.scores(&(&other.mean - &round.mean));
    let best = (0..scores.len()).max_by(|a, b| scores[*a].abs().total_cmp(&scores[*b].abs())).unwrap_or(0);
    let (statistic, place) = reference.words(best);
    // The distance in standard deviations grows with the square root of the length.
    let times = (DISTINCT_SDS / other.apart.max(1e-3)).powi(2);
    let longer = if times <= 1.0 {
        format!("A second recording of {place} would distinguish both, where {statistic} differs most")
    } else if times <= MAX_LENGTH_FACTOR {
        format!(
            "Recordings {:.0} times as long would distinguish both, above all {place}, where {statistic} differs most",
            times.ceil()
        )
    } else {
        "Longer recordings of these scenes would not distinguish both".to_owned()
    };
    let has = |f: &[&Definition], name: &str| f.iter().any(|d| d.name == name);
    let family = FAMILIES.iter().find(|f| has(f.0, round.winner) && has(f.0, other.name));
    let added =
        family.map_or(String::new(), |f| format!(". Additional scenes that distinguish both: {}", f.1));
    format!("{} or {}. {longer}{added}.", round.winner, other.name)
}
