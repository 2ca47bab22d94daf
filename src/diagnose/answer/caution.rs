//! What a name must have besides being the best one, before it is said plainly.

use super::diagnosis::{Diagnosis, Verdict};
use crate::diagnose::null::reference::Reference;
use crate::effects::{
    Definition, adaptation, dead_time, flicker, gain_drift, leak, partial_reset, response_nonlinearity,
    saturation_clamp, vignetting,
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

/// What the light in front of a camera does as well.
const OF_THE_LIGHT: [(&Definition, &str); 3] = [
    (&flicker::EFFECT, "; it is the light that swings: the lamp, and not the camera"),
    (&gain_drift::EFFECT, "; a lamp that drifts through all recordings looks the same"),
    (&vignetting::EFFECT, "; light that falls off to the corners looks the same"),
];

/// Names that are as likely, said with one at most.
const MOST_TIED: usize = 3;

/// Takes back what was said too plainly. A study's sensors share a reference, and what is said of them stays as it was judged.
pub(in crate::diagnose) fn cautious(d: &mut Diagnosis, reference: &Reference) {
    for effect in d.effects.iter_mut().filter(|e| !e.resembles) {
        let (Some(p), Some(neutral)) = (effect.parameters.first(), reference.neutral_of(effect.name)) else {
            continue;
        };
        if p.low <= neutral && neutral <= p.high {
            effect.resembles = true;
            effect.evidence += "; the interval of its strength holds none of it";
        }
    }
    d.effects.iter_mut().for_each(|e| e.evidence = nearer(&e.evidence, d.gap.floor));
    for effect in &mut d.effects {
        let light = OF_THE_LIGHT.iter().find(|l| l.0.name == effect.name);
        effect.evidence += light.map_or("", |l| l.1);
    }
    tie_bends(d, reference);
    let named = !d.misfits.is_empty() || d.effects.iter().any(|e| !e.resembles);
    if matches!(d.verdict, Verdict::Explained | Verdict::PartlyExplained) && !named {
        d.verdict = Verdict::Unknown;
    }
    if d.verdict == Verdict::Explained && d.gap.floor_sd > UNCERTAIN * d.gap.floor {
        d.verdict = Verdict::PartlyExplained;
        d.notes.push(format!(
            "Sensors of the final model differ so much among themselves (a gap of {:.0}, give or take {:.0}) that a gap at their floor does not show that all is explained. More light levels or longer recordings would.",
            d.gap.floor, d.gap.floor_sd
        ));
    }
}

/// A name that bends the response is tied with others that bend it alike and were never fitted beside it.
fn tie_bends(d: &mut Diagnosis, reference: &Reference) {
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
                && !effect.tied_with.contains(other)
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
        let room = MOST_TIED.saturating_sub(effect.tied_with.len());
        effect.tied_with.extend(alike.into_iter().take(room));
    }
}

/// What a search says of a step, as far as it speaks for the name. A name whose sensors differ more among themselves makes recordings likelier
/// without bringing the model nearer, and its squared distance may grow.
fn nearer(evidence: &str, floor: f64) -> String {
    let Some((before, rest)) = evidence.split_once("the misfit goes from ") else {
        return evidence.to_owned();
    };
    let Some((numbers, after)) = rest.split_once(')') else { return evidence.to_owned() };
    let told: Vec<f64> = numbers
        .split(|c: char| !(c.is_ascii_digit() || c == '.' || c == '-'))
        .filter_map(|word| word.parse().ok())
        .collect();
    let [.., from, to] = told[..] else { return evidence.to_owned() };
    let words = if to < from {
        format!("the held-out gap falls from {from:.0} to {to:.0}, where its floor is {floor:.0}")
    } else {
        "held-out recordings become likelier, as sensors with it differ more".to_owned()
    };
    format!("{before}{words}{after}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gap_that_grows_is_no_evidence() {
        let fell = "in the place of leak the misfit goes from 900 to 210 (950 held out: 200); 3 found";
        assert_eq!(
            nearer(fell, 190.0),
            "in the place of leak the held-out gap falls from 950 to 200, where its floor is 190; 3 found"
        );
        let grew = nearer("the misfit goes from 2403 to 4702 (2400 held out: 4600)", 900.0);
        assert!(!grew.contains("4702") && !grew.contains("4600"), "{grew}");
        assert_eq!(nearer("nothing", 1.0), "nothing");
    }
}
