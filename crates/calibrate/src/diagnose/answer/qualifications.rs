//! Qualifications of a diagnosis: tentative names, ambiguities, causes outside the camera, and notes.

use super::diagnosis::{Diagnosis, Discrepancy, ParameterMismatch, Verdict};
use crate::diagnose::null::reference::NullModel;
use crate::diagnose::protocol::recorded_set::Setup;
use spikelane::effects::{
    Definition, adaptation, dead_time, flicker, gain_drift, leak, partial_reset, readout_jitter,
    response_nonlinearity, saturation_clamp, vignetting,
};

/// Standard deviation of the noise floor, divided by the noise floor, above which a discrepancy at the floor is not
/// evidence. Such a floor is compatible with a discrepancy of zero and with one of several floors.
const MAX_RELATIVE_FLOOR_SD: f64 = 3.0;

const BENT: [&Definition; 6] = [
    &dead_time::EFFECT,
    &response_nonlinearity::EFFECT,
    &partial_reset::EFFECT,
    &adaptation::EFFECT,
    &leak::EFFECT,
    &saturation_clamp::EFFECT,
];

/// Smallest cosine of two signatures at which one effect may replace the other.
const MIN_SIMILAR_COSINE: f64 = 0.9;

const LOOKS_THE_SAME: [(&Definition, &str); 4] = [
    (
        &flicker::EFFECT,
        "; a flickering lamp has the same statistics, so the cause is the lamp and not the camera",
    ),
    (&gain_drift::EFFECT, "; a lamp that drifts through all recordings has the same statistics"),
    (&vignetting::EFFECT, "; light that decreases towards the corners has the same statistics"),
    (
        &readout_jitter::EFFECT,
        "; the rows with the effect are not identified: a band around another row has nearly the same statistics, with half the spread if rows lie on both sides",
    ),
];

/// Largest number of effects that are reported as ambiguous with one effect.
const MAX_AMBIGUOUS: usize = 3;

/// Weakens statements of a diagnosis that its evidence does not support.
///
/// Sets that share a null model are not qualified.
pub(in crate::diagnose) fn qualify(d: &mut Diagnosis, reference: &NullModel) {
    for effect in d.effects.iter_mut().filter(|e| !e.is_tentative) {
        let (Some(p), Some(neutral)) = (effect.parameters.first(), reference.neutral_of(effect.name)) else {
            continue;
        };
        if p.low <= neutral && neutral <= p.high {
            effect.is_tentative = true;
            effect.evidence += "; the interval of the strength contains the value without the effect";
        }
    }
    for effect in &mut d.effects {
        if let Some(step) = effect.step {
            effect.evidence = effect.evidence.replace(&step.words(), &step.nearer(d.discrepancy.noise_floor));
        }
    }
    for effect in &mut d.effects {
        let same = LOOKS_THE_SAME.iter().find(|l| l.0.name == effect.name);
        effect.evidence += same.map_or("", |l| l.1);
    }
    add_response_ambiguities(d, reference);
    let named = !d.parameter_mismatches.is_empty() || d.effects.iter().any(|e| !e.is_tentative);
    if matches!(d.verdict, Verdict::Explained | Verdict::PartlyExplained) && !named {
        d.verdict = Verdict::Unknown;
    }
    if d.verdict == Verdict::Explained
        && d.discrepancy.noise_floor_sd > MAX_RELATIVE_FLOOR_SD * d.discrepancy.noise_floor
    {
        d.verdict = Verdict::PartlyExplained;
        d.notes.push(format!(
            "Simulated sensors of the final model differ strongly from each other (noise floor {:.0}, standard deviation {:.0}). A discrepancy at this noise floor therefore does not show that the model is complete. More light levels or longer recordings reduce the noise floor.",
            d.discrepancy.noise_floor, d.discrepancy.noise_floor_sd
        ));
    }
}

/// Adds ambiguities between effects that change the response curve: a found effect is ambiguous with a similar one
/// that was never fitted beside it.
fn add_response_ambiguities(d: &mut Diagnosis, reference: &NullModel) {
    let bends = |name: &str| BENT.iter().any(|e| e.name == name);
    let tried = |name: &str, other: &str| {
        let rounds = d.traces.tournament.iter();
        rounds.filter(|r| r.iter().any(|e| e.0 == name)).any(|r| r.iter().any(|e| e.0 == other))
    };
    let said: Vec<&'static str> = d.effects.iter().map(|e| e.name).collect();
    let mut ties: Vec<Vec<&'static str>> = Vec::new();
    for effect in &d.effects {
        let open = BENT.iter().map(|e| e.name).filter(|other| {
            bends(effect.name)
                && !said.contains(other)
                && !effect.ambiguous_with.contains(other)
                && !tried(effect.name, other)
        });
        let mut alike: Vec<(f64, &'static str)> = open
            .map(|other| (reference.cosine_of(effect.name, other), other))
            .filter(|a| a.0 >= MIN_SIMILAR_COSINE)
            .collect();
        alike.sort_by(|a, b| b.0.total_cmp(&a.0));
        ties.push(alike.into_iter().map(|a| a.1).collect());
    }
    for (effect, alike) in d.effects.iter_mut().zip(ties) {
        let room = MAX_AMBIGUOUS.saturating_sub(effect.ambiguous_with.len());
        effect.ambiguous_with.extend(alike.into_iter().take(room));
    }
}

/// Returns notes about the judged readouts and the held-out recordings. `aside` contains the excluded readouts at the
/// start of recordings.
pub(in crate::diagnose) fn set_notes(
    setup: &Setup,
    aside: &[(String, usize)],
    held_out: bool,
    alone: bool,
) -> Vec<String> {
    let mut notes = Vec::new();
    if let Some((first, rows)) = setup.row_band {
        notes.push(format!(
            "The scene is large: only rows {first} to {} were compared, which contain most of the uniform surface.",
            first + rows - 1
        ));
    }
    if let Some([fewest, most]) = setup.judged_readouts {
        let first = if fewest == most { fewest.to_string() } else { format!("{fewest} to {most}") };
        notes.push(format!(
            "The recordings are large: only the first {first} readouts of each were compared. A comparison of all readouts detects weaker and slower effects and takes longer in proportion."
        ));
    }
    if !held_out && alone {
        notes.push("There is no second recording set, and the recordings of this set cannot be split: no recordings were held out.".to_owned());
    } else if !held_out {
        notes.push(
            "There is no second recording set: effects were fitted to the first half of every recording and tested on the second half, so only stronger effects are detectable. A second set of the same scenes doubles the number of readouts for both steps.".to_owned(),
        );
    }
    if let Some(longest) = aside.iter().map(|a| a.1).max() {
        let shortest = aside.iter().map(|a| a.1).min().unwrap_or(longest);
        notes.push(format!(
            "The pixels start with the same charge, as in simulations and after a common reset. The first {shortest} to {longest} readouts of {} recordings, in which pixels fire together, were excluded. Effects that occur only in these readouts are not detectable.",
            aside.len()
        ));
    }
    notes
}

/// Explains why a set without a significant statistic is not explained.
pub(in crate::diagnose) fn open_discrepancy_note(gap: &Discrepancy) -> String {
    format!(
        "No single statistic exceeds its limit, but the {}discrepancy is {:.0}, the noise floor of the final model is {:.0}, and the \
         largest discrepancy that counts as explained is {:.0}. By chance, 2 % of the sensors without missing effects exceed this limit.",
        if gap.is_held_out() { "held-out " } else { "" },
        gap.held_out_set.last().copied().unwrap_or_default(),
        gap.noise_floor,
        gap.limit()
    )
}

/// Lists parameters that are not reported as mismatches, because the found effects determine or disturb them strongly.
pub(in crate::diagnose) fn untested_note(wrong: &[ParameterMismatch]) -> String {
    let names: Vec<&str> = wrong.iter().map(|m| m.parameter.as_str()).collect();
    format!(
        "Not tested: {}. The found effects are so strong that the recordings do not determine these parameters of the camera. Add the found \
         effects, which camera.toml contains, to your camera file with your own values of these parameters, and diagnose again.",
        names.join(", ")
    )
}
