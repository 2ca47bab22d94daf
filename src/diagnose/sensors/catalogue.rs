//! What a camera may have that its model lacks: the catalogue's effects and where to try them.

use super::knob::Knob;
use super::knob::Scale;
use crate::effects::definition::Form;
use crate::effects::{Definition, find};

/// A parameter, how its knob turns, and the values to try it at.
#[derive(Clone, Copy, Debug)]
struct Turn {
    key: &'static str,
    scale: Scale,
    range: (f64, f64),
    at: &'static [f64],
}

const fn amplitude(key: &'static str, range: (f64, f64), at: &'static [f64]) -> Turn {
    Turn { key, scale: Scale::Linear, range, at }
}

const fn deviation(key: &'static str, range: (f64, f64), at: &'static [f64]) -> Turn {
    Turn { key, scale: Scale::Square, range, at }
}

const fn shape(key: &'static str, range: (f64, f64), at: &'static [f64]) -> Turn {
    Turn { key, scale: Scale::Log, range, at }
}

const fn kept(key: &'static str, range: (f64, f64), at: &'static [f64]) -> Turn {
    Turn { key, scale: Scale::Kept, range, at }
}

/// The length of the recording, in readouts.
const LENGTH: Turn = Turn { key: "duration", scale: Scale::Log, range: (1.0, 1e9), at: &[f64::NAN] };

/// An entry of the catalogue: its amplitude first, then its shape.
#[derive(Clone, Copy, Debug)]
struct Entry {
    name: &'static str,
    turns: &'static [Turn],
}

macro_rules! entries {
    ($($name:literal: $($turn:expr),+;)*) => { &[$(Entry { name: $name, turns: &[$($turn),+] }),*] };
}

/// Ranges are the catalogue's; values to try lie where the effect is plain but still nearly linear. A switching current's counts
/// of odd intervals set in and saturate within a decade: from a tenth of a current the weak ones looked like false spikes.
const CATALOGUE: &[Entry] = entries! {
    "dead_time": amplitude("lost_fraction", (0.0, 0.15), &[0.012, 0.06]);
    "response_nonlinearity": amplitude("quadratic", (-0.15, 0.15), &[-0.01, 0.01, 0.06, -0.06]);
    "partial_reset": amplitude("lost_remainder", (0.0, 1.0), &[0.02, 0.25, 0.8]);
    "leak": amplitude("fraction_per_readout", (0.0, 4e-3), &[4e-5, 5e-4]);
    "dark_shot_noise": amplitude("strength", (0.0, 2.0), &[0.4]);
    "comparator_noise": deviation("sigma", (0.0, 0.05), &[0.004, 0.015]);
    "slow_threshold_noise": deviation("sigma", (0.0, 0.02), &[0.002, 0.006]), shape("time_constant", (30.0, 5e4), &[150.0, 1000.0, 6000.0]);
    "adaptation": amplitude("rise", (0.0, 0.02), &[0.002]), kept("decay", (0.8, 0.999), &[0.85, 0.95, 0.99, 0.998]);
    "telegraph_dark": amplitude("amplitude", (0.0, 1.0), &[0.008, 0.03, 0.15]), shape("pixels", (0.01, 1.0), &[0.2]), shape("rate", (1e-4, 1e-2), &[1e-3]);
    "hot_pixels": amplitude("fraction", (0.0, 0.05), &[0.004]), shape("factor", (1.5, 60.0), &[5.0, 12.0]);
    "dead_pixels": amplitude("fraction", (0.0, 0.05), &[0.005]);
    "column_pattern": deviation("sigma", (0.0, 0.1), &[0.006, 0.025]);
    "row_pattern": deviation("sigma", (0.0, 0.1), &[0.006, 0.025]);
    "smooth_prnu": deviation("sigma", (0.0, 0.1), &[0.02]), shape("length", (0.5, 20.0), &[1.0, 2.0, 4.5]);
    "vignetting": amplitude("strength", (0.0, 0.5), &[0.04, 0.2]);
    "row_noise": deviation("sigma", (0.0, 0.05), &[0.002, 0.012]);
    "flicker": amplitude("depth", (0.0, 0.2), &[0.01]), shape("frequency_hz", (1.0, 1e4), &[80.0, 400.0, 2000.0]);
    "gain_drift": amplitude("relative_change", (-0.3, 0.3), &[0.004, -0.004, 0.05, -0.05]), LENGTH;
    "image_lag": amplitude("fraction", (0.0, 0.1), &[0.01]), shape("time_constant", (2.0, 600.0), &[8.0, 40.0, 150.0]);
    "crosstalk": amplitude("share", (0.0, 0.12), &[0.004, 0.03]);
    "spike_coupling": amplitude("charge", (-0.03, 0.03), &[0.001, -0.001, 0.008, -0.008]);
    "supply_droop": amplitude("depth", (-0.06, 0.06), &[0.002, -0.002, 0.015, -0.015]);
    "missed_spikes": amplitude("probability", (0.0, 0.2), &[1e-4, 2e-3, 0.02]);
    "false_spikes": amplitude("probability", (0.0, 0.05), &[4e-6, 6e-5, 1e-3]);
    "dropped_readouts": amplitude("probability", (0.0, 0.2), &[0.001, 0.01]);
    "repeated_readouts": amplitude("probability", (0.0, 0.2), &[0.001, 0.01]);
    "saturation_clamp": amplitude("largest_charge", (1.0, 2.0), &[1.7, 1.3]);
    "dark_tail": deviation("log_sigma", (0.0, 1.5), &[0.2, 0.5]);
    "gain_dark_correlation": amplitude("correlation", (-1.0, 1.0), &[0.3, -0.3]);
    "edge_columns": amplitude("factor", (0.3, 3.0), &[1.02, 1.1, 1.4, 0.9]);
};

/// Effects whose numbers belong to the base model: another value is a misfit of it.
pub(in crate::diagnose) const MISFITS: [&str; 1] = ["dead_time"];

/// Effects of which nothing shows up to some strength, and soon after it much: a slope says little of what lies further on.
pub(in crate::diagnose) const SETTING_IN: [&str; 1] = ["saturation_clamp"];

/// What a still scene of unknown light cannot tell from the scene, or from more or less light.
pub(in crate::diagnose) const OF_THE_SCENE: [&str; 18] = [
    "vignetting",
    "edge_columns",
    "column_pattern",
    "row_pattern",
    "smooth_prnu",
    "crosstalk",
    "response_nonlinearity",
    "gain_dark_correlation",
    "dead_time",
    "leak",
    "image_lag",
    "spike_coupling",
    "supply_droop",
    "saturation_clamp",
    "hot_pixels",
    "dead_pixels",
    "dark_tail",
    "dark_shot_noise",
];

/// An effect with the knobs that it adds and a position to try.
#[derive(Clone, Debug)]
pub(in crate::diagnose) struct Candidate {
    pub name: &'static str,
    pub knobs: Vec<Knob>,
    pub at: Vec<f64>,
}

/// Every candidate at every position, and the names of the catalogue that the model cannot simulate.
pub(in crate::diagnose) fn candidates(
    base: &crate::effects::Camera,
    readouts: usize,
) -> (Vec<Candidate>, Vec<&'static str>) {
    let (mut all, mut missing) = (Vec::new(), Vec::new());
    for entry in CATALOGUE {
        let Ok(definition) = find(entry.name) else {
            missing.push(entry.name);
            continue;
        };
        let knobs: Option<Vec<Knob>> =
            entry.turns.iter().map(|t| knob(definition, t, base, readouts as f64)).collect();
        let Some(knobs) = knobs else {
            missing.push(entry.name);
            continue;
        };
        let mut values = vec![Vec::new()];
        for turn in entry.turns {
            values = values
                .iter()
                .flat_map(|v| {
                    turn.at.iter().map(move |a| {
                        [v.as_slice(), &[if a.is_nan() { readouts as f64 } else { *a }]].concat()
                    })
                })
                .collect();
        }
        for value in values {
            let at = knobs.iter().zip(&value).map(|(k, v)| k.position(*v)).collect();
            all.push(Candidate { name: entry.name, knobs: knobs.clone(), at });
        }
    }
    (all, missing)
}

fn knob(
    definition: &'static Definition,
    turn: &Turn,
    base: &crate::effects::Camera,
    readouts: f64,
) -> Option<Knob> {
    let param = definition.params.iter().find(|p| p.key == turn.key)?;
    let Form::Number { low, high, .. } = param.form else { return None };
    if turn.at[0].is_nan() {
        let range = (readouts, readouts);
        return Some(Knob {
            effect: definition.name,
            key: param.key,
            scale: turn.scale,
            centre: readouts,
            unit: 1.0,
            range,
        });
    }
    let own = base.effect(definition.name).and_then(|e| e.get(turn.key).ok());
    let neutral = own.unwrap_or(param.neutral);
    let (centre, unit) = match turn.scale {
        Scale::Log | Scale::Kept => (*turn.at.get(turn.at.len() / 2)?, 1.0),
        // An infinite neutral value is one that the light of the set never reaches.
        _ if neutral.is_infinite() => (turn.range.1, -0.1),
        _ => (neutral, (turn.at[0] - neutral).abs()),
    };
    let range = (turn.range.0.max(low), turn.range.1.min(high));
    Some(Knob { effect: definition.name, key: param.key, scale: turn.scale, centre, unit, range })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_effect_of_the_model_is_a_candidate_or_part_of_the_base() {
        const BASE: [&str; 7] = [
            "capacitor_mismatch",
            "bias_voltage",
            "prnu",
            "dark_current",
            "shot_noise",
            "thermal_noise",
            "start_phase",
        ];
        let setup = crate::presets::builtin("ideal").unwrap();
        let (all, _) = candidates(&setup, 4000);
        for effect in crate::effects::ALL {
            let known = BASE.contains(&effect.name) || all.iter().any(|c| c.name == effect.name);
            assert!(known, "{} can never be found", effect.name);
        }
    }
}
