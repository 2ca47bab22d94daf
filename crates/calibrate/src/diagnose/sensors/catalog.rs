//! What a camera may have that its model lacks: effects by what they say of themselves, and where to try them.

use super::knob::Knob;
use spikelane::effects::definition::{Param, ParamKind, SearchScale, SearchSpec};
use spikelane::effects::{
    Camera, Catalog, Definition, adaptation, column_pattern, comparator_noise, correlated_shot_noise,
    crosstalk, dark_shot_noise, dark_tail, dead_pixels, dead_time, dropped_readouts, edge_columns,
    false_spikes, flicker, gain_dark_correlation, gain_drift, hot_pixels, image_lag, leak, missed_spikes,
    partial_reset, readout_jitter, repeated_readouts, response_nonlinearity, row_noise, row_pattern,
    saturation_clamp, slow_threshold_noise, smooth_prnu, spike_coupling, supply_droop, telegraph_dark,
    vignetting,
};

/// Ties go to the one that is tried first. Effects that are not among these follow in the order of their list.
const FIRST: [&Definition; 32] = [
    &dead_time::EFFECT,
    &response_nonlinearity::EFFECT,
    &partial_reset::EFFECT,
    &leak::EFFECT,
    &dark_shot_noise::EFFECT,
    &comparator_noise::EFFECT,
    &slow_threshold_noise::EFFECT,
    &adaptation::EFFECT,
    &telegraph_dark::EFFECT,
    &hot_pixels::EFFECT,
    &dead_pixels::EFFECT,
    &column_pattern::EFFECT,
    &row_pattern::EFFECT,
    &smooth_prnu::EFFECT,
    &vignetting::EFFECT,
    &row_noise::EFFECT,
    &flicker::EFFECT,
    &gain_drift::EFFECT,
    &image_lag::EFFECT,
    &crosstalk::EFFECT,
    &spike_coupling::EFFECT,
    &supply_droop::EFFECT,
    &missed_spikes::EFFECT,
    &false_spikes::EFFECT,
    &dropped_readouts::EFFECT,
    &repeated_readouts::EFFECT,
    &saturation_clamp::EFFECT,
    &dark_tail::EFFECT,
    &gain_dark_correlation::EFFECT,
    &edge_columns::EFFECT,
    &correlated_shot_noise::EFFECT,
    &readout_jitter::EFFECT,
];

/// An effect with the knobs that it adds and a position to try.
#[derive(Clone, Debug)]
pub(in crate::diagnose) struct Candidate {
    pub effect: &'static Definition,
    pub knobs: Vec<Knob>,
    pub at: Vec<f64>,
}

/// The effects of which a number is tried, in the order in which ties go.
pub(in crate::diagnose) fn looked_for(effects: &Catalog) -> Vec<&'static Definition> {
    let mut all: Vec<_> = effects.all().filter(|effect| effect.searched_params().next().is_some()).collect();
    all.sort_by_key(|effect| FIRST.iter().position(|first| first == effect).unwrap_or(FIRST.len()));
    all
}

/// Every candidate at every position, in recordings of at most `readouts` that show lines from `lowest_hz`.
pub(in crate::diagnose) fn candidates(
    base: &Camera,
    readouts: usize,
    lowest_hz: f64,
    effects: &Catalog,
) -> Vec<Candidate> {
    let of = |effect| positions(effect, base, readouts as f64, lowest_hz);
    looked_for(effects).into_iter().flat_map(of).collect()
}

fn positions(effect: &'static Definition, base: &Camera, readouts: f64, lowest_hz: f64) -> Vec<Candidate> {
    let of = |(param, mut tried): (_, SearchSpec)| {
        if tried.is_frequency {
            tried.range.0 = lowest_hz.clamp(tried.range.0, tried.range.1);
        }
        knob(effect, param, tried, base, readouts)
    };
    let knobs: Vec<Knob> = effect.searched_params().map(of).collect();
    let mut values = vec![Vec::new()];
    for (_, tried) in effect.searched_params() {
        let tried: &[f64] = if tried.values.is_empty() { &[readouts] } else { tried.values };
        let with = |v: &Vec<f64>| tried.iter().map(|at| [v.as_slice(), &[*at]].concat()).collect::<Vec<_>>();
        values = values.iter().flat_map(with).collect();
    }
    let at = |value: Vec<f64>| knobs.iter().zip(&value).map(|(k, v)| k.position(*v)).collect();
    values.into_iter().map(|value| Candidate { effect, knobs: knobs.clone(), at: at(value) }).collect()
}

fn knob(
    effect: &'static Definition,
    param: &'static Param,
    tried: SearchSpec,
    base: &Camera,
    readouts: f64,
) -> Knob {
    let SearchSpec { scale, range, values, .. } = tried;
    let key = param.key;
    let [first, ..] = values else {
        return Knob { effect, key, scale, center: readouts, unit: 1.0, range: (readouts, readouts) };
    };
    let own = base.effect(effect.name).and_then(|e| e.get(key).ok());
    let neutral = own.unwrap_or(param.neutral);
    let (center, unit) = match scale {
        SearchScale::Log | SearchScale::LogComplement => (values[values.len() / 2], 1.0),
        // An infinite neutral value is one that the light of the set never reaches.
        _ if neutral.is_infinite() => (range.1, -0.1),
        _ => (neutral, (first - neutral).abs()),
    };
    Knob { effect, key, scale, center, unit, range: within(range, param) }
}

/// The part of a range that the parameter can have.
fn within(range: (f64, f64), param: &Param) -> (f64, f64) {
    match param.kind {
        ParamKind::Number { low, high, .. } => (range.0.max(low), range.1.min(high)),
        ParamKind::Choice(_) => range,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::sensors::base::BASE;
    use spikelane::effects::{ALL, capacitor_mismatch, start_phase};

    #[test]
    fn every_effect_of_the_model_is_a_candidate_or_part_of_the_base() {
        // The base model has the whole spread of thresholds in its voltages, and pixels that start anywhere.
        let held = [&capacitor_mismatch::EFFECT, &start_phase::EFFECT];
        let all = candidates(&spikelane::presets::builtin("ideal").unwrap(), 4000, 10.0, &Catalog::new());
        for effect in ALL {
            let base = held.contains(effect) || BASE.iter().any(|n| n.effect == *effect);
            assert!(base != all.iter().any(|c| c.effect == *effect), "{} can never be found", effect.name);
        }
    }

    #[test]
    fn no_line_is_tried_below_two_periods_of_a_recording() {
        let ideal = spikelane::presets::builtin("ideal").unwrap();
        // 300 readouts at 20 kHz last 15 ms.
        let lines: Vec<Candidate> = candidates(&ideal, 300, 2.0 / 0.015, &Catalog::new())
            .into_iter()
            .filter(|c| c.effect.name == "flicker")
            .collect();
        let hz = |c: &Candidate| c.knobs[1].value(c.knobs[1].clamped(c.at[1]));
        assert!(lines.len() >= 3 && lines.iter().all(|c| hz(c) > 133.0), "{lines:?}");
    }

    #[test]
    fn ties_go_as_they_did_and_to_effects_of_other_crates_last() {
        static NEW: [Param; 1] =
            [Param::number("x", spikelane::units::Unit::Dimensionless, (0.0, 1.0), 0.0, 0.1, "x")
                .with_search(SearchSpec::amplitude((0.0, 1.0), &[0.1]))];
        static BROUGHT: Definition = Definition::new("abc", "", "", &NEW);
        let order = looked_for(&Catalog::new().with_definition(&BROUGHT).unwrap());
        assert_eq!(order[..FIRST.len()], FIRST);
        assert_eq!(order[FIRST.len()..], [&BROUGHT]);
    }
}
