//! Candidates of a search: the effects of a catalog, with the parameter values that are tried.

use crate::sensors::model::Knob;
use spikelane::effects::definition::{Param, ParamKind, SearchScale, SearchSpec};
use spikelane::effects::{Camera, Catalog, Definition};

/// An effect with its adjustable parameters and one combination of tried values. `at` contains the positions of the
/// knobs.
#[derive(Clone, Debug)]
pub(crate) struct Candidate {
    pub effect: &'static Definition,
    pub knobs: Vec<Knob>,
    pub at: Vec<f64>,
}

/// Returns the effects with searched parameters, in the order of the catalog.
pub(crate) fn searched_effects(effects: &Catalog) -> Vec<&'static Definition> {
    effects.all().filter(|effect| effect.searched_params().next().is_some()).collect()
}

/// Returns the candidates of all effects at all combinations of tried values. `readouts` is the length of the
/// longest recording. `lowest_hz` is the lowest frequency of an oscillation that the recordings show.
pub(crate) fn candidates(
    base: &Camera,
    readouts: usize,
    lowest_hz: f64,
    effects: &Catalog,
) -> Vec<Candidate> {
    let of = |effect| positions(effect, base, readouts as f64, lowest_hz);
    searched_effects(effects).into_iter().flat_map(of).collect()
}

/// Returns the candidates of one effect, one for each combination of tried values.
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

/// Returns the knob of a searched parameter.
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
        // If the neutral value is infinite, for example that of a limit which the light never reaches, the upper
        // end of the range is the center.
        _ if neutral.is_infinite() => (range.1, -0.1),
        _ => (neutral, (first - neutral).abs()),
    };
    Knob { effect, key, scale, center, unit, range: allowed_range(range, param) }
}

/// Returns the part of `range` that the parameter `param` allows.
fn allowed_range(range: (f64, f64), param: &Param) -> (f64, f64) {
    match param.kind {
        ParamKind::Number { low, high, .. } => (range.0.max(low), range.1.min(high)),
        ParamKind::Choice(_) => range,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sensors::model::BASE_KNOBS;
    use spikelane::effects::{ALL, capacitor_mismatch, start_phase};

    #[test]
    fn every_effect_of_the_model_is_a_candidate_or_part_of_the_base() {
        // The base model describes the spread of the thresholds by the bias voltage alone. Its start phases are
        // random.
        let held = [&capacitor_mismatch::EFFECT, &start_phase::EFFECT];
        let all = candidates(&spikelane::presets::builtin("ideal").unwrap(), 4000, 10.0, &Catalog::new());
        for effect in ALL {
            let base = held.contains(effect) || BASE_KNOBS.iter().any(|n| n.effect == *effect);
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
    fn effects_of_other_crates_are_searched_last() {
        static NEW: [Param; 1] =
            [Param::number("x", spikelane::units::Unit::Dimensionless, (0.0, 1.0), 0.0, 0.1, "x")
                .with_search(SearchSpec::amplitude((0.0, 1.0), &[0.1]))];
        static ADDED: Definition = Definition::new("abc", "", "", &NEW);
        let order = searched_effects(&Catalog::new().with_definition(&ADDED).unwrap());
        assert_eq!(order.last(), Some(&&ADDED));
    }
}
