//! What a name must have besides being the best one, before it is said plainly.

use super::diagnosis::{Diagnosis, Verdict};
use crate::diagnose::null::reference::NullModel;
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
    let named =
        d.parameter_mismatches.iter().any(|m| !m.is_tentative) || d.effects.iter().any(|e| !e.is_tentative);
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
