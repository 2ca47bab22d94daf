//! Qualifications of a diagnosis: tentative names, ambiguities, causes outside the camera, and notes.

use crate::null_model::model::NullModel;
use crate::prepared::recordings::HeldOut;
use crate::recordings::setup::Setup;
use crate::sensors::model::BASE_KNOBS;
use crate::thresholds::{MAX_AMBIGUOUS_EFFECTS, MAX_RELATIVE_FLOOR_SD, MIN_SIMILAR_COSINE};
use crate::verdict::diagnosis::{Diagnosis, Discrepancy, FoundEffect, ParameterMismatch, Verdict};
use spikelane::effects::{AmbiguityGroup, Definition};

/// Makes those statements of a diagnosis weaker that its evidence does not support.
///
/// Diagnoses with a given null model are not qualified.
pub(crate) fn qualify(d: &mut Diagnosis, reference: &NullModel) {
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
        let caveat = definition(reference, effect.name).map_or("", |definition| definition.caveat);
        if !caveat.is_empty() {
            effect.evidence += &format!("; {caveat}");
        }
    }
    add_response_ambiguities(d, reference);
    if reference.setup.only_still() {
        drop_texture(d);
    }
    let named =
        d.parameter_mismatches.iter().any(|m| !m.is_tentative) || d.effects.iter().any(|e| !e.is_tentative);
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
    if !d.verdict.is_complete() {
        d.limits.clear();
    }
}

/// Removes mismatches of spreads between pixels that are larger than in the model. The texture of an unknown scene
/// adds to these spreads.
fn drop_texture(d: &mut Diagnosis) {
    let is_texture = |m: &ParameterMismatch| m.fitted_value > m.model_value && is_pixel_spread(&m.parameter);
    let dropped: Vec<String> = d
        .parameter_mismatches
        .extract_if(.., |m| is_texture(m))
        .map(|m| format!("{} {:.4} instead of {:.4}", m.parameter, m.fitted_value, m.model_value))
        .collect();
    if dropped.is_empty() {
        return;
    }
    d.notes.push(format!(
        "Adjacent pixels differ more than in the model ({}). This is no mismatch, because the texture of the scene has the same effect. A recording of uniform light shows the spread of the pixels.",
        dropped.join(", ")
    ));
    let is_named = !d.parameter_mismatches.is_empty() || !d.effects.is_empty();
    if d.verdict == Verdict::Explained && !is_named {
        d.verdict = Verdict::Agrees;
    }
}

/// Returns whether a parameter of the base model is a spread between pixels that a static scene determines.
fn is_pixel_spread(parameter: &str) -> bool {
    let is_shown = |name: &str, key: &str| {
        BASE_KNOBS
            .iter()
            .any(|n| n.is_spread && n.is_shown_by_static_scene && n.effect.name == name && n.key == key)
    };
    parameter.split_once('.').is_some_and(|(name, key)| is_shown(name, key))
}

/// Adds ambiguities between effects that change the response curve. A found effect becomes ambiguous with each
/// similar effect with which it was never compared.
fn add_response_ambiguities(d: &mut Diagnosis, reference: &NullModel) {
    let changes_response = |effect: &&Definition| effect.ambiguity_groups.contains(&AmbiguityGroup::Response);
    let response_effects: Vec<&'static str> =
        reference.effects().into_iter().filter(changes_response).map(|effect| effect.name).collect();
    let are_compared = |name: &str, other: &str| {
        let mut rounds = d.traces.tournament.iter();
        rounds.any(|round| [name, other].iter().all(|name| round.iter().any(|e| e.0 == *name)))
    };
    let found: Vec<&'static str> = d.effects.iter().map(|e| e.name).collect();
    let similar_effects = |effect: &FoundEffect| -> Vec<&'static str> {
        if !response_effects.contains(&effect.name) {
            return Vec::new();
        }
        let others = response_effects.iter().filter(|other| {
            !found.contains(other)
                && !effect.ambiguous_with.contains(other)
                && !are_compared(effect.name, other)
        });
        let mut similar: Vec<(f64, &'static str)> = others
            .map(|other| (reference.cosine_of(effect.name, other), *other))
            .filter(|(cosine, _)| *cosine >= MIN_SIMILAR_COSINE)
            .collect();
        similar.sort_by(|a, b| b.0.total_cmp(&a.0));
        similar.into_iter().map(|(_, other)| other).collect()
    };
    let ambiguities: Vec<Vec<&'static str>> = d.effects.iter().map(similar_effects).collect();
    for (effect, similar) in d.effects.iter_mut().zip(ambiguities) {
        let free = MAX_AMBIGUOUS_EFFECTS.saturating_sub(effect.ambiguous_with.len());
        effect.ambiguous_with.extend(similar.into_iter().take(free));
    }
}

/// Returns the definition of an effect that was searched.
pub(super) fn definition(reference: &NullModel, name: &str) -> Option<&'static Definition> {
    reference.effects().into_iter().find(|effect| effect.name == name)
}

/// Returns a note on the quantities that static scenes of unknown light show.
fn static_scene_note(setup: &Setup) -> String {
    let longest = setup.recordings.iter().map(|s| s.readouts).max().unwrap_or(0);
    format!(
        "The light of the scene is unknown and was estimated from the recorded rates. Static scenes therefore show noise of single pixels over time, and an upper limit of the spread between adjacent pixels. In {longest} readouts, or {:.1} ms, an oscillation below {:.0} Hz looks like a drift. Recordings of known light show the other effects.",
        1e3 * longest as f64 / setup.readout_hz,
        setup.lowest_line_hz()
    )
}

/// Returns notes on the compared readouts and on the held-out recordings. `aside` contains the file and the number
/// of readouts that were excluded at the start of each recording.
pub(crate) fn set_notes(setup: &Setup, aside: &[(String, usize)], held_out: HeldOut) -> Vec<String> {
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
    if setup.only_still() {
        notes.push(static_scene_note(setup));
    }
    if held_out == HeldOut::None {
        let most = if setup.only_still() {
            " At most one effect is named, because nothing tests a second one."
        } else {
            ""
        };
        notes.push(format!(
            "There is no second recording set, and the recordings of this set cannot be split: no recordings were held out.{most}"
        ));
    } else if held_out == HeldOut::SecondHalves {
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

/// Returns a note for a set that is not explained although no single statistic is significant.
pub(crate) fn open_discrepancy_note(gap: &Discrepancy) -> String {
    format!(
        "No single statistic exceeds its limit, but the {}discrepancy is {:.0}, the noise floor of the final model is {:.0}, and the \
         largest discrepancy that counts as explained is {:.0}. By chance, 2 % of the sensors without missing effects exceed this limit.",
        if gap.is_held_out() { "held-out " } else { "" },
        gap.held_out_set.last().copied().unwrap_or_default(),
        gap.noise_floor,
        gap.limit()
    )
}

/// Returns a note on parameters that are not tested, because the found effects change them or the noise strongly.
pub(crate) fn untested_note(wrong: &[ParameterMismatch]) -> String {
    let names: Vec<&str> = wrong.iter().map(|m| m.parameter.as_str()).collect();
    format!(
        "Not tested: {}. The found effects are so strong that the recordings do not determine these parameters of the camera. Add the found \
         effects, which camera.toml contains, to your camera file with your own values of these parameters, and diagnose again.",
        names.join(", ")
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn spread(parameter: &str, fitted_value: f64) -> ParameterMismatch {
        ParameterMismatch {
            parameter: parameter.to_owned(),
            model_value: 0.02,
            fitted_value,
            low: fitted_value - 0.001,
            high: fitted_value + 0.001,
            ambiguous_with: Vec::new(),
            is_tentative: false,
        }
    }

    /// Removes the texture from an explained diagnosis with one mismatch. Returns the remaining mismatches and the
    /// verdict.
    fn without_texture(mismatch: ParameterMismatch) -> (Vec<String>, Verdict) {
        let camera = spikelane::presets::builtin("physical").unwrap();
        let mut diagnosis = Diagnosis {
            parameter_mismatches: vec![mismatch],
            verdict: Verdict::Explained,
            ..Diagnosis::stopped(Vec::new(), camera)
        };
        drop_texture(&mut diagnosis);
        (diagnosis.parameter_mismatches.into_iter().map(|m| m.parameter).collect(), diagnosis.verdict)
    }

    #[test]
    fn the_texture_of_a_scene_is_no_spread_of_the_pixels() {
        assert_eq!(without_texture(spread("prnu.sigma", 0.026)), (vec![], Verdict::Agrees));
        let smaller = vec!["prnu.sigma".to_owned()];
        assert_eq!(without_texture(spread("prnu.sigma", 0.01)), (smaller, Verdict::Explained));
        let noise = vec!["thermal_noise.sigma".to_owned()];
        assert_eq!(without_texture(spread("thermal_noise.sigma", 0.026)), (noise, Verdict::Explained));
    }
}
