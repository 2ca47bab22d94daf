//! What a name must have besides being the best one, before it is said plainly.

use super::diagnosis::{Diagnosis, ParameterMismatch, Verdict};
use crate::diagnose::null::reference::NullModel;
use crate::diagnose::sensors::base::BASE;
use spikelane::effects::{
    Definition, adaptation, dead_time, flicker, gain_drift, leak, partial_reset, readout_jitter,
    response_nonlinearity, saturation_clamp, vignetting,
};

/// Deviation of the floor over the floor from which on a gap at its floor says nothing: `partial_reset` on four levels was said to be `dead_time`,
/// and all to be explained, where the floor was 690 and its deviation 2,069.
const UNCERTAIN: f64 = 3.0;

/// Effects that bend the same curve, that of the rate over the light.
const BENT: [&Definition; 6] = [
    &dead_time::EFFECT,
    &response_nonlinearity::EFFECT,
    &partial_reset::EFFECT,
    &adaptation::EFFECT,
    &leak::EFFECT,
    &saturation_clamp::EFFECT,
];

/// Cosine of two signatures from which on one may stand for the other.
const ALIKE: f64 = 0.9;

/// What looks the same: light in front of a camera, or other places on it.
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

/// Names that are as likely, said with one at most.
const MOST_TIED: usize = 3;

/// Takes back what was said too plainly. A study's sensors share a reference, and what is said of them stays as it was judged.
pub(in crate::diagnose) fn cautious(d: &mut Diagnosis, reference: &NullModel) {
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
    tie_bends(d, reference);
    if reference.setup.only_still() {
        drop_texture(d);
    }
    let named = !d.parameter_mismatches.is_empty() || d.effects.iter().any(|e| !e.is_tentative);
    if matches!(d.verdict, Verdict::Explained | Verdict::PartlyExplained) && !named {
        d.verdict = Verdict::Unknown;
    }
    if d.verdict == Verdict::Explained && d.discrepancy.noise_floor_sd > UNCERTAIN * d.discrepancy.noise_floor
    {
        d.verdict = Verdict::PartlyExplained;
        d.notes.push(format!(
            "Simulated sensors of the final model differ strongly from each other (noise floor {:.0}, standard deviation {:.0}). A discrepancy at this noise floor therefore does not show that the model is complete. More light levels or longer recordings reduce the noise floor.",
            d.discrepancy.noise_floor, d.discrepancy.noise_floor_sd
        ));
    }
}

/// Drops spreads between pixels that are larger than in the model: the texture of an unknown scene adds to the spread.
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

/// Whether a parameter of the base model is a spread between pixels that a static scene shows.
fn is_pixel_spread(parameter: &str) -> bool {
    BASE.iter()
        .any(|n| n.is_spread && n.shown_by_still && parameter.split_once('.') == Some((n.effect.name, n.key)))
}

/// A name that bends the response is tied with others that bend it alike and were never fitted beside it.
fn tie_bends(d: &mut Diagnosis, reference: &NullModel) {
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
            .filter(|a| a.0 >= ALIKE)
            .collect();
        alike.sort_by(|a, b| b.0.total_cmp(&a.0));
        ties.push(alike.into_iter().map(|a| a.1).collect());
    }
    for (effect, alike) in d.effects.iter_mut().zip(ties) {
        let room = MOST_TIED.saturating_sub(effect.ambiguous_with.len());
        effect.ambiguous_with.extend(alike.into_iter().take(room));
    }
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
        }
    }

    /// Returns the remaining mismatches and the verdict of an explained diagnosis.
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
