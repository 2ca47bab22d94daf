//! Recommends recordings that distinguish ambiguous effects.

use crate::null_model::model::NullModel;
use crate::search::round::{Entrant, Round, tied};
use crate::thresholds::{DISTINCT_SDS, MAX_LENGTH_FACTOR};
use crate::verdict::qualifications::definition;
use spikelane::effects::AmbiguityGroup;

/// Returns one sentence for each pair of a retained effect and an effect that is ambiguous with it.
pub(crate) fn recommended_recordings(reference: &NullModel, rounds: &[Round]) -> Vec<String> {
    let kept = rounds.iter().filter(|r| r.is_kept());
    kept.flat_map(|r| tied(r).into_iter().map(|e| sentence(reference, r, e))).collect()
}

fn sentence(reference: &NullModel, round: &Round, other: &Entrant) -> String {
    let scores = reference.metric.scores(&(&other.mean - &round.mean));
    let best = (0..scores.len()).max_by(|a, b| scores[*a].abs().total_cmp(&scores[*b].abs())).unwrap_or(0);
    let (statistic, place) = reference.words(best);
    // The distance between both models, in standard deviations, is proportional to the square root of the length.
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
    let group = common_group(reference, round.winner, other.name);
    let added = group.map_or_else(String::new, |group| {
        format!(". Additional scenes that distinguish both: {}", distinguishing_scenes(group))
    });
    format!("{} or {}. {longer}{added}.", round.winner, other.name)
}

/// Returns the first ambiguity group that contains both effects.
fn common_group(reference: &NullModel, name: &str, other: &str) -> Option<AmbiguityGroup> {
    let [groups, others] = [name, other].map(|name| definition(reference, name).map(|d| d.ambiguity_groups));
    let others = others?;
    groups?.iter().copied().filter(|group| others.contains(group)).min()
}

/// Returns a description of the recordings that distinguish the effects of a group.
fn distinguishing_scenes(group: AmbiguityGroup) -> &'static str {
    match group {
        AmbiguityGroup::Response => {
            "flat fields at 1/2, 2/3 and 3/4 of saturation and 2 % above and below each level (a partial reset causes plateaus there, and adaptation \
         makes an interval depend on the previous interval), and one light level at two temperatures (dead time and reset also change the response \
         to the dark current, a nonlinear response does not)"
        }
        AmbiguityGroup::Neighbors => {
            "a checkerboard of squares one pixel wide, and a checkerboard of lower contrast: crosstalk follows the light of the neighbor, and coupled \
         spikes follow the spikes of the neighbor by one readout"
        }
        AmbiguityGroup::DarkSpikes => {
            "a much longer dark recording, and a dark recording at another temperature: effects of the dark current grow with the dark current, false \
         spikes do not, and switching pixels are the same pixels in both recordings"
        }
        AmbiguityGroup::SingleReadouts => {
            "a longer flat field at 0.1: a lost or repeated readout affects all pixels at once, and a missed spike affects one pixel"
        }
        AmbiguityGroup::SpatialPattern => {
            "the same flat field with the lamp or the camera rotated by 90 degrees: a pattern of the sensor rotates with the sensor"
        }
        AmbiguityGroup::SlowChange => {
            "a flat field ten times as long, and the same flat field after ten minutes: a drift continues, and slow noise returns to its mean"
        }
        AmbiguityGroup::Memory => {
            "a square wave with a longer half period and another high level: lag depends on the light, and adaptation depends on the spikes"
        }
        AmbiguityGroup::IrregularIntervals => {
            "a longer flat field at 0.03: comparator noise does not accumulate over intervals, and other noise accumulates"
        }
    }
}
